"""Run filters with different tunings for a sensor on simulated drives with GNSS outages.

The signals are simulated with the true model of a simulated recording (low-pass and register
included) or with the estimated model of a measured one, or they are pieces of a long log.
"""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pyarrow.compute as pc

from imubench_pipeline.datasheets.comparable import read_comparables
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.rows import read_estimates, read_recommended_estimates
from imubench_pipeline.extensions.aided.axis_states import make_axis_states
from imubench_pipeline.extensions.aided.error_state import GROUPS
from imubench_pipeline.extensions.aided.runs import (
    ERRORS,
    FIX_INTERVAL,
    RECOVERY_TIME,
    WARM_UP,
    Drive,
    Outcome,
    Share,
    compute_mean_squares,
    compute_nees_share,
    compute_ratio,
    compute_root_mean_square,
    predict_root_mean_square,
    schedule_outages,
)
from imubench_pipeline.extensions.aided.settings import NavigateSettings
from imubench_pipeline.extensions.aided.tables import NavigationRow
from imubench_pipeline.extensions.aided.trajectories import (
    Signals,
    Spreads,
    simulate_signals,
    simulate_trajectory,
)
from imubench_pipeline.extensions.calibration.noise_source import lend_axes
from imubench_pipeline.extensions.exports.overbound import overbound
from imubench_pipeline.extensions.exports.request import curve_of
from imubench_pipeline.model.estimates import AllanRow, LowPassRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.recordings.kept import find_static_recordings, load_static_logs
from imubench_pipeline.settings.requirements import Trajectory
from imubench_pipeline.settings.sensor import CHANNELS, Sensor, quantity_of
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.from_datasheet import from_datasheet
from imubench_pipeline.simulate.model import SensorModel, before_the_filter, in_the_log
from imubench_pipeline.simulate.models import make_imu_model
from imubench_pipeline.tables.files import read
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_difference, parse_quantity

T = TypeVar("T")

Models = dict[str, NoiseModel]  # by channel

DATASHEET, MISREAD, TENFOLD = "datasheet", "datasheet_misread", "times_ten"
TABLE_1, OVERBOUND, TRUE = "table_1", "overbound", "true"
"""Tunings other than those named after a method."""

_ESTIMATION_METHODS = (
    "curve",
    "paper",
    "weighted",
    "robust",
    "likelihood",
    "likelihood_gm",
    "compensated",
)
_TENFOLD_FACTOR = 10.0
_MIN_PIECES = 4  # least number of runs for which a log must be long enough
_MIN_RATE = 10.0  # least sampling rate of a log for navigation, Hz

_SHARE_TOLERANCE = 0.02
"""Tolerance on the share 0.95 of a consistent filter. A filter is inconsistent if its share differs
by more than the tolerance plus three standard errors."""
_MAX_SHARE_ERROR = 0.05  # of a consistent filter, including two standard errors


def complete_axes(models: Mapping[str, T]) -> dict[str, T]:
    """Return models of all six channels; a missing axis gets another one of its quantity."""
    return {channel: models[lent] for channel, lent in lend_axes(models).items()}


def complete_noise_models(models: Mapping[str, NoiseModel]) -> Models | None:
    """Return models of all six channels; None if gyros or accelerometers have no white noise."""
    usable = {name: model for name, model in models.items() if model.N > 0.0}
    quantities = {quantity_of(name) for name in usable}
    return complete_axes(usable) if quantities >= {"gyro", "accel"} else None


def collect_tunings(
    folder: Path, sensor: str, declared: Sensor | None, horizon: float, stand_in: Models
) -> tuple[dict[str, Models], dict[str, str]]:
    """Return models of each tuning, with ``stand_in``, and why others are missing; horizon in s."""
    every = read_estimates(folder / "parameters.parquet", folder / "draws.parquet")
    best = read_recommended_estimates(folder / "parameters.parquet", folder / "draws.parquet")
    named = _make_printed_models(sensor, declared)
    lacking: dict[str, str] = {}
    ten = {name: _scale_model(estimate.model, _TENFOLD_FACTOR) for name, estimate in best.items()}
    named |= {TENFOLD: ten, TABLE_1: _select_method(every, "authors")}
    named |= {method: _select_method(every, method) for method in _ESTIMATION_METHODS}
    try:
        # The smallest models of white noise and a walk above the curves.
        table, bounds = read("allan", [folder / "allan.parquet"]), {}
        for channel, estimate in best.items():
            curve = curve_of(AllanRow.rows_of(table.filter(pc.field("channel") == channel)))
            rate = float(curve.cluster_size[0] / curve.tau[0])
            drawn = estimate.draws
            many = [drawn.model(k) for k in range(len(drawn))] if drawn is not None else []
            bounds[channel] = overbound(
                curve,
                estimate.model,
                rate,
                horizon=horizon,
                drawn=many,
                most_excess=_TENFOLD_FACTOR,
            ).model
        named[OVERBOUND] = bounds
    except ValueError as error:
        lacking[OVERBOUND] = str(error)
    replaced = {quantity_of(channel) for channel in stand_in}
    found = {}
    for name, models in named.items():
        if not models:
            continue
        own = {c: m for c, m in models.items() if quantity_of(c) not in replaced}
        whole = complete_noise_models(own | stand_in)
        if whole is None:
            lacking[name] = "no white noise of a gyro or an accelerometer is estimated"
        else:
            found[name] = whole
    return found, lacking


