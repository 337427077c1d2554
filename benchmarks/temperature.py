"""How well temperature is told from noise: simulated logs, and the real log where it is at hand.

python benchmarks/temperature.py [--logs 100] [--first 0] [--real ../shared/logs/cats/day1.csv.gz]

Each log has a noise model, a temperature (day cycle, warm-up, steps of a chamber, weather), a
register (fine to whole degrees, quiet or not), a lag and a sensitivity drawn at random; three in
ten have no sensitivity. The Cramér-Rao bound is that of the true temperature, noise and lag.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.fft
from numpy.typing import NDArray
from scipy.signal import lfilter

from imubench_pipeline.allan import allan_variance, of_blocks
from imubench_pipeline.estimators import likelihood
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.robust import fit as robust
from imubench_pipeline.estimators.robust.parts import compute_part_variances
from imubench_pipeline.estimators.thermal.fit import ThermalFit, fit_temperature
from imubench_pipeline.estimators.thermal.path import estimate_temperature_path
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

Array = NDArray[np.float64]

MODELS = (
    NoiseModel(N=8.4e-5),
    NoiseModel(N=8.4e-5, K=3e-7),
    NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7),
    NoiseModel(N=2e-4, B=3e-5, K=2e-7),
    NoiseModel(N=1e-4, B=3e-5),
    NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5),
)
PROFILES = ("day", "warm-up", "steps", "weather")
REGISTERS = ((1.0, 0.0), (1.0, 0.15), (1.0 / 340.0, 0.05), (0.01, 0.01), (0.0625, 0.0))


@dataclass(frozen=True)
class Case:
    """A simulated log, and what was put into it."""

    log: Array
    readings: Array
    rate: float
    profile: str
    step: float
    sensitivity: float
    lag: float
    bias: float
    bound: float
    lag_bound: float


def behind(values: Array, rate: float, lag: float) -> Array:
    """Return values behind a first-order lag, sample by sample."""
    if lag == 0.0:
        return values
    a = math.exp(-1.0 / (lag * rate))
    return np.asarray(lfilter([1.0 - a], [1.0, -a], values - values[0])) + values[0]


def temperature(profile: str, samples: int, rate: float, rng: np.random.Generator) -> Array:
    """Return a temperature, °C."""
    t = np.arange(samples) / samples
    if profile == "day":
        cycles = rng.uniform(0.7, 3.0)
        phase = rng.uniform(0.0, 2.0 * np.pi)
        return 22.0 + rng.uniform(3.0, 8.0) * np.sin(2.0 * np.pi * cycles * t + phase)
    if profile == "warm-up":
        return 25.0 + rng.uniform(5.0, 15.0) * (1.0 - np.exp(-t / rng.uniform(0.02, 0.15)))
    if profile == "steps":
        levels = rng.uniform(10.0, 40.0, 8)
        return behind(levels[np.minimum((8 * t).astype(int), 7)], rate, samples / rate / 80.0)
    weather = NoiseModel(B=3.0, T_B=samples / rate / 10.0)
    return 20.0 + behind(simulate(weather, rate, samples, rng), rate, 120.0)


def bounds(spectrum: Array, truth: Array, rate: float, lag: float, s: float) -> tuple[float, float]:
    """Return the Cramér-Rao bounds of the sensitivity and the lag.

    ``spectrum`` is that of the noise at the n - 1 frequencies of the DCT-II of n samples.
    """
    step = 0.02 * lag
    columns = [behind(truth, rate, lag)]
    if lag > 0.0:
        columns.append((behind(truth, rate, lag + step) - columns[0]) / step)
    kept = np.array([scipy.fft.dct(c - c.mean(), norm="ortho")[1:] for c in columns])
    inverse = np.linalg.inv((kept / spectrum) @ kept.T)
    return math.sqrt(inverse[0, 0]), math.sqrt(inverse[1, 1]) / s if lag > 0 and s else math.nan


def case(number: int) -> Case:
    """Return a random log."""
    rng = np.random.default_rng([number, 8])
    model = MODELS[number % len(MODELS)]
    profile = PROFILES[(number // len(MODELS)) % len(PROFILES)]
    step, noise = REGISTERS[rng.integers(len(REGISTERS))]
    rate = float(rng.choice([5.0, 10.0]))
    samples = int(rng.uniform(3.0, 10.0) * 3600.0 * rate)
    truth = temperature(profile, samples, rate, rng)
    lag = float(rng.choice([0.0, rng.uniform(30.0, 400.0)]))
    spectrum = model.sampled_spectrum(np.pi * np.arange(1, samples) / samples, rate)
    bound, _ = bounds(spectrum, truth, rate, lag, 0.0)
    s = 0.0 if rng.random() < 0.3 else bound * float(np.exp(rng.uniform(np.log(3), np.log(60))))
    _, lag_bound = bounds(spectrum, truth, rate, lag, s)
    bias = float(rng.normal(0.0, 1e-3))
    effect = s * (behind(truth, rate, lag) - truth.mean())
    log = simulate(model, rate, samples, rng) + bias + effect
    sensed = truth + noise * rng.standard_normal(samples)
    return Case(
        log, np.round(sensed / step) * step, rate, profile, step, s, lag, bias, bound, lag_bound
    )


def of_log(number: int) -> dict[str, object]:
    """Return what the fit makes of a random log."""
    made = case(number)
    rng = np.random.default_rng([number, 9])
    path = estimate_temperature_path([made.readings], [(0, len(made.log))], rng)
    fit = fit_temperature([made.log], len(made.log), made.rate, path)
    s, lag, bias = fit.sensitivity, fit.lag, fit.bias
    value = s.in_model
    row: dict[str, object] = {
        "number": number,
        "profile": made.profile,
        "model": MODELS[number % len(MODELS)].name,
        "step": made.step,
        "true": made.sensitivity,
        "z": made.sensitivity / made.bound,
        "status": s.status,
        "compensated": fit.compensated,
        "error": math.nan if value is None else (value - made.sensitivity) / made.bound,
        "inside": s.lower is not None
        and s.upper is not None
        and s.lower <= made.sensitivity <= s.upper,
        "width": math.nan
        if s.lower is None or s.upper is None
        else (s.upper - s.lower) / 3.92 / made.bound,
        "lag": made.lag,
        "lag_status": lag.status,
        "lag_found": lag.in_model,
        "lag_bound": made.lag_bound,
        "lag_inside": lag.lower is not None
        and lag.upper is not None
        and lag.lower <= made.lag <= lag.upper,
        "bias_inside": bias.lower is not None
        and bias.upper is not None
        and bias.lower <= made.bias <= bias.upper,
        "reason": fit.reason,
    }
    truth = MODELS[number % len(MODELS)]
    estimates = estimate_rest(made.log, made.rate, fit, rng)
    for name, true in (("N", truth.N), ("B", truth.B), ("K", truth.K)):
        for method, estimate in estimates.items():
            found = estimate.parameters[name]
            low, high = found.lower, found.upper
            row |= {
                f"{method}_{name}_true": true,
                f"{method}_{name}_found": found.value,
                f"{method}_{name}_given": low is not None and high is not None and true > 0.0,
                f"{method}_{name}_inside": low is not None
                and high is not None
                and low <= true <= high,
            }
    return row


def estimate_rest(
    log: Array, rate: float, fit: ThermalFit, rng: np.random.Generator
) -> dict[str, Estimate]:
    """Return the estimates of a compensated log by the robust method and the likelihood."""
    left = np.concatenate(list(fit.compensate([log])))
    fitted = likelihood.fit_blocks(lambda: [left], len(log), rate, holes=False, rng=rng)
    curve, added = (
        of_blocks([values], len(log), rate, holes=False) for values in (left, log - left)
    )
    curve = replace(curve, variance=curve.variance + fit.relative_error**2 * added.variance)
    parts = compute_part_variances([left], curve, holes=False)
    lines = [line.term for line in fitted.lines if line.kind != "alias"]
    return {
        "robust": robust.fit(curve, parts, lines, rng=rng),
        "likelihood": fitted.estimates[0],
    }


def summary(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Return the lines of the table."""
    told = rows[rows.error.notna()]
    nothing, something = told[told.true == 0.0], told[told.true != 0.0]
    lagged = something[(something.lag_status == "ok") & (something.lag > 0)]
    given = something[something.compensated]
    left = []
    for method in ("robust", "likelihood"):
        for name in ("N", "B", "K"):
            limited = given[given[f"{method}_{name}_given"].astype(bool)]
            inside = limited[f"{method}_{name}_inside"].astype(float)
            value = limited[f"{method}_{name}_found"].astype(float)
            error = np.log(value / limited[f"{method}_{name}_true"]).dropna()
            text = f"{100 * inside.mean():.1f} % of {len(limited)}, {len(error)} values, "
            text += f"rms error {100 * math.sqrt((error**2).mean()):.1f} %"
            left.append((f"coverage of {name}, {method} of the compensated log", text))
    lag_error = (lagged.lag_found.astype(float) - lagged.lag) / lagged.lag_bound
    return [
        ("logs", f"{len(rows)}, s told in {len(told)}"),
        ("coverage of s, all", f"{100 * told.inside.mean():.1f} % of {len(told)}"),
        ("coverage of s = 0", f"{100 * nothing.inside.mean():.1f} % of {len(nothing)}"),
        ("coverage of the bias", f"{100 * told.bias_inside.mean():.1f} %"),
        ("error of s over its bound, rms", f"{math.sqrt((told.error**2).mean()):.3f}"),
        ("  where s is not 0", f"{math.sqrt((something.error**2).mean()):.3f}"),
        ("width of the interval over the bound", f"{told.width.median():.2f} (median)"),
        ("compensated with s = 0", f"{int(nothing.compensated.sum())} of {len(nothing)}"),
        ("compensated with s > 0", f"{int(given.shape[0])} of {len(something)}"),
        ("not identified", f"{int((rows.status == 'not_identified').sum())}"),
        ("lags told", f"{len(lagged)}, coverage {100 * lagged.lag_inside.mean():.1f} %"),
        (
            "error of the lag over its bound, median",
            f"{lag_error.abs().median():.2f}",
        ),
        *left,
    ]


