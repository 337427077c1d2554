"""Findings about time stamps, sampling rates, and missing samples."""

import math

from imubench_pipeline.words.findings import base
from imubench_pipeline.words.findings.base import at_text
from imubench_pipeline.words.numbers import counted, join_names, number_text, percent_text

_TIMED = frozenset(base.POWERS_OF_TIME)  # parameters that a wrong sampling rate changes


def _rate_text(rate: float) -> str:
    return f"{number_text(rate, 6)} Hz"


class RateChanges(base.FindingData, affects=base.WHITE, doubt="the sampling rate changes"):
    """A part of a log has only every n-th sample."""

    share: float  # share of the samples in that part
    start: float
    end: float
    lower_rate: float
    rate: float  # rate at which all are analysed, Hz

    def text(self, channel: str) -> str:
        of = f" of {base.channel_name(channel)}" if channel else ""
        low = 1.0 - math.sqrt(self.lower_rate / self.rate)
        return (
            f"The sampling rate{of} changes. {percent_text(self.share, 2)} of the samples, from "
            f"{at_text(self.start)} to {at_text(self.end)}, have {_rate_text(self.lower_rate)} "
            f"instead of {_rate_text(self.rate)}. They are analysed at {_rate_text(self.rate)} "
            "with missing samples. If the sensor was set to the lower rate, their N is "
            f"{percent_text(low, 2)} too low. Analyse the parts separately: 'use:' in the notes"
        )


class CoarseStamps(base.FindingData, affects=_TIMED, doubt="the sampling rate is ambiguous"):
    """Time stamps with steps of zero or of two intervals at regular distances."""

    rate: float
    other_rate: float  # rate if the stamps are not rounded, Hz

    def text(self, channel: str) -> str:
        change = math.sqrt(self.rate / self.other_rate) - 1.0  # N is as the rate^(-1/2)
        size = f"{percent_text(abs(change), 2)} {'higher' if change > 0.0 else 'lower'}"
        what, cause = "repeat", "records are written twice"
        if self.other_rate > self.rate:
            what, cause = "have double steps", "samples are lost"
        return (
            f"The time stamps {what} at regular distances: taken as rounded, at "
            f"{_rate_text(self.rate)}. If {cause} so regularly instead, the rate is "
            f"{_rate_text(self.other_rate)}, and N is {size}. State 'rate' in the sensor file"
        )


class MissingSamples(base.FindingData, affects=base.ALL, doubt="samples are missing"):
    """Points of the grid without a sample."""

    missing: int
    expected: int
    gaps: int
    longest: float  # duration of the longest gap, s
    start: float  # its start, s
    rate_of_bursts: float | None = None
    """Rate if no sample is missing, Hz; None unless most samples are missing."""
    noise_ratio: float | None = None  # N at that rate divided by N

    def text(self, channel: str) -> str:
        longest = f"{number_text(self.longest, 3)} s, from {at_text(self.start)} on"
        gaps = (
            f"1 gap of {longest}" if self.gaps == 1 else f"{self.gaps} gaps, the longest {longest}"
        )
        text = (
            f"{self.missing} of {counted(self.expected, 'sample')} "
            f"{'is' if self.missing == 1 else 'are'} missing ({gaps}). The Allan variance uses "
            "the others"
        )
        if self.rate_of_bursts is not None:
            text += (
                ". If the samples came in bursts and none is missing, the rate is "
                f"{number_text(self.rate_of_bursts, 4)} Hz, and N is "
                f"{number_text(self.noise_ratio, 2)} times as large. State 'rate' in the sensor "
                "file"
            )
        return text


class Segments(
    base.FindingData, affects=base.SLOW | {"bias"}, doubt="the recording was interrupted"
):
    """Pauses of the recording, or jumps of its clock."""

    has_grid: bool  # the stamps lie on a uniform grid
    pauses: int
    longest: float  # largest step of the stamps, s; below 0: backwards
    at: float  # duration of the samples before it, s

    def text(self, channel: str) -> str:
        what = "The clock jumps or stops" if self.has_grid else "The stamps stop or run backwards"
        direction = "backwards" if self.longest < 0.0 else "forward"
        step = f"{at_text(abs(self.longest))} {direction}, after {at_text(self.at)} of samples"
        often = "once, by" if self.pauses == 1 else f"{self.pauses} times, by up to"
        return f"{what} {often} {step}. The recording is analysed as {self.pauses + 1} segments"


