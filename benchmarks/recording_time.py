"""How well each parameter is known from a static log of 10 minutes to 100 hours.

python benchmarks/recording_time.py [--logs 10] [--hours 0.17 1 3 10 30 100] [--cores 1]

Logs of two gyros with known N, B (flicker noise) and K are simulated at 50 Hz, and estimated at
default settings. Each row has the median half-width of the 95 % interval (no value: in half of the
logs or more), the number of logs with a value, and of these the number whose interval is right.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product

import numpy as np

import imubench_pipeline as imu
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.noise import NoiseModel

RATE = 50.0  # Hz
TAUS = np.geomspace(0.1, 1e6, 2000)  # s
SHOWN = ("N", "B_curve", "sigma_min", "K")


def gyro(white: float, flicker: float, walk: float) -> NoiseModel:
    """Return a model from °/√h, °/h and °/h/√h."""
    return NoiseModel(
        N=imu.convert(white, "deg/sqrt(h)", "rad/s/sqrt(Hz)"),
        B=imu.convert(flicker, "deg/h", "rad/s"),
        K=imu.convert(walk, "deg/h/sqrt(h)", "rad/s/sqrt(s)"),
    )


SENSORS = {"consumer": gyro(0.3, 8.0, 25.0), "tactical": gyro(0.15, 0.5, 0.3)}


def find_minimum(model: NoiseModel) -> tuple[float, float]:
    """Return the lowest Allan deviation, rad/s, and its averaging time, s."""
    deviation = np.sqrt(model.allan_variance(TAUS))
    lowest = int(np.argmin(deviation))
    return float(deviation[lowest]), float(TAUS[lowest])


def estimate_log(sensor: str, hours: float, seed: int) -> dict[str, Parameter]:
    """Return the parameters estimated from one simulated log."""
    log = imu.simulate(SENSORS[sensor], RATE, duration=3600.0 * hours, seed=seed)
    found = imu.estimate(log, rate=RATE, threads=1)["gyro_x"]
    return {name: found[name] for name in SHOWN}


def describe_parameter(found: list[Parameter], truth: float) -> str:
    """Return the width of the intervals, the logs with a value, and of these the right ones."""
    given = [one for one in found if one.value is not None]
    limits = [(one.lower, one.upper) for one in given if one.lower and one.upper]
    widths = [math.sqrt(upper / lower) for lower, upper in limits]
    width = float(np.median(widths + [math.inf] * (len(found) - len(widths))))
    shown = f"±{100 * (width - 1):.2g} %" if width < 1.3 else f"×/÷ {width:.2g}"
    right = sum(lower <= truth <= upper for lower, upper in limits)
    return f"{shown if math.isfinite(width) else 'no value':>9}{len(given):4d}{right:4d}"


def compute_rows(hours: list[float], logs: int, cores: int) -> Iterator[str]:
    """Yield a row for each sensor and duration."""
    with ProcessPoolExecutor(cores) as pool:
        for sensor, duration in product(SENSORS, hours):
            model = SENSORS[sensor]
            lowest, tau = find_minimum(model)
            truth = {"N": model.N, "B_curve": model.B, "sigma_min": lowest, "K": model.K}
            found = list(pool.map(partial(estimate_log, sensor, duration), range(logs)))
            cells = (
                describe_parameter([one[name] for one in found], truth[name]) for name in SHOWN
            )
            yield f"{sensor:<10}{tau:7.0f}{duration:8.3g}" + "  ".join(("", *cells))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--logs", type=int, default=10, help="of each sensor and duration")
    parser.add_argument("--hours", type=float, nargs="+", default=[1 / 6, 1, 3, 10, 30, 100])
    parser.add_argument("--cores", type=int, default=1)
    given = parser.parse_args()
    print(f"{'sensor':<10}{'tau_min':>7}{'hours':>8}" + "".join(f"{name:>19}" for name in SHOWN))
    for row in compute_rows(given.hours, given.logs, given.cores):
        print(row, flush=True)


if __name__ == "__main__":
    main()
