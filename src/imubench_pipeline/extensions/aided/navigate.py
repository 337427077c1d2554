"""Run filters with different tunings for a sensor on simulated drives with GNSS outages.

Their signals are simulated with the true model of a simulated recording, low-pass and register
included, or, of a measured one, with the model that was found of it; or they are pieces of the log
itself, where it is long enough.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from imubench_pipeline.estimators.rows import recommended_estimates
from imubench_pipeline.extensions.aided.axis_states import AxisStates, axis_states
from imubench_pipeline.extensions.aided.error_state import GROUPS
from imubench_pipeline.extensions.aided.measures import (
    ERRORS,
    Share,
    inside,
    predicted,
    ratio,
    root_mean_square,
    squares,
)
from imubench_pipeline.extensions.aided.runs import (
    FIX_INTERVAL,
    RECOVERY_TIME,
    WARM_UP,
    Drive,
    Outcome,
    schedule,
)
from imubench_pipeline.extensions.aided.settings import NavigateSettings
from imubench_pipeline.extensions.aided.signals import Signals, Spreads, signals
from imubench_pipeline.extensions.aided.tables import NavigationRow
from imubench_pipeline.extensions.aided.trajectories import trajectory
from imubench_pipeline.extensions.aided.tunings import TRUE, Models, all_axes, scaled, tunings
from imubench_pipeline.model.estimates import LowPassRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.recordings.kept import kept_static_logs
from imubench_pipeline.settings.requirements import Trajectory
from imubench_pipeline.settings.sensor import CHANNELS, Sensor, quantity_of
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.simulate.model import SensorModel, before_the_filter, in_the_log
from imubench_pipeline.simulate.models import imu_model
from imubench_pipeline.steps.noise_source import static_recordings
from imubench_pipeline.tables import read
from imubench_pipeline.typing import Array
from imubench_pipeline.units import difference_to_si, quantity_to_si

_MIN_PIECES = 4
"""Min. number of runs for which a log must be long enough."""

_SHARE_TOLERANCE = 0.02
"""Tolerance on the share 0.95 of a consistent filter. A filter is inconsistent if its share differs
by more than the tolerance plus three standard errors."""


_MAX_SHARE_ERROR = 0.05
"""Max. difference from 0.95, including two standard errors, of the share of a consistent filter."""

_MIN_RATE = 10.0
"""Min. sampling rate of a log for navigation, Hz."""


@dataclass(frozen=True)
class _Source:
    """Source of the sensor signals of a run."""

    words: str  # truth, estimate or log
    sampling: float  # Hz
    runs: int
    of_run: Callable[[Drive, str, int], Signals]
    true: Models | None


def navigate(folders: Sequence[Path], sensor: str, settings: str) -> Iterator[NavigationRow]:
    """Yield the rows of the table ``navigation`` of a sensor.

    Of the longest of its static recordings that can be used, in ``folders``; `settings`: of
    `imubench_pipeline.extensions.aided.plan.navigate_settings`.
    """
    sections = json.loads(settings)
    how = _add_requirements(
        NavigateSettings.model_validate(sections["navigate"]), sections["asked"]
    )
    declared = Sensor.model_validate(sections["sensor"]) if sections["sensor"] else None
    truths = {
        entry.recording: entry
        for entry in map(SimulatedRecording.model_validate, sections["truths"])
    }
    # A measured recording before a simulated one, the longest of several.
    for about, folder in static_recordings(folders, lambda row: (row.simulated,)):
        best = recommended_estimates(folder / "parameters.parquet")
        fitted = {name: scaled(each.model, 1.0) for name, each in best.items()}
        if not fitted:
            continue
        names = {"sensor": sensor, "recording": about.recording}
        untold = NavigationRow(sensor=sensor, recording=about.recording, tuning=TRUE)
        rate = about.rate or 0.0
        if rate < _MIN_RATE:
            slow = f"samples of {rate:.3g} Hz; expected {_MIN_RATE:g} Hz or more"
            for course in how.trajectories:
                yield replace(untold, trajectory=course, reason=slow)
            return
        stand_in = _substitute_accelerometers(fitted, how)
        fitted |= stand_in
        if all_axes(fitted) is None:
            lacking = "the recording tells no white noise of a gyro"
            for course in how.trajectories:
                yield replace(untold, trajectory=course, reason=lacking)
            return
        longest = max(quantity_to_si(length, "time") for length in how.outages)
        tuned, lacking_of = tunings(folder, sensor, declared, longest, stand_in)
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
    lengths = {quantity_to_si(length, "time"): length for length in how.outages}
    for _, length in asked:
        lengths.setdefault(quantity_to_si(length, "time"), length)
    courses = dict.fromkeys([*how.trajectories, *(course for course, _ in asked)])
    least = WARM_UP + sum(lengths) + RECOVERY_TIME * (len(lengths) - 1) + FIX_INTERVAL
    longer = max(quantity_to_si(how.duration, "time"), least)
    return how.model_copy(
        update={
            "outages": tuple(lengths.values()),
            "trajectories": tuple(courses),
            "duration": f"{longer!r} s",
        }
    )


def _substitute_accelerometers(fitted: Models, how: NavigateSettings) -> Models:
    """Return substitute accelerometer models for a log without accelerometer noise."""
    if any(quantity_of(name) == "accel" and model.N > 0.0 for name, model in fitted.items()):
        return {}
    return {"accel_x": NoiseModel(N=quantity_to_si(how.accel_noise, "accel_density"))}


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
    block = _choose_block(logged, how)
    spreads = _make_spreads(how)
    known = truth is not None and not truth.simulated_sensors
    if known and truth is not None:
        axes = {str(name): model for name, model in imu_model(truth.channels, truth).axes.items()}
    else:
        axes = {
            channel: _model_before_filter(folder, channel, noise, logged)
            for channel, noise in fitted.items()
        }
    axes |= {channel: SensorModel(noise=noise) for channel, noise in stand_in.items()}
    axes = {channel: replace(model, bias=0.0, scale_error=0.0) for channel, model in axes.items()}
    whole = _complete_models(axes)
    true = {
        channel: replace(model.noise, N=in_the_log(model, logged))
        for channel, model in whole.items()
    }
    change = (
        difference_to_si(how.temperature_change, "temperature") if how.temperature_change else 0.0
    )

    def simulated(drive: Drive, course: str, number: int) -> Signals:
        samples, reference = len(drive.trajectory.rate) * block, _find_reference(whole)
        return signals(
            drive.trajectory,
            whole,
            spreads,
            drive.every,
            how.seed,
            (about.sensor, about.recording, course, str(number)),
            block=block,
            temperature=(
                (lambda start, stop: reference + change * np.arange(start, stop) / samples)
                if change
                else None
            ),
        )

    sampling = logged / block
    yield _Source("truth" if known else "estimate", sampling, how.runs, simulated, true)
    if not about.simulated:
        pieces = _cut_pieces(folder, block, round(quantity_to_si(how.duration, "time") * sampling))
        if len(pieces) >= _MIN_PIECES:

            def of_log(drive: Drive, course: str, number: int) -> Signals:
                return signals(
                    drive.trajectory,
                    whole,
                    spreads,
                    drive.every,
                    how.seed,
                    (about.sensor, about.recording, course, f"log {number}"),
                    added=pieces[number],
                )

            yield _Source("log", sampling, min(len(pieces), how.runs), of_log, None)


def _make_spreads(how: NavigateSettings) -> Spreads:
    return Spreads(
        quantity_to_si(how.gyro_bias, "angular_rate"),
        quantity_to_si(how.accel_bias, "acceleration"),
        how.gyro_scale,
        how.accel_scale,
    )


def _complete_models(axes: Mapping[str, SensorModel]) -> dict[str, SensorModel]:
    """Return models of all six channels, as `all_axes`."""
    whole = {}
    for channel in CHANNELS:
        own = [name for name in axes if quantity_of(name) == quantity_of(channel)]
        whole[channel] = axes[
            channel if channel in own else own["xyz".index(channel[-1]) % len(own)]
        ]
    return whole


def _find_reference(axes: Mapping[str, SensorModel]) -> float:
    return next((m.drift.reference for m in axes.values() if m.drift is not None), 25.0)


def _model_before_filter(folder: Path, channel: str, noise: NoiseModel, rate: float) -> SensorModel:
    """Return the model of an axis from the estimates of a log, with its low-pass; rate in Hz."""
    rows = LowPassRow.rows_of(read("low_pass", [folder / "low_pass.parquet"]))
    filters = [
        LowPass(row.value, row.order)
        for row in rows
        if row.channel == channel and row.parameter == "cutoff"
        if row.value is not None and row.order is not None
    ]
    plain = SensorModel(low_pass=filters[-1] if filters else None)
    return replace(plain, noise=before_the_filter(plain, noise, rate))


def _choose_block(logged: float, how: NavigateSettings) -> int:
    """Return the number of samples of a log, at a rate in Hz, per sample of the filter."""
    return max(math.ceil(logged / quantity_to_si(how.rate, "frequency") - 1e-6), 1)


def _cut_pieces(folder: Path, block: int, size: int) -> list[dict[str, Array]]:
    """Return pieces of a log of ``size`` means over ``block`` samples, less the mean of the log.

    Those with a hole in a channel lack it.
    """
    pieces: list[dict[str, Array]] = []
    for channel, log in kept_static_logs(folder).items():
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
    lengths = [quantity_to_si(length, "time") for length in how.outages]
    duration = quantity_to_si(how.duration, "time")
    spreads = _make_spreads(how)
    models = dict(tuned) | ({TRUE: source.true} if source.true is not None else {})
    for course in how.trajectories:
        drive = Drive(trajectory(course, duration, source.sampling), schedule(duration, lengths))
        outcomes = drive.repeat(
            {
                name: _make_states(model, source.sampling, spreads, duration)
                for name, model in models.items()
            },
            partial(source.of_run, drive, course),
            source.runs,
        )
        about: dict[str, Any] = dict(names) | {
            "trajectory": course,
            "signals": source.words,
            "runs": source.runs,
        }
        told = [
            NavigationRow(
                **(
                    about
                    | _describe_tuning(drive, outcomes, name, length)
                    | _list_bank_shares(models[name])
                ),
                model=_describe_terms(models[name]),
            )
            for name in models
            for length in (None, *lengths)
        ]
        smallest = _choose_smallest(told)
        for row in told:
            yield replace(row, smallest=row.tuning == smallest)
        for name, reason in lacking.items():
            yield NavigationRow(**about, tuning=name, reason=reason)


def _make_states(
    models: Models, sampling: float, spreads: Spreads, duration: float
) -> list[AxisStates]:
    return [
        axis_states(
            models[channel],
            sampling,
            turn_on=spreads.bias(channel),
            shortest=FIX_INTERVAL,
            longest=duration,
            scale=spreads.scale(channel),
        )
        for channel in CHANNELS
    ]


def _describe_terms(models: Models) -> str:
    """Describe the terms of the models of gyros and accelerometers."""
    return "; ".join(
        f"{quantity} {', '.join(dict.fromkeys(models[c].name for c in own))}"
        for quantity in ("gyro", "accel")
        if (own := [c for c in CHANNELS if quantity_of(c) == quantity])
    )


def _describe_tuning(
    drive: Drive, outcomes: Mapping[str, Outcome], name: str, length: float | None
) -> dict[str, Any]:
    """Return the fields of a row about a tuning, at the end of outages, s, or with fixes."""
    outcome = outcomes[name]
    row: dict[str, Any] = {
        "tuning": name,
        "outage": length,
        "outages": sum(o.length == length for o in drive.outages) * len(outcome.errors),
        "states": outcome.states,
    }
    for error in ERRORS:
        of_runs = squares(drive, outcome, error, length)
        size = root_mean_square(of_runs)
        row |= {error: size.value, f"{error}_lower": size.lower, f"{error}_upper": size.upper}
        row[f"{error}_predicted"] = predicted(drive, outcome, error, length)
        if TRUE in outcomes:
            against = ratio(of_runs, squares(drive, outcomes[TRUE], error, length))
            row |= {
                f"{error}_ratio": against.value,
                f"{error}_ratio_lower": against.lower,
                f"{error}_ratio_upper": against.upper,
            }
    for group in GROUPS:
        share = inside(drive, outcome, group, length)
        if group != "navigation":
            row[f"nees_{group}"] = share and share.value
        elif share is not None:
            row |= {
                "nees_inside": share.value,
                "nees_error": share.error,
                "consistent": _is_consistent(share),
            }
    return row


def _list_bank_shares(models: Models) -> dict[str, None]:
    """Return the shares that are null: those of biases that a bank of processes only stands for.

    It has no process shorter than an epoch, so that its states are no truth to hold a filter to.
    """
    flickering = [name for name, model in models.items() if "F" in model.name.split("+")]
    return {f"nees_{quantity_of(name)}": None for name in flickering}


def _is_consistent(share: Share) -> bool | None:
    """Return whether the share of a filter is consistent with 0.95; None: not enough runs."""
    off = abs(share.value - 0.95)
    if off > _SHARE_TOLERANCE + 3.0 * share.error:
        return False
    return True if off + 2.0 * share.error <= _MAX_SHARE_ERROR + 1e-9 else None


def _choose_smallest(rows: Sequence[NavigationRow]) -> str | None:
    """Return the consistent tuning (in all its rows) with the fewest states.

    Of several that one whose position is best after the longest outage. The true model is none.
    """
    by_tuning: dict[str, list[NavigationRow]] = {}
    for row in rows:
        by_tuning.setdefault(row.tuning, []).append(row)
    consistent = {
        name: (own[0].states or 0, own[-1].position or 0.0)
        for name, own in by_tuning.items()
        if name != TRUE and all(row.consistent for row in own)
    }
    return min(consistent, key=lambda name: consistent[name], default=None)
