"""Simulated recordings, written as the logger of their sensor would write them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import TEMPERATURE
from imubench_pipeline.sensor import ColumnSource, LogFormat
from imubench_pipeline.sensor_model.imu import simulate_imu
from imubench_pipeline.sensor_model.models import imu_model
from imubench_pipeline.sensor_model.profiles import profiles_of
from imubench_pipeline.simulated_recordings import SimulatedRecording
from imubench_pipeline.text_log import TextLog
from imubench_pipeline.units import quantity_to_si
from imubench_pipeline.validation import ConfigError


def write_simulated(recording: SimulatedRecording, log: LogFormat, folder: Path) -> None:
    """Simulate a recording and write it as text in the layout of its sensor's logs.

    Parameters
    ----------
    recording : SimulatedRecording
    log : LogFormat
        Its `layout`: the columns, units and files that the reader expects.
    folder : Path
        Where the files go.

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
    remarks = ("simulated, not measured", f"Update Rate: {recording.rate}")
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
    return simulate_imu(
        model,
        rate,
        recording.samples,
        recording.seed,
        (recording.sensor, recording.recording),
        motion=motion,
        temperature=temperature,
    )
