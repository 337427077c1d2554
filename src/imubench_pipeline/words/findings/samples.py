"""Findings about samples: values, quantisation, repeats, changes, joined logs, copies."""

from math import ceil
from typing import Literal

from imubench_pipeline.settings.sensor import TEMPERATURE
from imubench_pipeline.words.findings.base import (
    ALL,
    NONE,
    SLOW,
    WHITE,
    FindingData,
    at_text,
    channel_name,
    value_text,
)
from imubench_pipeline.words.numbers import counted, join_names, number_text, percent_text

Change = Literal["level", "noise", "steps"]
"""A property of the samples that changes where another sensor begins."""

_CHANGES: dict[str, str] = {"level": "level", "noise": "noise", "steps": "resolution"}
_ROUNDED = ". The values were rounded again afterwards"


class Quantised(FindingData, affects=NONE):
    """The values are multiples of a visible step."""

    step: float
    step_over_noise: float | None = None  # None: the noise is unknown, as most samples are equal
    lowest: float | None = None
    highest: float | None = None
    is_rounded: bool = False
    """The values were rounded again, so their differences are no multiples of the step."""

    def text(self, channel: str) -> str:
        if channel == TEMPERATURE:
            return (
                f"The temperature has steps of {number_text(self.step, 3)} °C, from "
                f"{number_text(self.lowest)} to {number_text(self.highest)} °C"
            )
        text = f"{channel_name(channel)} is quantised in steps of {value_text(self.step, channel)}"
        if self.step_over_noise is not None:
            text += f", {number_text(self.step_over_noise, 2)} times its noise"
        return text + (_ROUNDED if self.is_rounded else "")


class Truncated(FindingData, affects=WHITE, doubt="truncated samples of {channels}"):
    """The values were truncated towards 0 when they were converted to integers."""

    step: float

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} was truncated towards 0 in steps of "
            f"{value_text(self.step, channel)}. The level 0 is twice as frequent as it should be, "
            "and the noise is too small. Round to integers instead, and record again"
        )


class Coarse(FindingData, affects=ALL, doubt="coarse resolution of {channels}"):
    """The noise is mostly rounding noise."""

    levels: float
    step: float
    step_over_noise: float | None  # None: the noise is unknown, as most samples are equal
    is_rounded: bool

    def text(self, channel: str) -> str:
        size = "and most samples are equal"
        if self.step_over_noise is not None:
            size = f"{number_text(self.step_over_noise, 2)} times its noise"
        return (
            f"{channel_name(channel)} has {counted(round(self.levels), 'level')}, "
            f"{value_text(self.step, channel)} apart, {size}. N contains the rounding noise. "
            "Record more digits, or use a finer range" + _ROUNDED * self.is_rounded
        )


class Interpolated(FindingData, affects=NONE):
    """Samples that lie on straight lines between neighbours, and are left out."""

    samples: int
    share: float

    def text(self, channel: str) -> str:
        return (
            f"{counted(self.samples, 'sample')} of {channel_name(channel)} "
            f"({percent_text(self.share, 2)}) {'lies' if self.samples == 1 else 'lie'} on straight "
            "lines, as lost samples do that were interpolated. They are treated as missing. Record "
            "losses as gaps"
        )


class RepeatedSamples(FindingData, affects=WHITE, doubt="repeated samples in {channels}"):
    """Samples repeat their predecessor more often than rounding explains."""

    share: float
    share_by_chance: float

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} repeats its previous sample in {percent_text(self.share, 2)} "
            f"of the records; rounding explains {percent_text(self.share_by_chance, 2)}. The "
            "logger reads faster than the sensor samples. State the rate of the sensor, and record "
            "each sample once"
        )