def _scale_model(model: NoiseModel, factor: float = 1.0) -> NoiseModel:
    """Return the model of a signal that is a factor larger, without a ramp and lines."""
    return replace(model.scaled(factor), R=0.0, sinusoids=())


def _select_method(every: Mapping[str, Sequence[Estimate]], method: str) -> Models:
    """Return the models of a method without ramp and lines, which a filter cannot extrapolate."""
    return {
        channel: _scale_model(estimate.model)
        for channel, own in every.items()
        for estimate in own
        if estimate.method == method
    }


def _make_printed_models(sensor: str, declared: Sensor | None) -> dict[str, Models]:
    """Return the models of the datasheet, read correctly and as Maia et al. read it."""
    if declared is None:
        return {}
    try:
        axes = from_datasheet(sensor, declared, 0).imu.axes
    except ConfigError:
        return {}
    right = {channel: model.noise for channel, model in axes.items()}
    wrong = {}
    for channel, noise in right.items():
        halved = any(
            row.statistic == "N" and row.sidedness == "one-sided" and row.quantity == "N"
            for row in read_comparables(declared.datasheet, channel)
            if row.value == noise.N
        )
        # A one-sided density for N, and the lowest point of the curve for B.
        factor = math.sqrt(2.0) if halved else 1.0
        wrong[channel] = replace(noise, N=noise.N * factor, B=noise.B * FLOOR)
    return {DATASHEET: right, MISREAD: wrong}


@dataclass(frozen=True)
class _Source:
    """Source of the sensor signals of a run."""

    words: str  # truth, estimate or log
    sampling: float  # Hz
    runs: int
    of_run: Callable[[Drive, str, int], Signals]
    true: Models | None


def navigate(folders: Sequence[Path], sensor: str, settings: str) -> Iterator[NavigationRow]:
    """Yield the rows of the table ``navigation`` for a sensor's longest usable recording."""
    sections = json.loads(settings)
    how = NavigateSettings.model_validate(sections["navigate"])
    how = _add_requirements(how, sections["asked"])
    declared = Sensor.model_validate(sections["sensor"]) if sections["sensor"] else None
    truths = {
        entry.recording: entry
        for entry in map(SimulatedRecording.model_validate, sections["truths"])
    }
    # A measured recording before a simulated one, the longest of several.
    for about, folder in find_static_recordings(folders, lambda row: (row.simulated,)):
        best = read_recommended_estimates(folder / "parameters.parquet")
        fitted = {name: _scale_model(each.model) for name, each in best.items()}
        if not fitted:
            continue
        rate = about.rate or 0.0
        stand_in: Models = {}
        if not any(
            quantity_of(name) == "accel" and model.N > 0.0 for name, model in fitted.items()
        ):
            stand_in = {"accel_x": NoiseModel(N=parse_quantity(how.accel_noise, "accel_density"))}
        fitted |= stand_in
        lacking = None
        if rate < _MIN_RATE:
            lacking = f"samples of {rate:.3g} Hz; expected {_MIN_RATE:g} Hz or more"
        elif complete_noise_models(fitted) is None:
            lacking = "the recording has no estimate of gyro white noise"
        names: dict[str, Any] = {"sensor": sensor, "recording": about.recording}
        if lacking is not None:
            for course in how.trajectories:
                yield NavigationRow(**names, tuning=TRUE, trajectory=course, reason=lacking)
            return
        longest = max(parse_quantity(length, "time") for length in how.outages)
        tuned, lacking_of = collect_tunings(folder, sensor, declared, longest, stand_in)
        truth = truths.get(about.recording)
        methods = [each.method for each in best.values()]
        chosen = max(sorted(set(methods)), key=methods.count)
        for source in _list_sources(folder, about, rate, fitted, stand_in, truth, how):
            for row in _make_rows(names, how, source, tuned, lacking_of):
                yield replace(
                    row,
                    recommended=row.tuning == chosen,
                    assumed=f"accelerometers: {how.accel_noise}" if stand_in else None,
                )
        return


