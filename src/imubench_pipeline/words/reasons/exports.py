"""Cautions and notes in the head of exported files. Numbers are as in programs: ``1.2e-06``."""

from collections.abc import Mapping, Sequence
from typing import Literal

from imubench_pipeline.model.states import Status
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import counted, join_names, number_text

OtherAxes = Literal["other_device", "no_white_noise", "not_median", "less_noise"]
"""Why an axis is not the one that represents a sensor."""

_OTHER_AXES: Mapping[OtherAxes, str] = {
    "other_device": "of another device",
    "no_white_noise": "no white noise in the model",
    "not_median": "not the median at {horizon} s",
    "less_noise": "less noise at {horizon} s",
}


NO_WALK_KNOWN = "the model has no random walk, and no upper limit of it is known, so it is 0"
NO_TEMPERATURE_FIT = "no fit of the temperature"
BIAS_NOT_LINEAR = "its bias is not linear in temperature, and the program supports a slope only"


def chosen_axis(
    channel: str, recording: str, method: str, rank: str, horizon: float, error: float, unit: str
) -> str:
    """Return which axis represents a sensor; ``error`` after the horizon, s, in ``unit``."""
    times = number_text(horizon)
    return (
        f"{channel_name(channel)} of recording {recording} by method {method}, {rank} at "
        f"{times} s. Its error after {times} s is {number_text(error, 3)} {unit}, with a bias "
        f"averaged over the {times} s before"
    )


def axis_rank(number: int, place: str, of: str = "") -> str:
    """Return the place of an axis, ``worst`` or ``median``; ``of``: its device, if asked for."""
    rank = "the only axis" if number == 1 else f"the {place} of {number} axes"
    return f"{rank} of {of}" if of else rank


def axes_not_used(
    why: OtherAxes, horizon: float, of: Mapping[str, Sequence[str]], most: int
) -> str:
    """Return which axes are not used; ``of``: channels by recording, the first ``most`` named."""
    named = [
        f"{join_names(list(map(channel_name, channels)))} of {recording}"
        for recording, channels in of.items()
    ]
    reason = _OTHER_AXES[why].format(horizon=number_text(horizon))
    text = f"axes not used ({reason}): {'; '.join(named[:most])}"
    more = len(named) - most
    return f"{text}; and of {counted(more, 'more recording')}" if more > 0 else text


def bound_used(
    label: str, reason: str | None, value: float, limits: tuple[float, float] | None
) -> str:
    """Return the note that a value at the end of its search is used, SI."""
    return (
        f"{label} is at the end of its search{_because(reason)}. "
        f"Its value of {value:.4e} is used{_limits_text(limits)}"
    )


def fitted_used(
    label: str, status: Status, reason: str | None, value: float, limits: tuple[float, float] | None
) -> str:
    """Return the note that the fit is used where no value is given, SI."""
    return (
        f"{status_reason(label, status, reason)}. "
        f"The fitted {value:.3e} is used{_limits_text(limits)}"
    )


def zero_used(label: str, status: Status, reason: str | None, upper: float) -> str:
    """Return the note that 0 is used where a term has an upper limit, SI."""
    return (
        f"{status_reason(label, status, reason)}. "
        f"It is 0 in this file, and its upper limit is {upper:.3e}"
    )


def _because(reason: str | None) -> str:
    return f" ({reason})" if reason else ""


def _limits_text(limits: tuple[float, float] | None) -> str:
    return "" if limits is None else f", with 95 % limits of {limits[0]:.3e} to {limits[1]:.3e}"


def terms_replaced(
    terms: str, by: str, horizon: float, half: float, twice: float, worst: tuple[float, float]
) -> str:
    """Return the replacement of terms, with the relative errors of the Allan deviation.

    ``half``, ``twice``: at half and at twice the horizon, s; ``worst``: largest error below the
    horizon, and its tau, s.
    """
    at = number_text
    return (
        f"{terms}: replaced by {by}, with the same Allan variance at the horizon of "
        f"{at(horizon)} s. The Allan deviation differs by {_signed(half)} at {at(horizon / 2)} s "
        f"and {_signed(twice)} at {at(2 * horizon)} s. Below the horizon the largest "
        f"difference is {_signed(worst[0])}, at {at(worst[1], 3)} s"
    )


def _signed(share: float) -> str:
    return f"{100 * share:+.1f} %"


def overbound_used(
    family: str, longest: float, band: tuple[float, float], horizon: float, excess: float
) -> str:
    """Return the limits that an overbound covers: times in s, frequencies in Hz.

    ``excess``: its Allan deviation over the measured one at the minimum of the curve.
    """
    low, high = (number_text(frequency, 3) for frequency in band)
    return (
        f"this is the smallest {family} above the measured Allan variance at every "
        f"tau up to {number_text(longest)} s (95 % for all together). It is also above the "
        f"fitted spectral density from {low} to {high} Hz, and the growth of the integrals up "
        f"to {number_text(horizon)} s. Its Allan deviation is {number_text(excess, 3)} times the "
        "measured one at the minimum of the curve"
    )


def density_bounded(lowest: float, passed: float | None) -> str:
    """Return the frequency, Hz, above which the density is bounded.

    ``passed``: frequency below which the fitted density is above the bound, Hz.
    """
    if passed is None:
        below = "Below, the fitted density does not exceed the bound, but is less certain"
    else:
        below = f"The fitted density exceeds the bound below {number_text(passed, 3)} Hz"
    return (
        f"the spectral density is bounded above {number_text(lowest, 3)} Hz only. {below}. "
        f"Filters that average for longer than {number_text(1.0 / lowest)} s are not covered"
    )


def families_compared(
    family: str,
    excess: tuple[float, float],
    unsuited: str | None,
    better: Sequence[tuple[str, float]],
    least: float,
) -> str:
    """Return the excess of a family of models over its limit, and the closer families.

    ``excess``: ratio of the Allan deviation to its limit, and its tau, s; ``least``: of all.
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
    """Return the effect of the temperature on an axis, in ``unit`` per K; lag in s."""
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
