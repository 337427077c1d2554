"""Bias, scale factor or attitude of one recording with known rates or directions, as rows."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from imubench_pipeline.extensions.calibration.alignment.attitude import euler_angles, rotation
from imubench_pipeline.extensions.calibration.alignment.fine import align
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment, block_means
from imubench_pipeline.extensions.calibration.least_squares import (
    Estimated,
    NotObservable,
    NotObservableError,
)
from imubench_pipeline.extensions.calibration.noise_source import (
    NoiseSource,
    find_noise_source,
    lend_axes,
    load_noise_at_rest,
    take_printed_noise,
)
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.extensions.calibration.rate_table import calibrate, residuals
from imubench_pipeline.extensions.calibration.reasons import NO_MODEL, explain_segments
from imubench_pipeline.extensions.calibration.schedule import Schedule
from imubench_pipeline.extensions.calibration.settings import (
    AtRest,
    InPositions,
    OnRateTable,
    SimulatedPositions,
    SimulatedTable,
)
from imubench_pipeline.extensions.calibration.still import bias_at_rest
from imubench_pipeline.extensions.calibration.tables import (
    CALIBRATED,
    CalibrationPointRow,
    CalibrationRow,
)
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.recordings.kept import load_logs
from imubench_pipeline.recordings.recording import ChannelLog, place_on_grid, read_metadata
from imubench_pipeline.settings.sensor import CHANNELS, Sensor
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_quantity

UNITS = {  # SI
    "bias": "rad/s",
    "present_bias": "rad/s",
    "scale_factor": "1",
    "quadratic": "s/rad",
    "asymmetry": "1",
    "linearity": "1",
    "earth_rate": "rad/s",
    "heading": "rad",
}
_ANGLES = ("roll", "pitch", "heading")  # of the first position
_Z_95 = 1.96  # standard deviations of a 95 % limit
_RUN_PARAMETERS = {"rate_table": ("bias", "scale_factor"), "at_rest": ("bias", "present_bias")}


def make_calibration_tables(
    folder: Path, static: Sequence[Path], sensor: str, recording: str, settings: str
) -> dict[str, list[TableRow]]:
    """Return the rows of the tables of a gyro on a rate table, or at rest with a known direction.

    `folder`: results of the recording; `static`: results of the static recordings of its sensor;
    `settings`: from `run.plan.Plan.experiment_settings`. A rejected recording has no rows.
    """
    tables: dict[str, list[TableRow]] = {name: [] for name in CALIBRATED}
    logs = load_logs(folder)
    if not logs:
        return tables
    sections = json.loads(settings)
    simulated = None
    if "simulated" in sections:
        simulated = SimulatedRecording.model_validate(sections["simulated"])
    declared = _declared(sections, simulated)
    stated = Sensor.model_validate(sections["sensor"])
    rows: Iterator[TableRow]
    if isinstance(declared, InPositions):
        triad = None if simulated is None else simulated.block(SimulatedPositions)
        truth = {} if triad is None else triad.true_angles
        rows = _attitude(Key(sensor, recording, "gyro_x"), logs, static, stated, declared, truth)
    else:
        # Of several gyros the notes name one: the ingest has seen to it.
        metadata = read_metadata(next(iter(logs.values())).path)
        gyros = (name for name in [*logs, *metadata.unusable] if name.startswith("gyro_"))
        channel: str = declared.channel or next(gyros)
        key = Key(sensor, recording, channel)
        run = "rate_table" if isinstance(declared, OnRateTable) else "at_rest"
        row = partial(CalibrationRow, **asdict(key), run=run)
        if channel not in logs:
            reason = f"{channel} cannot be used; see the findings of the recording"
            rows = _without(row, "not_shown", reason)
        else:
            source = find_noise_source(folder, static, key, stated)
            truth = _truth(simulated, channel)
            log = GyroLog(key, logs[channel], source, metadata.begins, truth)
            rows = _calibrate_gyro(row, log, declared)
    for made in rows:
        tables[made.table].append(made)
    return tables


_EXPERIMENTS: Mapping[str, type[InPositions | OnRateTable | AtRest]] = {
    "positions": InPositions,
    "rate_table": OnRateTable,
    "pointing": AtRest,
}


def _declared(
    sections: Mapping[str, Any], simulated: SimulatedRecording | None
) -> InPositions | OnRateTable | AtRest:
    """Return the block in the notes of a log, or its equivalent for a simulated one."""
    if simulated is not None:
        blocks = map(simulated.block, _EXPERIMENTS.values())
        return next(block for block in blocks if block is not None)
    key = next(key for key in _EXPERIMENTS if key in sections)
    return _EXPERIMENTS[key].model_validate(sections[key])


def _truth(simulated: SimulatedRecording | None, channel: str) -> dict[str, float]:
    """Return the true bias of a simulation, and its line on a rate table, SI."""
    if simulated is None:
        return {}
    truth = {}
    for name, axis in simulated.channels.items():
        if name == channel and axis.bias is not None:
            truth["bias"] = parse_quantity(axis.bias, "angular_rate")
    if (table := simulated.block(SimulatedTable)) is not None:
        truth |= {"scale_factor": table.scale_factor, "quadratic": 0.0, "asymmetry": 0.0}
    return truth


@dataclass(frozen=True)
class GyroLog:
    """The log of a calibrated gyro."""

    key: Key
    log: ChannelLog
    source: NoiseSource | None  # without it nothing is estimated
    begins: float  # time of the first sample used, s from the first of the recording
    truth: Mapping[str, float]  # true figures of a simulation, SI


def _attitude(
    key: Key,
    logs: Mapping[str, ChannelLog],
    static: Sequence[Path],
    sensor: Sensor,
    declared: InPositions,
    truth: Mapping[str, float],
) -> Iterator[CalibrationRow]:
    """Yield roll, pitch and heading, rad, of the first position, or the reason without them."""
    about = partial(
        CalibrationRow, **asdict(key), run="positions", unit="rad", latitude=declared.latitude_si
    )

    def without(status: str, reason: str) -> Iterator[CalibrationRow]:
        for name in _ANGLES:
            yield about(parameter=name, status=status, reason=reason)

    missing = [name for name in CHANNELS if name not in logs]
    if missing:
        reason = f"{', '.join(missing)} cannot be used; see the findings of the recording"
        yield from without("not_shown", reason)
        return
    if any(len(logs[name].segments) > 1 for name in CHANNELS):
        yield from without("not_shown", explain_segments(len(logs[CHANNELS[0]].segments)))
        return
    at_rest = load_noise_at_rest(static)
    if at_rest is not None and any(channel.startswith("accel") for channel in at_rest.models):
        models = [at_rest.models[name] for name in lend_axes(at_rest.models).values()]
        words = f"static recording {at_rest.recording}"
    else:
        printed = [take_printed_noise(key.sensor, sensor, channel) for channel in CHANNELS]
        known = [source for source in printed if source is not None]
        if len(known) < 6:
            yield from without("no_model", NO_MODEL)
            return
        models, words = [source.model for source in known], known[0].words
    about = partial(about, model=models[0].name, model_from=words)
    try:
        positions, means = _average_positions([logs[name] for name in CHANNELS], declared)
        triad = Triad(
            gyros=models[:3],
            accelerometers=models[3:],
            gyro_bias=parse_quantity(declared.gyro_bias, "angular_rate"),
            accelerometer_bias=parse_quantity(declared.accelerometer_bias, "acceleration"),
        )
        aligned, fine = align(means, triad, positions, Site(latitude=declared.latitude_si))
    except ValueError as error:
        yield from without(_name_status(error), str(error))
        return
    for name, value, sigma in zip(
        _ANGLES, euler_angles(aligned.attitude[0]).tolist(), fine.sigma[-1].tolist(), strict=True
    ):
        yield about(
            parameter=name,
            value=value,
            lower=value - _Z_95 * sigma,
            upper=value + _Z_95 * sigma,
            status="ok",
            sigma=sigma,
            sigma_noise=sigma,
            truth=truth.get(name),
            duration=positions.blocks.duration,
            samples=int(positions.blocks.count.sum()),
            rates=len(positions.turned),
        )


def _average_positions(
    axes: Sequence[ChannelLog], declared: InPositions
) -> tuple[Positions, Array]:
    """Return the positions of a log, and the mean of each axis in each, shape (b, 6)."""
    rate, grid = axes[0].rate, min(log.grid for log in axes)
    dwell, turning = declared.seconds("dwell"), declared.seconds("turning")
    dwells: list[Dwell] = []
    while True:
        start = len(dwells) * dwell
        stop = round((start + dwell - turning) * rate)
        if stop > grid:
            break
        dwells.append(Dwell(round(start * rate), stop, 1))
    if len(dwells) < 2:
        raise ValueError(f"the log has {len(dwells)} complete positions; expected two or more")
    experiment = Experiment(tuple(dwells), rate, 0.0)
    longest = max(one.stop - one.start for one in dwells)
    measured = [block_means(log.blocks(), experiment, longest) for log in axes]
    if {len(one.blocks) for one in measured} != {len(dwells)}:
        raise ValueError("more than half of the samples of a position are missing")
    angles = np.zeros((len(dwells), 3))
    angles[:, 2] = [declared.angle(number) for number in range(len(dwells))]
    count = np.min([one.blocks.count for one in measured], axis=0)
    blocks = replace(measured[0].blocks, count=count)
    means = np.stack([one.means[0] for one in measured], axis=1)
    return Positions(blocks, rotation(angles)), means


def _calibrate_gyro(
    row: partial[CalibrationRow], gyro: GyroLog, declared: OnRateTable | AtRest
) -> Iterator[TableRow]:
    axis = declared.axis if isinstance(declared, OnRateTable) else declared
    pointing = None if axis is None else axis.pointing
    if gyro.source is not None:
        row = partial(row, model=gyro.source.model.name, model_from=gyro.source.words)
    if pointing is not None:
        row = partial(row, earth_rate=pointing.rate, earth_rate_sigma=pointing.rate_sigma)
        row = partial(row, latitude=pointing.latitude, heading=pointing.heading)
        row = partial(row, elevation=pointing.elevation)
    if len(gyro.log.segments) > 1:
        yield from _without(row, "not_shown", explain_segments(len(gyro.log.segments)))
        return
    if isinstance(declared, OnRateTable):
        yield from _on_rate_table(row, gyro, declared, pointing)
    else:
        yield from _at_rest(row, gyro, declared.pointing)


def _at_rest(row: partial[CalibrationRow], gyro: GyroLog, pointing: Pointing) -> Iterator[TableRow]:
    """Yield the bias of a gyro with a stated direction, or the reason why there is none."""
    if gyro.source is None:
        yield from _without(row, "no_model", NO_MODEL)
        return
    samples = place_on_grid(gyro.log.blocks(), gyro.log.grid)
    try:
        bias = bias_at_rest(samples, gyro.log.rate, gyro.source.model, pointing)
    except ValueError as error:
        yield from _without(row, "too_short", str(error))
        return
    about = partial(
        row,
        duration=len(samples) / gyro.log.rate,
        samples=int(np.isfinite(samples).sum()),
        scatter=_finite(bias.p_value[0]),
        half_width=bias.bound,
    )
    yield _figure(gyro, about, "bias", bias.fixed)
    yield _figure(gyro, about, "present_bias", bias.present)
    yield from _open(row, bias.not_observable)


def _on_rate_table(
    row: partial[CalibrationRow], gyro: GyroLog, declared: OnRateTable, pointing: Pointing | None
) -> Iterator[TableRow]:
    """Yield scale factor and bias of a gyro on a rate table, or the reason without them."""
    try:
        schedule = _schedule(gyro, declared)
    except ValueError as error:
        yield from _without(row, "too_short", str(error))
        return
    if gyro.source is None:
        yield from _without(row, "no_model", NO_MODEL)
        return
    model = gyro.source.model
    setting = declared.si("setting_sigma", "angular_rate")
    samples = place_on_grid(gyro.log.blocks(), gyro.log.grid)
    try:
        fit, measured = calibrate(samples, schedule, model, pointing, setting_sigma=setting)
    except ValueError as error:
        yield from _without(row, _name_status(error), str(error))
        return
    earth = 0.0 if pointing is None else pointing.rate
    rates = schedule.of_blocks(measured.blocks) + earth
    left = residuals(fit, measured, rates, model, setting)
    about = partial(
        row,
        duration=measured.blocks.duration,
        samples=int(measured.blocks.count.sum()),
        rates=len(left.dwell),
        scatter=_finite(fit.line.p_value[0]) if fit.line.freedom else None,
    )
    for name in ("bias", "scale_factor", "quadratic", "asymmetry", "linearity"):
        estimated: Estimated | None = getattr(fit, name)
        if estimated is not None:
            yield _figure(gyro, about, name, estimated)
    yield from _open(row, fit.not_observable)
    for k, dwell in enumerate(left.dwell.tolist()):
        stretch = schedule.stretches[dwell]
        yield CalibrationPointRow(
            **asdict(gyro.key),
            number=dwell + 1,
            start=stretch.start / schedule.rate + gyro.begins,
            stop=stretch.stop / schedule.rate + gyro.begins,
            table_rate=float(schedule.table_rates[dwell]),
            earth_rate=earth,
            mean=float(left.mean[k]),
            line=float(left.line[k]),
            residual=float(left.value[k]),
            sigma=float(left.sigma[k]),
        )


def _schedule(gyro: GyroLog, declared: OnRateTable) -> Schedule:
    log, settling = gyro.log, declared.si("settling", "time")
    if not declared.steps:
        if not log.table_rate:
            raise ValueError(
                "log.table_rate: the column has another clock than the gyro; put it into the same "
                "file, or state the steps (rate_table: steps)"
            )
        try:
            return Schedule.from_column(
                place_on_grid(log.table_rates(), log.grid),
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
    ends = gyro.begins + log.grid / log.rate
    steps = []
    for number, step in enumerate(declared.steps, 1):
        start, stop = step.seconds
        if start < gyro.begins or stop > ends + 1.0 / log.rate:
            raise ValueError(
                f"rate_table.steps: step {number} lasts from {start:g} to {stop:g} s; expected "
                f"steps within the log, which is used from {gyro.begins:g} to {ends:g} s: correct "
                "the step, or 'use:' beside the log"
            )
        rate = parse_quantity(step.rate, "angular_rate")
        steps.append((start - gyro.begins, min(stop, ends) - gyro.begins, rate))
    return Schedule.from_steps(steps, log.rate, settling=settling)


def _figure(
    gyro: GyroLog, about: partial[CalibrationRow], name: str, estimated: Estimated
) -> CalibrationRow:
    chance = estimated.p_value
    return about(
        parameter=name,
        value=float(estimated.value[0]),
        lower=float(estimated.lower[0]),
        upper=float(estimated.upper[0]),
        unit=UNITS[name],
        status="ok",
        sigma=estimated.sigma,
        sigma_noise=estimated.noise_sigma,
        chance=None if chance is None else float(chance[0]),
        truth=gyro.truth.get(name),
    )


def _open(
    row: partial[CalibrationRow], quantities: tuple[NotObservable, ...]
) -> Iterator[CalibrationRow]:
    """Yield the quantities that are not observable, each with its reason."""
    for unknown in quantities:
        yield row(
            parameter=unknown.quantity,
            unit=UNITS[unknown.quantity],
            status="not_observable",
            reason=unknown.reason,
            half_width=unknown.half_width,
        )


def _without(row: partial[CalibrationRow], status: str, reason: str) -> Iterator[CalibrationRow]:
    for name in _RUN_PARAMETERS[row.keywords["run"]]:
        yield row(status=status, reason=reason, parameter=name, unit=UNITS[name])


def _name_status(error: ValueError) -> str:
    return "not_observable" if isinstance(error, NotObservableError) else "too_short"


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