class HeldSamples(FindingData, affects=WHITE, doubt="repeated samples in {channels}"):
    """Every n-th sample repeats its predecessor."""

    period: int
    share_by_chance: float

    def text(self, channel: str) -> str:
        return (
            f"One sample in {self.period} of {channel_name(channel)} repeats its predecessor, at "
            f"regular intervals; of the others, {percent_text(self.share_by_chance, 2)} do by "
            "chance. The logger reads faster than the sensor samples, or fills in lost samples. "
            "Record each sample once"
        )


class NoSamples(FindingData, affects=ALL, doubt="no samples in {channels}"):
    """A channel that has no number at all."""

    def text(self, channel: str) -> str:
        return f"{channel_name(channel)} contains no number"


class TooShort(FindingData, affects=ALL, doubt="too few samples in {channels}"):
    """Too few samples, or too few adjacent ones for an Allan variance."""

    samples: int  # samples; of an Allan variance, points of the grid
    required: int | None = None  # smallest number of samples
    rate: float | None = None  # rate of the grid, Hz, if no Allan variance can be estimated

    def text(self, channel: str) -> str:
        name = channel_name(channel)
        if self.rate is None:
            return (
                f"{name} has {counted(self.samples, 'sample')}; at least {self.required} are "
                "required (quality.shortest). Record for longer"
            )
        return (
            f"{name} has too many missing samples for an Allan variance: no two adjacent clusters "
            f"are full. The grid has {counted(self.samples, 'point')} at "
            f"{number_text(self.rate, 6)} Hz. Record without losses, or for longer"
        )


class Stuck(FindingData, affects=ALL, unfit=True, doubt="{channels} did not change"):
    """A channel that never changes."""

    value: float
    samples: int

    def text(self, channel: str) -> str:
        stays = f"stays at {value_text(self.value, channel)}" if self.value else "is exactly 0"
        return (
            f"{channel_name(channel)} never changes: it {stays} in all {self.samples} samples. The "
            "axis is dead or was not read, or the column is the wrong one"
        )


class EmptyCells(FindingData, affects=ALL, doubt="missing samples in {channels}"):
    """Records in which the channel has no number."""

    cells: int
    longest: int  # records of the longest run
    duration: float  # its duration, s
    start: float  # its start, s

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} has {counted(self.cells, 'record')} without a number, "
            f"treated as missing samples. {_longest_run(self.longest, self.duration, self.start)}"
        )


class NotFinite(FindingData, affects=ALL, doubt="values of {channels} that are not finite"):
    """Infinities, or values that are too large for a measurement."""

    cells: int
    limit: float
    longest: int  # records of the longest run
    duration: float  # its duration, s
    start: float  # its start, s

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} has {counted(self.cells, 'value')} that are infinite or "
            f"above {number_text(self.limit)}, treated as missing samples. "
            f"{_longest_run(self.longest, self.duration, self.start)}"
        )


def _longest_run(records: int, duration: float, start: float) -> str:
    """Return a sentence about the longest run of records without a finite number."""
    return (
        f"The longest run has {counted(records, 'record')} ({number_text(duration, 3)} s), from "
        f"{at_text(start)}"
    )


class StuckForAWhile(FindingData, affects=ALL, doubt="{channels} did not change for some time"):
    """A channel that stays at one value for longer than by chance."""

    duration: float
    samples: int

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} stays at one value for {number_text(self.duration)} s "
            f"({self.samples} samples)"
        )


class Saturated(FindingData, affects=ALL, doubt="saturated samples in {channels}"):
    """Samples at an end of the range."""

    samples: int
    value: float
    side: str  # ``lowest`` or ``highest``

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} has {self.samples} samples at its {self.side} value, "
            f"{value_text(self.value, channel)}: it is saturated. Use a wider range"
        )


class PiledUp(FindingData, affects=ALL, doubt="one value is too frequent in {channels}"):
    """One value is far more frequent than its neighbours."""

    share: float
    value: float

    def text(self, channel: str) -> str:
        return (
            f"{percent_text(self.share, 2)} of the samples of {channel_name(channel)} are exactly "
            f"{value_text(self.value, channel)}, many times more than at neighbouring values. "
            "Lost samples were filled in, or the sensor has a dead band. Leave the cells of lost "
            "samples empty"
        )