def _add_requirements(
    how: NavigateSettings, asked: Sequence[tuple[Trajectory, str]]
) -> NavigateSettings:
    """Return settings with the outages of the requirements, and sufficiently long runs."""
    lengths = {parse_quantity(length, "time"): length for length in how.outages}
    for _, length in asked:
        lengths.setdefault(parse_quantity(length, "time"), length)
    courses = dict.fromkeys([*how.trajectories, *(course for course, _ in asked)])
    least = WARM_UP + sum(lengths) + RECOVERY_TIME * (len(lengths) - 1) + FIX_INTERVAL
    longer = max(parse_quantity(how.duration, "time"), least)
    return how.model_copy(
        update={
            "outages": tuple(lengths.values()),
            "trajectories": tuple(courses),
            "duration": f"{longer!r} s",
        }
    )


def _list_sources(
    folder: Path,
    about: RecordingRow,
    logged: float,
    fitted: Models,
    stand_in: Models,
    truth: SimulatedRecording | None,
    how: NavigateSettings,
) -> Iterator[_Source]:
    """Yield the sources of signals: the simulator, and a measured log."""
    axes: dict[str, SensorModel] = {}
    known = truth is not None and not truth.simulated_sensors
    if known and truth is not None:
        axes = {
            str(name): model for name, model in make_imu_model(truth.channels, truth).axes.items()
        }
    else:
        low_pass = {
            row.channel: LowPass(row.value, row.order)
            for row in LowPassRow.rows_of(read("low_pass", [folder / "low_pass.parquet"]))
            if row.parameter == "cutoff" and row.value is not None and row.order is not None
        }
        for channel, noise in fitted.items():
            plain = SensorModel(low_pass=low_pass.get(channel))
            axes[channel] = replace(plain, noise=before_the_filter(plain, noise, logged))
    axes |= {channel: SensorModel(noise=noise) for channel, noise in stand_in.items()}
    axes = complete_axes(
        {channel: replace(model, bias=0.0, scale_error=0.0) for channel, model in axes.items()}
    )
    true = {name: replace(model.noise, N=in_the_log(model, logged)) for name, model in axes.items()}
    warming = how.temperature_change
    change = parse_difference(warming, "temperature") if warming else 0.0
    reference = next((m.drift.reference for m in axes.values() if m.drift is not None), 25.0)
    block = max(math.ceil(logged / parse_quantity(how.rate, "frequency") - 1e-6), 1)
    sampling = logged / block

    def of_run(
        drive: Drive, course: str, number: int, pieces: Sequence[Mapping[str, Array]] = ()
    ) -> Signals:
        samples = len(drive.trajectory.rate) * block
        return simulate_signals(
            drive.trajectory,
            axes,
            _make_spreads(how),
            drive.every,
            how.seed,
            (about.sensor, about.recording, course, f"log {number}" if pieces else str(number)),
            block=1 if pieces else block,
            temperature=(
                (lambda start, stop: reference + change * np.arange(start, stop) / samples)
                if change and not pieces
                else None
            ),
            added=pieces[number] if pieces else None,
        )

    yield _Source("truth" if known else "estimate", sampling, how.runs, of_run, true)
    if not about.simulated:
        pieces = _cut_pieces(folder, block, round(parse_quantity(how.duration, "time") * sampling))
        if len(pieces) >= _MIN_PIECES:
            runs = min(len(pieces), how.runs)
            yield _Source("log", sampling, runs, partial(of_run, pieces=pieces), None)


def _make_spreads(how: NavigateSettings) -> Spreads:
    return Spreads(
        parse_quantity(how.gyro_bias, "angular_rate"),
        parse_quantity(how.accel_bias, "acceleration"),
        how.gyro_scale,
        how.accel_scale,
    )


