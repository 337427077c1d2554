"""Simulated, estimated, simulated again: what comes back of random sensor models.

python benchmarks/sensor_models.py [--logs 100] [--first 0] [--rows FILE]

Each model is an axis of a gyro or an accelerometer with figures as MEMS sensors have them: noise,
fixed bias, temperature sensitivity (none in a fifth of the models) and lag, low-pass, resolution.
Its log of 2 to 6 h at 20 to 50 Hz under a temperature that a register reads is estimated as the
workflow does, which is not told the bandwidth; the estimates are a model again.
"""

from __future__ import annotations

import argparse
import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import scipy.fft
from numpy.typing import NDArray
from scipy.stats import binomtest

from imubench_pipeline.allan import AllanCurve, cluster_sizes, of_blocks
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_estimate
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.recordings.recording import ChannelLog, LogWriter, open_channel_logs
from imubench_pipeline.settings.config import EstimateSettings
from imubench_pipeline.settings.sensor import TEMPERATURE
from imubench_pipeline.simulate.imu import ImuModel, simulate_imu
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift, in_the_log
from imubench_pipeline.simulate.profiles import Profile, make_day_cycle, make_steps, make_warm_up
from imubench_pipeline.steps.estimate import Estimation, estimate_channel
from imubench_pipeline.tables.keys import Key
from temperature import behind, bounds

Array = NDArray[np.float64]

RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "gyro": {
        "N": (3.5e-5, 3.5e-4),
        "B": (1e-5, 2e-4),
        "K": (2e-7, 2e-6),
        "bias": (1e-4, 2e-2),
        "sensitivity": (1e-5, 3e-4),
    },
    "accel": {
        "N": (3e-4, 3e-3),
        "B": (1e-4, 1.5e-3),
        "K": (2e-6, 2e-5),
        "bias": (1e-2, 0.3),
        "sensitivity": (1e-4, 3e-3),
    },
}
"""Least and greatest of each figure, SI."""

CORRELATION_TIME = (20.0, 600.0)
LAG = (30.0, 300.0)
CUTOFF = (0.1, 1.3)
"""Parts of Nyquist."""

RESOLUTION = (0.05, 0.5)
"""Parts of the standard deviation of the noise that passes the filter."""

PROFILES = ("warm-up", "day cycle", "steps", "sum")
REGISTERS = (1.0 / 340.0, 1.0 / 16.0, 1.0)
FIGURES = ("N", "B", "T_B", "K", "sensitivity", "lag", "bias", "cutoff", "N_sensor")
SETTINGS = EstimateSettings(methods=("likelihood", "compensated"))
LONGEST = 1 / 9
"""Longest tau that is compared, as a part of the log."""


@dataclass(frozen=True)
class Case:
    """A sensor, and how it is logged.

    Attributes
    ----------
    number : int
    channel : str
    model : SensorModel
    temperature : Profile
    profile : str
        Which kind of temperature it is.
    step : float
        Of the register of temperature, K.
    rate : float
        Hz.
    samples : int
    """

    number: int
    channel: str
    model: SensorModel
    temperature: Profile
    profile: str
    step: float
    rate: float
    samples: int

    def truth(self) -> Array:
        """Return the true temperature at every sample, °C."""
        return self.temperature(np.arange(self.samples) / self.rate)


