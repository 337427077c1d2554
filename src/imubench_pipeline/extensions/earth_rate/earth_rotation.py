"""The Earth's rate of one recording of a gyro that was turned, as rows of the tables."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.linalg import LinAlgError

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment
from imubench_pipeline.extensions.calibration.noise_source import NoiseSource, find_noise_source
from imubench_pipeline.extensions.calibration.reasons import NO_MODEL, explain_segments
from imubench_pipeline.extensions.earth_rate.outlook import Outlook, prediction_rows
from imubench_pipeline.extensions.earth_rate.published import (
    METHODS,
    Courses,
    Range,
    compute_allowed_sigmas,
    compute_sigma_ranges,
    compute_white_sigma,
    estimate_courses,
    judge_error,
    thin,
)
from imubench_pipeline.extensions.earth_rate.settings import (
    EarthRateSettings,
    SimulatedTurns,
    TwoPosition,
)
from imubench_pipeline.extensions.earth_rate.simulation import design_run
from imubench_pipeline.extensions.earth_rate.tables import (
    TURNED,
    EarthRatePublishedRow,
    EarthRateRow,
    EarthRateSeriesRow,
    TurningRow,
)
from imubench_pipeline.extensions.earth_rate.turning import find_turning
from imubench_pipeline.extensions.earth_rate.turns import FoundDwell, Turning
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.recordings.kept import load_logs
from imubench_pipeline.recordings.recording import ChannelLog, place_on_grid, read_metadata
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.simulate.models import make_axis_model
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_quantity

WHOLE = "whole"  # name of the part that is a whole recording
_MIN_SCHEDULED_SHARE = 0.9  # share of turns found by the schedule alone: turns are not visible
_Z_95 = 1.96  # standard deviations of a 95 % limit
_GIVEN = (
    "bias tracking with known rate: this filter is given the Earth's rate, and its output "
    "approaches the given rate; it is no estimate"
)


def make_earth_rate_tables(
    folder: Path, static: Sequence[Path], sensor: str, recording: str, settings: str
) -> dict[str, list[TableRow]]:
    """Return the rows of the tables of a turned gyro; none for a rejected recording.

    `folder`: results of the recording; `static`: results of the static recordings of its sensor;
    `settings`: from `imubench_pipeline.run.plan.Plan.experiment_settings`.
    """
    rows: dict[str, list[TableRow]] = {name: [] for name in TURNED}
    sections = json.loads(settings)
    logs = load_logs(folder)
    if not logs:
        return rows
    simulated = turns = None
    if "simulated" in sections:
        simulated = SimulatedRecording.model_validate(sections["simulated"])
        turns = simulated.block(SimulatedTurns)
    declared = turns or TwoPosition.model_validate(sections["two_position"])
    metadata = read_metadata(next(iter(logs.values())).path)
    channel = declared.moved_gyro([*logs, *metadata.unusable])
    key = Key(sensor, recording, channel)
    if channel not in logs:
        reason = f"{channel} cannot be used; see the findings of the recording"
        rows["earth_rate"] = list(_without(_start_row(key, declared), WHOLE, "not_shown", reason))
        return rows
    how = EarthRateSettings.model_validate(sections["earth_rate"])
    source = find_noise_source(
        folder, static, key, Sensor.model_validate(sections["sensor"]), how.draws
    )
    for row in _earth_rate(key, logs[channel], declared, source, how, metadata.begins):
        rows[row.table].append(row)
    if simulated is not None and turns is not None:
        rows["earth_rate_published"] = list(_published(key, simulated, turns, rows["earth_rate"]))
    return rows


def _published(
    key: Key, simulated: SimulatedRecording, turns: SimulatedTurns, estimates: Sequence[TableRow]
) -> Iterator[EarthRatePublishedRow]:
    """Yield the printed estimates of a simulated recording, with the estimates from its log."""
    rate = parse_quantity(simulated.rate, "frequency")
    period, turning = turns.seconds("dwell"), turns.seconds("turning")
    axes = {str(name): axis for name, axis in simulated.channels.items()}
    noise = make_axis_model(axes[key.channel], key.channel).noise
    rows = [row for row in estimates if isinstance(row, EarthRateRow)]
    values = {(row.part, row.method): row.value for row in rows}
    for figure in turns.published:
        part = figure.part
        text = simulated.duration if part == WHOLE else part.removeprefix("last ")
        value = parse_quantity(figure.printed, "angular_rate")
        duration = parse_quantity(text, "time")
        design = design_run(duration, period, turning, rate, turns.latitude_si)
        allowed = compute_allowed_sigmas(design, noise)
        off = (value - EARTH_RATE) / allowed.sigma
        yield EarthRatePublishedRow(
            **asdict(key),
            part=part,
            place=figure.where,
            printed=figure.printed,
            **vars(allowed),
            duration=duration,
            published=value,
            truth=EARTH_RATE,
            off_sigma=off,
            verdict=judge_error(off),
            simulated=values.get((part, "pairs")),
            simulated_filter=values.get((part, "filter")),
            assumed=", ".join(turns.assumed) or None,
        )


def _start_row(
    key: Key, declared: TwoPosition, source: NoiseSource | None = None
) -> partial[EarthRateRow]:
    return partial(
        EarthRateRow,
        **asdict(key),
        parameter="earth_rate",
        unit="rad/s",
        truth=EARTH_RATE,
        latitude=declared.latitude_si,
        model=source.model.name if source else None,
        model_from=source.words if source else None,
    )


def _earth_rate(
    key: Key,
    log: ChannelLog,
    declared: TwoPosition,
    source: NoiseSource | None,
    settings: EarthRateSettings,
    begins: float,
) -> Iterator[TableRow]:
    """Find the turns of a gyro and estimate the Earth's rate; else the rows say why not.

    Without a noise source the turns are found, and nothing is estimated. `begins`: time of the
    first sample that is used, s from the first of the recording.
    """
    row = _start_row(key, declared, source)
    if len(log.segments) > 1 or log.position_elsewhere:
        reason = (
            explain_segments(len(log.segments))
            if len(log.segments) > 1
            else "the position has a clock of its own; give it as a column of the file that the "
            "gyro is in, or leave 'position' out"
        )
        yield from _without(row, WHOLE, "not_shown", reason)
        return
    bias = declared.turn_on_bias_si
    if source is not None:
        dwell, turn_time = declared.seconds("dwell"), declared.seconds("turning")
        sigma = math.inf if bias is None else bias
        outlook = Outlook(source.model, declared.latitude_si, turn_time, log.rate, sigma)
        run_time = max(parse_quantity(settings.run_time, "time"), 3.0 * dwell + turn_time)
        yield from prediction_rows(key, outlook, dwell - turn_time, settings.goals, run_time)
    samples = place_on_grid(log.blocks(), log.grid)
    try:
        turning = find_turning(
            samples,
            log.rate,
            declared.seconds("dwell"),
            turning=declared.seconds("turning"),
            start=declared.seconds("start"),
            first_sense=declared.first_sense,
            position=place_on_grid(log.positions(), log.grid) if log.position else None,
            model=source.model if source else None,
            margin=parse_quantity(settings.margin, "time"),
            trust_schedule=declared.trust_schedule,
        )
    except ValueError as error:
        reason = (
            f"no turns: {error}; check 'dwell' and 'channel' of two_position, or give the log a "
            "column with the position (log: position)"
        )
        yield from _without(row, WHOLE, "no_turns", reason)
        return
    used = np.where(turning.senses(len(samples), log.rate) == 0, np.nan, samples)  # no knocks
    dwells = [
        (dwell, dwell.in_samples(log.rate))
        for dwell in turning.dwells
        if dwell.stop - dwell.start > 2.0 / log.rate
    ]
    yield from _turning_rows(key, turning, dwells, used, begins)
    if source is None:
        yield from _without(row, WHOLE, "no_model", NO_MODEL)
        return
    model, *drawn = source.model, *source.drawn
    if drift := declared.drift_si:  # beside the noise of the model
        model, *drawn = (replace(m, R=(m.R**2 + drift**2) ** 0.5) for m in (model, *drawn))
    unsure = _unsure(turning, declared.trust_schedule)
    parts = {WHOLE: 0.0}  # start of each part in the log, s
    for text in declared.last:
        parts[f"last {text}"] = max(len(samples) / log.rate - parse_quantity(text, "time"), 0.0)
    for part, start in parts.items():
        chosen = tuple(dwell for _, dwell in dwells if dwell.start >= start * log.rate)
        if len(chosen) < 2:
            reason = f"{len(chosen)} dwells are not enough; it takes one of each position"
            yield from _without(row, part, "too_short", reason)
            continue
        try:
            experiment = Experiment(chosen, log.rate, declared.latitude_si)
            courses = estimate_courses(used, experiment, model, source.papers, bias)
        except (ValueError, LinAlgError) as error:
            yield from _without(row, part, "too_short", str(error))
            continue
        about = partial(row, part=part, dwells=len(chosen), turns=len(chosen) - 1)
        ranges = compute_sigma_ranges(courses.measured.blocks, drawn, bias)
        yield from _estimates(about, courses, source, unsure, ranges)
        yield from _series(key, part, courses, begins)


def _turning_rows(
    key: Key,
    turning: Turning,
    dwells: Sequence[tuple[FoundDwell, Dwell]],
    used: Array,
    begins: float,
) -> Iterator[TurningRow]:
    names = asdict(key)
    for text in turning.doubts:
        yield TurningRow(**names, what="doubt", doubts=(text,))
    for number, (dwell, part) in enumerate(dwells, 1):
        values = used[part.start : part.stop]
        finite = np.isfinite(values)
        yield TurningRow(
            **names,
            what="dwell",
            number=number,
            start=dwell.start + begins,
            stop=dwell.stop + begins,
            sense=dwell.sense,
            found_by=dwell.found_by,
            mean=float(values[finite].mean()) if finite.any() else None,
            doubts=tuple(dwell.doubts),
        )
    for number, turn in enumerate(turning.turns, 1):
        yield TurningRow(
            **names,
            what="turn",
            number=number,
            start=turn.start + begins,
            stop=turn.stop + begins,
            time=turn.time + begins,
            found_by=turn.found_by,
            peak=turn.peak,
            doubts=tuple(turn.doubts),
        )
    for number, (start, stop) in enumerate(turning.knocks, 1):
        start, stop = start + begins, stop + begins
        yield TurningRow(**names, what="knock", number=number, start=start, stop=stop)


def _unsure(turning: Turning, trusted: bool) -> dict[str, Any]:
    """Return status and reason of estimates with uncertain sign or turns."""
    reasons = []
    by_schedule, turns = turning.by_schedule, len(turning.turns)
    unseen = by_schedule >= _MIN_SCHEDULED_SHARE * turns
    if unseen:
        reasons.append(
            f"{by_schedule} of {turns} turns rest on the schedule: nothing else shows that it was "
            f"turned, and its level alternates by {abs(turning.alternation.z):.1f} standard errors"
        )
        if not trusted:
            reasons.append(
                "chance alone does so in one log of some 400 that were never turned; if this one "
                "was turned by the clock, state 'trust_schedule: true'"
            )
    if turning.ambiguous:
        reasons.append(
            "where the axis points first is not known, and taken for north: the sign may be the "
            "other one; state 'first: north' or 'first: south'"
        )
    doubtful = turning.ambiguous or (unseen and not trusted)
    return {"status": "ambiguous" if doubtful else "ok", "reasons": tuple(reasons)}


def _estimates(
    row: partial[EarthRateRow],
    courses: Courses,
    source: NoiseSource,
    unsure: dict[str, Any],
    ranges: dict[str, Range],
) -> Iterator[EarthRateRow]:
    """Yield the estimates of each method; ``unsure``: status and reasons of all."""
    measured, blocks = courses.measured, courses.measured.blocks
    about = partial(
        row,
        white=compute_white_sigma(source.model, blocks),
        duration=blocks.duration,
        samples=int(blocks.count.sum()),
        missing=measured.missing + measured.left_out,
        block=courses.longest / blocks.rate,
    )
    for course in courses.courses:
        one = partial(about, method=course.method, **ranges.get(course.method, {}))
        if course.reason is not None:
            yield one(status="not_shown", reasons=(course.reason,))
        elif course.sigma is None:
            settled = None if course.settled in (None, math.inf) else course.settled
            yield one(
                value=float(course.rate[-1]), status="given", reasons=(_GIVEN,), settled=settled
            )
        else:
            value, sigma = float(course.rate[-1]), float(course.sigma[-1])
            yield one(
                value=value,
                lower=value - _Z_95 * sigma,
                upper=value + _Z_95 * sigma,
                sigma=sigma,
                off_sigma=(value - EARTH_RATE) / sigma,
                **unsure,
            )


def _without(
    row: partial[EarthRateRow], part: str, status: str, reason: str
) -> Iterator[EarthRateRow]:
    for method in METHODS:
        yield row(part=part, method=method, status=status, reasons=(reason,))


def _series(key: Key, part: str, courses: Courses, begins: float) -> Iterator[EarthRateSeriesRow]:
    rates = [("rate", course) for course in courses.courses]
    for quantity, course in [*rates, ("drift", courses.drift)]:
        for k in thin(len(course.time)):
            yield EarthRateSeriesRow(
                **asdict(key),
                part=part,
                method=course.method,
                quantity=quantity,
                time=float(course.time[k]) + begins,
                value=float(course.rate[k]),
                sigma=None if course.sigma is None else float(course.sigma[k]),
            )