class RepeatedStamps(base.FindingData, affects=base.NONE):
    """Records with the stamp of an earlier one, which are left out."""

    records: int

    def text(self, channel: str) -> str:
        one = self.records == 1
        records = "record repeats a stamp or goes" if one else "records repeat a stamp or go"
        return (
            f"{self.records} {records} back to an earlier one; left out. "
            f"{'It was' if one else 'They were'} written twice, or the clock was set back"
        )


class MissingStamps(base.FindingData, affects=_TIMED, doubt="time stamps are missing"):
    """Records without a stamp, which are taken as consecutive."""

    records: int

    def text(self, channel: str) -> str:
        return (
            f"{counted(self.records, 'record has', 'records have')} no time stamp, or one far from "
            "its neighbours; taken as consecutive"
        )


class RateContradictsStamps(
    base.FindingData, affects=_TIMED, doubt="the stated rate contradicts the time stamps"
):
    """The stated rate contradicts the stamps, whose rate is used."""

    stated: float
    rate: float

    def text(self, channel: str) -> str:
        return (
            f"The sensor file or the log states {_rate_text(self.stated)}, but the time stamps "
            f"have {_rate_text(self.rate)}, which is used. Correct 'rate', or remove it"
        )


class RateDrifts(base.FindingData, affects=_TIMED, doubt="the clock drifts"):
    """The sampling interval differs between the halves of a log."""

    drift: float  # relative change of the interval

    def text(self, channel: str) -> str:
        return (
            f"The sampling interval is {number_text(1e6 * abs(self.drift), 3)} ppm "
            f"{'longer' if self.drift > 0.0 else 'shorter'} in the second half of the recording: "
            "the clock of the sensor or of the host drifts. One rate is used"
        )


class JitteredStamps(base.FindingData, affects=_TIMED, doubt="the time stamps are irregular"):
    """Time stamps that lie on no uniform grid, so that lost samples cannot be detected."""

    share: float  # share of the stamps off the grid
    pauses: int
    longest: float  # longest interval, s
    at: float  # its position, s
    rate: float

    def text(self, channel: str) -> str:
        return (
            f"The time stamps lie on no uniform grid: {percent_text(self.share, 2)} are off it, "
            f"with {counted(self.pauses, 'pause')}, and intervals up to "
            f"{number_text(1e3 * self.longest, 3)} ms (at {at_text(self.at)}). The samples are "
            f"taken as consecutive at the mean rate, {_rate_text(self.rate)}. Lost samples cannot "
            "be detected"
        )


class IrregularStamps(
    base.FindingData,
    affects=_TIMED,
    doubt="some time stamps have more or fewer samples than others",
):
    """Time stamps shared by more or fewer samples than others."""

    stamps: int
    rate: float

    def text(self, channel: str) -> str:
        return (
            f"{counted(self.stamps, 'stamp has', 'stamps have')} more or fewer samples than the "
            "others: the clock was set, or samples are lost. The rate, "
            f"{_rate_text(self.rate)}, is taken from the others"
        )


class OwnRate(base.FindingData, affects=base.NONE):
    """Channels with fewer numbers than the log has records."""

    channels: tuple[str, ...]
    rows: int
    records: int
    rate: float

    def text(self, channel: str) -> str:
        one = len(self.channels) == 1
        return (
            f"{join_names([base.channel_name(name) for name in self.channels])} "
            f"{'has' if one else 'have'} numbers in {self.rows} of {self.records} records, and a "
            f"clock of {'its' if one else 'their'} own. {'It is' if one else 'They are'} analysed "
            f"at {_rate_text(self.rate)}"
        )
