"""Reasons for the parameters of a likelihood: absent, doubtful, or not determined."""

from __future__ import annotations

from collections.abc import Sequence

from imubench_pipeline.model.states import Status
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.numbers import join_names, number_text, percent_text

ABSENT = "the data do not support it"
ABSENT_BELOW = f"{ABSENT}; the upper limit is at 95 %"
BIAS_MODELS_ALIKE = "models with a bias instability fit about as well: only the interval is given"
FLICKER_WITHOUT_TIME = (
    "the bias instability of this model is flicker noise, which has no correlation time"
)
SHORT_LOG = "the log is too short"
SENSITIVITY_WITH_ZERO = "the 95 % interval of the temperature sensitivity includes 0"
LAG_NOT_ASKED = "no lag was asked for"
NO_EFFECT_TO_LAG = "no effect of the temperature is shown that could lag"
MONOTONE_TEMPERATURE = (
    "the temperature only rises or only falls, and a drift with time explains as much. "
    "Vary it up and down"
)
TEMPERATURE_BY_CHANCE = (
    "temperature follows most of the slow drift, but a random walk as strong as in this log "
    "would do so by chance"
)


def models_alike(others: Sequence[str], chosen: str) -> str:
    include, fit = ("includes", "fits") if len(others) == 1 else ("include", "fit")
    return (
        f"{join_names(others)}, which {include} it, {fit} about as well as {chosen}: only the "
        "interval is given"
    )


def correlation_bound(bound: float, *, longest: bool) -> str:
    end = "longest" if longest else "shortest"
    return f"the {end} correlation time that this log can show is {number_text(bound)} s"


def wide_interval(ratio: float) -> str:
    """Return why no value is given; ``ratio``: upper over lower limit."""
    return (
        f"the upper 95 % limit is {number_text(ratio, 2)} times the lower one: only the interval "
        "is given"
    )


def wide_limits(ratio: float) -> str:
    """Return why a value is doubtful; ``ratio``: upper over lower limit."""
    return (
        f"the upper 95 % limit is {number_text(ratio, 2)} times the lower one. "
        "Record a longer log to narrow them"
    )


def interval_with_zero(*, at_limit: bool) -> str:
    where = "the lower 95 % limit is 0" if at_limit else "the 95 % interval includes 0"
    return f"{where}: only the interval is given"


def excluded_by_reference(symbol: str, lower: float, upper: float) -> str:
    return (
        f"the recommended method excludes this value: its 95 % interval of {symbol} is "
        f"{number_text(lower, 3)} to {number_text(upper, 3)} times this value"
    )


def no_reference(symbol: str, status: Status, reason: str | None) -> str:
    return f"the recommended method gives no {symbol}: {reason or STATUS_WORDS[status]}"


def criteria_disagree(by_aic: str, delta_aic: float, by_bic: str, delta_bic: float) -> str:
    return (
        f"AIC prefers {by_aic} by {number_text(delta_aic, 2)}, BIC prefers {by_bic} by "
        f"{number_text(delta_bic, 2)}"
    )


def model_disfavoured(chosen: str, papers: str, delta_bic: float) -> str:
    return f"BIC prefers {chosen} to {papers} by {number_text(delta_bic, 3)}"


def hardly_worse_without(symbol: str, without: str, chosen: str, delta_bic: float) -> str:
    return (
        f"{without}, without {symbol}, fits almost as well as {chosen}: its BIC is only "
        f"{number_text(delta_bic, 2)} higher"
    )


def hardly_worse_bias(other: str, chosen: str, delta_bic: float, *, several: bool) -> str:
    """Return why B is doubtful; ``several``: the chosen model has more than one."""
    has = "has another B. B_curve includes both" if several else "has no B"
    return (
        f"{other} fits almost as well as {chosen}, with a BIC only {number_text(delta_bic, 2)} "
        f"higher, and {has}"
    )


def other_bias_terms(other: str, delta_aic: float) -> str:
    return (
        f"AIC prefers {other}, with other terms of bias instability, by {number_text(delta_aic, 2)}"
    )


def slow_process(other: str, delta_aic: float) -> str:
    return (
        f"AIC prefers {other}, which has no random walk, by {number_text(delta_aic, 2)}: a process "
        "as slow as the log may look like a random walk"
    )


def ramp_explains(other: str, delta_aic: float, ratio: float) -> str:
    """Return why K is doubtful beside a ramp; ``ratio``: K with it over K without it."""
    return (
        f"AIC prefers {other} by {number_text(delta_aic, 2)}, and with its ramp K is only "
        f"{number_text(ratio, 2)} times as large"
    )


def drift_or_walk(lowest: int, without: str) -> str:
    return (
        f"without the {lowest} lowest frequencies, {without} fits as well. In these, drift with "
        "temperature or time may look like a random walk"
    )


def smooth_drift(without: str, delta_aic: float) -> str:
    return (
        f"AIC prefers {without} and a smooth drift, with a spectrum falling as f⁻⁴, by "
        f"{number_text(delta_aic, 2)}. Drift with temperature or time may look like a random walk"
    )


def few_frequencies(lowest: int) -> str:
    return (
        f"the log has too few frequencies above the {lowest} lowest, which drift affects as well. "
        "Record a longer log"
    )


def curve_bias_unknown(reason: str | None) -> str:
    text = "the bias instability of the curve is not determined"
    return f"{text}: {reason}" if reason else text


def band_excluded(highest: float) -> str:
    return (
        f"above {number_text(highest)} Hz neither a process nor a low-pass explains the spectrum, "
        "so a faster process is not visible"
    )


def small_temperature_range(kelvin: float) -> str:
    return f"the temperature changes by only {number_text(kelvin, 2)} K"


def temperature_preferred(delta_bic: float, *, enough: bool) -> str:
    short = "" if enough else ", which is not enough"
    return f"BIC prefers the model with temperature by {number_text(delta_bic, 3)}{short}"


def settling_excluded(seconds: float) -> str:
    return (
        f"the first {number_text(seconds, 3)} s follow the temperature differently, and are not "
        "used for the sensitivity"
    )


def lag_range(lower: float, upper: float) -> str:
    return f"lags from {number_text(lower, 3)} to {number_text(upper, 3)} s fit the log"


def temperature_like_ramp(share: float) -> str:
    """Return why temperature is not separable from time; ``share`` of the information."""
    return (
        f"the temperature is close to a ramp: time alone explains {percent_text(share, 2)} of the "
        "information on the sensitivity. Vary the temperature up and down"
    )
