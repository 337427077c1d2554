"""Overbounding: the smallest noise model that lies above a measured Allan variance curve.

A filter with too small a noise model is overconfident; a model that is ten times too large wastes
the sensor. This module finds the smallest model of a family (N+K, N+GM, N+GM+K) for which

- the Allan variance lies above the upper limit of the measured one at every tau up to the longest;
- the spectral density lies above the fitted one in a band, by default from a tenth of 1 / horizon
  (a filter has averaged for longer than it then goes without a measurement) to half the rate;
- the variances of the first and the second integral lie above the fitted ones at every time up to
  the horizon (`growth`).

A bound on the Allan variance alone is not enough. It hardly resolves how the power is distributed
within an octave or two, and the covariance of a filter depends on that distribution. A spectral
density that lies above the true one at every frequency bounds the covariance of any linear filter
that is stationary in time [1, 2].

The confidence limits of a measured curve hold at each tau separately; the true curve leaves them
somewhere in a fifth to a third of the logs. The limits used here hold simultaneously for the whole
curve (`simultaneous_upper`).

Density and integrals are bounded by noise models that are drawn jointly from the posterior of the
fit: their limits lie above 95 % of the models at all frequencies and times simultaneously. Without
draws, the fitted density and integrals are widened by the factors of the measured curve, which is
less reliable: the density at f by the factor at tau = 0.37 / f, the integrals at t by the factor at
tau = t. On 100 simulated logs of 10 h of each of three sensors (``benchmarks/overbound.py``) the
models then lay above the true curve in 99 or 100, and a filter was overconfident in one at most.

A random walk cannot follow a Gauss-Markov process: beyond 2 T_B its Allan variance must lie ever
further above that process, and below the band its density still rises. The excess of a family is
therefore reported with the model. A model whose Allan deviation must be more than three times its
limit is refused, and the error names the excess of the other families.

References
----------
[1] S. Langel, O. Garcia Crespillo and M. Joerger, "A new approach for modeling correlated Gaussian
errors using frequency domain overbounding", IEEE/ION PLANS 2020. [2] S. Langel, O. Garcia Crespillo
and M. Joerger, "Overbounding the effect of uncertain Gauss-Markov noise in Kalman filtering",
NAVIGATION 68 (2), 2021.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.optimize import linprog, minimize_scalar

from imubench_pipeline import noise
from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.extensions.exports import reasons as texts
from imubench_pipeline.typing import Array
from imubench_pipeline.words.numbers import number_text

Family = Literal["N+K", "N+GM", "N+GM+K"]

FAMILIES: Sequence[Family] = get_args(Family)

_TIMES_PER_DECADE = 6  # correlation times of the grid search, which a bounded search refines
_MAX_PROGRAMS = 12  # max. number of successive linear programs for one T_B
_CONVERGED_DECREASE = 1e-6  # converged where the mean logarithm decreases by less
_ROUNDING_MARGIN = 1e-9
"""Relative increase of the densities, so that rounding does not put the model below a limit."""


@dataclass(frozen=True)
class Limits:
    """Lower limits on a quantity of a model, such as its Allan variance at several tau."""

    x: Array  # shape (m,); tau or time, s, or frequency, Hz
    value: Array  # shape (m,); lower limit there
    of_term: Callable[[noise.Term], Array]  # contribution of a term to the limited quantity at `x`

    def ratio(self, model: noise.NoiseModel) -> Array:
        """Return the quantity of a model divided by its limit, shape (m,)."""
        return np.asarray(np.sum([self.of_term(term) for term in model.terms], axis=0) / self.value)


def find_smallest(
    limits: Sequence[Limits], family: Family, times: tuple[float, float]
) -> noise.NoiseModel:
    """Return the smallest model of a family that lies above limits, by linear programs.

    For a given T_B all limits are linear in the densities N^2, S_B and K^2. Linear programs are
    therefore solved inside a one-dimensional search over T_B. The smallest model has the least
    mean, over log tau, of the logarithm of the ratio of its Allan variance to the limit. (The mean
    ratio would need one program only, but the largest ratios would dominate it: where a random walk
    must be far above the curve at long tau, the program would raise the white noise instead.)

    The first of the `limits` must be on the Allan variance: the model is minimised there.
    `times`: shortest and longest T_B of the search, s.

    Raises ValueError if the family is not known, or no model of it lies above.
    """
    if family not in FAMILIES:
        raise ValueError(f"family {family!r} is not known, expected one of {', '.join(FAMILIES)}")
    walks = family.endswith("K")
    fixed: list[noise.Term] = [noise.WhiteNoise(1.0)] + [noise.RandomWalk(1.0)] * walks
    if "GM" not in family:
        cost, powers = _minimise_mean_log_ratio(limits, fixed)
        T_B = None
    else:
        tried = np.log(np.geomspace(*times, count_points(*times, _TIMES_PER_DECADE)))

        def solved(log_time: float) -> tuple[float, Array]:
            time = math.exp(log_time)
            return _minimise_mean_log_ratio(
                limits, [*fixed, noise.GaussMarkov(noise.compute_bias_instability(1.0, time), time)]
            )

        costs = [solved(float(x))[0] for x in tried]
        best = int(np.argmin(costs))
        around = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
        finer = minimize_scalar(lambda x: solved(x)[0], bounds=around, method="bounded")
        place = float(finer.x) if finer.fun < costs[best] else float(tried[best])
        cost, powers = solved(place)
        T_B = math.exp(place)
    if not math.isfinite(cost):
        raise ValueError(f"no model of the family {family} lies above all limits")
    powers = powers * (1.0 + _ROUNDING_MARGIN)
    B = noise.compute_bias_instability(float(powers[-1]), T_B) if T_B else 0.0
    K = math.sqrt(powers[1]) if walks else 0.0
    return noise.NoiseModel(N=math.sqrt(powers[0]), B=B, T_B=T_B if B > 0.0 else None, K=K)


def _minimise_mean_log_ratio(
    limits: Sequence[Limits], terms: Sequence[noise.Term]
) -> tuple[float, Array]:
    """Minimise the mean log ratio of Allan variance to limit; return it, and the densities.

    The objective is a sum of logarithms, which are concave. Each program minimises their tangent at
    the last solution, an upper bound (majorise-minimise), so that the mean decreases monotonically.
    """
    parts = [
        np.column_stack([limit.of_term(term) for term in terms]) / limit.value[:, None]
        for limit in limits
    ]
    rows = np.concatenate(parts)
    scale = rows.max(axis=0)
    curve, rows = parts[0] / scale, rows / scale
    # Weights of a mean over log tau.
    x = limits[0].x
    edges = np.log(np.concatenate((x[:1], np.sqrt(x[1:] * x[:-1]), x[-1:])))
    weights = np.diff(edges) / (edges[-1] - edges[0]) if len(x) > 1 else np.ones(1)
    cost, powers, ratio = math.inf, np.zeros(len(terms)), np.ones(len(curve))
    for _ in range(_MAX_PROGRAMS):
        answer = linprog(
            (weights / ratio) @ curve, A_ub=-rows, b_ub=-np.ones(len(rows)), method="highs"
        )
        if answer.status != 0 or answer.x is None:
            break
        # Scale up, since the tolerance of the solver allows values slightly below a limit.
        solution = np.maximum(answer.x, 0.0)
        solution /= min(float(np.min(rows @ solution)), 1.0)
        ratio = curve @ solution
        lower = float(weights @ np.log(ratio))
        if lower > cost - _CONVERGED_DECREASE:
            break
        cost, powers = lower, solution
    return cost, np.asarray(powers / scale)


def count_points(start: float, stop: float, a_decade: int) -> int:
    """Return the number of log-spaced points in an interval, for a number per decade."""
    return 2 + math.ceil(a_decade * math.log10(stop / start))


_ALLAN_PEAK_FREQUENCY = 0.37
"""f tau at the maximum of the transfer function of the Allan variance.