def allan_of_spectrum(
    spectrum: Callable[[Array], NDArray[Any]], sizes: NDArray[np.int64]
) -> NDArray[Any]:
    """Return the Allan variance, shape (m,), of samples of a spectrum that takes rad per sample.

    (1/pi) int_0^pi P(w) 2 sin^4(n w/2) / (n sin(w/2))^2 dw, by Gauss-Legendre: in octaves up to the
    first zero of the response to clusters of n samples, then in its periods.
    """
    points, weights = np.polynomial.legendre.leggauss(16)
    variances = []
    for n in sizes.tolist():
        end = n * np.pi / 2.0
        first = min(np.pi, end)
        edges = np.append(first * 2.0 ** np.arange(-40.0, 1.0), np.arange(2, n // 2 + 1) * np.pi)
        edges = np.append(edges[edges < end], end)
        middle, half = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges) / 2.0
        x = (middle[:, None] + half[:, None] * points).ravel()
        w = 2.0 * x / n
        response = 4.0 / np.pi * np.sin(x) ** 4 / (n * np.sin(w / 2.0)) ** 2 / n
        variances.append((np.outer(half, weights).ravel() * response) @ spectrum(w))
    return np.array(variances)


def log_uniform(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """Return a number whose logarithm is uniform between those of two limits."""
    return float(np.exp(rng.uniform(*np.log(limits))))


def temperature(profile: str, duration: float, rng: np.random.Generator) -> Profile:
    """Return a random temperature of a kind; ``duration`` in s."""
    start = rng.uniform(15.0, 30.0)
    warm_up = make_warm_up(start, start + rng.uniform(5.0, 15.0), rng.uniform(300.0, 1800.0), 0.0)
    period = duration / rng.uniform(0.7, 3.0)
    day = make_day_cycle(0.0, rng.uniform(3.0, 8.0), period, rng.uniform(0.0, period))
    if profile == "warm-up":
        return warm_up
    if profile == "day cycle":
        return lambda times: 22.0 + day(times)
    if profile == "steps":
        return make_steps(
            [k * duration / 8.0 for k in range(8)], rng.uniform(10.0, 40.0, 8).tolist()
        )
    return lambda times: warm_up(times) + day(times)


def case(number: int) -> Case:
    """Return a random sensor, always the same for a number."""
    rng = np.random.default_rng([number, 14])
    quantity = str(rng.choice(["gyro", "accel"]))
    ranges = RANGES[quantity]
    rate = float(rng.choice([20.0, 25.0, 40.0, 50.0]))
    samples = round(rng.uniform(2.0, 6.0) * 3600.0 * rate)
    noise = NoiseModel(
        N=log_uniform(rng, ranges["N"]),
        B=log_uniform(rng, ranges["B"]),
        T_B=log_uniform(rng, CORRELATION_TIME) if rng.random() < 0.5 else None,
        K=log_uniform(rng, ranges["K"]) if rng.random() < 0.6 else 0.0,
    )
    sign = rng.choice([-1.0, 1.0], 2)
    drift = TemperatureDrift(
        sensitivity=0.0 if number % 5 == 4 else sign[0] * log_uniform(rng, ranges["sensitivity"]),
        lag=0.0 if rng.random() < 1 / 3 else log_uniform(rng, LAG),
    )
    low_pass = LowPass(rng.uniform(*CUTOFF) * rate / 2.0, int(rng.choice([1, 2])))
    # Two-sided bandwidth of the noise behind a Butterworth filter.
    n = low_pass.order
    bandwidth = math.pi * low_pass.cutoff / (n * math.sin(math.pi / (2 * n)))
    resolution = noise.N * math.sqrt(bandwidth) * rng.uniform(*RESOLUTION)
    model = SensorModel(
        noise=noise,
        bias=sign[1] * log_uniform(rng, ranges["bias"]),
        drift=drift,
        low_pass=low_pass,
        resolution=resolution if rng.random() < 1 / 3 else 0.0,
    )
    profile = PROFILES[number % len(PROFILES)]
    return Case(
        number,
        f"{quantity}_{rng.choice(['x', 'y', 'z'])}",
        model,
        temperature(profile, samples / rate, rng),
        profile,
        REGISTERS[int(rng.integers(len(REGISTERS)))],
        rate,
        samples,
    )


def simulated(made: Case, model: SensorModel, seed: int, folder: Path) -> ChannelLog:
    """Simulate a log of a model as a recording is kept, under the temperature of a case."""
    imu = ImuModel(axes={made.channel: model}, temperature_step=made.step)
    names = (made.channel, TEMPERATURE)
    path = folder / "log.parquet"
    with LogWriter(path, dict.fromkeys(names, pa.float64())) as writer:
        for block in simulate_imu(
            imu,
            made.rate,
            made.samples,
            seed,
            (str(made.number),),
            temperature=made.temperature,
        ):
            writer.write(block)
        writer.finish(
            {
                "rate": made.rate,
                "grid": made.samples,
                "segments": [[0, made.samples]],
                "holes": dict.fromkeys(names, False),
                "unusable": [],
            }
        )
    return open_channel_logs(folder)[made.channel]


def curve_of(log: ChannelLog, longest: float = 0.5) -> AllanCurve:
    """Return the Allan variance of a log up to a part of its length."""
    sizes = cluster_sizes(log.grid, per_decade=10, longest=longest)
    return of_blocks(log.blocks(), log.grid, log.rate, sizes, holes=False, segments=log.segments)


@dataclass(frozen=True)
class Found:
    """What is estimated of a log.

    Attributes
    ----------
    noise : Estimate
        By method ``compensated`` where temperature is taken out, else ``likelihood``.
    thermal, low_pass : dict of str to Parameter
        The tables ``temperature`` and ``low_pass``.
    order : int or None
        Of the filter.
    """

    noise: Estimate
    thermal: dict[str, Parameter]
    low_pass: dict[str, Parameter]
    order: int | None

    @property
    def compensated(self) -> bool:
        """Whether temperature is taken out of the noise."""
        return self.noise.method == "compensated"

    def parameters(self, truth: NoiseModel) -> dict[str, Parameter]:
        """Return the figures by name; of several processes the one that is as the true one is."""
        of_noise = dict(self.noise.parameters)
        if self.noise.further and truth.T_B is not None and self.noise.model.T_B is None:
            of_noise |= self.noise.further[0]
        return of_noise | self.thermal | {"cutoff": self.low_pass["cutoff"]}

    def model(self, rate: float) -> SensorModel:
        """Return the model that the estimates make, to simulate the sensor again.

        What sampling folds back from beyond Nyquist passes for quantization noise: the filter
        has it already.
        """
        thermal = {name: parameter.in_model or 0.0 for name, parameter in self.thermal.items()}
        drift = TemperatureDrift(
            sensitivity=thermal["sensitivity"],
            quadratic=thermal["quadratic"],
            reference=thermal["T_0"],
            lag=thermal["lag"],
        )
        noise, cutoff = self.noise.model, self.low_pass["cutoff"].in_model
        found = SensorModel(bias=thermal["bias"], drift=drift if self.compensated else None)
        if cutoff is None or self.order is None:
            return replace(found, noise=noise)
        floor = self.low_pass["floor"].in_model or 0.0
        before = self.noise.parameters.get("N_sensor")
        N = before.value if before is not None and before.value is not None else noise.N
        return replace(
            found,
            noise=replace(noise, N=N, Q=0.0),
            low_pass=LowPass(cutoff, self.order),
            resolution=floor * math.sqrt(12.0 * rate),
        )


def estimated(made: Case, log: ChannelLog) -> Found:
    """Estimate a log as the workflow does."""
    rows = Estimation()
    key = Key("random", str(made.number), made.channel)
    estimate_channel(key, log, curve_of(log), SETTINGS, None, rows)
    methods = {row.method for row in rows.parameters}
    method = "compensated" if "compensated" in methods else "likelihood"
    own = [row for row in rows.parameters if row.method == method]
    return Found(
        make_estimate(method, own),
        {row.parameter: _parameter(row) for row in rows.temperature},
        {row.parameter: _parameter(row) for row in rows.low_pass},
        rows.low_pass[0].order,
    )


def _parameter(row: Any) -> Parameter:
    names = ("value", "status", "reason", "lower", "upper", "fitted")
    return Parameter(**{name: row[name] for name in names})


def true_figures(made: Case, found: Found) -> dict[str, float | None]:
    """Return the truth of each figure; None where what is found has none.

    The bias is that at the mean temperature T_0 that is told with it; where temperature is not
    taken out, it is the mean of the log without its noise.
    """
    model, noise = made.model, made.model.noise
    drift, low_pass = model.drift, model.low_pass
    assert drift is not None and low_pass is not None  # every case has them
    at = found.thermal["T_0"].value if found.compensated else None
    if at is None:
        at = float(behind(made.truth(), made.rate, drift.lag).mean())
    return {
        "N": in_the_log(model, made.rate),
        "B": noise.B,
        "T_B": noise.T_B,
        "K": noise.K,
        "sensitivity": drift.sensitivity,
        "lag": drift.lag if drift.sensitivity else None,
        "bias": model.bias + drift.sensitivity * (at - drift.reference),
        "cutoff": low_pass.cutoff,
        "N_sensor": noise.N,
    }


def bound_of(made: Case) -> tuple[float, float]:
    """Return the Cramér-Rao bound of the sensitivity, SI per K, and that with a register's levels.

    The first knows the true temperature. Between steps a register says of each level only that it
    lies within half a bit: the second has an unknown of that variance for each.
    """
    model = made.model
    assert model.drift is not None  # every case has one
    places = np.geomspace(math.pi / made.samples, math.pi, 400)
    places[-1] = math.pi
    density = model.sampled_spectrum(places, made.rate)
    omega = np.pi * np.arange(1, made.samples) / made.samples
    spectrum = np.exp(np.interp(np.log(omega), np.log(places), np.log(density)))
    truth, lag, s = made.truth(), model.drift.lag, model.drift.sensitivity
    bound = bounds(spectrum, truth, made.rate, lag, 0.0)[0]
    if made.profile != "steps" or s == 0.0:
        return bound, bound
    columns = [behind(truth, made.rate, lag)]
    if lag > 0.0:
        columns.append((behind(truth, made.rate, 1.02 * lag) - columns[0]) / (0.02 * lag))
    known = len(columns)
    columns += [
        behind((truth == level).astype(float), made.rate, lag) for level in np.unique(truth)
    ]
    kept = np.array([scipy.fft.dct(c - c.mean(), norm="ortho")[1:] for c in columns])
    information = (kept / spectrum) @ kept.T
    levels = np.arange(known, len(columns))
    information[levels, levels] += 12.0 / (s * made.step) ** 2
    return bound, math.sqrt(np.linalg.inv(information)[0, 0])


def decades(one: Array, other: Array) -> float:
    """Return the rms difference of log10 of the deviation of two Allan variances."""
    return float(np.sqrt(np.mean((0.5 * np.log10(one / other)) ** 2)))


def of_model(number: int) -> list[dict[str, object]]:
    """Return a row for each figure of a random sensor."""
    began = time.process_time()
    made = case(number)
    with tempfile.TemporaryDirectory() as folder:
        log = simulated(made, made.model, 1, Path(folder))
        found = estimated(made, log)
        measured = curve_of(log, LONGEST)
        again = found.model(made.rate)
        curve_again = curve_of(simulated(made, again, 2, Path(folder)), LONGEST)
        curve_twin = curve_of(simulated(made, made.model, 3, Path(folder)), LONGEST)
    true_variance, variance = (
        allan_of_spectrum(partial(each.sampled_spectrum, rate=made.rate), measured.cluster_size)
        for each in (made.model, again)
    )
    truths, parameters = true_figures(made, found), found.parameters(made.model.noise)
    drift, low_pass = made.model.drift, made.model.low_pass
    assert drift is not None and low_pass is not None  # every case has them
    bound, with_levels = bound_of(made)
    about: dict[str, object] = {
        "number": number,
        "channel": made.channel,
        "hours": made.samples / made.rate / 3600.0,
        "rate": made.rate,
        "profile": made.profile,
        "step": made.step,
        "model": made.model.noise.name,
        "chosen": found.noise.model.name,
        "compensated": found.compensated,
        "order": low_pass.order,
        "order_found": found.order,
        "cutoff_over_nyquist": 2.0 * low_pass.cutoff / made.rate,
        "resolution": made.model.resolution,
        "true_sensitivity": drift.sensitivity,
        "true_lag": drift.lag,
        "sensitivity_bound": bound,
        "sensitivity_bound_levels": with_levels,
        "adev_model": decades(variance, true_variance),
        "adev_again": decades(curve_again.variance, measured.variance),
        "adev_twin": decades(curve_twin.variance, measured.variance),
        "seconds": time.process_time() - began,
    }
    unknown = Parameter(None, "absent", "the spectrum shows no low-pass")
    return [about | _figure(name, truths[name], parameters.get(name, unknown)) for name in FIGURES]


def _figure(name: str, truth: float | None, found: Parameter) -> dict[str, object]:
    there = found.lower is not None and found.upper is not None
    return {
        "figure": name,
        "truth": truth,
        "value": found.value,
        "in_model": found.in_model,
        "lower": found.lower,
        "upper": found.upper,
        "status": found.status,
        "reason": found.reason,
        "has_interval": there,
        "inside": there and truth is not None and found.lower <= truth <= found.upper,  # type: ignore[operator]  # not None where there is an interval
    }


Line = tuple[str, str, str]


def coverage(name: str, rows: pd.DataFrame) -> Line:
    """Return the line of the coverage of some figures, with its binomial limits."""
    judged = rows[rows.has_interval & rows.truth.notna()]
    none = int((~rows.has_interval & rows.truth.notna()).sum())
    untrue = int(rows.truth.isna().sum())
    more = f", {none} without" * (none > 0) + f", {untrue} without a truth" * (untrue > 0)
    if judged.empty:
        return name, "95 %", f"no interval{more}"
    inside = int(judged.inside.sum())
    limits = binomtest(inside, len(judged)).proportion_ci(0.95, "exact")
    return (
        name,
        "95 %",
        f"{100 * inside / len(judged):.1f} % [{100 * limits.low:.1f}, {100 * limits.high:.1f}] "
        f"of {len(judged)}{more}",
    )


def summary(rows: pd.DataFrame) -> Iterator[Line]:
    """Yield the lines of the table: what it is, what is asked, what is found."""
    models = rows.drop_duplicates("number")
    told = rows[rows.truth.notna()]
    yield "models", "100", f"{len(models)}, {models.seconds.mean():.1f} s of CPU each"
    yield coverage("coverage, all figures", rows)
    yield coverage("  those that are not 0", told[told.truth != 0.0])
    for name in FIGURES:
        yield coverage(f"  {name}", rows[rows.figure == name])
    cutoff = rows[(rows.figure == "cutoff")]
    known = cutoff[cutoff.status == "ok"]
    error = known.value.astype(float) / known.truth.astype(float) - 1.0
    yield "cut-off told", "", f"{len(known)} of {len(cutoff)}"
    yield "  error, rms", "2 %", f"{100 * math.sqrt((error**2).mean()):.2f} %"
    yield "  within 2 %", "", f"{100 * (error.abs() <= 0.02).mean():.1f} %"
    yield "  order found", "", f"{100 * (known.order == known.order_found).mean():.1f} %"
    s = rows[(rows.figure == "sensitivity") & rows.in_model.notna()]
    ratio = (s.in_model.astype(float) - s.truth.astype(float)) / s.sensitivity_bound
    yield "error of s over its bound, rms", "1.2", f"{math.sqrt((ratio**2).mean()):.3f}"
    for step, part in ratio.groupby(s.step.round(4)):
        rms = math.sqrt((part**2).mean())
        yield f"  register of {step:g} K", "", f"{rms:.3f} of {len(part)}"
    of_levels = ratio * s.sensitivity_bound / s.sensitivity_bound_levels
    rms = math.sqrt((of_levels**2).mean())
    yield "  over that of a register's levels", "", f"{rms:.3f}"
    given = models[models.true_sensitivity != 0.0]
    nothing = models[models.true_sensitivity == 0.0]
    yield "temperature taken out, s > 0", "", f"{int(given.compensated.sum())} of {len(given)}"
    yield "  s = 0", "0", f"{int(nothing.compensated.sum())} of {len(nothing)}"
    yield "terms of the noise as the true ones", "", f"{int((models.model == models.chosen).sum())}"
    size = models.adev_model
    yield "Allan deviation of the estimates, rms", "", f"{size.median():.4f} decades (median)"
    yield "  worst", "", f"{size.max():.4f} decades"
    for name, words in (("adev_again", "log simulated again"), ("adev_twin", "log of the truth")):
        yield f"{words} against the log", "", f"{models[name].median():.4f} decades (median)"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--logs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--rows", type=Path, help="where to write a row a figure, as CSV")
    options = parser.parse_args(arguments)
    found: list[dict[str, object]] = []
    for number in range(options.first, options.first + options.logs):
        rows = of_model(number)
        found += rows
        judged = [row for row in rows if row["has_interval"] and row["truth"] is not None]
        missed = [row["figure"] for row in judged if not row["inside"]]
        about = rows[0]
        print(
            f"{number:4d} {about['channel']:8s} {about['model']} -> {about['chosen']}, "
            f"{about['seconds']:.1f} s"
            + (f"; outside: {', '.join(map(str, missed))}" if missed else ""),
            flush=True,
        )
        if options.rows:
            pd.DataFrame(found).to_csv(options.rows, index=False)
    print(f"{'':42s} {'asked':8s} found")
    for name, asked, text in summary(pd.DataFrame(found)):
        print(f"{name:42s} {asked:8s} {text}")


if __name__ == "__main__":
    main()
