"""Reasons for the parameters of a likelihood: absent, doubtful, or not determined."""

from collections.abc import Sequence

from imubench_pipeline.model.states import Status
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.numbers import join_names, number_text, percent_text

ABSENT = "the data do not support it"
SLOW_NOISE_MISSING = (
    "the slow noise was removed from the log, by a high-pass or by subtracted means"
)
ABSENT_BELOW = f"{ABSENT}; the upper limit is at 95 %"
BIAS_MODELS_ALIKE = "models with a bias instability fit about as well: only the interval is given"
FLICKER_WITHOUT_TIME = (
    "the bias instability of this model is flicker noise, which has no correlation time"
)
SHORT_LOG = "the log is too short"
SENSITIVITY_WITH_ZERO = "the 95 % interval of the temperature sensitivity includes 0"
NO_EFFECT_TO_LAG = "no effect of the temperature is shown that could lag"


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
    """Return why no value is given; ``ratio``: upper limit / lower limit."""
    return (
        f"the upper 95 % limit is {number_text(ratio, 2)} times the lower one: only the interval "
        "is given"
    )


def wide_limits(ratio: float) -> str:
    """Return why a value is doubtful; ``ratio``: upper limit / lower limit."""
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


def model_disfavoured(chosen: str, papers: str, delta_bic: float) -> str:
    return f"BIC prefers {chosen} to {papers} by {number_text(delta_bic, 3)}"


def small_temperature_range(kelvin: float) -> str:
    return f"the temperature changes by only {number_text(kelvin, 2)} K"


def temperature_preferred(delta_bic: float) -> str:
    which = "with" if delta_bic > 0.0 else "without"
    return f"BIC prefers the model {which} temperature by {number_text(abs(delta_bic), 3)}"


def settling_excluded(seconds: float) -> str:
    return (
        f"the first {number_text(seconds, 3)} s follow the temperature differently, and are not "
        "used for the sensitivity"
    )


def lag_range(lower: float, upper: float) -> str:
    return f"lags from {number_text(lower, 3)} to {number_text(upper, 3)} s fit the log"


def temperature_like_ramp(share: float) -> str:
    """Return why temperature is not separable from time; ``share``: explained by time only."""
    return (
        f"the temperature is close to a ramp: time alone explains {percent_text(share, 2)} of the "
        "information on the sensitivity. Vary the temperature up and down"
    )
