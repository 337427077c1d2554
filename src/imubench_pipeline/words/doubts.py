"""Doubts about recordings in words, by their codes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

_TEXTS: Mapping[str, str] = {
    "suspicious_unit": "the unit of {channels} looks wrong",
    "unit_contradicts": "the unit of {channels} contradicts the file",
    "rate_implausible": "the sampling rate looks wrong",
    "motion": "the sensor was moved",
    "turning": "{channels} was turning",
    "stuck": "{channels} did not change",
    "channel_twice": "{channels} is a copy of another channel",
    "log_twice": "the log is a copy of another one",
    "recording_twice": "the recording is a copy of another one",
    "joined": "two logs are joined",
    "interleaved": "samples of two sensors are interleaved",
    "simulated_beside_measured": "simulated, and other recordings are measured",
    "not_sold": "this sensor is not sold",
    "not_explained": "no model explains the spectrum of {channels}",
    "doubtful": "the decisive parameter is doubtful",
}


def doubt_text(code: str, channels: Sequence[str] = ()) -> str:
    """Return a doubt in words: ``the unit of gyro z looks wrong``."""
    where = " and ".join(
        filter(None, (", ".join(_name(each) for each in channels[:-1]), *map(_name, channels[-1:])))
    )
    if text := _TEXTS.get(code):
        return text.format(channels=where or "the data")
    return code.replace("_", " ") + (f" ({where})" if where else "")


def _name(channel: str) -> str:
    return channel.replace("_", " ")
