"""The estimates of one channel by every method, as rows of the tables."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import AllanCurve, of_blocks
from imubench_pipeline.allan.presence import presence
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators import least_squares, likelihood
from imubench_pipeline.estimators.agreement import agreeing, disagreements
from imubench_pipeline.estimators.curve_limits import with_fitted_limits
from imubench_pipeline.estimators.deterministic.courses import find_courses
from imubench_pipeline.estimators.deterministic.verdict import deterministic_rows, verdict_of
from imubench_pipeline.estimators.estimate import SI_UNITS, Estimate, not_shown
from imubench_pipeline.estimators.least_squares import UnfitCurveError
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.missing_slow import slow_noise_missing
from imubench_pipeline.estimators.model_choice import disagreement
from imubench_pipeline.estimators.rows import allan_rows, draw_rows, parameter_rows
from imubench_pipeline.estimators.thermal.path import TemperaturePath, temperature_path
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.recordings.quality_file import Quality
from imubench_pipeline.recordings.recording import ChannelLog, static_logs
from imubench_pipeline.settings.config import EstimateSettings
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.steps.compensation import (
    compensated_curve,
    compensated_estimate,
    compensated_rows,
    low_pass_rows,
    resolution_of,
    temperature_curve,
    temperature_of,
    temperature_rows,
)
from imubench_pipeline.steps.kept_curves import curves
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Row
from imubench_pipeline.units import quantity_to_si


@dataclass
class Estimation:
    """Rows of the tables that the estimation of a recording leaves."""

    allan: list[Row] = field(default_factory=list)
    parameters: list[Row] = field(default_factory=list)
    draws: list[Row] = field(default_factory=list)
    models: list[Row] = field(default_factory=list)
    lines: list[Row] = field(default_factory=list)
    spectrum: list[Row] = field(default_factory=list)
    fixed_bias: list[Row] = field(default_factory=list)
    temperature: list[Row] = field(default_factory=list)
    allan_compensated: list[Row] = field(default_factory=list)
    low_pass: list[Row] = field(default_factory=list)
    deterministic: list[Row] = field(default_factory=list)
    estimate_findings: list[Row] = field(default_factory=list)
    """Rows of the table ``findings``."""
    paths: dict[Path, TemperaturePath] = field(default_factory=dict)
    """Of the temperature, by the file of the log: its channels have one."""


def estimate_channel(
    key: Key,
    log: ChannelLog,
    curve: AllanCurve,
    settings: EstimateSettings,
    bandwidth: float | None,
    into: Estimation,
) -> None:
    """Estimate the noise of a channel by every method of the settings.

    Parameters
    ----------
    key : Key
    log : ChannelLog
    curve : AllanCurve
        Of the log, with limits by the identified power laws.
    settings : EstimateSettings
    bandwidth : float or None
        Cut-off of the sensor's own filter, where it is known, Hz.
    into : Estimation
        Takes the rows.
    """
    band = quantity_to_si(settings.band, "frequency") if settings.band else None
    courses = find_courses(
        log.blocks, log.grid, log.rate, segments=log.segments, highest=_unfiltered(band, bandwidth)
    )
    unit = SI_UNITS[quantity_of(key.channel)]["B"]
    verdict = verdict_of(key.channel, unit, courses)
    into.deterministic += deterministic_rows(asdict(key), unit, courses)
    into.estimate_findings += [
        finding.row(key.sensor, key.recording) for finding in verdict.findings
    ]

    def blocks() -> Iterator[NDArray[np.float64]]:
        return courses.less(log.blocks())

    measured = curve
    if courses.found:
        sizes = curve.cluster_size
        curve = of_blocks(
            blocks(), log.grid, log.rate, sizes, holes=log.holes, segments=log.segments
        )
    estimates: dict[str, Estimate] = {}
    final = measured
    if "curve" in settings.methods:
        estimates["curve"] = reading.read(curve, longest=settings.longest)
    for method in ("paper", "weighted"):
        if method in settings.methods:
            try:
                fitted = least_squares.fit(curve, method=method, longest=settings.longest)
            except UnfitCurveError as error:
                fitted = not_shown(method, str(error))
            estimates[method] = fitted
    if _BY_LIKELIHOOD & set(settings.methods):

        def stream(use: str) -> np.random.Generator:
            return channel_rng(settings.seed, *asdict(key).values(), use)

        fit = partial(
            likelihood.fit_blocks,
            samples=log.grid,
            rate=log.rate,
            holes=log.holes,
            segments=log.segments,
            band=band,
            bandwidth=bandwidth,
            resolution=resolution_of(log),
        )
        found = fit(blocks, rng=stream("posterior"))
        estimates |= {estimate.method: estimate for estimate in found.estimates}
        there = presence(log.blocks(), log.grid, log.segments) if log.holes else None
        limited = partial(with_fitted_limits, segments=log.segments, presence=there)
        final = limited(measured, found)
        if not courses.found:  # else what they explain is taken out
            white = found.estimates[0].parameters["N"].lower
            lack = slow_noise_missing(key.channel, found.spectrum, found.fitted, white)
            into.estimate_findings += [lack.row(key.sensor, key.recording)] if lack else []
        into.models += _model_rows(key, found)
        into.lines += _line_rows(key, found)
        into.spectrum += _spectrum_rows(key, found)
        into.low_pass += low_pass_rows(key, found)
        if log.temperature and "compensated" in settings.methods:
            if log.path not in into.paths:
                rng = channel_rng(settings.seed, key.sensor, key.recording, log.path.name)
                path = temperature_path(log.temperatures(), log.segments, rng)
                into.paths[log.path] = path
            path = into.paths[log.path]
            # A warm-up is what temperature explains: it stays in the log that they are fitted to.
            plain = found
            if courses.found:
                plain = fit(log.blocks, rng=stream("posterior"))
            warm = temperature_of(log, path, plain, band, bandwidth, stream("temperature"))
            into.temperature += temperature_rows(key, warm)
            if warm.compensated:
                estimates["compensated"] = compensated_estimate(warm)
                left = limited(compensated_curve(log, warm, measured), warm.without_temperature)
                added = temperature_curve(log, warm, measured)
                into.allan_compensated += compensated_rows(key, left, added)
    into.allan += allan_rows(key, final)
    into.estimate_findings += [
        finding.row(key.sensor, key.recording) for finding in disagreements(key.channel, estimates)
    ]
    if "likelihood" in estimates:
        estimates |= {
            method: agreeing(estimates[method], estimates["likelihood"])
            for method in _BY_CURVE
            if method in estimates
        }
    best = next(method for method in _BEST_FIRST if method in settings.methods)
    for method in settings.methods:
        if method in estimates:
            estimate = estimates[method]
            if method != "compensated":
                estimate = verdict.applied(estimate)
            into.parameters += parameter_rows(key, estimate, recommended=method == best)
            into.draws += draw_rows(key, estimate)
    into.fixed_bias.append(asdict(key) | {"value": log.mean(), "unit": unit})


def _unfiltered(band: float | None, bandwidth: float | None) -> float | None:
    """Return the frequency up to which a log shows its noise as it is, Hz; None: not known."""
    known = [frequency for frequency in (band, 0.5 * bandwidth if bandwidth else None) if frequency]
    return min(known) if known else None


_BY_LIKELIHOOD = {"likelihood", "likelihood_gm", "compensated"}

_BY_CURVE = ("likelihood_gm", "weighted", "paper", "curve")
"""Methods that know one model only, or the curve alone."""

_BEST_FIRST = ("likelihood", "likelihood_gm", "weighted", "paper", "curve")
"""The method to use is the first of these that is asked for."""


def _model_rows(key: Key, found: Likelihood) -> Iterator[Row]:
    """Yield the rows of the table ``models``, the chosen model first."""
    for place, candidate in enumerate(found.candidates):
        terms = candidate.found.terms
        yield asdict(key) | {
            "model": terms.name,
            "chosen": place == 0,
            "free": terms.parameters,
            "log_likelihood": -candidate.found.cost,
            "bic": candidate.bic,
            "aic": candidate.aic,
            "weight": candidate.weight,
            "deviance": candidate.goodness.deviance,
            "chance": candidate.goodness.chance,
            "verdict": candidate.goodness.verdict,
            "note": _note(found) if place == 0 else candidate.goodness.where,
            "bins": int(found.used.sum()),
            "band": found.band.highest if found.band else None,
            "band_source": found.band.source if found.band else None,
        }


def _note(found: Likelihood) -> str:
    notes = [found.candidates[0].goodness.where, disagreement(found.candidates)]
    return "; ".join(note for note in notes if note)


def _line_rows(key: Key, found: Likelihood) -> Iterator[Row]:
    """Yield the rows of the table ``lines``."""
    for line in found.lines:
        row = asdict(line)
        row.pop("resolution")
        yield asdict(key) | row


def _spectrum_rows(key: Key, found: Likelihood) -> Iterator[Row]:
    """Yield the rows of the table ``spectrum``."""
    spectrum, fitted = found.spectrum, found.fitted
    names = ("frequency", "lower", "upper", "ordinates", "density")
    columns = [getattr(spectrum, name) for name in names]
    for i, values in enumerate(zip(*columns, strict=True)):
        yield (
            asdict(key)
            | dict(zip(names, map(float, values), strict=True))
            | {
                "fitted": float(fitted[i]) if np.isfinite(fitted[i]) else None,
                "used": bool(found.used[i]),
            }
        )


def estimation(
    quality: Path, curve: Path, sensor: str, recording: str, settings: str
) -> Estimation:
    """Return the rows that the channels leave; none of a rejected recording."""
    given = json.loads(settings)
    found = Estimation()
    measured = curves(curve, Quality.read(quality))
    for channel, log in static_logs(quality.parent).items():
        key = Key(sensor, recording, channel)
        how = EstimateSettings.model_validate(given["estimate"])
        estimate_channel(key, log, measured[channel], how, given["bandwidth"], found)
    return found
