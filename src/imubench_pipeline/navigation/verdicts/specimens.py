"""Predict the error of the next specimen of a sensor from the recorded specimens.

The errors are log-normal: y_d = ln sigma_d = mu + u_d + e_d, with variances tau^2 between specimens
and v_d from the limits of each. `navigation.pooled.pool` gives mu, its standard error s, and tau.
The prediction interval is mu +- t sqrt(tau^2 + s^2), with t of D - 1 degrees of freedom (Hahn and
Meeker 1991, chapter 4; with errors, Higgins et al. 2009). tau^2 is at least half the variance of
the y_d: in 100,000 simulated sets for each D = 2; 3; 5; 10, the 95 % limits then cover at least
95.8; 94.4; 93.3; 93.4 %, and without that bound 95.1; 92.8; 89.5; 86.4 %.

The spread of one specimen is pooled from other sensors with three degrees of freedom or more. Else
it is unknown, and the error applies to this specimen only.

References
----------
G. Hahn and W. Meeker, "Statistical Intervals", Wiley 1991; J. Higgins, S. Thompson and
D. Spiegelhalter, J. R. Stat. Soc. A 172, 2009.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import variance

from scipy.special import stdtr, stdtrit

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.states import SpreadOf
from imubench_pipeline.navigation.pooled import NORMAL_QUANTILE, compute_bounded_exp, pool

Limits = tuple[float, float, float]  # value, lower, upper
_MIN_VARIANCE_SHARE = 0.5  # minimum tau^2, as a fraction of the variance of the logarithms

_MIN_FREEDOM = 3
"""Minimum degrees of freedom of a spread from other sensors: t = 3.2, and 4.3 with two."""

_MIN_LOWER_RATIO = 1e-4  # of a value: a lower limit of 0 has no logarithm
_MIN_RELATIVE_WIDTH = 1e-9  # of a value, for a value that equals its limit


@dataclass(frozen=True)
class Spread:
    """Variance between specimens."""

    variance: float  # of the logarithm, tau^2
    freedom: int  # degrees of freedom


@dataclass(frozen=True)
class Expected:
    """Predicted error of the next specimen, or error of the only one."""

    # sigma, lower, upper: median and 95 % limits, SI; None if nothing is known
    sigma: float | None
    lower: float | None
    upper: float | None
    within: float | None  # probability that it is within the limit
    # specimens, recordings: their numbers
    specimens: int
    recordings: int
    # spread between specimens, or between the recordings of one specimen; None: unknown
    spread: Spread | None = None
    spread_of: SpreadOf | None = None


def predict_error(
    totals: Sequence[ErrorBudgetRow], devices: Mapping[str, str], usual: Spread | None = None
) -> Expected:
    """Return the predicted error of the next specimen, from one total per recording.

    ``devices`` has the specimen of each recording; ``usual`` is the spread of other sensors.
    """
    figures = [
        (row, (row.sigma, row.lower, row.upper))
        for row in totals
        if row.sigma is not None and row.lower is not None and row.upper is not None
    ]
    if not figures:
        return Expected(None, None, None, None, 0, 0)
    groups: dict[str, list[Limits]] = {}
    for row, (value, lower, upper) in figures:
        # `pool` needs positive limits on either side of a value.
        lower = min(max(lower, _MIN_LOWER_RATIO * value), value * (1.0 - _MIN_RELATIVE_WIDTH))
        upper = max(upper, value * (1.0 + _MIN_RELATIVE_WIDTH))
        groups.setdefault(devices[row.recording], []).append((value, lower, upper))
    counts = (len(groups), len(figures))
    if any(sigma <= 0.0 for _, (sigma, _, _) in figures) or (len(figures) == 1 and usual is None):
        worst, figure = max(figures, key=lambda pair: pair[1][0])
        return Expected(*figure, worst.within, *counts)
    limit = figures[0][0].limit
    if len(groups) == 1 and usual is not None:
        value, lower, upper = _pool_device(*groups.values())
        error = math.log(upper / lower) / (2.0 * NORMAL_QUANTILE)
        # Spread of the known specimen, and of the next one.
        scale = math.sqrt(2.0 * usual.variance + error**2)
        prediction = _predict(math.log(value), scale, usual.freedom, limit)
        return Expected(*prediction, *counts, usual, "other sensors")
    if len(groups) == 1:
        (values,) = groups.values()
    else:
        values = [_pool_device(own) for own in groups.values()]
    together = pool(*zip(*values, strict=True))
    # There are several, and all are usable.
    assert together.value is not None and together.error is not None and together.spread is not None
    least = _MIN_VARIANCE_SHARE * variance([math.log(value) for value, _, _ in values])
    spread = Spread(max(together.spread**2, least), len(values) - 1)
    scale = math.sqrt(spread.variance + together.error**2)
    prediction = _predict(math.log(together.value), scale, spread.freedom, limit)
    return Expected(*prediction, *counts, spread, "specimens" if len(groups) > 1 else "recordings")


def pool_spreads(spreads: Iterable[Spread]) -> Spread | None:
    """Return the pooled spread of several sensors; None with too few degrees of freedom."""
    listed = list(spreads)
    freedom = sum(spread.freedom for spread in listed)
    if freedom < _MIN_FREEDOM:
        return None
    return Spread(
        math.fsum(spread.variance * spread.freedom for spread in listed) / freedom, freedom
    )


def _pool_device(recordings: Sequence[Limits]) -> Limits:
    pooled = pool(*zip(*recordings, strict=True))
    assert pooled.value and pooled.lower and pooled.upper  # all are usable
    return pooled.value, pooled.lower, pooled.upper


def _predict(
    mean: float, scale: float, freedom: int, limit: float | None
) -> tuple[float, float, float, float | None]:
    """Return median, 95 % limits and the probability to be within a limit."""
    half = float(stdtrit(freedom, 0.975)) * scale
    within = None
    if limit is not None:
        within = float(stdtr(freedom, (math.log(limit) - mean) / scale))
    return (
        compute_bounded_exp(mean),
        compute_bounded_exp(mean - half),
        compute_bounded_exp(mean + half),
        within,
    )
