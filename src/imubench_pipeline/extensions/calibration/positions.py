"""The attitude of a triad that stood in several positions, as rows of the table ``calibration``."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np

from imubench_pipeline.extensions.calibration.alignment.attitude import euler_angles, rotation
from imubench_pipeline.extensions.calibration.alignment.fine import align
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment, block_means
from imubench_pipeline.extensions.calibration.least_squares import NotObservableError
from imubench_pipeline.extensions.calibration.settings import TRIAD, InPositions, SimulatedPositions
from imubench_pipeline.extensions.calibration.tables import CalibrationRow
from imubench_pipeline.extensions.earth_rate.outlook import noise_at_rest
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.steps.noise_source import NO_MODEL, from_printed, segments_reason
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array
from imubench_pipeline.units import quantity_to_si

ANGLES = ("roll", "pitch", "heading")
"""Estimated angles, of the first position."""

_Z_95 = 1.96  # standard deviations of a 95 % limit


def attitude_rows(
    key: Key,
    logs: Mapping[str, ChannelLog],
    static: Sequence[Path],
    sensor: Sensor,
    declared: InPositions,
    truth: Mapping[str, float],
) -> Iterator[CalibrationRow]:
    """Yield roll, pitch and heading of the first position, or the reason without them.

    `logs` are the channels that can be analysed, `static` the folders of the static recordings of
    the same sensor, `truth` the angles of a simulation, rad.
    """
    about = partial(
        CalibrationRow,
        **asdict(key),
        run="positions",
        unit="rad",
        latitude=declared.latitude_si,
    )

    def without(status: str, reason: str) -> Iterator[CalibrationRow]:
        for name in ANGLES:
            yield about(parameter=name, status=status, reason=reason)

    missing = [name for name in TRIAD if name not in logs]
    if missing:
        reason = f"{', '.join(missing)} cannot be used; the findings of the recording say why"
        yield from without("not_shown", reason)
        return
    axes = [logs[name] for name in TRIAD]
    if any(len(log.segments) > 1 for log in axes):
        yield from without("not_shown", segments_reason(axes[0]))
        return
    at_rest = noise_at_rest(static)
    if at_rest is not None and any(channel.startswith("accel") for channel in at_rest.models):
        models = [*at_rest.three("gyro").values(), *at_rest.three("accel").values()]
        words = f"static recording {at_rest.recording}"
    else:
        printed = [from_printed(key.sensor, sensor, channel) for channel in TRIAD]
        known = [source for source in printed if source is not None]
        if len(known) < 6:
            yield from without("no_model", NO_MODEL)
            return
        models, words = [source.model for source in known], known[0].words
    about = partial(about, model=models[0].name, model_from=words)
    try:
        positions, means = _means(axes, declared)
        triad = Triad(
            gyros=models[:3],
            accelerometers=models[3:],
            gyro_bias=quantity_to_si(declared.gyro_bias, "angular_rate"),
            accelerometer_bias=quantity_to_si(declared.accelerometer_bias, "acceleration"),
        )
        aligned, fine = align(means, triad, positions, Site(latitude=declared.latitude_si))
    except NotObservableError as error:
        yield from without("not_observable", str(error))
        return
    except ValueError as error:
        yield from without("too_short", str(error))
        return
    for name, value, sigma in zip(
        ANGLES, euler_angles(aligned.attitude[0]).tolist(), fine.sigma[-1].tolist(), strict=True
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


def _means(axes: Sequence[ChannelLog], declared: InPositions) -> tuple[Positions, Array]:
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
        raise ValueError(f"{len(dwells)} positions are in the log; expected two or more")
    experiment = Experiment(tuple(dwells), rate, 0.0)
    longest = max(one.stop - one.start for one in dwells)
    measured = [block_means(log.blocks(), experiment, longest) for log in axes]
    if {len(one.blocks) for one in measured} != {len(dwells)}:
        raise ValueError("too many samples of a position are missing")
    angles = np.zeros((len(dwells), 3))
    angles[:, 2] = [declared.angle(number) for number in range(len(dwells))]
    count = np.min([one.blocks.count for one in measured], axis=0)
    blocks = replace(measured[0].blocks, count=count)
    means = np.stack([one.means[0] for one in measured], axis=1)
    return Positions(blocks, rotation(angles)), means


def true_angles(simulated: SimulatedPositions) -> dict[str, float]:
    """Return roll, pitch and heading of a simulation, rad, the heading from -pi to pi."""
    angles = {name: quantity_to_si(getattr(simulated, name), "angle") for name in ANGLES}
    angles["heading"] = math.remainder(angles["heading"], 2.0 * math.pi)
    return angles
