"""The cut-off of a sensor's own low-pass, from the spectrum of its noise at rest.

White noise of density N behind a filter (`imubench_pipeline.estimators.low_pass`) has the density
N^2 G(f); an analogue filter may have its cut-off above Nyquist, where the folds leave little of the
bend, but a long log shows it. N is the density before the filter.

White noise behind an analogue filter of first order is a Gauss-Markov process. What tells the one
from the other is the white noise that stands beside a process up to Nyquist, and not behind a
filter; where it does not show, a correlation of a few samples is a filter's, and a longer one may
be either: then nothing is said.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.goodness import goodness
from imubench_pipeline.estimators.low_pass import Filter, Kind
from imubench_pipeline.estimators.whittle import COARSE, Behind, Terms, Whittle, whittle_of
from imubench_pipeline.estimators.whittle_kernels import best_powers
from imubench_pipeline.sensor_model.low_pass import LowPass
from imubench_pipeline.spectrum import Spectrum

Array = NDArray[np.float64]

_POINTS = 6
"""Frequencies of a bin over which a density is averaged."""

_SCAN, _COARSE_SCAN = 24, 8
"""Cut-offs tried before the best is polished, and to see whether a filter may be there."""

_LOWEST = 1 / 500
_HIGHEST: Mapping[tuple[Kind, int], float] = {
    ("analogue", 1): 4.0,
    ("analogue", 2): 1.0,
    ("analogue", 3): 1.0,
    ("analogue", 4): 1.0,
    ("bilinear", 1): 0.42,
    ("bilinear", 2): 0.42,
    ("bilinear", 3): 0.42,
    ("bilinear", 4): 0.42,
    ("boxcar", 1): 0.222,
}
"""Filters that are looked for, and their highest cut-off, parts of the rate; the lowest is 1/500.
An analogue filter of higher order is there to keep noise from folding, and beyond the rate its
folds are those of a lower one of first order; the shortest mean is one of two samples."""

FAMILY: Sequence[tuple[Kind, int]] = tuple(_HIGHEST)
"""Kind and order of the filters that are tried."""

_CORRELATIONS = (1e2, 1e5)
"""Shortest and longest correlation time of slow noise, sampling intervals."""

_SLOWER = 4.0
"""Least correlation time of slow noise over that of the filter, 1 / (2 pi f_c)."""

_FILTERS, PROCESSES = 3.0, 10.0
"""Correlation in sampling intervals, 1 / (2 pi f_c T), below which white noise beside it is taken
for that behind a filter of first order, and above which it is beside a process."""

_SHOWS = 2.0
"""Log likelihood that white noise beside a process must gain to be there."""

_ENDS_RULE = 0.03
"""Part of the density that the ends of the transform may add; beyond, a bin says nothing."""

_STEEP = 0.4
"""Least over greatest gain in a bin below which its mean is ruled by one end of it."""

_SOMETHING_ELSE = 3.0
"""Measured over expected density from which it is not those ends."""

_A_DECADE = 6
"""Correlation times that are tried."""

_WORTH_TRYING = 1.0
"""Log likelihood that a filter of the coarse scan must gain for more to be tried."""

_NEAR = 1 / 300
"""Part of the cut-off from which frequencies count: drift, as with temperature, is not as any noise
is, and far below the bend it says nothing of it."""

_MOST_SLOW = 4
"""Terms of slow noise."""

_UNFOLDED = 0.3
"""Part of the rate up to which there is one such cut-off only: little is folded."""

_REFINED_WITHIN = math.log(2.0)
"""Distance in log f_c that a joint fit with the noise may move the cut-off."""

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

_SIGMAS = 1.96
_AS_STATED = 1.6
"""Ratio to the stated cut-off up to which a filter is the stated one."""

_TWIN = 0.1
"""Weight of the same first-order filter applied to the samples: it looks like that before the
sampling, whose folds are in N."""

_ALONE = (("N", 0), ("NK", 0), ("NFK", 0), ("NK", 1), ("NFK", 1), ("NK", 2))
"""Letters and processes of the models of noise that are tried."""

_WITH_Q = (Terms("N"), Terms("NK"), Terms("NF"), Terms("NFK"), Terms("NK", 1))
_ABOVE_ENDS = 1.01
_FEWEST_BINS = 24


@dataclass(frozen=True)
class Reading:
    """What a filter that the log allows makes of N.

    Attributes
    ----------
    weight : float
        Of the filter, by its likelihood.
    below, at, above : float
        Logarithm of N at the lower limit of the cut-off, at its best and at its upper limit, less
        that of the filter that was chosen.
    """

    weight: float
    below: float
    at: float
    above: float


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
    kind : str or None
        ``analogue``, ``bilinear`` or ``boxcar``; None where no filter shows.
    or_process : str or None
        Why what bends the spectrum may be a process or a filter, and is not told.
    N_behind : float or None
        N before the filter, if it is one, where that is not told; SI.
    behind : Behind or None
        What the filter leaves of noise in each bin of the whole spectrum.
    ruled : ndarray of bool, shape (b,), or None
        Bins in which the ends of the transform rule, and not the noise.
    readings : sequence of Reading
        Of all filters that the log does not rule out.
    """

    frequency: Parameter
    order: int | None
    N: Parameter
    floor: float
    gained: float
    or_quantization: bool = False
    kind: Kind | None = None
    or_process: str | None = None
    N_behind: float | None = None
    behind: Behind | None = None
    ruled: NDArray[np.bool_] | None = None
    readings: Sequence[Reading] = ()

    @property
    def words(self) -> str:
        """The filter, in words; empty where none shows."""
        cutoff = self.frequency.value or self.frequency.fitted
        if self.kind is None or self.order is None or cutoff is None:
            return ""
        return f"{Filter(self.kind, self.order, cutoff).name} at {cutoff:.4g} Hz"

    def factors(self, number: int, rng: np.random.Generator) -> Array:
        """Return draws of N over its value for the filter that was chosen, shape (number,)."""
        if not self.readings:
            return np.ones(number)
        weight = np.array([one.weight for one in self.readings])
        which = rng.choice(len(weight), number, p=weight / weight.sum())
        below, at, above = (
            np.array([getattr(one, name) for one in self.readings])[which]
            for name in ("below", "at", "above")
        )
        normal = rng.standard_normal(number)
        side = np.where(normal < 0.0, at - below, above - at)
        return np.asarray(np.exp(at + normal / _SIGMAS * side))


