"""Reasons for comparisons of recordings: pools, drift, repeatability, ratios, back-tests."""

from collections.abc import Sequence

from imubench_pipeline.model.states import Status
from imubench_pipeline.words.estimates import STATUS_WORDS, symbol_text
from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import counted, number_text

GRAVITY_IN_MEAN = "the mean includes gravity: differences in tilt add to the spread"
WITHOUT_MEAN = "no mean"
CLOSE_AGREEMENT = "the values agree more closely than their limits predict"
VALUE_WITHOUT_LIMITS = "the value has no 95 % limits"
NARROW_LIMITS = "its limits are far narrower than before"
EQUAL_EARLIER = "all earlier values are equal"
TILT_CHANGED = "the mean includes gravity: the sensor may be tilted differently"
SAME_HEADING_ASSUMED = (
    "assumes that the sensor pointed the same way each time, so that the Earth's rate adds no "
    "spread"
)
POWER_CYCLES_ASSUMED = (
    "assumes that the power was off between the recordings. State power_cycled beside each log"
)
NO_MODEL = "one recording has no noise model"
NORTH_NOT_TESTED = "a log at one position cannot separate the bias of a gyro from the Earth's rate"
TURN_ON_NOT_TESTED = "a log shows one turn-on bias, not the spread of turn-on biases"
NOISE_NOT_KNOWN = "the noise of this channel is not known"


def not_comparable(status: Status) -> str:
    if status == "ok":
        return "no 95 % limits"
    return "the recording is in doubt" if status == "does_not_decide" else STATUS_WORDS[status]


def not_pooled(number: int, why: str) -> str:
    return f"{counted(number, 'recording')} not used ({why})"


def contradicting_limits(number: int) -> str:
    have = "has" if number == 1 else "have"
    return f"{counted(number, 'recording')} not used {have} limits outside the predicted range"


def absent_in(number: int, of: int) -> str:
    return f"not in the model of {number} of {of} recordings, so the recordings do not agree"


def recordings_differ(*, of_devices: bool) -> str:
    devices = "the devices differ, or " if of_devices else ""
    return f"the recordings differ: {devices}the sensor is not stationary"


def status_reason(status: Status, reason: str | None) -> str:
    words = STATUS_WORDS[status]
    return f"{words}: {reason}" if reason else words


def first_value(terms: str) -> str:
    """Return why a first value is not tested; ``terms`` of bias instability in its model, or ''."""
    return f"the first value with {terms}" if terms else "the first value"


def few_earlier(number: int) -> str:
    return (
        f"only {counted(number, 'earlier recording')} at this level: the spread between recordings "
        "is not known"
    )


def outlier_before(recording: str) -> str:
    return f"{recording} was an outlier"


def level_changed(number: int, *, above: bool) -> str:
    side = "above" if above else "below"
    earlier = counted(number, "earlier recording")
    return f"{side} the range expected from {earlier}"


def operand_status(place: str, status: Status) -> str:
    """Return why a ratio has no value or is doubtful; ``place``: ``first`` or ``second``."""
    return f"the {place} value is {STATUS_WORDS[status]}"


def tau_beyond(longest: float) -> str:
    return f"the logs are long enough for τ up to {number_text(longest, 3)} s only"


def undetermined(symbol: str, recording: str, channel: str, status: Status) -> str:
    parameter = f"{symbol_text(symbol)} of {channel_name(channel)}"
    return f"in recording {recording}, {parameter} is {STATUS_WORDS[status]}"


def short_for_windows(windows: int, span: float, needed: float, longest: float) -> str:
    """Return why a log is not tested; all times in s, ``longest``: part without a gap."""
    return (
        f"the log is too short: {_windows_text(windows, span, needed)}. "
        f"Its longest part without a gap has {number_text(longest, 3)} s"
    )


def gaps_between_windows(count: int, windows: int, span: float, needed: float) -> str:
    """Return why a log with gaps is not tested; ``count``: overlapping windows; times in s."""
    return (
        f"gaps leave {counted(count, 'overlapping window')}: "
        f"{_windows_text(windows, span, needed)} without a gap"
    )


def _windows_text(windows: int, span: float, needed: float) -> str:
    each = number_text(span)
    return f"{windows} consecutive windows of {each} s need {number_text(needed)} s"


def long_sampling_interval(rate: float) -> str:
    return f"the sampling interval exceeds the times of the errors ({number_text(rate)} Hz)"


def recording_not_used(recording: str, doubts: str) -> str:
    return f"recording {recording} is not used: {doubts}"


def recordings_not_used(reasons: Sequence[tuple[str, str]]) -> str:
    return "; ".join(recording_not_used(*each) for each in reasons)
