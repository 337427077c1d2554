"""Findings on the noise model: lines, fitted band, missing noise, other methods, back-tests."""

from imubench_pipeline.words.findings.base import NONE, SLOW, FindingData, channel_name, value_text
from imubench_pipeline.words.numbers import counted, join_names, number_text, percent_text


class MethodsDiffer(FindingData, affects=NONE):
    """Robust fit and likelihood give a parameter with intervals that exclude each other."""

    parameter: str
    ratio: float  # value of the likelihood divided by the value of the robust fit

    def text(self, channel: str) -> str:
        return (
            f"{self.parameter} of {channel_name(channel)} by the likelihood is "
            f"{number_text(self.ratio, 3)} times the value by the robust fit, and their intervals "
            "do not overlap. The sensor changes during the log, or no sum of a few noise terms "
            "describes it. The value of the robust fit follows the Allan deviation: use it"
        )


class Lines(FindingData, affects=NONE):
    """Spectral lines that the noise fit excludes."""

    sinusoids: int
    bands: int  # number of narrow bands of noise
    frequency: float  # frequency of the strongest, Hz
    ratio: float  # density of the strongest divided by the noise floor

    def text(self, channel: str) -> str:
        kinds = [
            counted(number, noun)
            for number, noun in ((self.sinusoids, "spectral line"), (self.bands, "noise band"))
            if number
        ]
        one = self.sinusoids + self.bands == 1
        where = f"at {number_text(self.frequency, 5)} Hz"
        strength = f"{number_text(self.ratio, 3)} times the noise floor"
        return (
            f"{channel_name(channel)} has {' and '.join(kinds)}"
            + (f" {where}, {strength}. It is" if one else f". The strongest is {where}, {strength}")
            + (" " if one else ". They are ")
            + "excluded from the noise fit. If the vibration is strong, record without it"
        )


class StrongLine(
    FindingData,
    affects=frozenset({"S"}),
    doubt="a vibration of {channels} adds much to the white-noise error",
):
    """A sinusoid whose integral is comparable to the integral of white noise."""

    frequency: float  # Hz
    ratio: float  # ratio of its integral to the integral of white noise, after 1 s

    def text(self, channel: str) -> str:
        return (
            f"A sinusoid of {channel_name(channel)} at {number_text(self.frequency, 5)} Hz adds "
            f"{number_text(self.ratio, 3)} times the white-noise error over 1 s. "
            "The error budgets include it. "
            "If the ground vibrates, and not the sensor, record elsewhere, or on softer ground"
        )


class TooManyLines(
    FindingData, affects=frozenset({"S"}), doubt="too many spectral lines in {channels}"
):
    """More sinusoids than a noise model can have."""

    lines: int
    single: int  # number of lines that are used individually
    share: float  # power of the other lines divided by the power of all lines
    rms: float  # root mean square of the other lines, SI

    def text(self, channel: str) -> str:
        return (
            f"{channel_name(channel)} has {self.lines} sinusoids, too many for a noise model. "
            f"Error budgets, simulations and filters use the {self.single} strongest individually. "
            f"The other {self.lines - self.single} are merged into one of the same power, "
            f"{percent_text(self.share)} of the power of all lines "
            f"({value_text(self.rms, channel)} rms). "
            "Look for motors, fans or converters nearby, or record without them"
        )


class Filtered(FindingData, affects=NONE):
    """The noise is filtered above a frequency."""

    cutoff: float  # Hz

    def text(self, channel: str) -> str:
        return (
            f"The noise of {channel_name(channel)} is filtered above {number_text(self.cutoff, 3)} "
            "Hz, as by a low-pass of the sensor. The Allan deviation bends at short τ. N is the "
            "value before the filter"
        )


class BandLimit(FindingData, affects=NONE):
    """The fit uses only frequencies below a limit."""

    highest: float  # Hz

    def text(self, channel: str) -> str:
        name, limit = channel_name(channel), f"{number_text(self.highest)} Hz"
        return (
            f"The spectrum of {name} bends above {limit}, as by the filter of the sensor. The fit "
            "is limited to lower frequencies. Look at the spectrum for vibration, and state the "
            "bandwidth in the sensor file"
        )


class SlowNoiseMissing(
    FindingData, affects=SLOW, doubt="slow noise of {channels} was removed before logging"
):
    """Less power than white noise at the lowest frequencies."""

    highest: float  # frequency up to which power is missing, Hz
    ratio: float  # ratio of the density up to there to the white noise

    def text(self, channel: str) -> str:
        return (
            f"Up to {number_text(self.highest, 3)} Hz the spectrum of {channel_name(channel)} has "
            f"{number_text(self.ratio, 2)} times the density of its white noise. Slow noise only "
            "adds to it, so it was removed before the log was written. K, B and the errors of dead "
            "reckoning are too small. Switch off automatic zeroing, high-pass filters and the "
            "subtraction of means or curves, and record again"
        )


class BacktestContradicts(
    FindingData, affects=SLOW, doubt="more drift of {channels} than its noise model predicts"
):
    """In windows of the log, errors of dead reckoning are larger than predicted."""

    error: str  # ``attitude``, ``heading``, ``velocity`` or ``position``
    time: float  # of dead reckoning, s
    window: float | None  # time at rest before, from which the bias is estimated, s
    ratio: float  # measured error divided by predicted error
    ratio_lower: float | None
    ratio_upper: float | None  # limits of the ratio in 95 % of logs, if the model is right
    windows: int | None
    independent: float | None  # equivalent number of independent windows
    removed: tuple[str, ...]
    """Kinds of the deterministic signals that are in the log and not in the noise."""

    def text(self, channel: str) -> str:
        rest = "" if self.window is None else f" (bias from {number_text(self.window)} s at rest)"
        removed = join_names([name.replace("_", " ") for name in self.removed])
        why = (
            f"the log contains {removed}, which is removed from the noise"
            if removed
            else "its slow noise misses an effect, such as drift with temperature"
        )
        return (
            f"{channel_name(channel)} drifts {number_text(self.ratio, 3)} times as much as "
            f"predicted: {self.error} after {number_text(self.time)} s{rest}. In 95 % of logs a "
            f"correct model gives {number_text(self.ratio_lower, 3)} to "
            f"{number_text(self.ratio_upper, 3)} times. The log has "
            f"{counted(self.windows or 0, 'window')}, equivalent to "
            f"{number_text(self.independent, 3)} independent ones. Error budgets of this channel "
            f"are too small: {why}. Multiply them by this ratio until the cause is found"
        )