def find_cutoff(
    spectrum: Spectrum,
    clear: NDArray[np.bool_] | None = None,
    *,
    filters: Sequence[tuple[Kind, int]] = FAMILY,
    resolution: float = 0.0,
    stated: float | None = None,
) -> Cutoff:
    """Find the low-pass of a sensor from its spectrum, or that there is none.

    Noise alone, with processes of ten sampling intervals and more, and noise behind each filter
    of the family are fitted up to Nyquist; kind and order, and a floor behind the filter beyond
    that of rounding, are chosen by BIC. The interval is that of all filters that the log does not
    rule out: above Nyquist the folds of one may look like those of another.

    Parameters
    ----------
    spectrum : Spectrum
        Of a log, up to Nyquist.
    clear : ndarray of bool, shape (b,), optional
        Bins that no line touches.
    filters : sequence of (str, int)
        Kinds and orders to try, at least one.
    resolution : float
        Step of the register (LSB), SI, where the samples are rounded: white noise of variance
        LSB^2 / 12 behind the filter.
    stated : float, optional
        Cut-off of the sensor's filter as its maker states it, Hz: tells a filter from a process
        where the spectrum does not.

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
    if not fits.may_bend(filters):
        absent = Parameter(None, "absent", "the spectrum shows no low-pass")
        return Cutoff(absent, None, Parameter(fits.unfiltered()[0]), 0.0, 0.0)
    tried = fits.tried(filters)
    rounding = resolution**2 / (12.0 * spectrum.rate)
    ruled = np.zeros(len(used), dtype=np.bool_)
    if tried:
        near = used & (spectrum.frequency > _NEAR * tried[0].cutoff)
        ruled = _ruled_by_ends(spectrum, fits, tried[0], rounding)
        if (near & ~ruled).sum() >= _FEWEST_BINS:
            used = near & ~ruled
            fits = _Fits(spectrum.taken(used))
        if rounding > 0.0:
            fits.rounded = rounding / fits.density(tried[0])[0] ** 2
        fits.choose_slow(tried[0])
        tried = fits.tried(filters)
    N_alone, without, cost_alone, rising = fits.unfiltered()
    behind = fits.behind(tried[0]) if tried else math.inf
    gained = 2.0 * (without - behind)
    beside_rounding = 2.0 * (rising - behind)
    doubt = _process_or_filter(fits, tried, cost_alone, gained, stated)
    if doubt is not None or gained < _BEYOND_BIC or beside_rounding < -_BEYOND_BIC:
        absent = Parameter(None, "absent", "the spectrum shows no low-pass")
        if doubt is None:
            return Cutoff(absent, None, Parameter(N_alone), 0.0, gained)
        reason, before = doubt
        low, high = sorted((N_alone, before))
        unknown = Parameter(None, "not_identified", reason, low, high, fitted=N_alone)
        told = replace(absent, status="not_identified", reason=reason)
        return Cutoff(told, None, unknown, 0.0, gained, or_process=reason, N_behind=before)
    best = tried[0]
    # A floor is taken to be there where it shows only: with it a high cut-off is never told.
    alike = [
        one
        for one in tried
        if one.floor <= best.floor and one.cost + one.floor < best.cost + best.floor + _RULED_OUT
    ]
    limits = [fits.limits(one) for one in alike]
    lower, upper = min(low for low, _ in limits), max(high for _, high in limits)
    N, after = fits.density(best)
    readings = [
        Reading(
            math.exp(best.cost - one.cost),
            *(
                math.log(fits.density(replace(one, cutoff=cutoff))[0] / N)
                for cutoff in (low, one.cutoff, high)
            ),
        )
        for one, (low, high) in zip(alike, limits, strict=True)
    ]
    readings += [
        replace(reading, weight=_TWIN * reading.weight, **_moved(reading, one, spectrum.rate))
        for reading, one in zip(readings, alike, strict=True)
        if one.kind == "analogue" and one.order == 1
    ]
    error = _SIGMAS / math.sqrt(2.0 * float(spectrum.ordinates[used].sum()))
    ends = [end for one in readings for end in (one.below, one.above)]
    density = Parameter(
        N, lower=N * math.exp(min(0.0, *ends) - error), upper=N * math.exp(max(0.0, *ends) + error)
    )
    reason = ""
    if beside_rounding < _BEYOND_BIC:
        reason = (
            "the spectrum rises towards Nyquist, by quantization noise as well as by a low-pass "
            f"with a cut-off from {lower:.4g} to {upper:.4g} Hz"
        )
    elif upper > _WIDEST * lower or upper >= 0.999 * fits.highest(best.kind, best.order):
        reason = f"the log allows cut-offs from {lower:.4g} to {upper:.4g} Hz"
    elif not fits.explains(best):
        reason = (
            f"the spectrum bends, but not as behind any of {len(filters)} filters that were tried"
        )
    if reason:
        found = Parameter(None, "not_identified", reason, lower, upper, fitted=best.cutoff)
        density = replace(
            density, value=None, status="not_identified", reason=reason, fitted=density.value
        )
    else:
        found = Parameter(best.cutoff, lower=lower, upper=upper)
    whole = _Fits(spectrum)
    whole.rounded = fits.rounded
    white, *slow = whole.gains(best)
    return Cutoff(
        found,
        best.order,
        density,
        math.hypot(after, math.sqrt(rounding)),
        gained,
        beside_rounding < _BEYOND_BIC,
        best.kind,
        behind=Behind(white + (after / N) ** 2, *slow),
        ruled=ruled,
        readings=readings,
    )


def _moved(reading: Reading, one: _Tried, rate: float) -> dict[str, float]:
    """Return a reading with the filter applied to the samples, which folds nothing into N."""
    gain = 0.5 * math.log(float(LowPass(one.cutoff).folded_power(0.0, rate)))
    return {name: getattr(reading, name) + gain for name in ("below", "at", "above")}


def _ruled_by_ends(
    spectrum: Spectrum, fits: _Fits, best: _Tried, rounding: float
) -> NDArray[np.bool_]:
    """Return the bins in which the ends of the transform rule, or the filter falls within the bin.

    Those in which something else stands are none of them.
    """
    N = fits.density(best)[0]
    one = best.low_pass
    within = one.white(_inside(spectrum), spectrum.rate) + rounding / N**2
    white = within.mean(axis=1)
    leak = one.leak(spectrum.frequency, spectrum.length, spectrum.rate)
    leak = np.where(spectrum.block == 1, leak, 0.0)
    rules = (leak > _ENDS_RULE * white) | (within.min(axis=1) < _STEEP * within.max(axis=1))
    return np.asarray(rules & (spectrum.density < _SOMETHING_ELSE * N**2 * (white + leak)))


def _inside(spectrum: Spectrum) -> Array:
    """Return frequencies within each bin, shape (b, 6), Hz."""
    within = (np.arange(_POINTS) + 0.5) / _POINTS
    width = (spectrum.upper - spectrum.lower)[:, None]
    return np.asarray(spectrum.lower[:, None] + width * within)


def _process_or_filter(
    fits: _Fits, tried: Sequence[_Tried], cost_alone: float, gained: float, stated: float | None
) -> tuple[str, float] | None:
    """Return why the log does not tell a process from a filter, and N before that; None if it does.

    Only a filter of first order looks like a process, and only where no white noise shows beside
    it up to Nyquist.
    """
    first = next(
        (one for one in tried if (one.kind, one.order) == ("analogue", 1) and not one.floor), None
    )
    if first is None or first.correlation(fits.rate) < PROCESSES:
        return None
    if stated is not None and 1.0 / _AS_STATED < first.cutoff / stated < _AS_STATED:
        return None
    leads = gained >= _BEYOND_BIC and tried[0] == first
    if not leads and first.cost > cost_alone + _SHOWS:
        return None
    if not leads and gained >= _BEYOND_BIC:
        return None  # another filter explains it better than both
    time = 1.0 / (2.0 * math.pi * first.cutoff)
    reason = (
        f"a Gauss-Markov process of T_B = {time:.3g} s and a low-pass of first order at "
        f"{first.cutoff:.3g} Hz look alike: no white noise shows beside it; bandwidth in the "
        "sensor file would tell"
    )
    return reason, fits.density(first)[0]


def refined(found: Cutoff, spectrum: Spectrum, clear: NDArray[np.bool_], terms: Terms) -> Cutoff:
    """Return a low-pass whose cut-off is fitted together with all parameters of a model.

    A process whose correlation is not much longer than that of the filter and the filter share
    the bend: what one has the other has not.

    Parameters
    ----------
    found : Cutoff
        Its kind and order stay.
    spectrum : Spectrum
    clear : ndarray of bool, shape (b,)
        Bins that no line touches, and in which the ends of the transform do not rule.
    terms : Terms
        The model.
    """
    start = found.frequency.value or found.frequency.fitted
    if found.kind is None or found.order is None or start is None or found.behind is None:
        return found
    joint = _Joint(spectrum, clear, found, terms)
    around = math.log(start)
    best = minimize_scalar(
        lambda x: joint.at(x)[0],
        bounds=(around - _REFINED_WITHIN, around + _REFINED_WITHIN),
        method="bounded",
        options={"xatol": 1e-4},
    )
    cost, N = joint.at(float(best.x))
    ends, relative = [], []
    for sign in (-1.0, 1.0):
        step, inside, outside = 2e-3, 0.0, 2e-3
        while outside < _REFINED_WITHIN and joint.at(best.x + sign * outside)[0] < (
            cost + _HALF_CHI_SQUARED
        ):
            step *= 2.0
            inside, outside = outside, outside + step
        for _ in range(4):
            middle = 0.5 * (inside + outside)
            if joint.at(best.x + sign * middle)[0] < cost + _HALF_CHI_SQUARED:
                inside = middle
            else:
                outside = middle
        ends.append(math.exp(best.x + sign * outside))
        relative.append(math.log(joint.at(best.x + sign * outside)[1] / N))
    lower, upper = ends
    cutoff = math.exp(best.x)
    told = upper <= _WIDEST * lower
    reason = None if told else f"the log allows cut-offs from {lower:.4g} to {upper:.4g} Hz"
    frequency = Parameter(
        cutoff if told else None,
        "ok" if told else "not_identified",
        reason,
        lower,
        upper,
        fitted=None if told else cutoff,
    )
    reading = Reading(1.0, relative[0], 0.0, relative[1])
    one = _Tried(0.0, 0.0, found.kind, found.order, cutoff, False)
    readings = [reading]
    if (found.kind, found.order) == ("analogue", 1):
        readings.append(replace(reading, weight=_TWIN, **_moved(reading, one, spectrum.rate)))
    behind = joint.behind(spectrum, cutoff)
    return replace(found, frequency=frequency, behind=behind, readings=readings)


class _Joint:
    """Fits of a model behind a filter, over its cut-off."""

    def __init__(
        self, spectrum: Spectrum, clear: NDArray[np.bool_], found: Cutoff, terms: Terms
    ) -> None:
        self._found, self._terms, self._clear = found, terms, clear
        self._spectrum = spectrum
        shortest = PROCESSES / spectrum.rate
        self._plain = whittle_of(
            spectrum.taken(clear), 0.5 * spectrum.rate, COARSE, shortest=shortest
        )
        self._known: dict[float, tuple[float, float]] = {}
        N = found.N.in_model or 1.0
        self._floor = (found.floor / N) ** 2

    def behind(self, spectrum: Spectrum, cutoff: float) -> Behind:
        """Return what the filter leaves, with what stands behind it."""
        assert self._found.kind is not None and self._found.order is not None
        one = _Tried(0.0, 0.0, self._found.kind, self._found.order, cutoff, False)
        white, flicker, slow = _gains(spectrum, one)
        return Behind(white + self._floor, flicker, slow)

    def at(self, x: float) -> tuple[float, float]:
        """Return -log L and N at a logarithm of the cut-off."""
        if x not in self._known:
            behind = self.behind(self._plain.spectrum, math.exp(x))
            found = self._plain.standing(behind).maximum(self._terms)
            self._known[x] = found.cost, max(found.parameter("N"), 1e-300)
        return self._known[x]


def _gains(spectrum: Spectrum, one: _Tried) -> tuple[Array, Array, Array]:
    """Return what a filter leaves of white noise, of flicker noise and of slow noise."""
    low_pass, frequency = one.low_pass, _inside(spectrum)
    white = low_pass.white(frequency, spectrum.rate).mean(axis=1)
    leak = low_pass.leak(spectrum.frequency, spectrum.length, spectrum.rate)
    flicker = low_pass.flicker(frequency, spectrum.rate).mean(axis=1)
    slow = low_pass.slow(frequency, spectrum.rate).mean(axis=1)
    return white + np.where(spectrum.block == 1, leak, 0.0), flicker, slow


@dataclass(frozen=True)
class _Tried:
    """A filter, where its likelihood has a maximum.

    Attributes
    ----------
    score : float
        Half its BIC.
    cost : float
        -log L.
    kind : str
    order : int
    cutoff : float
        Hz.
    floor : bool
        White noise stands behind it beside that of rounding.
    """

    score: float
    cost: float
    kind: Kind
    order: int
    cutoff: float
    floor: bool

    @property
    def low_pass(self) -> Filter:
        """The filter."""
        return Filter(self.kind, self.order, self.cutoff)

    def correlation(self, rate: float) -> float:
        """Return the correlation time of a filter of first order, sampling intervals."""
        return rate / (2.0 * math.pi * self.cutoff)


class _Fits:
    """Whittle fits of a spectrum for given filters."""

    def __init__(self, spectrum: Spectrum) -> None:
        self.rate = spectrum.rate
        self.lowest = _LOWEST * spectrum.rate
        self.whittle: Whittle = whittle_of(
            spectrum, 0.5 * spectrum.rate, COARSE, shortest=PROCESSES / spectrum.rate
        )
        whittle = self.whittle
        shortest, longest = (end / spectrum.rate for end in _CORRELATIONS)
        count = 1 + round(_A_DECADE * math.log10(longest / shortest))
        times = np.geomspace(shortest, longest, count)
        times = times[(times >= whittle.shortest) & (times < whittle.longest)]
        columns = [whittle.column("F"), whittle.column("K")]
        columns += [whittle.gauss_markov(float(time)) for time in times]
        self.everything_slow = np.column_stack(columns)
        self.times = np.concatenate([[np.inf, np.inf], times])
        self.slow = [0, 1, *range(2, len(columns), _A_DECADE)]  # those that are in the fits
        self.penalty = 0.5 * math.log(len(spectrum.frequency))
        self.rounded = 0.0  # density of rounding, parts of N^2

    def choose_slow(self, one: _Tried) -> None:
        """Keep the terms of slow noise that the spectrum asks for behind a filter, by BIC.

        A term that is not there can only add to a fit: together they would pull the cut-off.
        """
        slow: list[int] = []
        self.slow = slow
        best = self.cost(one)
        while len(slow) < _MOST_SLOW:
            wider = [
                (self._powers(self._columns(one, [*slow, k]))[1], k)
                for k in range(self.everything_slow.shape[1])
                if k not in slow
            ]
            cost, place = min((c + self.penalty * (1 + (k > 1)), k) for c, k in wider)
            if cost >= best:
                break
            best = cost - self.penalty * (1 + (place > 1))
            slow.append(place)

    def unfiltered(self) -> tuple[float, float, float, float]:
        """Return of noise without a filter N, half its BIC, -log L, and half the BIC with Q.

        The density of quantization noise rises towards Nyquist as that of what a steep filter
        lets fold.
        """

        def score(terms: Terms) -> tuple[float, float, float]:
            found = self.whittle.maximum(terms)
            return found.cost + self.penalty * terms.parameters, found.cost, found.parameter("N")

        plain = min(score(Terms(*one)) for one in _ALONE)
        rounded = min(score(Terms("Q" + one.linear, one.gauss_markov)) for one in _WITH_Q)
        return (plain if plain[0] < rounded[0] else rounded)[2], plain[0], plain[1], rounded[0]

    def behind(self, one: _Tried) -> float:
        """Return half the BIC of the best model behind a filter."""
        white, *slow = self.gains(one)
        N, after = self.density(one)
        behind = Behind(white + (after / N) ** 2, *slow)
        shortest = max(PROCESSES / self.rate, _SLOWER / (2.0 * math.pi * one.cutoff))
        spectrum = self.whittle.spectrum
        whittle = whittle_of(spectrum, 0.5 * self.rate, COARSE, shortest=shortest, behind=behind)
        own = 1 + one.floor
        terms = [Terms(*alone) for alone in _ALONE]
        return min(
            whittle.maximum(each).cost + self.penalty * (each.parameters + own) for each in terms
        )

    def cost(self, one: _Tried) -> float:
        """Return -log L at a cut-off."""
        return self._powers(self._columns(one))[1]

    def density(self, one: _Tried) -> tuple[float, float]:
        """Return N before the filter, and the density after it."""
        powers = self._powers(self._columns(one))[0]
        return math.sqrt(powers[0]), math.sqrt(powers[-1]) if one.floor else 0.0

    def highest(self, kind: Kind, order: int) -> float:
        """Return the highest cut-off that is looked for, Hz."""
        return _HIGHEST[kind, order] * self.rate

    def may_bend(self, filters: Sequence[tuple[Kind, int]]) -> bool:
        """Return whether a filter at any of a few cut-offs is nearly as good as none."""
        _, _, alone, _ = self.unfiltered()
        flat = np.column_stack(
            [np.ones(len(self.whittle.spectrum.frequency)), self.everything_slow[:, self.slow]]
        )
        alone = min(alone, self._powers(flat)[1])
        least = min(
            self.cost(_Tried(0.0, 0.0, kind, order, float(cutoff), False))
            for kind, order in filters
            for cutoff in np.geomspace(2.0 * self.lowest, self.highest(kind, order), _COARSE_SCAN)
        )
        return least < alone - _WORTH_TRYING

    def tried(self, filters: Sequence[tuple[Kind, int]]) -> list[_Tried]:
        """Return the maxima of the likelihood, the best by BIC first."""
        found = [one for kind, order in filters for one in self._of(kind, order)]
        # A floor that gains next to nothing is none.
        return sorted(found, key=lambda one: one.score + one.floor)

    def _of(self, kind: Kind, order: int) -> Iterator[_Tried]:
        """Yield the maxima of the likelihood over the cut-off, without and with a floor."""
        scan = np.linspace(math.log(self.lowest), math.log(self.highest(kind, order)), _SCAN)
        start = _Tried(0.0, 0.0, kind, order, 1.0, True)

        def at(x: float, floor: bool) -> _Tried:
            return replace(start, cutoff=math.exp(x), floor=floor)

        columns = [self._columns(at(float(x), True)) for x in scan]
        for floor in (False, True):
            costs = np.array([self._powers(c if floor else c[:, :-1])[1] for c in columns])
            beside = np.pad(costs, 1, constant_values=np.inf)
            for place in np.flatnonzero((costs <= beside[:-2]) & (costs < beside[2:])).tolist():
                best = minimize_scalar(
                    lambda x, floor=floor: self.cost(at(x, floor)),
                    bounds=(float(scan[max(place - 1, 0)]), float(scan[min(place + 1, _SCAN - 1)])),
                    method="bounded",
                    options={"xatol": 1e-5},
                )
                one = replace(at(best.x, floor), cost=float(best.fun))
                if (
                    floor
                    and order == 1
                    and kind != "boxcar"
                    and one.correlation(self.rate) > _FILTERS
                ):
                    continue  # white noise beside a process
                before, after = self.density(one)
                # Where what is behind the filter is the greater, it is a process of slow noise.
                if before > after and one.cutoff > _ABOVE_ENDS * self.lowest:
                    yield replace(one, score=one.cost + self.penalty * (1 + floor))

    def explains(self, one: _Tried) -> bool:
        """Return whether the filter gives the spectrum where it bends."""
        columns = self._columns(one)
        fitted = columns @ self._powers(columns)[0]
        spectrum = self.whittle.spectrum
        bent = spectrum.frequency > min(0.1 * one.cutoff, spectrum.frequency[-_FEWEST_BINS])
        shown = spectrum.taken(bent)
        judged = goodness(
            shown.ordinates, shown.density, fitted[bent], shown.frequency, 2 + one.floor
        )
        return judged.verdict == "explained"

    def limits(self, one: _Tried) -> tuple[float, float]:
        """Return the ends of the 95 % interval, by the profile of the likelihood.

        Above Nyquist the profile may have several hollows: the ends are the outermost.
        """
        most = self.cost(one) + _HALF_CHI_SQUARED

        def beyond(x: float) -> float:
            return self.cost(replace(one, cutoff=math.exp(x))) - most

        def end_of(sign: float, end: float) -> float:
            inside = math.log(one.cutoff)
            step, outside = 1e-3, inside
            while sign * ((outside := inside + sign * step) - end) < 0.0:
                if beyond(outside) > 0.0:
                    return float(brentq(beyond, inside, outside, xtol=1e-6))
                inside, step = outside, 2.0 * step
            return end

        ends = []
        for sign, end in ((-1.0, self.lowest), (1.0, self.highest(one.kind, one.order))):
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

    def gains(self, one: _Tried) -> tuple[Array, Array, Array]:
        """Return what a filter leaves of white noise, with rounding, of flicker and slow noise."""
        white, flicker, slow = _gains(self.whittle.spectrum, one)
        return white + self.rounded, flicker, slow

    def _columns(self, one: _Tried, slow: Sequence[int] | None = None) -> Array:
        white, flicker, gain = self.gains(one)
        kept = np.array(self.slow if slow is None else slow, dtype=np.int64)
        # A process as fast as the filter is the filter.
        kept = kept[self.times[kept] >= _SLOWER / (2.0 * math.pi * one.cutoff)]
        gains = np.where(kept == 0, flicker[:, None], gain[:, None])
        columns = np.column_stack([white, self.everything_slow[:, kept] * gains])
        return np.column_stack([columns, np.ones(len(white))]) if one.floor else columns

    def _powers(self, columns: Array) -> tuple[Array, float]:
        norm = columns.mean(axis=0)
        powers, _, cost = best_powers(
            np.ascontiguousarray(columns / norm), self.whittle.bins(), False
        )
        return powers / norm * self.whittle.scale, cost
