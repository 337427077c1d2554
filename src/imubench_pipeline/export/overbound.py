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
integrals at t by that at tau = t. Widened so, on 100 simulated logs of 10 h of each of three
sensors (``benchmarks/overbound.py``), the models lay above the true curve in 99 or
100, and a filter that loads them was overconfident in one at most. With the noise of the MTi-7's
gyro their Allan variance was 1.18 (N+K) and 1.12 times the true one at its minimum, in the median.
No random walk lies close above flicker noise: there it was 5.0 times, 4.5 of them the family's.

A random walk cannot follow a Gauss-Markov process: beyond 2 T_B it must lie ever further above it,
and below the band its density still rises. So what a family costs is told with the model, and one
whose Allan deviation must be more than three times its limit is refused, with what the other
families would come to.

The search for it is in `imubench_pipeline.export.smallest_model`.

References
----------
[1] S. Langel, O. Garcia Crespillo and M. Joerger, "A new approach for modeling correlated Gaussian
errors using frequency domain overbounding", IEEE/ION PLANS 2020. [2] S. Langel, O. Garcia Crespillo
and M. Joerger, "Overbounding the effect of uncertain Gauss-Markov noise in Kalman filtering",
NAVIGATION 68 (2), 2021.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.export.growth import growth
from imubench_pipeline.export.smallest_model import (
    FAMILIES,
    Family,
    Limits,
    count_of_points,
    smallest,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_LOOKS_AT = 0.37
"""f tau at which the Allan variance looks: where sin^4(x) / x^2 is largest, over pi."""

_MEMORY = 0.1
"""Lowest frequency times the horizon, by default."""

_POINTS_A_DECADE = 12
_BEYOND = 30.0
"""Longest correlation time tried over the longest tau or the horizon."""

MOST_EXCESS = 3.0
"""Largest Allan deviation of a model over the limit that it must lie above, by default."""

_WALK_FOLLOWS = 2.0
"""Horizon over T_B up to which a random walk follows a Gauss-Markov process."""

_BELOW_BAND = 1e-4
"""Lowest frequency over that of the band down to which the densities are compared."""

_TOUCHES = 1.01


@dataclass(frozen=True)
class Overbound:
    """A model that lies above its limits.

    Attributes
    ----------
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
    excess : (float, float)
        Largest Allan deviation of the model over its limit, and the tau where that is, s: what
        the family costs, however long the log.
    passed_below : float or None
        Frequency, Hz, below which the fitted density is above that of the model; None: as far as
        a ten-thousandth of the lowest of the band it nowhere is.
    warning : str or None
        The family does not suit the horizon, in words; with what the others would come to.
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
    excess: tuple[float, float]
    passed_below: float | None
    warning: str | None = None

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

    @property
    def density_words(self) -> str:
        """Above which frequency the density is bounded, for the head of a file."""
        low = self.band[0]
        if self.passed_below is None:
            below = "the fitted density is nowhere above it there, but it is less sure"
        else:
            below = f"the fitted density is above it below {self.passed_below:.3g} Hz"
        return (
            f"the bound on the spectral density holds above {low:.3g} Hz only; below, it is none "
            f"({below}): it does not cover a filter that averages for longer than {1.0 / low:.4g} s"
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
    most_excess: float = MOST_EXCESS,
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
    most_excess : float
        Largest Allan deviation of the model over the limit that it must lie above.

    Raises
    ------
    ValueError
        If the family is not known, no model of it lies above, or only one that is more than
        ``most_excess`` times too large, the horizon is shorter than two samples, or the curve does
        not reach ``longest``.
    """
    reach = longest or horizon
    ends = (band[0] or _MEMORY / horizon, band[1] or 0.5 * rate)
    limits = limits_of(curve, fitted, rate, horizon, reach, ends, confidence, drawn)
    times = (2.0 / rate, _BEYOND * max(horizon, reach))
    model = smallest(limits, family, times)
    excess = _excess(limits[0], model)
    unsuited = _unsuited(fitted, family, max(horizon, reach))
    warning = None
    if excess[0] > most_excess or unsuited:
        offer = _offer(limits, family, times, excess, unsuited, most_excess)
        if excess[0] > most_excess:
            raise ValueError(f"{offer}; at most {most_excess:g} times is allowed")
        warning = offer
    within = curve.tau <= reach * (1.0 + 1e-9)
    tau, measured = curve.tau[within], curve.variance[within]
    ratio = model.allan_variance(tau, rate) / measured
    touches = {}
    for limit in limits:
        above = limit.ratio(model)
        if above.min() < _TOUCHES:
            touches[limit.kind] = float(limit.x[np.argmin(above)])
    lowest = float(ratio[np.argmin(measured)])
    return Overbound(
        model,
        family,
        horizon,
        reach,
        ends,
        tau,
        ratio,
        lowest,
        touches,
        excess,
        _passed_below(model, fitted, rate, ends[0]),
        warning,
    )


def _excess(limit: Limits, model: NoiseModel) -> tuple[float, float]:
    """Return the largest deviation of a model over a limit, and where that is."""
    above = limit.ratio(model)
    worst = int(np.argmax(above))
    return math.sqrt(float(above[worst])), float(limit.x[worst])


def _unsuited(fitted: NoiseModel, family: Family, horizon: float) -> str | None:
    """Say so where a random walk is to follow a Gauss-Markov process beyond 2 T_B."""
    processes = [term.gauss_markov for term in fitted.terms if term.gauss_markov is not None]
    times = [process.T_B for process in processes]
    if "GM" in family or not times or horizon <= _WALK_FOLLOWS * min(times):
        return None
    return (
        f"a random walk cannot follow a Gauss-Markov process of T_B = {min(times):.4g} s beyond "
        f"2 T_B = {_WALK_FOLLOWS * min(times):.4g} s"
    )


def _offer(
    limits: Sequence[Limits],
    family: Family,
    times: tuple[float, float],
    excess: tuple[float, float],
    unsuited: str | None,
    most_excess: float,
) -> str:
    """Return how far a family is above its limits, why, and how far the others would be."""
    words = (
        f"the Allan deviation of the smallest {family} is {excess[0]:.3g} times its limit at "
        f"{excess[1]:.4g} s"
    )
    others = {
        other: _excess(limits[0], smallest(limits, other, times))[0]
        for other in FAMILIES
        if other != family
    }
    better = {
        other: value for other, value in others.items() if value < min(excess[0], most_excess)
    }
    reason = f": {unsuited}" if unsuited else ""
    offer = ", ".join(f"{other} is {value:.3g} times" for other, value in better.items())
    if offer:
        return f"{words}{reason}; the smallest {offer} at most"
    least = min([excess[0], *others.values()])
    return f"{words}{reason}; no family comes closer than {least:.3g} times"


def _passed_below(
    model: NoiseModel, fitted: NoiseModel, rate: float, lowest: float
) -> float | None:
    """Return the frequency below the band from which on the fitted density is the larger."""
    frequency = np.geomspace(lowest, _BELOW_BAND * lowest, 400)
    passed = np.flatnonzero(fitted.psd(frequency, rate) > model.psd(frequency))
    return float(frequency[passed[0]]) if len(passed) else None


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

    frequency = np.geomspace(*band, count_of_points(*band, _POINTS_A_DECADE))
    time = np.geomspace(1.0 / rate, horizon, count_of_points(1.0 / rate, horizon, _POINTS_A_DECADE))

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
        Limits("first integral", time, first, lambda t: t.growth_from_known(time)[0]),
        Limits("second integral", time, second, lambda t: t.growth_from_known(time)[1]),
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
