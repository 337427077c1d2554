"""Write the log of the tutorial: a cheap board on a bench, as its logger would write it.

    python docs/tutorial/make_log.py run.csv [minutes]

It is simulated, and says so in its first line. What it has in common with a log of one's own: time
in whole ms, degrees and g, a register, a sensor that is warming up, somebody who knocks at the
bench at minute 10, and samples that the logger lost at minute 20.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.simulate.imu import ImuModel, simulate_imu
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift
from imubench_pipeline.simulate.profiles import Constant, WarmUp

RATE = 50.0  # Hz
DEGREE, G = math.pi / 180, 9.80665
CHANNELS = [f"{quantity}_{axis}" for quantity in ("gyro", "accel") for axis in "xyz"]

GYRO = NoiseModel(N=0.005 * DEGREE, B=8 * DEGREE / 3600, K=3e-4 * DEGREE)
ACCEL = NoiseModel(N=120e-6 * G, B=40e-6 * G)
FILTER = LowPass(15.0, order=2)


def board() -> ImuModel:
    """Return the six axes."""
    axes = {}
    for channel in CHANNELS:
        if channel.startswith("gyro"):
            drift = TemperatureDrift(sensitivity=2e-3 * DEGREE, reference=25.0, lag=60.0)
            axes[channel] = SensorModel(
                noise=GYRO, drift=drift, low_pass=FILTER, bias=0.2 * DEGREE, resolution=DEGREE / 131
            )
        else:
            axes[channel] = SensorModel(noise=ACCEL, low_pass=FILTER, resolution=G / 16384)
    return ImuModel(axes=axes, temperature_step=0.1)


def main(path: Path, minutes: float) -> None:
    """Simulate and write it."""
    samples = round(minutes * 60 * RATE)
    blocks = simulate_imu(
        board(),
        RATE,
        samples,
        7,
        ("tutorial",),
        motion={"accel_z": Constant(G)},
        temperature=WarmUp(24.0, 31.0, 480.0, begin=0.0),
    )
    parts = [
        np.column_stack([block[name] for name in (*CHANNELS, "temperature")]) for block in blocks
    ]
    values = np.concatenate(parts) / np.array([*[DEGREE] * 3, *[G] * 3, 1.0])
    time = np.arange(samples) * 1000.0 / RATE
    knock = (time > 600e3) & (time < 600.1e3)
    values[knock, 3:6] += 0.3
    kept = (time < 1200e3) | (time >= 1200.4e3)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w") as file:
        file.write("# SIMULATED board on a bench, started by hand\n")
        file.write("time_ms;gx;gy;gz;ax;ay;az;temp\n")
        np.savetxt(
            file, np.column_stack([time, values])[kept], "%d;%.4f;%.4f;%.4f;%.6f;%.6f;%.6f;%.1f"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 60.0)
