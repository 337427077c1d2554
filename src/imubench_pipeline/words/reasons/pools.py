"""Reasons for comparisons of recordings: pools, drift, repeatability, ratios, back-tests."""

from __future__ import annotations

from collections.abc import Sequence

from imubench_pipeline.model.states import Status
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import counted, number_text


def gravity_in_mean() -> str:
    """Return why the spread of an accelerometer's mean is not that of its bias."""
    return "the mean includes gravity: differences in tilt add to the spread"


def not_comparable(status: Status) -> str:
    """Return why an estimate cannot be compared."""
    if status == "ok":
        return "no 95 % limits"
    return "the recording is in doubt" if status == "does_not_decide" else STATUS_WORDS[status]


def without_mean() -> str:
    """Return why a bias cannot be compared."""
    return "no mean"


def not_pooled(number: int, why: str) -> str:
    """Return how many recordings a pool leaves out."""
    return f"{counted(number, 'recording')} not used ({why})"


def contradicting_limits(number: int) -> str:
    """Return how many recordings without a value have limits that exclude the pool."""
    have = "has" if number == 1 else "have"
    return f"{counted(number, 'recording')} not used {have} limits outside the predicted range"


def absent_in(number: int, of: int) -> str:
    """Return why a pool does not agree where a term is in some models alone."""
    return f"not in the model of {number} of {of} recordings, so the recordings do not agree"


def recordings_differ(*, of_devices: bool) -> str:
    """Return why recordings differ."""
    devices = "the devices differ, or " if of_devices else ""
    return f"the recordings differ: {devices}the sensor is not stationary"


def close_agreement() -> str:
    """Return that the values are closer than their limits."""
    return "the values agree more closely than their limits predict"


def devices_compared(p_value: float, *, differ: bool) -> str:
    """Return whether devices differ more than recordings of one device."""
    than = "more than" if differ else "no more than"
    return f"devices differ {than} repeated recordings (p = {number_text(p_value, 2)})"


def status_reason(status: Status, reason: str | None) -> str:
    """Return the status of an estimate with its reason."""
    words = STATUS_WORDS[status]
    return f"{words}: {reason}" if reason else words


def first_value(terms: str) -> str:
    """Return why a first value is not tested; ``terms``: of bias instability, may be empty."""
    return f"the first value with {terms}" if terms else "the first value"


def value_without_limits() -> str:
    """Return why a value is not tested."""
    return "the value has no 95 % limits"


def few_earlier(number: int) -> str:
    """Return why a value after a few others is not tested."""
    return (
        f"only {counted(number, 'earlier recording')} at this level: the spread between recordings "
        "is not known"
    )


def narrow_limits() -> str:
    """Return why a value is not tested whose limits are narrower than all before it."""
    return "its limits are far narrower than before"


def equal_earlier() -> str:
    """Return why a mean is not tested after equal ones."""
    return "all earlier values are equal"


def outlier_before(recording: str) -> str:
    """Return that an earlier recording was an outlier."""
    return f"{recording} was an outlier"


def level_changed(number: int, *, above: bool) -> str:
    """Return how a value departs from the recordings before it."""
    side = "above" if above else "below"
    earlier = counted(number, "earlier recording")
    return f"{side} the range expected from {earlier}"


def tilt_changed() -> str:
    """Return what a change of an accelerometer's mean may be."""
    return "the mean includes gravity: the sensor may be tilted differently"


def same_heading_assumed() -> str:
    """Return what the spread of a gyro's mean assumes."""
    return (
        "assumes that the sensor pointed the same way each time, so that the Earth's rate adds no "
        "spread"
    )


def power_cycles_assumed() -> str:
    """Return what a spread assumes where it is not stated."""
    return (
        "assumes that the power was off between the recordings. State power_cycled beside each log"
    )


def operand_status(place: str, status: Status) -> str:
    """Return why a ratio has no value or is doubtful; ``place``: ``first`` or ``second``."""
    return f"the {place} value is {STATUS_WORDS[status]}"


def tau_beyond(longest: float) -> str:
    """Return why there is no ratio at a longer tau, s."""
    return f"the logs are long enough for τ up to {number_text(longest, 3)} s only"


def no_model() -> str:
    """Return why there is no ratio of Allan deviations."""
    return "one recording has no noise model"


def undetermined(symbol: str, recording: str, channel: str, status: Status) -> str:
    """Return which parameter of a recording may matter and is not determined."""
    return f"{symbol} of {recording} {channel_name(channel)} is {STATUS_WORDS[status]}"


def short_for_windows(windows: int, span: float, needed: float, longest: float) -> str:
    """Return why a log is not tested; all times in s, ``longest``: part without a gap."""
    return (
        f"the log is too short: {_windows_text(windows, span, needed)}. "
        f"Its longest part without a gap has {number_text(longest, 3)} s"
    )


def gaps_between_windows(count: int, windows: int, span: float, needed: float) -> str:
    """Return why a log with gaps is not tested; ``count``: of overlapping windows, times in s."""
    return (
        f"gaps leave {counted(count, 'overlapping window')}: "
        f"{_windows_text(windows, span, needed)} without a gap"
    )


def _windows_text(windows: int, span: float, needed: float) -> str:
    each = number_text(span)
    return f"{windows} consecutive windows of {each} s need {number_text(needed)} s"


def north_not_tested() -> str:
    """Return why north-finding is not tested."""
    return "a log at one position cannot separate the bias of a gyro from the Earth's rate"


def turn_on_not_tested() -> str:
    """Return why errors by turn-on biases are not tested."""
    return "a log shows one turn-on bias, not the spread of turn-on biases"


def noise_not_known() -> str:
    """Return why a channel is not tested."""
    return "the noise of this channel is not known"


def long_sampling_interval(rate: float) -> str:
    """Return why a log with a rate, Hz, is not tested."""
    return f"the sampling interval exceeds the times of the errors ({number_text(rate)} Hz)"


def recording_not_used(recording: str, doubts: str) -> str:
    """Return that a recording is not used for comparisons, with its doubts."""
    return f"{recording} is not used: {doubts}"


def recordings_not_used(reasons: Sequence[tuple[str, str]]) -> str:
    """Return that recordings are not used, each with its doubts."""
    return "; ".join(recording_not_used(*each) for each in reasons)
