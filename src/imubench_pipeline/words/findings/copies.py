"""Findings about copied samples, copied recordings, and noise that axes share."""

from __future__ import annotations

from imubench_pipeline.words.findings.base import ALL, FindingData, channel_name
from imubench_pipeline.words.numbers import join_names, number_text, percent_text


class ChannelTwice(
    FindingData, affects=ALL, unfit=True, doubt="{channels} {are} a copy of another channel"
):
    """A channel has the samples of another one."""

    original: str
    factor: float  # factor from the other channel, SI

    def text(self, channel: str) -> str:
        scaled = ""
        if abs(self.factor - 1.0) >= 1e-6:
            scaled = f", multiplied by {number_text(self.factor, 6)} in SI units"
        return (
            f"{channel_name(channel)} has the samples of {channel_name(self.original)}{scaled}: "
            "one column is used for both. Give each channel its own column in the sensor file"
        )


def _describe_repeat(channel: str, start: float, end: float, original: float, number: int) -> str:
    """Return sentences about repeated parts of a log, s; ``number``: of them."""
    repeats = f"{channel_name(channel) if channel else 'The log'} repeats itself bit for bit"
    span = f"{number_text(start, 5)} s to {number_text(end, 5)} s"
    where = f"is a copy of the data from {number_text(original, 5)} s on"
    if number > 1:
        return f"{repeats}, {number} times. The longest part, {span}, {where}"
    return f"{repeats}: {span} {where}"


class LogTwice(FindingData, affects=ALL, unfit=True, doubt="the log repeats itself"):
    """A large part of a log is a copy of an earlier part."""

    start: float
    end: float
    original: float  # start of the copied part, s
    repeats: int
    share: float  # share of copies in the log

    def text(self, channel: str) -> str:
        return (
            f"{_describe_repeat(channel, self.start, self.end, self.original, self.repeats)}. "
            f"{percent_text(self.share, 2)} of the log are copies, as if it had been appended to "
            "itself. Use the part before them: 'use:' in the notes beside the log"
        )


class RepeatedStretch(FindingData, affects=ALL, doubt="a part of {channels} is a copy"):
    """A small part of a log is a copy of an earlier part."""

    start: float
    end: float
    original: float  # start of the copied part, s
    repeats: int

    def text(self, channel: str) -> str:
        return (
            f"{_describe_repeat(channel, self.start, self.end, self.original, self.repeats)}. Find "
            "out why it was written twice (a buffer, a paste), or use a part without it"
        )


class RecordingTwice(
    FindingData, affects=ALL, unfit=True, doubt="the recording is a copy of another one"
):
    """A recording has the samples of another one."""

    recording: str
    original: str
    channels: tuple[str, ...]

    def text(self, channel: str) -> str:
        names = join_names([channel_name(name) for name in self.channels])
        return (
            f"{self.recording} has the samples of {self.original} ({names}). One log lies in the "
            "folder of the sensor twice, and would count as two. Remove one of them"
        )


class SharedNoise(FindingData, affects=ALL, doubt="correlated noise of {channels}"):
    """The noise of two axes is correlated."""

    other: str
    correlation: float

    def text(self, channel: str) -> str:
        return (
            f"The noise of {channel_name(channel)} and {channel_name(self.other)} is correlated "
            f"({number_text(self.correlation, 2)}). It comes from a vibration, from the supply, or "
            "from a column that was computed from several axes. Fusion and pooling treat axes as "
            "independent"
        )
