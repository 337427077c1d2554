"""Doubts about recordings in words, by their codes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from imubench_pipeline.words.findings import FINDINGS
from imubench_pipeline.words.numbers import join_names

_TEXTS: Mapping[str, str] = {
    "simulated_beside_measured": "it is simulated, and other recordings are measured",
    "not_sold": "this sensor is not sold",
    "not_explained": "no model explains the spectrum of {channels}",
    "doubtful": "the decisive parameter is doubtful",
}
"""Doubts that are no findings."""


def doubt_text(code: str, channels: Sequence[str] = ()) -> str:
    """Return a doubt in words: ``the unit of gyro z looks wrong``."""
    where = join_names([channel.replace("_", " ") for channel in channels])
    text = _TEXTS.get(code) or FINDINGS[code].doubt
    return text.format(channels=where or "the data", are="is" if len(channels) == 1 else "are")
