"""Cautions and notes in the head of exported files. Numbers are as in programs: ``1.2e-06``."""

from collections.abc import Mapping, Sequence
from typing import Literal

from imubench_pipeline.model.states import Status
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.findings.base import channel_name, value_text
from imubench_pipeline.words.numbers import counted, join_names, number_text

OtherAxes = Literal["other_device", "no_white_noise", "not_median", "less_noise"]
"""Why an axis is not the one that represents a sensor."""

_OTHER_AXES: Mapping[OtherAxes, str] = {
    "other_device": "of another device",
    "no_white_noise": "no white noise in the model",
    "not_median": "not the median at {horizon} s",
    "less_noise": "less noise at {horizon} s",
}


NO_MORE_THAN_AT_REST = (
    "CAUTION: the log in use has no more noise than the log at rest: were the motors on?"
)
NO_TEMPERATURE_FIT = "no fit of the temperature"
BIAS_NOT_LINEAR = "its bias is not linear in temperature, and the program supports a slope only"


MODE_WORDS: Mapping[Literal["bench", "bounded"], str] = {
    "bench": "BENCH: the noise at rest. On a vehicle it is larger",
    "bounded": "BOUNDED: at least the noise at rest; see the range below",
}
"""The modes of a file that need no further data."""


def value_kind(model: str, written: str, limited: bool) -> str:
    """Return how the slow terms of a file were found; ``model``: fitted terms, as in ``N+GM+K``."""
    if limited:
        source = "" if "K" in written.split("+") else "from the "
        return f"{source}upper limit of K: the log does not show it"
    terms = [term for term in dict.fromkeys(model.split("+")) if term not in ("Q", "S")]
    if set(terms) == set(written.split("+")):
        return ""
    return f"the slow terms of {'+'.join(terms)} together"


def limit_of_walk(K: float, horizon: float) -> str:
    """Return a note that K, SI, is an upper limit from the Allan variance at the horizon, s."""
    return (
        f"no slow term is determined: K = {K:.3e} is the upper 95 % limit by the Allan variance at "
        f"{number_text(horizon)} s. A longer log gives a lower one"
    )


def channel_in_use(
    channel: str, N: float, motion: float, lines: Sequence[tuple[float, float]]
) -> str:
    """Return the noise of a channel in use, SI; ``lines``: frequency, Hz, and rms."""
    at = [f"{number_text(f, 3)} Hz ({value_text(rms, channel)} rms)" for f, rms in lines]
    return (
        f"{channel_name(channel)} N = {value_text(N, channel, 'density')}"
        + (f", lines at {join_names(at)}" if at else "")
        + f", motion of {value_text(motion, channel)} rms removed"
    )


def noise_in_use(cutoff: float, channels: Sequence[str]) -> str:
    """Return a note on noise from a log in use above ``cutoff``, Hz; ``channels``: a text each."""
    at = number_text(cutoff)
    return (
        f"IN USE: at least the broadband noise above {at} Hz of a log in use. Below {at} Hz all is "
        "taken as motion, and a spectral line is not white noise: both are left out. Values: "
        + "; ".join(channels)
    )


def floor_in_use(source: str) -> str:
    """Return a note that there is no log in use, and figures of ``source`` are used."""
    return f"IN USE, NOT MEASURED: at least {source}. Measure it with --in-use LOG"


def raised(before: float, N: float, K: float) -> str:
    """Return a note on N before and after the mode raised it, and on K (0: none), SI."""
    walk = f", K at least {K:.4e}" if K else ""
    return f"N is {N:.4e} in use, and {before:.4e} at rest{walk}"


def pooled(channel: str, recordings: Sequence[str]) -> str:
    """Return a note that a channel is the mean of several recordings of one device."""
    number = counted(len(recordings), "recording")
    return (
        f"mean of the spectra of {channel_name(channel)} in {number} of the device: "
        f"{', '.join(recordings)}"
    )


def chosen_axis(
    channel: str, recording: str, method: str, rank: str, horizon: float, error: float, unit: str
) -> str:
    """Return a note on the axis that represents a sensor, with its error after the horizon, s."""
    times = number_text(horizon)
    return (
        f"{channel_name(channel)} of recording {recording} by method {method}, {rank} at "
        f"{times} s. Its error after {times} s is {number_text(error, 3)} {unit}, with a bias "
        f"averaged over the {times} s before"
    )


def axis_rank(number: int, place: str, of: str = "", noun: str = "axis") -> str:
    """Return the rank of the chosen axis; ``place``: worst or median; ``of``: its device.

    ``noun`` is ``axis``, or ``estimate`` if the estimates of one axis are compared.
    """
    plural = "axes" if noun == "axis" else f"{noun}s"
    rank = f"the only {noun}" if number == 1 else f"the {place} of {number} {plural}"
    return f"{rank} of {of}" if of else rank


def axes_not_used(
    why: OtherAxes, horizon: float, of: Mapping[str, Sequence[str]], most: int
) -> str:
    """Return a note on unused axes; ``of``: channels by recording; the first ``most`` are named."""
    named = [
        f"{join_names(list(map(channel_name, channels)))} of {recording}"
        for recording, channels in of.items()
    ]
    reason = _OTHER_AXES[why].format(horizon=number_text(horizon))
    text = f"axes not used ({reason}): {'; '.join(named[:most])}"
    more = len(named) - most
    return f"{text}; and of {counted(more, 'more recording')}" if more > 0 else text


def _because(reason: str | None) -> str:
    return f" ({reason})" if reason else ""


def families_compared(
    family: str,
    excess: tuple[float, float],
    unsuited: str | None,
    better: Sequence[tuple[str, float]],
    least: float,
) -> str:
    """Return a text on the excess of a family above its limit, and on families with a smaller one.

    ``excess`` is the ratio, and its tau, s; ``least`` is the least ratio of all families.
    """
    text = (
        f"the Allan deviation of the smallest {family} is {number_text(excess[0], 3)} times its "
        f"limit at {number_text(excess[1])} s"
    )
    if unsuited:
        text += f". Reason: {unsuited}"
    if better:
        offers = ", ".join(f"{name} {number_text(x, 3)} times" for name, x in better)
        return f"{text}. Smaller excess: {offers}"
    return f"{text}. No family is closer than {number_text(least, 3)} times"


def temperature_range(
    reference: float, recording: str, device: str, low: float, high: float
) -> str:
    at = number_text
    return (
        f"T_0 = {at(reference)} degC, from recording {recording} of device {device}. It is valid "
        f"for that device from {at(low)} to {at(high)} degC"
    )


def axis_not_included(axis: str, reason: str) -> str:
    return f"axis {axis} is not included: {reason}"


def axis_slope(
    axis: str,
    slope: float,
    limits: tuple[float | None, float | None],
    square: float,
    unit: str,
    lag: float | None,
) -> str:
    """Return a note on the temperature effect of an axis, in ``unit`` per K; ``lag`` in s."""
    lower, upper = (0.0 if limit is None else limit for limit in limits)
    bends = f", square {square:.3e} {unit}/K^2" if square else ""
    late = "no lag" if lag is None else f"a lag of up to {number_text(lag, 3)} s is not corrected"
    return (
        f"axis {axis}: {slope:.4e} {unit}/K, 95 % limits {lower:.3e} to {upper:.3e}{bends}; {late}"
    )


def status_reason(figure: str, status: Status, reason: str | None) -> str:
    return f"{figure} is {STATUS_WORDS[status]}{_because(reason)}"


def effect_not_shown(reason: str | None) -> str:
    return f"the log does not show an effect{_because(reason)}"