def _cut_pieces(folder: Path, block: int, size: int) -> list[dict[str, Array]]:
    """Return pieces of ``size`` block means, less the mean of the log; channels without holes."""
    pieces: list[dict[str, Array]] = []
    for channel, log in load_static_logs(folder).items():
        values = np.concatenate([*log.blocks()])
        values -= np.nanmean(values)
        means = values[: len(values) // block * block].reshape(-1, block).mean(axis=1)
        for number in range(len(means) // size):
            if number == len(pieces):
                pieces.append({})
            piece = means[number * size : (number + 1) * size]
            if np.isfinite(piece).all():
                pieces[number][channel] = piece
    return [piece for piece in pieces if {*map(quantity_of, piece)} == {"gyro", "accel"}]


def _make_rows(
    names: Mapping[str, str],
    how: NavigateSettings,
    source: _Source,
    tuned: Mapping[str, Models],
    lacking: Mapping[str, str],
) -> Iterator[NavigationRow]:
    lengths = [parse_quantity(length, "time") for length in how.outages]
    duration = parse_quantity(how.duration, "time")
    spreads = _make_spreads(how)
    models = dict(tuned) | ({TRUE: source.true} if source.true is not None else {})
    states = {
        name: [
            make_axis_states(
                model[channel],
                source.sampling,
                turn_on=spreads.bias(channel),
                shortest=FIX_INTERVAL,
                longest=duration,
                scale=spreads.scale(channel),
            )
            for channel in CHANNELS
        ]
        for name, model in models.items()
    }
    for course in how.trajectories:
        drive = Drive(
            simulate_trajectory(course, duration, source.sampling),
            schedule_outages(duration, lengths),
        )
        outcomes = drive.repeat(states, partial(source.of_run, drive, course), source.runs)
        about: dict[str, Any] = dict(names) | {
            "trajectory": course,
            "signals": source.words,
            "runs": source.runs,
        }
        rows_of_tunings = {
            name: [
                NavigationRow(**about | _describe_tuning(drive, outcomes, name, model, length))
                for length in (None, *lengths)
            ]
            for name, model in models.items()
        }
        # The consistent tuning with the fewest states; of several, the one with the best position
        # after the longest outage. The true model is none.
        consistent = {
            name: (own[0].states or 0, own[-1].position or 0.0)
            for name, own in rows_of_tunings.items()
            if name != TRUE and all(row.consistent for row in own)
        }
        smallest = min(consistent, key=lambda name: consistent[name], default=None)
        for name, own in rows_of_tunings.items():
            for row in own:
                yield replace(row, smallest=name == smallest)
        for name, reason in lacking.items():
            yield NavigationRow(**about, tuning=name, reason=reason)


def _describe_tuning(
    drive: Drive, outcomes: Mapping[str, Outcome], name: str, models: Models, length: float | None
) -> dict[str, Any]:
    """Return the fields of a row about a tuning, at the end of outages, s, or with fixes."""
    outcome = outcomes[name]
    terms: dict[str, dict[str, None]] = {"gyro": {}, "accel": {}}
    for channel in CHANNELS:
        terms[quantity_of(channel)][models[channel].name] = None
    row: dict[str, Any] = {
        "tuning": name,
        "model": "; ".join(f"{quantity} {', '.join(own)}" for quantity, own in terms.items()),
        "outage": length,
        "outages": 0 if length is None else len(drive.of_outages(length)) * len(outcome.errors),
        "states": outcome.states,
    }
    for error in ERRORS:
        of_runs = compute_mean_squares(drive, outcome, error, length)
        columns = [f"{error}{end}" for end in ("", "_lower", "_upper")]
        row |= zip(columns, compute_root_mean_square(of_runs), strict=True)
        row[f"{error}_predicted"] = predict_root_mean_square(drive, outcome, error, length)
        if TRUE in outcomes:
            others = compute_mean_squares(drive, outcomes[TRUE], error, length)
            columns = [f"{error}_ratio{end}" for end in ("", "_lower", "_upper")]
            row |= zip(columns, compute_ratio(of_runs, others), strict=True)
    # A bank of processes has none shorter than an epoch: its states are no true bias.
    of_bank = {quantity_of(c) for c, model in models.items() if "F" in model.name.split("+")}
    for group in GROUPS:
        share = compute_nees_share(drive, outcome, group, length)
        if group != "navigation":
            row[f"nees_{group}"] = share.value if share and group not in of_bank else None
        elif share is not None:
            row["nees_inside"], row["nees_error"] = share.value, share.error
            row["consistent"] = _is_consistent(share)
    return row


def _is_consistent(share: Share) -> bool | None:
    """Return whether the share of a filter is consistent with 0.95; None: not enough runs."""
    off = abs(share.value - 0.95)
    if off > _SHARE_TOLERANCE + 3.0 * share.error:
        return False
    return True if off + 2.0 * share.error <= _MAX_SHARE_ERROR + 1e-9 else None
