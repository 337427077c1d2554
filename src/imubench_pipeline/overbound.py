"""The smallest noise model that lies above a measured curve: a safe one for a filter.

A filter that loads too little noise is overconfident; multiplying everything by ten wastes the
sensor. Wanted is the smallest model of a family (N+K, N+GM, N+GM+K) for which

- the Allan variance lies above the upper limit of the measured one at every tau up to the longest;
- the spectral density lies above the fitted one in a band, by default from a tenth of 1 / horizon
  (a filter has averaged for longer than it then goes without a measurement) to half the rate;
- the variances of the first and the second integral lie above the fitted ones at every time up to
  the horizon (`imubench_pipeline.export.growth`).

The Allan variance alone does not do it: it says little of how the power lies within an octave or
two, and a filter sees that. A spectral density that lies above at every frequency bounds the
covariance of any linear filter that is stationary in time [1, 2].

The limits of a measured curve hold at each tau; the true curve leaves them somewhere in a fifth to
a third of the logs. The limits used here hold for the curve as a whole: at each tau the chance
of an error is 5 % over the number of octaves of the curve, since Allan variances an octave apart
are nearly independent. Density and integrals are bounded by noise models that the log allows, drawn
jointly from the posterior of the fit: their limits lie above 95 % of the models everywhere at once.
Of a fit without draws they are widened as the measured curve is, which is less sure, at the same
time scale: the density at f by the factor at tau = 0.37 / f, where the Allan variance looks, the
integrals at t by that at tau = t. On 100 simulated logs of 10 h of each
of three sensors (``benchmarks/overbound.py``) the models so found lay above the true curve in 99 or
100, and a filter that loads them was overconfident in one at most. With the noise of the MTi-7's
gyro their Allan variance was 1.18 (N+K) and 1.12 times the true one at its minimum, in the median.
No random walk lies close above flicker noise: there it was 5.0 times, 4.5 of them the family's.

All of this is linear in the densities N^2, S_B and K^2 at a given T_B: linear programs, inside a
search over T_B. Smallest is the model with the least mean, over log tau, of the logarithm of its
Allan variance over the limit. (Its mean ratio, one program, lets the largest ratios rule: where a
random walk must be far above the curve at long tau, white noise would be raised to make room.)

References
----------
[1] S. Langel, O. Garcia Crespillo and M. Joerger, "A new approach for modeling correlated Gaussian
errors using frequency domain overbounding", IEEE/ION PLANS 2020. [2] S. Langel, O. Garcia Crespillo
and M. Joerger, "Overbounding the effect of uncertain Gauss-Markov noise in Kalman filtering",
NAVIGATION 68 (2), 2021.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.optimize import linprog, minimize_scalar

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.export.growth import growth, growth_of
from imubench_pipeline.noise import (
    GaussMarkov,
    NoiseModel,
    RandomWalk,
    Term,
    WhiteNoise,
    bias_instability,
)
from imubench_pipeline.noise_terms import Array

Family = Literal["N+K", "N+GM", "N+GM+K"]

FAMILIES: Sequence[Family] = get_args(Family)

_LOOKS_AT = 0.37
"""f tau at which the Allan variance looks: where sin^4(x) / x^2 is largest, over pi."""

_MEMORY = 0.1
"""Lowest frequency times the horizon, by default."""

_POINTS_A_DECADE = 12
_TIMES_A_DECADE = 6
"""Correlation times tried before the best is sought between its neighbours."""

_BEYOND = 30.0
"""Longest correlation time tried over the longest tau or the horizon."""

_MOST_PROGRAMS = 12
_SAME = 1e-6
"""The programs have come to an end where the mean logarithm falls by less."""

_TOUCHES = 1.01
_ABOVE = 1e-9
"""The model is larger by this, so that no rounding puts it below a limit."""


@dataclass(frozen=True)
class Limits:
    """What a model must lie above.

    Attributes
    ----------
    kind : str
        In words.
    x, value : ndarray, shape (m,)
        Tau or time in s, or frequency in Hz, and the least value there.
    of_term : callable
        Term -> what is bounded, of this term, at ``x``.
    """

    kind: str
    x: Array
    value: Array
    of_term: Callable[[Term], Array]


@dataclass(frozen=True)
class Overbound:
    """A model that lies above its limits.

    Attributes
    ----------
    model : NoiseModel
    family : str
    horizon, longest : float
        s.
    band : tuple of float
        Lowest and highest frequency, Hz.
    tau, ratio : ndarray, shape (m,)
        Allan variance of the model over the measured one, at tau up to ``longest``.
    at_minimum : float
        That ratio at the minimum of the measured curve.
    touches : mapping of str to float
        Where the model comes within 1 % of its limits: kind, and tau, frequency or time.
    """

    model: NoiseModel
    family: Family
    horizon: float
    longest: float
    band: tuple[float, float]
    tau: Array
    ratio: Array
    at_minimum: float
    touches: dict[str, float]

    @property
    def words(self) -> str:
        """What the model is, for the head of a file."""
        return (
            f"this is the smallest {self.family} that lies above the measured Allan variance at "
            f"every tau up to {self.longest:.4g} s (95 % for all together), above the fitted "
            f"spectral density from {self.band[0]:.3g} to {self.band[1]:.4g} Hz, and above the "
            f"fitted growth of the integrals up to {self.horizon:.4g} s; at the minimum of the "
            f"measured curve its Allan deviation is {math.sqrt(self.at_minimum):.2f} times the "
            "measured one"
        )


def simultaneous_upper(curve: AllanCurve, longest: float, confidence: float = 0.95) -> Array:
    """Return upper limits of an Allan variance that hold at every tau together.

    Parameters
    ----------
    curve : AllanCurve
    longest : float
        Longest tau that counts, s.
    confidence : float
        Chance that the true curve lies below the limits at every tau up to ``longest``.

    Returns
    -------
    ndarray, shape (m,)
        (rad/s)^2 or (m/s^2)^2, at every tau of the curve.
    """
    n = curve.cluster_size[curve.tau <= longest * (1.0 + 1e-9)]
    octaves = 1.0 + math.log2(n[-1] / n[0])
    level = 1.0 - (1.0 - confidence) / octaves
    return curve.limits(2.0 * level - 1.0)[1] ** 2


def overbound(
    curve: AllanCurve,
    fitted: NoiseModel,
    rate: float,
    *,
    family: Family = "N+K",
    horizon: float = 60.0,
    longest: float | None = None,
    band: tuple[float | None, float | None] = (None, None),
    confidence: float = 0.95,
    drawn: Sequence[NoiseModel] = (),
) -> Overbound:
    """Return the smallest model that lies above a measured curve and its fit.

    Parameters
    ----------
    curve : AllanCurve
        Measured.
    fitted : NoiseModel
        Fitted to the same log; ramps and lines have no density and do not grow like noise: where
        the curve shows them, they count.
    rate : float
        Hz.
    family : {"N+K", "N+GM", "N+GM+K"}
        Terms that the model may have.
    horizon : float
        How long the filter goes without a measurement, s.
    longest : float, optional
        Longest tau, s; the horizon by default.
    band : (float or None, float or None)
        Lowest and highest frequency of the density, Hz; by default a tenth of 1 / horizon, and
        half the rate. A sensor that is filtered below half the rate may say so here.
    confidence : float
        Of the limits, for all tau together.
    drawn : sequence of NoiseModel
        Models that the log allows, drawn jointly from the posterior of the fit; without them the
        fitted model is widened as the measured curve is.

    Returns
    -------
    Overbound

    Raises
    ------
    ValueError
        If the family is not known, no model of it lies above, the horizon is shorter than two
        samples, or the curve does not reach ``longest``.
    """
    reach = longest or horizon
    ends = (band[0] or _MEMORY / horizon, band[1] or 0.5 * rate)
    limits = limits_of(curve, fitted, rate, horizon, reach, ends, confidence, drawn)
    model = smallest(limits, family, (2.0 / rate, _BEYOND * max(horizon, reach)))
    within = curve.tau <= reach * (1.0 + 1e-9)
    tau, measured = curve.tau[within], curve.variance[within]
    ratio = model.allan_variance(tau, rate) / measured
    touches = {}
    for limit in limits:
        above = np.sum([limit.of_term(term) for term in model.terms], axis=0) / limit.value
        if above.min() < _TOUCHES:
            touches[limit.kind] = float(limit.x[np.argmin(above)])
    lowest = float(ratio[np.argmin(measured)])
    return Overbound(model, family, horizon, reach, ends, tau, ratio, lowest, touches)


def limits_of(
    curve: AllanCurve,
    fitted: NoiseModel,
    rate: float,
    horizon: float,
    longest: float,
    band: tuple[float, float],
    confidence: float = 0.95,
    drawn: Sequence[NoiseModel] = (),
) -> list[Limits]:
    """Return what a model must lie above: Allan variance, density, two integrals (`overbound`)."""
    if not 2.0 / rate < horizon:
        raise ValueError(f"the horizon of {horizon:g} s is shorter than two samples")
    if longest > curve.tau[-1] * (1.0 + 1e-9):
        raise ValueError(f"the curve ends at {curve.tau[-1]:g} s, before {longest:g} s")
    upper = simultaneous_upper(curve, longest, confidence)
    tau = np.append(curve.tau[curve.tau < longest * (1.0 - 1e-9)], longest)
    limit = np.exp(np.interp(np.log(tau), np.log(curve.tau), np.log(upper)))

    frequency = np.geomspace(*band, _count(*band, _POINTS_A_DECADE))
    time = np.geomspace(1.0 / rate, horizon, _count(1.0 / rate, horizon, _POINTS_A_DECADE))

    def of_model(model: NoiseModel) -> Array:
        grown = growth(model, time, rate)
        return np.concatenate((model.psd(frequency, rate), grown.first, grown.second))

    if drawn:
        wider = of_model(fitted) * _above_draws(of_model(fitted), map(of_model, drawn), confidence)
    else:
        looked = np.concatenate((_LOOKS_AT / frequency, time, time))
        factors = np.interp(np.log(looked), np.log(curve.tau), upper / curve.variance)
        wider = of_model(fitted) * factors
    density, first, second = np.split(wider, [len(frequency), len(frequency) + len(time)])
    n = tau * rate
    return [
        Limits("Allan variance", tau, limit, lambda t: t.sampled_allan_variance(n, 1.0 / rate)),
        Limits("spectral density", frequency, density, lambda t: t.psd(frequency)),
        Limits("first integral", time, first, lambda t: growth_of(t, time).first),
        Limits("second integral", time, second, lambda t: growth_of(t, time).second),
    ]


def _above_draws(fitted: Array, drawn: Iterable[Array], confidence: float) -> Array:
    """Return factors of a fit that lie above a share of the draws, at every place at once.

    In units of the spread of its logarithm at each place, every draw has one place where it is
    furthest above the fit: the limit lies as many above as that share of the draws stays below.
    """
    above = np.log(np.array([*drawn]) / fitted)
    spread = np.maximum(np.sqrt(np.mean(above**2, axis=0)), 1e-12)
    furthest = (above / spread).max(axis=1)
    return np.exp(max(float(np.quantile(furthest, confidence)), 0.0) * spread)


def smallest(limits: Sequence[Limits], family: Family, times: tuple[float, float]) -> NoiseModel:
    """Return the smallest model of a family that lies above limits.

    Parameters
    ----------
    limits : sequence of Limits
        Those of the Allan variance first: there the model is kept close.
    family : {"N+K", "N+GM", "N+GM+K"}
    times : (float, float)
        Shortest and longest T_B to try, s.

    Raises
    ------
    ValueError
        If the family is not known, or no model of it lies above.
    """
    if family not in FAMILIES:
        raise ValueError(f"family {family!r} is not known, expected one of {', '.join(FAMILIES)}")
    walks = family.endswith("K")
    fixed: list[Term] = [WhiteNoise(1.0)] + [RandomWalk(1.0)] * walks
    if "GM" not in family:
        cost, powers = _program(limits, fixed)
        T_B = None
    else:
        tried = np.log(np.geomspace(*times, _count(*times, _TIMES_A_DECADE)))

        def solved(log_time: float) -> tuple[float, Array]:
            time = math.exp(log_time)
            return _program(limits, [*fixed, GaussMarkov(bias_instability(1.0, time), time)])

        costs = [solved(float(x))[0] for x in tried]
        best = int(np.argmin(costs))
        around = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
        finer = minimize_scalar(lambda x: solved(x)[0], bounds=around, method="bounded")
        place = float(finer.x) if finer.fun < costs[best] else float(tried[best])
        cost, powers = solved(place)
        T_B = math.exp(place)
    if not math.isfinite(cost):
        raise ValueError(f"no model {family} lies above the limits")
    powers = powers * (1.0 + _ABOVE)
    B = bias_instability(float(powers[-1]), T_B) if T_B else 0.0
    return NoiseModel(
        N=math.sqrt(powers[0]),
        B=B,
        T_B=T_B if B > 0.0 else None,
        K=math.sqrt(powers[1]) if walks else 0.0,
    )


def _program(limits: Sequence[Limits], terms: Sequence[Term]) -> tuple[float, Array]:
    """Return the mean log ratio of the Allan variance to its limit, and the powers of the terms.

    The logarithm is concave: each program lies on its tangent at the last answer, so that the mean
    falls from program to program.
    """
    parts = [
        np.column_stack([limit.of_term(term) for term in terms]) / limit.value[:, None]
        for limit in limits
    ]
    rows = np.concatenate(parts)
    scale = rows.max(axis=0)
    curve, rows = parts[0] / scale, rows / scale
    weights = _log_weights(limits[0].x)
    cost, powers, ratio = math.inf, np.zeros(len(terms)), np.ones(len(curve))
    for _ in range(_MOST_PROGRAMS):
        answer = linprog(
            (weights / ratio) @ curve, A_ub=-rows, b_ub=-np.ones(len(rows)), method="highs"
        )
        if answer.status != 0 or answer.x is None:
            break
        # What the solver's tolerance leaves below a limit is made up for.
        found = np.maximum(answer.x, 0.0)
        found /= min(float(np.min(rows @ found)), 1.0)
        ratio = curve @ found
        lower = float(weights @ np.log(ratio))
        if lower > cost - _SAME:
            break
        cost, powers = lower, found
    return cost, np.asarray(powers / scale)


def _log_weights(x: Array) -> Array:
    """Return weights of a mean over log x."""
    if len(x) == 1:
        return np.ones(1)
    edges = np.log(np.concatenate((x[:1], np.sqrt(x[1:] * x[:-1]), x[-1:])))
    return np.asarray(np.diff(edges) / (edges[-1] - edges[0]))


def _count(start: float, stop: float, a_decade: int) -> int:
    return 2 + math.ceil(a_decade * math.log10(stop / start))
