"""Simulated recordings, written as the logger of their sensor would write them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.alignment.attitude import matrix
from imubench_pipeline.extensions.calibration.alignment.triad import Site
from imubench_pipeline.extensions.calibration.alignment.turned import sensed
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.in_positions import TRIAD
from imubench_pipeline.extensions.calibration.positions import true_angles
from imubench_pipeline.extensions.earth_rate.simulation import true_rate
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.readers.text_log import TextLog
from imubench_pipeline.settings.sensor import TEMPERATURE, ColumnSource, LogFormat
from imubench_pipeline.settings.simulated_recordings import (
    SimulatedPositions,
    SimulatedRecording,
    SimulatedTable,
    SimulatedTurns,
)
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.imu import simulate_imu
from imubench_pipeline.simulate.models import imu_model
from imubench_pipeline.simulate.profiles import Profile, profiles_of
from imubench_pipeline.steps.specimens import fused_blocks
from imubench_pipeline.tables import making
from imubench_pipeline.units import quantity_to_si


def write_simulated(recording: SimulatedRecording, log: LogFormat, folder: Path) -> None:
    """Simulate a recording and write it as text, by its `layout` of the sensor's logs.

    Raises
    ------
    ConfigError
        If the logs of the sensor are not text.
    """
    if log.reader not in (None, "csv"):
        raise ConfigError(
            f"{recording.sensor}: simulated logs are written as text, the sensor file has "
            f"reader {log.reader!r}"
        )
    rate = quantity_to_si(recording.rate, "frequency")
    files: dict[str, dict[str, ColumnSource]] = {}
    sources = {str(name): source for name, source in log.channels.items()}
    if log.temperature is not None:
        sources[TEMPERATURE] = log.temperature
    for name, source in sources.items():
        files.setdefault(source.file or "log.txt", {})[name] = source
    folder.mkdir(parents=True, exist_ok=True)
    remarks = (f"Update Rate: {recording.rate}",)
    with ExitStack() as stack:
        writers = [
            stack.enter_context(TextLog(folder / name, log, sources, rate, remarks, np.float32))
            for name, sources in files.items()
        ]
        for block in _blocks(recording, rate):
            for writer in writers:
                writer.write(block)


def _blocks(recording: SimulatedRecording, rate: float) -> Iterator[dict[str, NDArray[np.float64]]]:
    """Return the blocks of the channels in SI and, where there is one, of the temperature."""
    try:
        model = imu_model(recording.channels, recording)
    except ValueError as error:
        name = f"{recording.sensor}/{recording.recording}"
        raise ConfigError(f"{name}: channels.{error}") from error
    motion, temperature = profiles_of(recording, Path())
    motion = dict(motion)
    gyro = recording.experimental
    if gyro is not None:
        motion = motion | {gyro: _sensed(recording, rate)}
    if recording.positions is not None:
        motion = motion | _in_positions(recording.positions, rate, recording.samples)
    if recording.specimens is not None:
        return fused_blocks(recording, motion, temperature)
    return simulate_imu(
        model,
        rate,
        recording.samples,
        recording.seed,
        (recording.sensor, recording.recording),
        motion=motion,
        temperature=temperature,
    )


@dataclass(frozen=True)
class _Samples(Profile):
    """What is sensed at each sample of a log."""

    values: NDArray[np.float64]
    rate: float

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values of the samples at these times."""
        return self.values[np.rint(times * self.rate).astype(np.int64)]


def _sensed(recording: SimulatedRecording, rate: float) -> _Samples:
    """Return what the gyro of an experiment senses."""
    if recording.two_position is not None:
        return _turned(recording, recording.two_position, rate, recording.samples)
    if recording.rate_table is not None:
        return _on_table(recording.rate_table, rate, recording.samples)
    assert recording.pointing is not None  # there is no other experiment
    return _Samples(np.full(recording.samples, recording.pointing.true.rate), rate)


def _in_positions(positions: SimulatedPositions, rate: float, samples: int) -> dict[str, _Samples]:
    """Return what a triad senses that is turned at a steady rate between its positions."""
    dwell, turning = positions.seconds("dwell"), positions.seconds("turning")
    number = math.ceil(samples / rate / dwell) + 1
    # Where it stands, and where it begins to turn; without a turn it is moved between two samples.
    times = np.repeat(np.arange(number) * dwell, 2)
    times[1::2] += dwell - max(turning, 0.5 / rate)
    angles = np.repeat([positions.angle(k) for k in range(number)], 2)
    at = np.arange(samples) / rate
    angle = np.interp(at, times, angles)
    turned = np.diff(np.interp(at[0] + (np.arange(samples + 1) - 0.5) / rate, times, angles)) * rate
    attitude = matrix(*true_angles(positions.model_dump()).values())
    true = sensed(Site(latitude=positions.latitude_si), attitude, angle, turned)
    return {name: _Samples(true[:, k], rate) for k, name in enumerate(TRIAD)}


def _on_table(table: SimulatedTable, rate: float, samples: int) -> _Samples:
    """Return what the gyro indicates of the table, which goes straight from rate to rate."""
    times = [time for step in table.steps for time in step.seconds]
    rates = np.repeat([quantity_to_si(step.rate, "angular_rate") for step in table.steps], 2)
    true = np.interp(np.arange(samples) / rate, times, rates)
    earth = 0.0 if table.axis is None else table.axis.pointing.rate
    return _Samples(table.scale_factor * (true + earth), rate)


def _turned(
    recording: SimulatedRecording, turns: SimulatedTurns, rate: float, samples: int
) -> _Samples:
    """Return what the gyro senses that is turned by the clock; each turn is sensed otherwise."""
    dwell, turning = turns.seconds("dwell"), turns.seconds("turning")
    design = Experiment.regular(
        dwell=dwell - turning,
        turning=turning,
        dwells=max(round((samples / rate - turns.seconds("start")) / dwell), 1),
        rate=rate,
        latitude=turns.latitude_si,
        first=turns.first_sense or 1,
    )
    rng = channel_rng(recording.seed, recording.sensor, recording.recording, "turns")
    number = len(design.dwells) - 1
    peaks = rng.choice([-1.0, 1.0], number) * rng.uniform(0.7, 1.3, number)
    peaks = peaks * quantity_to_si(turns.transient, "angular_rate")
    true = true_rate(design, EARTH_RATE, peaks)
    before = np.full(round(turns.seconds("start") * rate), true[0])
    after = np.full(samples, true[-1])
    return _Samples(np.concatenate([before, true, after])[:samples], rate)


def write_recording(settings: str, folder: Path) -> None:
    """Write the recording into ``folder``, which appears when it is complete."""
    sections = json.loads(settings)
    recording = SimulatedRecording.model_validate(sections["recording"])
    with making(folder) as made:
        write_simulated(recording, LogFormat.model_validate(sections["log"]), made)