The function is sin^4(x) / x^2 with x = pi f tau; the constant is x at its maximum, over pi."""

_MIN_FREQUENCY_TIMES_HORIZON = 0.1  # lowest frequency of the band, in 1 / horizon
_POINTS_A_DECADE = 12
_MAX_TIME_RATIO = 30.0  # max. T_B of the search, over the larger of the longest tau and the horizon
_CONFIDENCE = 0.95  # of the limits, simultaneously for all tau
MAX_EXCESS = 3.0
"""Default of the max. ratio of a model's Allan deviation to its limit."""

_MAX_HORIZON_OVER_T_B = 2.0
"""Max. horizon over T_B for which a random walk can replace a Gauss-Markov process."""

_MIN_FREQUENCY_RATIO = 1e-4
"""Lowest frequency at which densities are compared, over the lowest of the band."""

_FLICKER_TAU_RATIO = 4.0
"""Longest tau of the approximation of flicker noise, over the longest time of the growth."""


@dataclass(frozen=True)
class Overbound:
    """A noise model above the measured curve and its fit, with its range and its excess."""

    model: noise.NoiseModel
    band: tuple[float, float]  # lowest and highest frequency of the bounded density, Hz
    excess: tuple[float, float]
    """Max. ratio of the model's Allan deviation to its limit, and its tau, s. It depends on the
    family; a longer log does not reduce it."""
    words: Sequence[str]  # its size, and the range of the bounded density, for the head of a file
    warning: str | None = None
    """Why the family does not suit the horizon, with the excess of the other families."""


