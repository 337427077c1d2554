"""The cut-off of a low-pass fitted together with the noise behind it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from imubench_pipeline.cutoff import WIDEST, Cutoff, Reading, also_after_sampling
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.filter_fits import HALF_CHI_SQUARED, PROCESSES, Tried, gains
from imubench_pipeline.estimators.whittle import COARSE, Behind, Terms, whittle_of
from imubench_pipeline.spectrum import Spectrum

_REFINED_WITHIN = math.log(2.0)
"""Distance in log f_c that a joint fit with the noise may move the cut-off."""


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
            cost + HALF_CHI_SQUARED
        ):
            step *= 2.0
            inside, outside = outside, outside + step
        for _ in range(4):
            middle = 0.5 * (inside + outside)
            if joint.at(best.x + sign * middle)[0] < cost + HALF_CHI_SQUARED:
                inside = middle
            else:
                outside = middle
        ends.append(math.exp(best.x + sign * outside))
        relative.append(math.log(joint.at(best.x + sign * outside)[1] / N))
    one = Tried(0.0, 0.0, found.kind, found.order, math.exp(best.x), False)
    lower, shown, upper = (
        replace(one, cutoff=cutoff).low_pass.half_power(spectrum.rate)
        for cutoff in (ends[0], one.cutoff, ends[1])
    )
    told = upper <= WIDEST * lower
    reason = None if told else f"the log allows cut-offs from {lower:.4g} to {upper:.4g} Hz"
    frequency = Parameter(
        shown if told else None,
        "ok" if told else "not_identified",
        reason,
        lower,
        upper,
        fitted=None if told else shown,
    )
    reading = Reading(1.0, relative[0], 0.0, relative[1])
    readings = [reading]
    if one.is_first_order_analogue:
        readings.append(also_after_sampling(reading, one, spectrum.rate))
    behind = joint.behind(spectrum, one.cutoff)
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
        one = Tried(0.0, 0.0, self._found.kind, self._found.order, cutoff, False)
        white, flicker, slow = gains(spectrum, one)
        return Behind(white + self._floor, flicker, slow)

    def at(self, x: float) -> tuple[float, float]:
        """Return -log L and N at a logarithm of the cut-off."""
        if x not in self._known:
            behind = self.behind(self._plain.spectrum, math.exp(x))
            found = self._plain.standing(behind).maximum(self._terms)
            self._known[x] = found.cost, max(found.parameter("N"), 1e-300)
        return self._known[x]
