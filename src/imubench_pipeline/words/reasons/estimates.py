"""Reasons for the parameters of a likelihood: absent, doubtful, or not determined."""

from __future__ import annotations

from collections.abc import Sequence

from imubench_pipeline.model.states import Status
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.numbers import join_names, number_text, percent_text


def absent() -> str:
    """Return why a term is not in the model."""
    return "the data do not support it"


def absent_below() -> str:
    """Return why a term with an upper limit is not in the model."""
    return f"{absent()}; the upper limit is at 95 %"


def models_alike(others: Sequence[str], chosen: str) -> str:
    """Return why a parameter that only other models have is not identified."""
    include, fit = ("includes", "fits") if len(others) == 1 else ("include", "fit")
    return (
        f"{join_names(others)}, which {include} it, {fit} about as well as {chosen}: only the "
        "interval is given"
    )


def bias_models_alike() -> str:
    """Return why B_curve is not identified where the chosen model has no bias instability."""
    return "models with a bias instability fit about as well: only the interval is given"


def correlation_bound(bound: float, *, longest: bool) -> str:
    """Return why T_B is at a bound, s."""
    end = "longest" if longest else "shortest"
    return f"the {end} correlation time that this log can show is {number_text(bound)} s"


def flicker_without_time() -> str:
    """Return why there is no T_B."""
    return "the bias instability of this model is flicker noise, which has no correlation time"


def wide_interval(ratio: float) -> str:
    """Return why no value is given; ``ratio``: upper over lower limit."""
    return (
        f"the upper 95 % limit is {number_text(ratio, 2)} times the lower one: only the interval "
        "is given"
    )


def interval_with_zero(*, at_limit: bool) -> str:
    """Return why no value is given where 0 is inside the interval or its lower limit."""
    where = "the lower 95 % limit is 0" if at_limit else "the 95 % interval includes 0"
    return f"{where}: only the interval is given"


def excluded_by_likelihood(symbol: str, lower: float, upper: float) -> str:
    """Return why a value is doubtful; limits of the likelihood over this value."""
    return (
        f"the likelihood excludes this value: its 95 % interval of {symbol} is "
        f"{number_text(lower, 3)} to {number_text(upper, 3)} times this value. "
        "Use the likelihood"
    )


def no_reference(symbol: str, status: Status, reason: str | None) -> str:
    """Return why a value is doubtful that the likelihood does not give."""
    return f"the likelihood gives no {symbol}: {reason or STATUS_WORDS[status]}"


def criteria_disagree(by_aic: str, delta_aic: float, by_bic: str, delta_bic: float) -> str:
    """Return that AIC and BIC prefer different models, each by a difference."""
    return (
        f"AIC prefers {by_aic} by {number_text(delta_aic, 2)}, BIC prefers {by_bic} by "
        f"{number_text(delta_bic, 2)}"
    )


def model_disfavoured(chosen: str, papers: str, delta_bic: float) -> str:
    """Return why parameters of the papers' model are doubtful."""
    return f"BIC prefers {chosen} to {papers} by {number_text(delta_bic, 3)}"


def hardly_worse_without(symbol: str, without: str, chosen: str, delta_bic: float) -> str:
    """Return why a term that a simpler model does not need is doubtful."""
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
    """Return why B is doubtful where AIC prefers other terms."""
    return (
        f"AIC prefers {other}, with other terms of bias instability, by {number_text(delta_aic, 2)}"
    )


def slow_process(other: str, delta_aic: float) -> str:
    """Return why K is doubtful where AIC prefers a model without it."""
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
    """Return why K is doubtful that only the lowest frequencies show."""
    return (
        f"without the {lowest} lowest frequencies, {without} fits as well. In these, drift with "
        "temperature or time may look like a random walk"
    )


def smooth_drift(without: str, delta_aic: float) -> str:
    """Return why K is doubtful where the spectrum is steeper than that of a random walk."""
    return (
        f"AIC prefers {without} and a smooth drift, with a spectrum falling as f⁻⁴, by "
        f"{number_text(delta_aic, 2)}. Drift with temperature or time may look like a random walk"
    )