def simultaneous_upper(curve: AllanCurve, longest: float) -> Array:
    """Return simultaneous upper 95 % confidence limits of an Allan variance.

    They follow from the limits at single tau by a Bonferroni correction for the number of octaves.
    With 95 % probability, the true curve lies below the limits at every tau up to ``longest``, s.
    The limits are at every tau of the curve, shape (m,), in its unit squared.
    """
    n = curve.cluster_size[curve.tau <= longest * (1.0 + 1e-9)]
    octaves = 1.0 + math.log2(n[-1] / n[0])
    level = 1.0 - (1.0 - _CONFIDENCE) / octaves
    return curve.limits(2.0 * level - 1.0)[1] ** 2


def overbound(
    curve: AllanCurve,
    fitted: noise.NoiseModel,
    rate: float,
    *,
    family: Family = "N+K",
    horizon: float = 60.0,
    longest: float | None = None,
    shortest: float = 0.0,
    drawn: Sequence[noise.NoiseModel] = (),
    most_excess: float = MAX_EXCESS,
) -> Overbound:
    """Return the smallest model that lies above a measured curve and its fit.

    ``fitted`` is of the same log; its ramps and lines have no density and do not grow like noise:
    they count only by their part of the measured curve. The rate is in Hz. ``family`` are the terms
    that the model may have; ``horizon`` is the longest time that the filter predicts without a
    measurement, s, and by default also ``longest``, the longest tau. ``shortest`` is the shortest
    tau and time, s, by default one sample. The density is bounded from a tenth of 1 / horizon to
    half the rate or 1 / ``shortest``. ``drawn`` are models drawn jointly from the posterior of the
    fit; without them the fitted model is widened by the factors of the measured curve.
    ``most_excess`` is the max. ratio of the model's Allan deviation to its limit.

    Raises ValueError if the family is not known, no model of it lies above, or only one that is
    more than ``most_excess`` times too large, the horizon is shorter than two samples, or the curve
    does not reach ``longest``.
    """
    reach = longest or horizon
    begins = max(shortest, 1.0 / rate)
    band = (_MIN_FREQUENCY_TIMES_HORIZON / horizon, min(0.5 * rate, 1.0 / begins))
    limits = limits_of(curve, fitted, rate, horizon, (begins, reach), band, drawn)
    times = (2.0 / rate, _MAX_TIME_RATIO * max(horizon, reach))
    model = find_smallest(limits, family, times)
    excess = _find_excess(limits[0], model)
    unsuited = None
    processes = [term.gauss_markov for term in fitted.terms if term.gauss_markov is not None]
    least_time = min((process.T_B for process in processes), default=math.inf)
    if "GM" not in family and max(horizon, reach) > _MAX_HORIZON_OVER_T_B * least_time:
        unsuited = (
            f"a random walk cannot follow a Gauss-Markov process of T_B = "
            f"{number_text(least_time)} s beyond "
            f"{number_text(_MAX_HORIZON_OVER_T_B * least_time)} s"
        )
    warning = None
    if excess[0] > most_excess or unsuited:
        others = {
            other: _find_excess(limits[0], find_smallest(limits, other, times))[0]
            for other in FAMILIES
            if other != family
        }
        allowed = min(excess[0], most_excess)
        better = [(other, value) for other, value in others.items() if value < allowed]
        least = min([excess[0], *others.values()])
        warning = texts.families_compared(family, excess, unsuited, better, least)
        if excess[0] > most_excess:
            raise ValueError(f"{warning}. At most {most_excess:g} times is allowed")
    within = (curve.tau >= begins * (1.0 - 1e-9)) & (curve.tau <= reach * (1.0 + 1e-9))
    tau, measured = curve.tau[within], curve.variance[within]
    lowest = int(np.argmin(measured))
    ratio = float(model.allan_variance(tau, rate)[lowest] / measured[lowest])
    frequency = np.geomspace(band[0], _MIN_FREQUENCY_RATIO * band[0], 400)
    passed = np.flatnonzero(fitted.psd(frequency, rate) > model.psd(frequency))
    below = "Below, the fitted density does not exceed the bound, but is less certain"
    if len(passed):
        passed_at = number_text(float(frequency[passed[0]]), 3)
        below = f"The fitted density exceeds the bound below {passed_at} Hz"
    low, high = (number_text(end, 3) for end in band)
    words = [
        f"this is the smallest {family} above the measured Allan variance at every tau from "
        f"{number_text(begins, 3)} to {number_text(reach)} s (95 % for all together). It is also "
        f"above the fitted spectral density from {low} to {high} Hz, and the growth of the "
        f"integrals up to {number_text(horizon)} s. Its Allan deviation is "
        f"{number_text(math.sqrt(ratio), 3)} times the measured one at the minimum of the curve",
        f"the spectral density is bounded above {low} Hz only. {below}. Filters that average for "
        f"longer than {number_text(1.0 / band[0])} s are not covered",
    ]
    return Overbound(model, band, excess, words, warning)


