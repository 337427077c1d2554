"""What a run finds of bias and scale factor in one recording, as rows of the tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from imubench_pipeline.experiments.calibration.least_squares import half_width
from imubench_pipeline.experiments.calibration.observability import (
    NotObservable,
    NotObservableError,
)
from imubench_pipeline.experiments.calibration.rate_table import Calibration, Term, calibrate
from imubench_pipeline.experiments.calibration.residuals import residuals
from imubench_pipeline.experiments.calibration.schedule import Schedule
from imubench_pipeline.experiments.calibration.still import bias_at_rest
from imubench_pipeline.recordings.recording import ChannelLog, on_grid
from imubench_pipeline.settings.known_rates import AtRest, OnRateTable
from imubench_pipeline.settings.pointing import Pointing
from imubench_pipeline.steps.noise_source import NO_MODEL, NoiseSource
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Row
from imubench_pipeline.units import quantity_to_si

UNITS = {
    "bias": "rad/s",
    "present_bias": "rad/s",
    "scale_factor": "1",
    "quadratic": "s/rad",
    "asymmetry": "1",
    "linearity": "1",
    "earth_rate": "rad/s",
    "heading": "rad",
}
"""SI unit of each quantity of the table ``calibration``."""

_OF_RUN = {"rate_table": ("bias", "scale_factor"), "at_rest": ("bias", "present_bias")}


@dataclass
class Found:
    """Rows of the tables that a calibration leaves."""

    calibration: list[Row] = field(default_factory=list)
    calibration_points: list[Row] = field(default_factory=list)


@dataclass(frozen=True)
class Given:
    """What a calibration is about.

    Attributes
    ----------
    key : Key
    log : ChannelLog
        Of the gyro.
    source : NoiseSource or None
        Its noise; without it nothing is estimated.
    begins : float
        Time of the first sample that is used, s from the first of the recording.
    truth : dict of str to float
        True figures of a simulation, SI.
    """

    key: Key
    log: ChannelLog
    source: NoiseSource | None
    begins: float = 0.0
    truth: Mapping[str, float] = field(default_factory=dict)

    def names(self, run: str, pointing: Pointing | None) -> dict[str, Any]:
        """Return what every row of the table ``calibration`` says."""
        found: dict[str, Any] = asdict(self.key) | {"run": run}
        if self.source is not None:
            found |= {"model": self.source.model.name, "model_from": self.source.words}
        if pointing is not None:
            found |= {name: getattr(pointing, name) for name in _OF_DIRECTION}
            found |= {"earth_rate": pointing.rate, "earth_rate_sigma": pointing.rate_sigma}
        return found

    def whole(self) -> str | None:
        """Return why the log cannot be used as one; None where it can."""
        if len(self.log.segments) == 1:
            return None
        return (
            f"the log is in {len(self.log.segments)} segments, with gaps of unknown length between "
            "them; use one of them ('use:' beside the log)"
        )


_OF_DIRECTION = ("latitude", "heading", "elevation")


def at_rest(given: Given, declared: AtRest) -> Found:
    """Return the bias of a gyro at rest whose axis points where it is stated.

    Returns
    -------
    Found
        Where nothing can be estimated, the rows say why.
    """
    pointing = declared.pointing
    names = given.names("at_rest", pointing)
    if (reason := given.whole()) is not None:
        return Found(list(_without(names, "not_shown", reason)))
    if given.source is None:
        return Found(list(_without(names, "no_model", NO_MODEL)))
    samples = on_grid(given.log.blocks(), given.log.grid)
    try:
        found = bias_at_rest(samples, given.log.rate, given.source.model, pointing)
    except ValueError as error:
        return Found(list(_without(names, "too_short", str(error))))
    about = names | {
        "duration": len(samples) / given.log.rate,
        "samples": int(np.isfinite(samples).sum()),
        "scatter": _finite(found.p_value[0]),
        "half_width": found.bound,
    }
    rows = []
    for name, value, noise, sigma, limits in (
        (
            "bias",
            found.fixed,
            found.fixed_noise_sigma,
            found.fixed_sigma,
            found.fixed_interval(),
        ),
        (
            "present_bias",
            found.present,
            found.present_noise_sigma,
            found.present_sigma,
            found.present_interval(),
        ),
    ):
        figures = _figure(given, name, value[0], sigma, (limits[0][0], limits[1][0]))
        rows.append(about | figures | {"sigma_noise": noise})
    return Found([*rows, *_open(names, found.not_observable)])


def on_rate_table(given: Given, declared: OnRateTable) -> Found:
    """Return scale factor and bias of a gyro from a recording on a rate table.

    Returns
    -------
    Found
        Where nothing can be estimated, the rows say why.
    """
    pointing = None if declared.axis is None else declared.axis.pointing
    names = given.names("rate_table", pointing)
    if (reason := given.whole()) is not None:
        return Found(list(_without(names, "not_shown", reason)))
    try:
        schedule = _schedule(given, declared)
    except ValueError as error:
        return Found(list(_without(names, "too_short", str(error))))
    if given.source is None:
        return Found(list(_without(names, "no_model", NO_MODEL)))
    model = given.source.model
    setting = declared.si("setting_sigma", "angular_rate")
    samples = on_grid(given.log.blocks(), given.log.grid)
    try:
        found, measured = calibrate(samples, schedule, model, pointing, setting_sigma=setting)
    except NotObservableError as error:
        return Found(list(_without(names, "not_observable", str(error))))
    except ValueError as error:
        return Found(list(_without(names, "too_short", str(error))))
    earth = 0.0 if pointing is None else pointing.rate
    rates = schedule.of_blocks(measured.blocks) + earth
    left = residuals(found, measured, rates, model, setting)
    about = names | {
        "duration": measured.blocks.duration,
        "samples": int(measured.blocks.count.sum()),
        "rates": len(left.dwell),
        "scatter": _finite(found.line.p_value[0]) if found.line.freedom else None,
    }
    rows = Found([about | one for one in _line(given, found)])
    rows.calibration += _open(names, found.not_observable)
    for k, dwell in enumerate(left.dwell.tolist()):
        stretch = schedule.stretches[dwell]
        rows.calibration_points.append(
            asdict(given.key)
            | {
                "number": dwell + 1,
                "start": stretch.start / schedule.rate + given.begins,
                "stop": stretch.stop / schedule.rate + given.begins,
                "table_rate": float(schedule.table_rates[dwell]),
                "earth_rate": earth,
                "mean": float(left.mean[k]),
                "line": float(left.line[k]),
                "residual": float(left.value[k]),
                "sigma": float(left.sigma[k]),
            }
        )
    return rows


def _schedule(given: Given, declared: OnRateTable) -> Schedule:
    """Return the steady rates in samples of the log.

    Raises
    ------
    ValueError
        If there are none, or they lie outside of the log; the text names the key.
    """
    log, settling = given.log, declared.si("settling", "time")
    if not declared.steps:
        if not log.table_rate:
            raise ValueError(
                "log.table_rate: the column has another clock than the gyro; give it as a column "
                "of the same file, or state the steps (rate_table: steps)"
            )
        try:
            return Schedule.from_column(
                on_grid(log.table_rates(), log.grid),
                log.rate,
                tolerance=declared.si("tolerance", "angular_rate"),
                shortest=declared.si("shortest", "time"),
                settling=settling,
            )
        except ValueError as error:
            raise ValueError(
                f"log.table_rate: {error}; check the column and its unit, or change rate_table: "
                f"tolerance ({declared.tolerance}) and shortest ({declared.shortest})"
            ) from None
    ends = given.begins + log.grid / log.rate
    steps = []
    for number, step in enumerate(declared.steps, 1):
        start, stop = step.seconds
        if start < given.begins or stop > ends + 1.0 / log.rate:
            raise ValueError(
                f"rate_table.steps: step {number} lasts from {start:g} to {stop:g} s; expected "
                f"steps within the log, which is used from {given.begins:g} to {ends:g} s: mend "
                "the step, or 'use:' beside the log"
            )
        rate = quantity_to_si(step.rate, "angular_rate")
        steps.append((start - given.begins, min(stop, ends) - given.begins, rate))
    return Schedule.from_steps(steps, log.rate, settling=settling)


def _line(given: Given, found: Calibration) -> Iterator[dict[str, Any]]:
    """Yield what is found of the line, and of its straightness."""
    bias, scale = found.bias_interval(), found.scale_factor_interval()
    limits = float(bias[0][0]), float(bias[1][0])
    yield _figure(given, "bias", found.bias[0], found.bias_sigma, limits) | {
        "sigma_noise": float(found.line.sigma[0])
    }
    limits = float(scale[0][0]), float(scale[1][0])
    sigma = found.scale_factor_sigma
    yield _figure(given, "scale_factor", found.scale_factor[0], sigma, limits) | {
        "sigma_noise": sigma
    }
    for name, term in (("quadratic", found.quadratic), ("asymmetry", found.asymmetry)):
        if term is not None:
            yield _term(given, name, term)
    if (straight := found.linearity) is not None:
        lower, upper = straight.interval()
        worst = int(np.abs(straight.deviation[0]).argmax())
        sigma = float(straight.sigma[worst])
        limits = float(lower[0]), float(upper[0])
        yield _figure(given, "linearity", straight.value[0], sigma, limits) | {
            "sigma_noise": sigma,
            "chance": float(straight.p_value[0]),
        }


def _term(given: Given, name: str, term: Term) -> dict[str, Any]:
    half = half_width(0.95) * term.sigma
    value = float(term.value[0])
    limits = value - half, value + half
    return _figure(given, name, value, term.sigma, limits) | {
        "sigma_noise": term.sigma,
        "chance": float(term.p_value[0]),
    }


def _figure(
    given: Given, name: str, value: float, sigma: float, limits: tuple[float, float]
) -> dict[str, Any]:
    return {
        "parameter": name,
        "value": float(value),
        "lower": float(limits[0]),
        "upper": float(limits[1]),
        "unit": UNITS[name],
        "status": "ok",
        "sigma": float(sigma),
        "truth": given.truth.get(name),
    }


def _open(names: Mapping[str, Any], found: tuple[NotObservable, ...]) -> Iterator[Row]:
    """Yield what the run cannot tell, each with its reason."""
    for one in found:
        yield {
            **names,
            "parameter": one.quantity,
            "unit": UNITS[one.quantity],
            "status": "not_observable",
            "reason": one.reason,
            "half_width": one.half_width,
        }


def _without(names: Mapping[str, Any], status: str, reason: str) -> Iterator[Row]:
    """Yield the rows of a run of which nothing can be estimated."""
    for parameter in _OF_RUN[names["run"]]:
        yield {
            **names,
            "parameter": parameter,
            "unit": UNITS[parameter],
            "status": status,
            "reason": reason,
        }


def unusable(key: Mapping[str, Any], on_table: bool) -> Iterator[Row]:
    """Yield the rows of a run whose gyro cannot be used, though others of the log can.

    Parameters
    ----------
    key : mapping
        Names sensor, recording and channel.
    on_table : bool
        The gyro was on a rate table, and not at rest.
    """
    names = {**key, "run": "rate_table" if on_table else "at_rest"}
    reason = f"{key['channel']} cannot be used; the findings of the recording say why"
    yield from _without(names, "not_shown", reason)


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
