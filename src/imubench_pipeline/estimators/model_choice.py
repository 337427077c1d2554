"""Comparison of the candidate noise models by BIC, and by AIC, over the bins of a spectrum."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erfc, polygamma, psi

from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle
from imubench_pipeline.model.states import GoodnessVerdict
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import spectra

MIN_FIT_CHANCE = 1e-3  # Probability below which a fit is rejected


@dataclass(frozen=True)
class Goodness:
    """Result of the goodness-of-fit tests of a model."""

    deviance: float  # mean deviance of a bin; about 1.0 where the model is right
    chance: float
    """Chance of so large a deviance, or so long runs of bins on one side, if the model is right."""
    verdict: GoodnessVerdict
    where: str  # the frequencies at which the spectrum is furthest from the model


def assess_goodness_of_fit(
    nu: Array, data: Array, density: Array, frequency: Array, parameters: int
) -> Goodness:
    """Test whether a model explains a binned spectrum; the arrays have shape (b,).

    Two tests, each at half the chance: the deviance sum nu (r - 1 - log r) of nu ordinates, with
    r = ``data`` / ``density``, measured over fitted, against the mean and variance of chi-squared
    variates; and the correlation of neighbouring residuals, which shows a shape that the model does
    not have. ``parameters`` is the number of free parameters of the model.
    """
    ratio = np.maximum(data / density, 1e-300)
    deviance = nu * (ratio - 1.0 - np.log(ratio))
    # With x = nu r chi-squared: E[r - 1 - log r] = log(nu/2) - psi(nu/2).
    expected = nu * (np.log(nu / 2.0) - psi(nu / 2.0))
    variance = nu**2 * (polygamma(1, nu / 2.0) - 2.0 / nu)
    bins = len(nu)
    free = max(bins - parameters, 1)
    far = (deviance.sum() - expected.sum() * free / bins) / math.sqrt(float(variance.sum()))
    # Wilson and Hilferty: the cube root of r is very nearly normal.
    ninth = 2.0 / (9.0 * nu)
    residual = (np.cbrt(ratio) - (1.0 - ninth)) / np.sqrt(ninth)
    residual = residual - residual.mean()
    spread = max(float(residual @ residual), 1e-300)
    correlation = float(residual[1:] @ residual[:-1]) / spread * math.sqrt(bins)
    chance = min(1.0, 2.0 * min(0.5 * float(erfc(z / math.sqrt(2.0))) for z in (far, correlation)))
    # The sixth of a decade with the largest mean residual.
    group = np.floor(np.log10(frequency) * 6.0)
    best, text = -1.0, ""
    for number in np.unique(group):
        inside = group == number
        total = float(residual[inside].sum()) / math.sqrt(float(inside.sum()))
        if abs(total) > best:
            best = abs(total)
            first, last = frequency[inside][[0, -1]]
            text = spectra.worst_band(float(first), float(last), best, above=total > 0)
    return Goodness(
        deviance=float(deviance.sum() / expected.sum() * bins / free),
        chance=chance,
        verdict="explained" if chance >= MIN_FIT_CHANCE else "not explained",
        where=text,
    )


PAPERS_MODEL = Terms("NK", 1)  # Model of the papers: N, B, T_B and K

CANDIDATE_MODELS = (
    *(Terms("N"), Terms("NK"), Terms("N", 1), PAPERS_MODEL),
    *(Terms("NF"), Terms("NFK"), Terms("NF", 1), Terms("NFK", 1)),
    *(Terms("N", 2), Terms("NK", 2)),
)
"""Models that are always fitted. A ramp and quantization noise are then added to the best one; if
BIC favours quantization noise, it is added to all of them."""

WALK_LIKE_TIME_FRACTION = 1 / 10  # Of the longest T_B; above it, a process looks like a walk

BIC_PENALTY_UNIT_ROOT = 4.0
"""Added to the BIC of a model with such a process, or with a ramp, but without a random walk, which
often looks mean-reverting or trending (D. Dickey and W. Fuller, J. Am. Stat. Assoc. 74, 1979; C. R.
Nelson and H. Kang, Econometrica 49, 1981)."""

BIC_PENALTY_RARE_TERM = 6.0
"""Added to the BIC of a model for a ramp, and for quantization noise: few sensors have either. With
the plain BIC, 2 to 6 % of simulated logs without a ramp get one in addition to a random walk, and
1 to 3 % get quantization noise."""


@dataclass(frozen=True)
class Candidate:
    """A model, its best fit and its scores."""

    maximum: Maximum
    bic: float
    aic: float
    """BIC = -2 log L + p log(number of bins), with the penalties, and AIC = -2 log L + 2 p."""
    weight: float  # Schwarz weight among the candidates, proportional to e^(-BIC/2)
    akaike_weight: float
    """Akaike weight, proportional to e^(-AIC/2), used to average intervals over models (Burnham and
    Anderson, "Model Selection and Multimodel Inference", 2002, section 2.9). BIC would exclude weak
    terms that the log does not rule out."""
    goodness: Goodness

    @property
    def terms(self) -> Terms:
        """The terms of the model."""
        return self.maximum.terms


def compare_models(whittle: Whittle, *, quantization: bool) -> list[Candidate]:
    """Return all fitted models, sorted by BIC; ``quantization``: whether Q may be visible."""
    bins = len(whittle.spectrum.density)
    tried: dict[Terms, Maximum] = {}

    def bic(maximum: Maximum) -> float:
        """Return the BIC of a fit, with a penalty for terms that few sensors have."""
        terms, times = maximum.terms, maximum.times
        slow = len(times) > 0 and times[-1] > WALK_LIKE_TIME_FRACTION * whittle.longest
        # A ramp is fitted together with a random walk: if K is 0, the ramp replaces the walk.
        replaced = terms.ramp and maximum.parameter("K") == 0.0
        is_walk_like = ("K" not in terms.linear and slow) | replaced
        score = 2.0 * maximum.cost + terms.parameters * math.log(bins)
        score += BIC_PENALTY_UNIT_ROOT * is_walk_like
        return score + BIC_PENALTY_RARE_TERM * (terms.ramp + ("Q" in terms.linear))

    def add(terms: Terms) -> None:
        if terms not in tried and terms.parameters < bins // 4:
            tried[terms] = whittle.maximum(terms)

    for terms in CANDIDATE_MODELS:
        add(terms)
    if quantization:
        plain = min(tried.values(), key=bic)
        rounded = replace(plain.terms, linear="Q" + plain.terms.linear)
        add(rounded)
        if rounded in tried and bic(tried[rounded]) < bic(plain):
            # Without this term, other terms had to fit the quantization noise.
            for terms in CANDIDATE_MODELS:
                add(Terms("Q" + terms.linear, terms.gauss_markov))
    # A single random walk often looks like a ramp: a ramp is accepted only with a random walk.
    best = min(tried.values(), key=bic).terms
    linear = best.linear if "K" in best.linear else best.linear + "K"
    add(Terms(linear, best.gauss_markov, ramp=True))
    maxima = sorted(tried.values(), key=bic)
    bics = np.array([bic(maximum) for maximum in maxima])
    aics = np.array([2.0 * (maximum.cost + maximum.terms.parameters) for maximum in maxima])
    weights, akaike_weights = compute_information_weights(bics), compute_information_weights(aics)
    candidates = []
    for i, maximum in enumerate(maxima):
        spectrum, density = whittle.spectrum, whittle.density(maximum)
        measured = spectrum.ordinates, whittle.data(maximum), density, spectrum.frequency
        goodness = assess_goodness_of_fit(*measured, maximum.terms.parameters)
        scores = float(bics[i]), float(aics[i]), float(weights[i]), float(akaike_weights[i])
        candidates.append(Candidate(maximum, *scores, goodness))
    return candidates


MIN_AKAIKE_WEIGHT = 0.05  # Candidates with a smaller Akaike weight do not enter the intervals


def compute_information_weights(scores: Array) -> Array:
    """Return the weights of models from their scores, BIC or AIC: e^(-score/2), normalised to 1."""
    weights = np.exp(-0.5 * (scores - scores.min()))
    return np.asarray(weights / weights.sum())