def _find_excess(limit: Limits, model: noise.NoiseModel) -> tuple[float, float]:
    """Return the max. ratio of a model's Allan deviation to a limit, and its tau, s."""
    above = limit.ratio(model)
    worst = int(np.argmax(above))
    return math.sqrt(float(above[worst])), float(limit.x[worst])


def growth(model: noise.NoiseModel, time: Array, rate: float) -> tuple[Array, Array]:
    """Return the variances of the first and second integral of noise at times, s: shapes (m,).

    The states were known at time 0. With h(s) the impulse response from the driving white noise of
    density S to the noise, integrated once (angle or velocity) or twice (position), Var(t) =
    S int_0^t h(s)^2 ds (`noise.terms.base.Term.growth_from_known`). White noise, Gauss-Markov
    processes, random walk and flicker noise contribute; the processes that approximate flicker
    noise begin at half the period of the rate, Hz. Deterministic terms (ramp, lines) and
    quantization noise, which does not grow, do not contribute.
    """
    longest = max(_FLICKER_TAU_RATIO * float(time.max()), 2.0 / rate)
    grown = [term.growth_from_known(time) for term in model.realised(1.0 / rate, longest)]
    first, second = np.sum(grown, axis=0) if grown else np.zeros((2, len(time)))
    return first, second


def limits_of(
    curve: AllanCurve,
    fitted: noise.NoiseModel,
    rate: float,
    horizon: float,
    reach: tuple[float, float],
    band: tuple[float, float],
    drawn: Sequence[noise.NoiseModel] = (),
) -> list[Limits]:
    """Return the limits on Allan variance, density and two integrals (see `overbound`).

    ``reach`` is the shortest and the longest tau, s; the integrals begin at the shortest.
    """
    shortest, longest = reach
    if not max(2.0 / rate, shortest) < horizon:
        raise ValueError(
            f"the horizon of {horizon:g} s is shorter than two samples, or than {shortest:g} s"
        )
    if longest > curve.tau[-1] * (1.0 + 1e-9):
        raise ValueError(f"the curve ends at {curve.tau[-1]:g} s, expected {longest:g} s or more")
    upper = simultaneous_upper(curve, longest)
    inside = (curve.tau >= shortest * (1.0 - 1e-9)) & (curve.tau < longest * (1.0 - 1e-9))
    tau = np.append(curve.tau[inside], longest)
    limit = np.exp(np.interp(np.log(tau), np.log(curve.tau), np.log(upper)))

    frequency = np.geomspace(*band, count_points(*band, _POINTS_A_DECADE))
    time = np.geomspace(shortest, horizon, count_points(shortest, horizon, _POINTS_A_DECADE))

    def of_model(model: noise.NoiseModel) -> Array:
        return np.concatenate((model.psd(frequency, rate), *growth(model, time, rate)))

    if drawn:
        # Factors that bound a share of the draws simultaneously at every point (sup-t band): the
        # quantile of the maxima of log(draw / fit) over its root mean square at each point.
        above = np.log(np.array([*map(of_model, drawn)]) / of_model(fitted))
        spread = np.maximum(np.sqrt(np.mean(above**2, axis=0)), 1e-12)
        furthest = (above / spread).max(axis=1)
        bound = max(float(np.quantile(furthest, _CONFIDENCE)), 0.0)
        wider = of_model(fitted) * np.exp(bound * spread)
    else:
        looked = np.concatenate((_ALLAN_PEAK_FREQUENCY / frequency, time, time))
        factors = np.interp(np.log(looked), np.log(curve.tau), upper / curve.variance)
        wider = of_model(fitted) * factors
    density, first, second = np.split(wider, [len(frequency), len(frequency) + len(time)])
    n = tau * rate
    return [
        Limits(tau, limit, lambda t: t.sampled_allan_variance(n, 1.0 / rate)),
        Limits(frequency, density, lambda t: t.psd(frequency)),
        Limits(time, first, lambda t: t.growth_from_known(time)[0]),
        Limits(time, second, lambda t: t.growth_from_known(time)[1]),
    ]
