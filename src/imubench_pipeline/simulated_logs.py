"""Simulated recordings, written as the logger of their sensor would write them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.config import SimulatedRecording
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.sensor import ColumnSource, LogFormat
from imubench_pipeline.simulate import channel_rng, simulate_blocks
from imubench_pipeline.text_log import TextLog
from imubench_pipeline.units import quantity_to_si
from imubench_pipeline.validation import ConfigError

_BLOCK = 1 << 18


def write_simulated(recording: SimulatedRecording, log: LogFormat, folder: Path) -> None:
    """Simulate a recording and write it as text in the layout of its sensor's logs.

    Parameters
    ----------
    recording : SimulatedRecording
    log : LogFormat
        The sensor's: the columns, units and files that its reader expects.
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
    samples = round(quantity_to_si(recording.duration, "time") * rate)
    files: dict[str, dict[str, ColumnSource]] = {}
    for channel in recording.channels:
        source = log.channels[channel]
        files.setdefault(source.file or "log.txt", {})[channel] = source
    folder.mkdir(parents=True, exist_ok=True)
    remarks = ("simulated, not measured", f"Update Rate: {recording.rate}")
    with ExitStack() as stack:
        writers = [
            stack.enter_context(TextLog(folder / name, log, sources, rate, remarks, np.float32))
            for name, sources in files.items()
        ]
        for block in _blocks(recording, rate, samples):
            for writer in writers:
                writer.write(block)


def _blocks(
    recording: SimulatedRecording, rate: float, samples: int
) -> Iterator[dict[str, NDArray[np.float64]]]:
    """Yield the channels in SI, block by block."""
    streams = {}
    bias = {}
    for channel, settings in recording.channels.items():
        truth = settings.si(channel)
        bias[channel] = truth.get("bias", 0.0)
        rng = channel_rng(recording.seed, recording.sensor, recording.recording, channel)
        model = NoiseModel(
            N=truth.get("N", 0.0),
            B=truth.get("B", 0.0),
            T_B=truth.get("T_B"),
            K=truth.get("K", 0.0),
        )
        streams[channel] = simulate_blocks(model, rate, samples, rng, _BLOCK)
    for _ in range(0, samples, _BLOCK):
        yield {str(name): next(stream) + bias[name] for name, stream in streams.items()}
