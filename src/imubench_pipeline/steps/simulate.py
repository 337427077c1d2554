"""Write simulated recordings in the log format of their sensor."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.text_log import TextLog
from imubench_pipeline.registry import Hook
from imubench_pipeline.settings.experiments import stated_experiments
from imubench_pipeline.settings.sensor import TEMPERATURE, ColumnSource, LogFormat
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.imu import simulate_imu
from imubench_pipeline.simulate.models import SIMULATIONS, make_imu_model
from imubench_pipeline.simulate.profiles import Profile, profiles_of
from imubench_pipeline.tables.files import make_folder
from imubench_pipeline.units import parse_quantity

Motion = Callable[[SimulatedRecording, float], Mapping[str, Profile]]
"""Takes a recording and its rate, Hz; returns the ideal signal of each channel as it moves."""

_MOTIONS: Hook[Motion] = Hook("motions")


def write_simulated(recording: SimulatedRecording, log: LogFormat, folder: Path) -> None:
    """Simulate a recording and write it as text in the `layout` of the sensor's logs.

    A ConfigError is raised if the logs of the sensor are not text.
    """
    if log.reader not in (None, "csv"):
        raise ConfigError(
            f"{recording.sensor}: the sensor file has reader {log.reader!r}, but simulated logs "
            "are text; expected reader: csv"
        )
    rate = parse_quantity(recording.rate, "frequency")
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
    """Return the blocks of the channels, and of the temperature if there is one, in SI."""
    try:
        model = make_imu_model(recording.channels, recording)
    except ValueError as error:
        name = f"{recording.sensor}/{recording.recording}"
        raise ConfigError(f"{name}: channels.{error}") from error
    motion, temperature = profiles_of(recording, Path())
    motion = dict(motion)
    for key in stated_experiments(recording):
        motion |= _MOTIONS.by_key()[key](recording, rate)
    for key in recording.simulated_sensors:
        return SIMULATIONS.by_key()[key].blocks(recording, motion, temperature)
    return simulate_imu(
        model,
        rate,
        recording.samples,
        recording.seed,
        (recording.sensor, recording.recording),
        motion=motion,
        temperature=temperature,
    )


def write_recording(settings: str, folder: Path) -> None:
    """Simulate a recording into ``folder``, which appears when complete; ``settings``: JSON."""
    sections = json.loads(settings)
    recording = SimulatedRecording.model_validate(sections["recording"])
    with make_folder(folder) as made:
        write_simulated(recording, LogFormat.model_validate(sections["log"]), made)