class Motion(FindingData, affects=ALL, unfit=True, doubt="the sensor was moved"):
    """The sensor was moved."""

    start: float
    end: float

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} shows motion from {at_text(self.start)} to "
            f"{at_text(self.end)}. Leave it out: 'use:' in the notes beside the log, --at-rest, or "
            "quality.at_rest in the settings"
        )


class Step(FindingData, affects=SLOW | {"bias"}, doubt="a step in {channels}"):
    """A sudden change of the mean."""

    size: float
    at: float
    sigmas: float  # size divided by the standard deviation of all changes of the mean

    def text(self, channel: str) -> str:
        return (
            f"The mean of {channel_name(channel)} changes by {value_text(self.size, channel)} at "
            f"{at_text(self.at)}, {number_text(self.sigmas, 3)} times its usual change. The sensor "
            "was moved, or its range or temperature jumped"
        )


class WarmUp(FindingData, affects=SLOW | {"bias"}, doubt="warm-up drift of {channels}"):
    """The channel drifts at the beginning of the log."""

    drift: float
    end: float
    ratio: float | None  # drift divided by the usual drift later in the log; None: no drift later

    def text(self, channel: str) -> str:
        later = "; later it does not drift"
        if self.ratio is not None:
            later = f", {number_text(self.ratio, 2)} times as much as later"
        return (
            f"{channel_name(channel)} drifts by {value_text(self.drift, channel)} in its first "
            f"{at_text(self.end)}{later}. Leave this out with 'use: {{start: {ceil(self.end)}}}' "
            "in the notes beside the log, or with quality.trim_warm_up"
        )


class NotStationary(FindingData, affects=ALL, doubt="the noise of {channels} changes"):
    """The noise is larger in one part of the log than elsewhere."""

    ratio: float
    start: float
    end: float

    def text(self, channel: str) -> str:
        return (
            f"The noise of {channel_name(channel)} is not stationary: from {at_text(self.start)} "
            f"to {at_text(self.end)} it is {number_text(self.ratio, 3)} times as large as in the "
            "calmest part"
        )


class Joined(FindingData, affects=ALL, unfit=True, doubt="two logs are joined"):
    """The data of another sensor, or of another range, begin within the log."""

    changes: tuple[Change, ...]
    at: float
    noise_ratio: float  # noise after the change divided by the noise before

    def text(self, channel: str) -> str:
        changed = join_names([_CHANGES[change] for change in self.changes])
        return (
            f"The {changed} of {channel_name(channel)} change at once at {at_text(self.at)}. The "
            f"noise is {number_text(self.noise_ratio, 3)} times as large after that. Two sensors, "
            "or two ranges of one, are joined in this log. Use one part: 'use:' in the notes "
            "beside the log"
        )


class Interleaved(
    FindingData, affects=ALL, unfit=True, doubt="samples of two sensors are interleaved"
):
    """Every other sample is from another sensor."""

    changes: tuple[Change, ...]
    level: float  # difference of the levels divided by the standard deviation of the noise
    noise_ratio: float

    def text(self, channel: str) -> str:
        changed = join_names([_CHANGES[change] for change in self.changes])
        verb = "alternates" if len(self.changes) == 1 else "alternate"
        return (
            f"The {changed} of {channel_name(channel)} {verb} from sample to sample. The levels "
            f"are {number_text(self.level, 3)} standard deviations apart, and the noise differs by "
            f"a factor of {number_text(self.noise_ratio, 3)}. Every other sample seems to be from "
            "another sensor. Write each sensor to its own log"
        )


class ChannelTwice(
    FindingData, affects=ALL, unfit=True, doubt="{channels} {are} a copy of another channel"
):
    """A channel has the samples of another one."""

    original: str
    factor: float  # samples of this channel divided by samples of the other one, SI

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
            "independent. Look for vibration, and check the columns"
        )