def few_frequencies(lowest: int) -> str:
    """Return why K is doubtful in a short log."""
    return (
        f"the log has too few frequencies above the {lowest} lowest, which drift affects as well. "
        "Record a longer log"
    )


def signal_or_walk(signal: str) -> str:
    """Return why K is doubtful beside a deterministic signal."""
    return f"{signal} explains the log about as well as a random walk"


def signals_hide_walk() -> str:
    """Return why K is doubtful beside the signals that were removed."""
    return "the deterministic signals contain most of the information on a random walk"


def pause_steps(number: int) -> str:
    """Return steps at pauses of the log as a deterministic signal."""
    if number == 1:
        return "a step of the bias at a pause of the log"
    return f"a series of bias steps at {number} pauses of the log"


def step_at(time: float) -> str:
    """Return a step at a time, s, as a deterministic signal."""
    return f"a step of the bias at {number_text(time, 5)} s"


def warm_up(time: float) -> str:
    """Return a warm-up with a time constant, s, as a deterministic signal."""
    return f"a warm-up with a time constant of {number_text(time, 3)} s"


def periodic_drift(period: float) -> str:
    """Return a periodic drift, s, as a deterministic signal."""
    return f"a periodic drift with a period of {number_text(period, 3)} s"


def curve_bias_unknown(reason: str | None) -> str:
    """Return why B is doubtful where B_curve is not identified."""
    text = "the bias instability of the curve is not determined"
    return f"{text}: {reason}" if reason else text


def band_excluded(highest: float) -> str:
    """Return why B is not identified where frequencies above a limit, Hz, are not fitted."""
    return (
        f"above {number_text(highest)} Hz neither a process nor a low-pass explains the spectrum, "
        "so a faster process is not visible"
    )


def short_log() -> str:
    """Return why nothing is fitted to the temperature."""
    return "the log is too short"


def small_temperature_range(kelvin: float) -> str:
    """Return why nothing is fitted to the temperature."""
    return f"the temperature changes by only {number_text(kelvin, 2)} K"


def sensitivity_with_zero() -> str:
    """Return why the effect of the temperature is not shown."""
    return "the 95 % interval of the temperature sensitivity includes 0"


def temperature_preferred(delta_bic: float, *, enough: bool) -> str:
    """Return by how much BIC prefers the noise with temperature."""
    short = "" if enough else ", which is not enough"
    return f"BIC prefers the model with temperature by {number_text(delta_bic, 3)}{short}"


def settling_excluded(seconds: float) -> str:
    """Return which beginning of a log, s, is not used for the sensitivity."""
    return (
        f"the first {number_text(seconds, 3)} s follow the temperature differently, and are not "
        "used for the sensitivity"
    )


def lag_not_asked() -> str:
    """Return why there is no lag."""
    return "no lag was asked for"


def no_effect_to_lag() -> str:
    """Return why a lag is not identified where there is no effect."""
    return "no effect of the temperature is shown that could lag"


def lag_range(lower: float, upper: float) -> str:
    """Return which lags, s, fit the log."""
    return f"lags from {number_text(lower, 3)} to {number_text(upper, 3)} s fit the log"


def temperature_like_ramp(share: float) -> str:
    """Return why temperature is not separable from time; ``share`` of the information."""
    return (
        f"the temperature is close to a ramp: time alone explains {percent_text(share, 2)} of the "
        "information on the sensitivity. Vary the temperature up and down"
    )


def monotone_temperature() -> str:
    """Return why temperature is not separable from time."""
    return (
        "the temperature only rises or only falls, and a drift with time explains as much. "
        "Vary it up and down"
    )


def temperature_by_chance() -> str:
    """Return why an effect that explains the drift is not shown."""
    return (
        "temperature follows most of the slow drift, but a random walk as strong as in this log "
        "would do so by chance"
    )
