"""The cut-off of a sensor's own low-pass, from the spectrum of its noise at rest.

White noise of density N behind a Butterworth filter of order n (n = 1: first order) has the
density N^2 |H(f)|^2 with |H|^2 = 1 / (1 + (f / f_c)^(2 n)), in continuous time; sampling at the
rate f_s folds it to N^2 sum_k |H(f + k f_s)|^2. That holds for a cut-off above Nyquist too, where
the folds leave little of the bend, but a long log shows it. N is the density before the filter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.goodness import goodness
from imubench_pipeline.estimators.whittle import COARSE, Whittle, whittle_of
from imubench_pipeline.estimators.whittle_kernels import best_powers
from imubench_pipeline.sensor_model.low_pass import LowPass
from imubench_pipeline.spectrum import Spectrum

Array = NDArray[np.float64]

_POINTS = 6
"""Frequencies of a bin over which a density is averaged."""

_SLOW_FOLDS = 3
"""Folds on each side of slow noise, of which little is left there."""

_SCAN = 32
"""Cut-offs tried before the best is polished."""

_LOWEST, _HIGHEST, _HIGHEST_STEEP = 1 / 500, 4.0, 1.0
"""Cut-offs that are looked for, parts of the rate; a filter of higher order is there to keep noise
from folding, and beyond the rate its folds are those of a lower one of first order."""

_CORRELATIONS = (1e2, 1e5)
"""Shortest and longest correlation time of slow noise, sampling intervals."""

_A_DECADE = 6
"""Correlation times that are tried."""

_NEAR = 1 / 300
"""Part of the cut-off from which frequencies count: drift, as with temperature, is not as any noise
is, and far below the bend it says nothing of it."""

_MOST_SLOW = 4
"""Terms of slow noise."""

_UNFOLDED = 0.3
"""Part of the rate up to which there is one such cut-off only: little is folded."""

_BETWEEN = 24
"""Cut-offs tried on each side, beyond that, for others that the log allows as well."""

_HALF_CHI_SQUARED = 1.9207
"""Log likelihood below its maximum at the ends of a 95 % interval."""

_RULED_OUT = 3.0
"""Log likelihood by which another filter must be the worse not to count: its share is 5 %."""

_BEYOND_BIC = 6.0
"""Gain of BIC below which there is no filter: strong evidence, on the scale that is used of it."""

_WIDEST = 1.2
"""Ratio of the limits of a cut-off beyond which it is not called known."""

_ABOVE_ENDS = 1.01
_FEWEST_BINS = 24


@dataclass(frozen=True)
class Cutoff:
    """The low-pass that a spectrum shows.

    Attributes
    ----------
    frequency : Parameter
        f_c (-3 dB), Hz.
    order : int or None
        n; None where no filter shows.
    N : Parameter
        Density of white noise before the filter, SI.
    floor : float
        Density of white noise after it, that of rounding and what else shows, SI.
    gained : float
        BIC of the noise without a filter, less that with it.
    or_quantization : bool
        Quantization noise would explain the spectrum as well.
    """

    frequency: Parameter
    order: int | None
    N: Parameter
    floor: float
    gained: float
    or_quantization: bool = False


def find_cutoff(
    spectrum: Spectrum,
    clear: NDArray[np.bool_] | None = None,
    *,
    orders: Sequence[int] = (1, 2, 3, 4),
    resolution: float = 0.0,
) -> Cutoff:
    """Find the low-pass of a sensor from its spectrum.

    Slow noise (flicker noise, a random walk, Gauss-Markov processes) stands beside the white;
    the order, and a floor behind the filter beyond that of rounding, are chosen by BIC. The
    interval is that of all filters that the log does not rule out: above Nyquist the folds of
    one may look like those of another. Of order 2 and more, cut-offs up to the rate are tried.

    Parameters
    ----------
    spectrum : Spectrum
        Of a log, up to Nyquist.
    clear : ndarray of bool, shape (b,), optional
        Bins that no line touches.
    orders : sequence of int
        Orders to try, at least one.
    resolution : float
        Step of the register (LSB), SI, where the samples are rounded: white noise of variance
        LSB^2 / 12 behind the filter.

    Returns
    -------
    Cutoff
        With status ``not_identified`` where the interval of the cut-off is wider than a fifth, or
        the bend is another than that of such a filter; ``absent`` where no filter shows.
    """
    used = np.ones(len(spectrum.frequency), dtype=np.bool_) if clear is None else clear
    if used.sum() < _FEWEST_BINS:
        unknown = Parameter(None, "not_shown", f"the spectrum has {used.sum()} bins only")
        return Cutoff(unknown, None, unknown, 0.0, 0.0)
    fits = _Fits(spectrum.taken(used))
    tried = fits.tried(orders)
    rounding = resolution**2 / (12.0 * spectrum.rate)
    if tried:
        near = used & (spectrum.frequency > _NEAR * tried[0].cutoff)
        if near.sum() >= _FEWEST_BINS:
            used = near
            fits = _Fits(spectrum.taken(used))
        if rounding > 0.0:
            fits.rounded = rounding / fits.density(*tried[0].filter)[0] ** 2
        fits.choose_slow(*tried[0].filter)
        tried = fits.tried(orders)
    N_alone, without, rising = fits.unfiltered()
    gained = 2.0 * (without - tried[0].score) if tried else 0.0
    beside_rounding = 2.0 * (rising - tried[0].score) if tried else 0.0
    if gained < _BEYOND_BIC or beside_rounding < -_BEYOND_BIC:
        absent = Parameter(None, "absent", "the spectrum shows no low-pass")
        return Cutoff(absent, None, Parameter(N_alone), 0.0, gained)
    best = tried[0]
    # A floor is taken to be there where it shows only: with it a high cut-off is never told.
    alike = [
        one
        for one in tried
        if one.floor <= best.floor and one.cost + one.floor < best.cost + best.floor + _RULED_OUT
    ]
    ends = [(end, one) for one in alike for end in fits.limits(*one.filter)]
    lower, upper = min(end for end, _ in ends), max(end for end, _ in ends)
    N, after = fits.density(*best.filter)
    error = 1.96 * N / math.sqrt(2.0 * float(spectrum.ordinates[used].sum()))
    found_N = [N, *(fits.density(end, one.order, one.floor)[0] for end, one in ends)]
    density = Parameter(N, lower=min(found_N) - error, upper=max(found_N) + error)
    reason = ""
    if beside_rounding < _BEYOND_BIC:
        reason = (
            "the spectrum rises towards Nyquist, by quantization noise as well as by a low-pass "
            f"with a cut-off from {lower:.4g} to {upper:.4g} Hz"
        )
    elif upper > _WIDEST * lower or upper >= 0.999 * fits.highest(best.order):
        reason = f"the log allows cut-offs from {lower:.4g} to {upper:.4g} Hz"
    elif not fits.explains(*best.filter):
        reason = "the spectrum bends, but not as behind a first-order or Butterworth low-pass"
    if reason:
        found = Parameter(None, "not_identified", reason, lower, upper, fitted=best.cutoff)
        density = replace(
            density, value=None, status="not_identified", reason=reason, fitted=density.value
        )
    else:
        found = Parameter(best.cutoff, lower=lower, upper=upper)
    return Cutoff(
        found,
        best.order,
        density,
        math.hypot(after, math.sqrt(rounding)),
        gained,
        beside_rounding < _BEYOND_BIC,
    )


@dataclass(frozen=True)
class _Tried:
    """A filter, where its likelihood has a maximum.

    Attributes
    ----------
    score : float
        Half its BIC.
    cost : float
        -log L.
    cutoff : float
        Hz.
    order : int
    floor : bool
        White noise stands behind it beside that of rounding.
    """

    score: float
    cost: float
    cutoff: float
    order: int
    floor: bool

    @property
    def filter(self) -> tuple[float, int, bool]:
        """Cut-off, order and floor."""
        return self.cutoff, self.order, self.floor


class _Fits:
    """Whittle fits of a spectrum for given filters."""

    def __init__(self, spectrum: Spectrum) -> None:
        self.rate = spectrum.rate
        self.lowest = _LOWEST * spectrum.rate
        self.whittle: Whittle = whittle_of(spectrum, 0.5 * spectrum.rate, COARSE)
        whittle = self.whittle
        within = (np.arange(_POINTS) + 0.5) / _POINTS
        width = (spectrum.upper - spectrum.lower)[:, None]
        self.frequency = spectrum.lower[:, None] + width * within
        shortest, longest = (end / spectrum.rate for end in _CORRELATIONS)
        count = 1 + round(_A_DECADE * math.log10(longest / shortest))
        times = np.geomspace(shortest, longest, count)
        times = times[(times > whittle.shortest) & (times < whittle.longest)]
        columns = [whittle.column("F"), whittle.column("K")]
        columns += [whittle.gauss_markov(float(time)) for time in times]
        self.everything_slow = np.column_stack(columns)
        self.slow = [0, 1, *range(2, len(columns), _A_DECADE)]  # those that are in the fits
        self.penalty = 0.5 * math.log(len(spectrum.frequency))
        self.rounded = 0.0  # density of rounding, parts of N^2

    def choose_slow(self, cutoff: float, order: int, floor: bool) -> None:
        """Keep the terms of slow noise that the spectrum asks for behind a filter, by BIC.

        A term that is not there can only add to a fit: together they would pull the cut-off.
        """
        slow: list[int] = []
        self.slow = slow
        best = self.cost(cutoff, order, floor)
        while len(slow) < _MOST_SLOW:
            wider = [
                (self._powers(self._columns(cutoff, order, floor, [*slow, k]))[1], k)
                for k in range(self.everything_slow.shape[1])
                if k not in slow
            ]
            cost, place = min((c + self.penalty * (1 + (k > 1)), k) for c, k in wider)
            if cost >= best:
                break
            best = cost - self.penalty * (1 + (place > 1))
            slow.append(place)

    def unfiltered(self) -> tuple[float, float, float]:
        """Return N without a filter, and half the BIC without and with quantization noise.

        The density of the latter rises towards Nyquist as that of what a steep filter lets fold.
        """
        columns = np.column_stack([self.whittle.column("N"), self.everything_slow])
        plain, cost = self._powers(columns)
        rounded, less = self._powers(np.column_stack([columns, self.whittle.column("Q")]))
        less += self.penalty
        return math.sqrt((plain if cost < less else rounded)[0]), cost, less

    def cost(self, cutoff: float, order: int, floor: bool) -> float:
        """Return -log L at a cut-off."""
        return self._powers(self._columns(cutoff, order, floor))[1]

    def density(self, cutoff: float, order: int, floor: bool) -> tuple[float, float]:
        """Return N before the filter, and the density after it."""
        powers = self._powers(self._columns(cutoff, order, floor))[0]
        return math.sqrt(powers[0]), math.sqrt(powers[-1]) if floor else 0.0

    def highest(self, order: int) -> float:
        """Return the highest cut-off that is looked for, Hz."""
        return (_HIGHEST if order == 1 else _HIGHEST_STEEP) * self.rate

    def tried(self, orders: Sequence[int]) -> list[_Tried]:
        """Return the maxima of the likelihood, the best by BIC first."""
        found = [one for order in orders for one in self._of(order)]
        # A floor that gains next to nothing is none.
        return sorted(found, key=lambda one: one.score + one.floor)

    def _of(self, order: int) -> Iterator[_Tried]:
        """Yield the maxima of the likelihood over the cut-off, without and with a floor."""
        scan = np.linspace(math.log(self.lowest), math.log(self.highest(order)), _SCAN)
        columns = [self._columns(math.exp(x), order, floor=True) for x in scan]
        for floor in (False, True):
            costs = np.array([self._powers(c if floor else c[:, :-1])[1] for c in columns])
            beside = np.pad(costs, 1, constant_values=np.inf)
            for place in np.flatnonzero((costs <= beside[:-2]) & (costs < beside[2:])).tolist():
                best = minimize_scalar(
                    lambda x, floor=floor: self.cost(math.exp(x), order, floor),
                    bounds=(float(scan[max(place - 1, 0)]), float(scan[min(place + 1, _SCAN - 1)])),
                    method="bounded",
                    options={"xatol": 1e-5},
                )
                cutoff, cost = math.exp(best.x), float(best.fun)
                before, after = self.density(cutoff, order, floor)
                # Where what is behind the filter is the greater, it is a process of slow noise.
                if before > after and cutoff > _ABOVE_ENDS * self.lowest:
                    yield _Tried(cost + self.penalty * (1 + floor), cost, cutoff, order, floor)

    def explains(self, cutoff: float, order: int, floor: bool) -> bool:
        """Return whether the filter gives the spectrum where it bends."""
        columns = self._columns(cutoff, order, floor)
        fitted = columns @ self._powers(columns)[0]
        spectrum = self.whittle.spectrum
        bent = spectrum.frequency > min(0.1 * cutoff, spectrum.frequency[-_FEWEST_BINS])
        shown = spectrum.taken(bent)
        judged = goodness(shown.ordinates, shown.density, fitted[bent], shown.frequency, 2 + floor)
        return judged.verdict == "explained"

    def limits(self, cutoff: float, order: int, floor: bool) -> tuple[float, float]:
        """Return the ends of the 95 % interval, by the profile of the likelihood.

        Above Nyquist the profile may have several hollows: the ends are the outermost.
        """
        most = self.cost(cutoff, order, floor) + _HALF_CHI_SQUARED

        def beyond(x: float) -> float:
            return self.cost(math.exp(x), order, floor) - most

        def end_of(sign: float, end: float) -> float:
            inside = math.log(cutoff)
            step, outside = 1e-3, inside
            while sign * ((outside := inside + sign * step) - end) < 0.0:
                if beyond(outside) > 0.0:
                    return float(brentq(beyond, inside, outside, xtol=1e-6))
                inside, step = outside, 2.0 * step
            return end

        ends = []
        for sign, end in ((-1.0, self.lowest), (1.0, self.highest(order))):
            found = end_of(sign, math.log(end))
            first = max(math.log(end), min(found, math.log(_UNFOLDED * self.rate)))
            further = np.linspace(first, found, _BETWEEN, endpoint=False)
            allowed = next((k for k, x in enumerate(further) if beyond(float(x)) < 0.0), None)
            if allowed is not None:
                inside = float(further[allowed])
                outside = float(further[allowed - 1]) if allowed else inside
                found = brentq(beyond, inside, outside, xtol=1e-6) if allowed else inside
            ends.append(math.exp(found))
        return ends[0], ends[1]

    def _columns(
        self, cutoff: float, order: int, floor: bool, slow: Sequence[int] | None = None
    ) -> Array:
        low_pass = LowPass(cutoff, order)
        white = low_pass.folded_power(self.frequency, self.rate).mean(axis=1)
        flicker, walk = self._slow_gains(low_pass)
        kept = self.slow if slow is None else slow
        columns = [white + self.rounded]
        columns += [self.everything_slow[:, k] * (walk if k else flicker) for k in kept]
        return np.column_stack([*columns, np.ones(len(white))] if floor else columns)

    def _slow_gains(self, low_pass: LowPass) -> tuple[Array, Array]:
        """Return what a filter leaves of sampled flicker noise and of a random walk, folds too."""
        f = np.abs(self.frequency[..., None] + self.rate * np.arange(-_SLOW_FOLDS, _SLOW_FOLDS + 1))
        power = low_pass.power(f)
        # As sampled without a filter, sqrt(2 - 2 cos w) stands for w.
        sampled = 2.0 * self.rate * np.sin(np.pi * self.frequency / self.rate)
        angular = 2.0 * np.pi * f
        flicker = sampled * (power / angular).sum(axis=-1)
        walk = sampled**2 * (power / angular**2).sum(axis=-1)
        return flicker.mean(axis=1), walk.mean(axis=1)

    def _powers(self, columns: Array) -> tuple[Array, float]:
        norm = columns.mean(axis=0)
        powers, _, cost = best_powers(
            np.ascontiguousarray(columns / norm), self.whittle.bins(), False
        )
        return powers / norm * self.whittle.scale, cost