def real(path: Path) -> None:
    """Print what temperature does to the gyro of a tag over a day."""
    log = pd.read_csv(path)
    rng = np.random.default_rng(1)
    readings = log.temperature_degC.to_numpy()
    course = estimate_temperature_path([readings], [(0, len(readings))], rng)
    for axis in "xyz":
        values = log[f"gyro_{axis}_mrad_s"].to_numpy() * 1e-3
        fit = fit_temperature([values], len(values), 1.0, course)
        s = fit.sensitivity
        print(
            f"gyro_{axis}: s = {1e3 * (s.in_model or 0.0):.4f} mrad/s/K "
            f"[{1e3 * (s.lower or 0.0):.4f}, {1e3 * (s.upper or 0.0):.4f}], {s.status}; "
            f"{fit.reason}"
        )
        left = np.concatenate(list(fit.compensate([values])))
        for n in (300, 1000, 3000, 10000):
            size = np.array([n])
            before = allan_variance(values, 1.0, cluster_sizes=size).deviation[0]
            after = allan_variance(left, 1.0, cluster_sizes=size).deviation[0]
            print(
                f"    {n:6d} s: {1e6 * before:8.2f} -> {1e6 * after:8.2f} urad/s, "
                f"{before / after:.2f} times less"
            )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--real", type=Path)
    parser.add_argument("--rows", type=Path, help="where to write a row a log, as CSV")
    options = parser.parse_args(arguments)
    if options.real:
        real(options.real)
        return
    found = []
    for number in range(options.first, options.first + options.logs):
        found.append(of_log(number))
        if options.rows:
            pd.DataFrame(found).to_csv(options.rows, index=False)
    for name, text in summary(pd.DataFrame(found)):
        print(f"{name:42s} {text}")


if __name__ == "__main__":
    main()
