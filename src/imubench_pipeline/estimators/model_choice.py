"""Which model the data favour: candidates compared by BIC over the bins, AIC beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from imubench_pipeline.estimators.goodness import Goodness, goodness
from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle
from imubench_pipeline.typing import Array

PAPERS = Terms("NK", 1)
"""N, B, T_B and K: the model of the papers."""

CANDIDATES = (
    Terms("N"),
    Terms("NK"),
    Terms("N", 1),
    PAPERS,
    Terms("NF"),
    Terms("NFK"),
    Terms("NF", 1),
    Terms("NFK", 1),
    Terms("N", 2),
    Terms("NK", 2),
)
"""Models that are always tried; then a ramp and quantization noise are added to the best, the
latter to all of them where it is favoured."""

LIKE_A_WALK = 1 / 10
"""Part of the longest correlation time beyond which a process looks like a random walk."""

UNIT_ROOT = 4.0
"""BIC by which such a process, or a ramp, must be the better where there is no walk: a walk often
looks as if it came back to its mean, or had a trend (D. Dickey and W. Fuller, J. Am. Stat. Assoc.
74, 1979; C. R. Nelson and H. Kang, Econometrica 49, 1981)."""

UNLIKELY = 6.0
"""BIC by which a model with a ramp, or with quantization noise, must be the better. Few sensors
have either, and both take what chance leaves at an end of the spectrum: with the plain BIC 2 to 6 %
of simulated logs without a ramp get one beside a random walk, and 1 to 3 % quantization noise."""


@dataclass(frozen=True)
class Candidate:
    """A model, its best fit and its scores."""

    maximum: Maximum
    bic: float
    aic: float
    """2 (-log L) + p log(number of bins), and + 2 p. Where a Gauss-Markov process or a ramp stands
    for a random walk, 4 is added to the BIC; for a ramp and for quantization noise, 6 each."""
    weight: float  # weight of the model among the candidates, proportional to e^(-BIC/2)
    share: float
    """That of e^(-AIC/2): an interval over models must not hang on a choice that the log hardly
    makes, and BIC leaves out what is weak."""
    goodness: Goodness

    @property
    def terms(self) -> Terms:
        """The terms of the model."""
        return self.maximum.terms


def compare(whittle: Whittle, *, quantization: bool) -> list[Candidate]:
    """Fit all candidates and sort them, the best by BIC first.

    With ``quantization`` that noise is tried too: the band must reach frequencies that show it.
    """
    bins = len(whittle.spectrum.density)
    tried: dict[Terms, Maximum] = {}
    bic = partial(_bic, bins=bins, longest=whittle.longest)

    def add(terms: Terms) -> None:
        if terms not in tried and terms.parameters < bins // 4:
            tried[terms] = whittle.maximum(terms)

    for terms in CANDIDATES:
        add(terms)
    if quantization:
        without_rounding = min(tried.values(), key=bic)
        rounded = Terms("Q" + without_rounding.terms.linear, without_rounding.terms.gauss_markov)
        add(rounded)
        if rounded in tried and bic(tried[rounded]) < bic(without_rounding):
            # Without quantization noise other terms had to stand for it.
            for terms in CANDIDATES:
                add(Terms("Q" + terms.linear, terms.gauss_markov))
    # A single walk often looks like a ramp: a ramp is only believed beside a random walk.
    best = min(tried.values(), key=bic).terms
    linear = best.linear if "K" in best.linear else best.linear + "K"
    add(Terms(linear, best.gauss_markov, ramp=True))
    order = sorted(tried.values(), key=bic)
    bics = np.array([bic(maximum) for maximum in order])
    aics = np.array([2.0 * (maximum.cost + maximum.terms.parameters) for maximum in order])
    weights, shares = relative(bics), relative(aics)
    return [
        Candidate(
            maximum,
            float(bics[i]),
            float(aics[i]),
            float(weights[i]),
            float(shares[i]),
            goodness(
                whittle.spectrum.ordinates,
                whittle.data(maximum),
                whittle.density(maximum),
                whittle.spectrum.frequency,
                maximum.terms.parameters,
            ),
        )
        for i, maximum in enumerate(order)
    ]


def _bic(maximum: Maximum, bins: int, longest: float) -> float:
    """Return the BIC of a fit, with what is asked of a model that few sensors have."""
    terms, times = maximum.terms, maximum.times
    slow = len(times) > 0 and times[-1] > LIKE_A_WALK * longest
    like_a_walk = "K" not in terms.linear and slow
    # A ramp is tried beside a walk: it stands for the walk where none is left.
    like_a_walk |= terms.ramp and maximum.parameter("K") == 0.0
    unlikely = terms.ramp + ("Q" in terms.linear)
    return (
        2.0 * maximum.cost
        + terms.parameters * math.log(bins)
        + UNIT_ROOT * like_a_walk
        + UNLIKELY * unlikely
    )


def rescore(candidates: Sequence[Candidate], gained: Mapping[Terms, float]) -> list[Candidate]:
    """Return candidates sorted anew, by what each model, with a ramp or without, gains."""
    gains = [gained.get(replace(candidate.terms, ramp=False), 0.0) for candidate in candidates]
    bics = np.array([candidate.bic for candidate in candidates]) - 2.0 * np.array(gains)
    aics = np.array([candidate.aic for candidate in candidates]) - 2.0 * np.array(gains)
    weights, shares = relative(bics), relative(aics)
    return [
        replace(
            candidates[i],
            bic=float(bics[i]),
            aic=float(aics[i]),
            weight=float(weights[i]),
            share=float(shares[i]),
        )
        for i in np.argsort(bics, kind="stable")
    ]


LEAST_SHARE = 0.05
"""Candidates of a smaller share by AIC do not enter the intervals."""


def relative(scores: Array) -> Array:
    """Return the shares of models by their scores, BIC or AIC; their sum is 1."""
    weights = np.exp(-0.5 * (scores - scores.min()))
    return np.asarray(weights / weights.sum())


def disagreement(candidates: Sequence[Candidate]) -> str | None:
    """Say so where AIC favours another model than BIC."""
    by_aic = min(candidates, key=lambda candidate: candidate.aic)
    chosen = candidates[0]
    if by_aic is chosen:
        return None
    return (
        f"AIC favours {by_aic.terms.name} by {chosen.aic - by_aic.aic:.1f}, "
        f"BIC {chosen.terms.name} by {by_aic.bic - chosen.bic:.1f}"
    )
