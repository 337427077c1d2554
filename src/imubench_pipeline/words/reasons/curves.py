"""Reasons for what an Allan deviation shows, by its slopes or by a fit to it."""

from imubench_pipeline.words.numbers import number_text, percent_text

_MAX_PRINTED_ERROR = 10.0  # maximum relative standard error that is printed as a number


REPEATED_SAMPLES = (
    "the Allan variance is 0 at some τ because samples repeat exactly. "
    "Check the log for stuck values"
)
SHORT_CURVE = "the curve is too short to show a slope. Record a longer log"
NO_FALL = "the curve has no minimum: it is lowest at its shortest τ"
READ_AT_MINIMUM = "read at the minimum of the whole curve, where N and K add to B"
FIT_WITHOUT_TERM = "the curve is fitted best without this term"
NO_NOISE = "the model has no noise"
NO_BIAS_TERMS = "the model has no flicker noise and no Gauss-Markov process"
MAY_BE_ABSENT = "the lower limit is 0: the term may be absent"
MINIMUM_BEYOND = "some models that fit the log have no minimum up to the longest τ that is used"


def changes_between_parts(excess: float) -> str:
    return (
        f"parts of the log differ by {percent_text(excess, 2)} (1σ) more than by chance, which the "
        "interval includes"
    )


def few_points(points: int, longest: float, needed: int) -> str:
    """Return why a curve is too short; ``longest``: longest tau divided by the log's length."""
    return (
        f"the curve has {points} of the {needed} points that are needed up to "
        f"{percent_text(longest)} of the log. Record a longer log"
    )


def no_white_slope(lowest: float, highest: float) -> str:
    return (
        "no part of the curve has the slope −1/2 of white noise: its slopes are between "
        f"{number_text(lowest, 2)} and {number_text(highest, 2)}"
    )


def no_rise(tau: float, sigmas: float) -> str:
    """Return why a curve that is lowest at ``tau``, s, has no significant minimum."""
    return (
        f"the curve has no minimum: after its lowest point at {number_text(tau, 3)} s it rises by "
        f"less than {number_text(sigmas, 2)} standard errors. A longer log may show one"
    )


def no_walk_slope(steepest: float | None) -> str:
    """Return why K is not read; ``steepest``: slope at the end, None if the minimum is there."""
    text = "the curve does not end with the slope +1/2 of a random walk: its "
    if steepest is None:
        return f"{text}lowest point is near its end"
    return f"{text}steepest end has the slope {number_text(steepest, 2)}"


def no_peak(longest: float) -> str:
    return (
        f"T_B reaches the longest time of its search, {number_text(longest)} s: the curve shows no "
        "peak of a Gauss-Markov process"
    )


def like_white_noise(shortest: float) -> str:
    return (
        f"T_B reaches the shortest time of its search, {number_text(shortest)} s: the process "
        "looks like white noise"
    )


def fitted_from(tau: float) -> str:
    """Return why a fit begins at ``tau``, s."""
    return (
        f"fitted from τ = {number_text(tau, 3)} s: at shorter τ the curve bends, as by the filter "
        "of the sensor"
    )


def large_error(symbol: str, error: float, most: float | None = None) -> str:
    above = "" if most is None else f", above {percent_text(most)}"
    return f"the relative standard error of {symbol} is {_error_text(error)}{above}"


def no_significant_peak(error_of_time: float, error: float | None = None) -> str:
    of_time = _error_text(error_of_time)
    text = "no peak of a Gauss-Markov process is significant: the relative standard error of "
    if error is None:
        return f"{text}T_B is {of_time}"
    return f"{text}B is {_error_text(error)}, but {of_time} for T_B"


def _error_text(error: float) -> str:
    if error >= _MAX_PRINTED_ERROR:
        return f"{percent_text(_MAX_PRINTED_ERROR)} or more"
    return percent_text(error, 2)


def broadband_process(time: float) -> str:
    return (
        f"a process with a correlation time of {number_text(time, 2)} s is broadband noise, not "
        "bias instability"
    )


def no_model_minimum(falls_to: float | None) -> str:
    text = "the Allan deviation of the fitted noise has no minimum: it "
    if falls_to is None:
        return f"{text}rises from its shortest τ"
    return f"{text}still falls at {number_text(falls_to)} s, the longest τ that is used"
