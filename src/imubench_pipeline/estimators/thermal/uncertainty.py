"""Intervals of a thermal fit, and tests whether temperature and time are distinguishable.

The noise is drawn from its posterior, the lag from its likelihood for that noise (uniform prior),
s and q from their normal distribution given both. Errors of the drawn temperature paths change s, q
and the lag where they correlate with the temperature; the rest, times s, is additional noise.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.posterior import sample
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.thermal.path import apply_lag_to_path
from imubench_pipeline.estimators.thermal.regression import Regression, Regressors
from imubench_pipeline.estimators.whittle import Terms, Whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as texts

_MAX_DRAWS = 1_000
_NOISE_DRAWS = 250  # draws of the effect, and of the noise, over all models
_LAG_GRID_SIZE = 48
_MAX_DELTA_LOG_LIKELIHOOD = 8.0  # below the best; less likely lags are not on the grid
_MIN_AKAIKE_WEIGHT = 0.05
_MIN_WALK_WEIGHT = 0.3  # minimum weight of a model with a random walk
_MIN_DELTA_BIC = 4.0  # least gain of BIC by temperature, which easily fits a random walk
_MAX_RAMP_FRACTION = 0.95  # of the information on s that a ramp shares; above it they are confused
_MIN_MONOTONE_RANGE = 0.9
_MIN_EXPLAINED_FRACTION = 0.5
_MAX_LAG_WIDTH = 0.5
_MAX_WIDTH_RATIO = 1.02  # of an interval from 0 that is preferred to the shortest one
_UPPER_LIMIT_OVER_RMS = 2.24  # 97.5 % quantile of |x| over its rms, x normal
_MAX_NEGLIGIBLE_ERROR = 0.02  # contribution of path errors to a bin, in its standard errors
_MAX_PATH_ROUNDS = 40
_PATH_TOLERANCE = 1e-3
_MIN_NOISE_FRACTION = 0.1  # of the power of a bin, so that each bin keeps some weight


@dataclass(frozen=True)
class Verdict:
    """Result of the assessment of a thermal fit."""

    sensitivity: Parameter
    quadratic: Parameter
    lag: Parameter
    compensated: bool
    reason: str
    temperature_error: float
    """Standard deviation of the mean effect of temperature on the log, SI."""
    path_errors: Array
    """(b,): density of the residual of path errors in each bin, (rad/s)²/Hz or (m/s²)²/Hz."""


def assess_fit(
    regressors: Regressors,
    regression: Regression,
    whittle: Whittle,
    candidates: Sequence[Candidate],
    lags: Array,
    *,
    gained: float,
    rng: np.random.Generator,
) -> Verdict:
    """Return the parameters of a converged fit with intervals and reasons.

    ``whittle`` and the noise models, best first, are fits to the compensated log; ``lags``, shape
    (l,), s, are the scanned lags; ``gained`` is the gain of BIC by temperature.
    """
    weights = whittle.spectrum.ordinates / whittle.density(candidates[0].maximum)
    p = regressors.thermal
    changes, residual = compute_path_errors(regressors, regression, weights)
    low, high = _bracket_likely_lags(regressors, weights, lags)
    fine = np.array([low])
    if high != low:
        coarse = np.linspace(low, high, _LAG_GRID_SIZE)
        low, high = _bracket_likely_lags(regressors, weights, coarse)
        fine = np.linspace(low, high, _LAG_GRID_SIZE)
    betas, drawn_lags = _draw_effect(regressors, whittle, candidates, fine, rng)
    moved = np.sqrt(np.mean(changes**2, axis=0))
    extra = rng.standard_normal((len(betas), 1)) * moved[None, :]
    betas, drawn_lags = betas[:, :p] + extra[:, :p], np.maximum(drawn_lags + extra[:, p], 0.0)
    lower, upper = np.quantile(betas, [0.025, 0.975], axis=0)
    lower, upper = np.minimum(lower, regression.beta[:p]), np.maximum(upper, regression.beta[:p])
    at_mean = regressors.means(regression.lag)
    excluded = any(lower[i] > 0.0 or upper[i] < 0.0 for i in range(1 + regressors.quadratic))
    confused = _explain_confusion(regressors, regression, weights, excluded)
    compensated = excluded and confused is None and gained > _MIN_DELTA_BIC
    reason = confused or texts.SENSITIVITY_WITH_ZERO
    if excluded and confused is None:
        reason = texts.temperature_preferred(gained, enough=gained > _MIN_DELTA_BIC)
    if regressors.settling > 0.0:
        reason += f"; {texts.settling_excluded(regressors.settling)}"
    s = _make_parameter(float(regression.beta[0]), float(lower[0]), float(upper[0]), confused)
    q = Parameter(None, "absent", texts.ABSENT)
    if regressors.quadratic:
        q = _make_parameter(float(regression.beta[1]), float(lower[1]), float(upper[1]), confused)
    lag = assess_lag(regression.lag, drawn_lags, float(lags[-1]), compensated)
    return Verdict(s, q, lag, compensated, reason, float(np.std(betas @ at_mean)), residual)


def _make_parameter(value: float, lower: float, upper: float, confused: str | None) -> Parameter:
    if confused is not None:
        return Parameter(None, "not_identified", confused, lower, upper, fitted=value)
    return Parameter(value, "ok", None, lower, upper)


def assess_lag(value: float, draws: Array, longest: float, compensated: bool) -> Parameter:
    """Return the lag with the shortest interval that contains 95 % of its draws, shape (d,), s.

    Equal tails would exclude a lag of 0 in half of the logs without a lag. ``value`` is the most
    likely lag, ``longest`` the longest that was tried, s.
    """
    if longest == 0.0:
        return Parameter(None, "absent", texts.LAG_NOT_ASKED)
    if not compensated:
        return Parameter(None, "not_identified", texts.NO_EFFECT_TO_LAG)
    ordered, inside = np.sort(draws), math.ceil(0.95 * len(draws))
    first = int(np.argmin(ordered[inside - 1 :] - ordered[: len(ordered) - inside + 1]))
    lower, upper = float(ordered[first]), float(ordered[first + inside - 1])
    # A lag at its lower end: one-sided interval with 5 % above.
    below = float(np.quantile(draws, 0.95))
    if value == 0.0 or below < _MAX_WIDTH_RATIO * (upper - lower):
        lower, upper = 0.0, below
    lower, upper = min(lower, value), max(upper, value)
    if upper - lower > _MAX_LAG_WIDTH * longest:
        reason = texts.lag_range(lower, upper)
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    if lower == 0.0:
        reason = texts.interval_with_zero(at_limit=False)
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    return Parameter(value, "ok", None, lower, upper)


def _explain_confusion(
    regressors: Regressors, regression: Regression, weights: Array, excluded: bool
) -> str | None:
    """Return why temperature and time are not distinguishable, or None."""
    both = regressors.also(ramp=True).at(regression.lag, weights)
    of_s, of_time = both.information[0, 0], both.information[-1, -1]
    shared = both.information[0, -1] ** 2 / (of_s * of_time)
    if shared > _MAX_RAMP_FRACTION:
        return texts.temperature_like_ramp(float(shared))
    value = regressors.path.value
    if abs(value[-1] - value[0]) > _MIN_MONOTONE_RANGE * regressors.path.range:
        z = both.beta[0] / both.error
        if excluded and abs(z) < SIGMAS:
            return texts.MONOTONE_TEMPERATURE
    explained = 0.0 if excluded else _compute_explained_fraction(regressors, regression)
    return texts.TEMPERATURE_BY_CHANCE if explained > _MIN_EXPLAINED_FRACTION else None


def _compute_explained_fraction(regressors: Regressors, regression: Regression) -> float:
    """Return the fraction of the drift, at the frequencies of the temperature, that it explains."""
    products = regressors.products(regression.lag)
    plain = regressors.coefficients.density()[regressors.used]
    nu = regressors.ordinates
    power = nu * products.gram[:, 0, 0]
    upto = int(np.searchsorted(np.cumsum(power), 0.95 * power.sum())) + 1
    part = slice(0, max(upto, 8))
    cross = float(nu[part] @ products.cross[part, 0])
    return cross**2 / float(power[part].sum() * (nu[part] @ plain[part]) + 1e-300)


def _bracket_likely_lags(
    regressors: Regressors, weights: Array, lags: Array
) -> tuple[float, float]:
    """Return the scanned lags that bracket all likely ones."""
    regressors.prepare(lags)
    gains = np.array([regressors.at(float(lag), weights).log_likelihood_gain for lag in lags])
    likely = np.flatnonzero(gains > gains.max() - _MAX_DELTA_LOG_LIKELIHOOD)
    return float(lags[max(likely[0] - 1, 0)]), float(lags[min(likely[-1] + 1, len(lags) - 1)])


def weigh_models(candidates: Sequence[Candidate]) -> list[tuple[Candidate, float]]:
    """Return the noise models that the log does not exclude, each with its normalised weight.

    The best model is first.
    """
    chosen = candidates[0]
    alike = {
        place: c.akaike_weight
        for place, c in enumerate(candidates)
        if c is chosen or (c.akaike_weight >= _MIN_AKAIKE_WEIGHT and not c.terms.ramp)
    }
    walks = (
        place for place, c in enumerate(candidates) if "K" in c.terms.linear and not c.terms.ramp
    )
    walk = next(walks, None)
    if walk is not None:
        # Temperature can explain part of a walk, so that the fit may wrongly have none.
        alike.setdefault(walk, candidates[walk].akaike_weight)
        alike[walk] = max(alike[walk], _MIN_WALK_WEIGHT * sum(alike.values()))
    total = sum(alike.values())
    return [(candidates[place], share / total) for place, share in alike.items()]


def _draw_effect(
    regressors: Regressors,
    whittle: Whittle,
    candidates: Sequence[Candidate],
    lags: Array,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Return draws of beta (d, p) and of the lag (d,)."""
    regressors.prepare(lags)
    products_of_lags = [regressors.products(float(lag)) for lag in lags]
    cross = np.array([products.cross for products in products_of_lags])
    gram = np.array([products.gram for products in products_of_lags])
    betas, chosen_lags = [], []
    for candidate, share in weigh_models(candidates):
        number = max(8, round(_NOISE_DRAWS * share))
        # Densities of the noise, drawn from its posterior, shape (number, b).
        posterior = sample(whittle, candidate.maximum, rng, 8 * number)
        densities = [
            whittle.matrix(candidate.terms, posterior.times[row]) @ posterior.parameters[row] ** 2
            for row in range(0, 8 * number, 8)
        ]
        weights = regressors.ordinates / np.array(densities)
        information = np.einsum("db,lbij->dlij", weights, gram, optimize=True)
        diagonal = information.diagonal(axis1=2, axis2=3)[..., None]
        information += 1e-12 * diagonal * np.eye(information.shape[-1])
        target = np.einsum("db,lbi->dli", weights, cross, optimize=True)
        beta = np.linalg.solve(information, target[..., None])[..., 0]
        gain = 0.5 * np.einsum("dli,dli->dl", target, beta)
        mass = np.exp(gain - gain.max(axis=1, keepdims=True)).cumsum(axis=1)
        for _ in range(_MAX_DRAWS // _NOISE_DRAWS):
            level = rng.random(number) * mass[:, -1]
            place = np.minimum((mass < level[:, None]).sum(axis=1), len(lags) - 1)
            row = np.arange(number)
            root = np.linalg.cholesky(np.linalg.inv(information[row, place]))
            normal = rng.standard_normal((number, root.shape[-1]))
            betas.append(beta[row, place] + np.einsum("dij,dj->di", root, normal))
            chosen_lags.append(lags[place])
    return np.concatenate(betas), np.concatenate(chosen_lags)


def add_likely_walk(model: NoiseModel, K: Parameter) -> NoiseModel:
    """Return a model with the rms of K over its posterior, if K is absent from the fit.

    The fit is often 0, and the error of the mean would be too small. The posterior is half normal.
    """
    if K.status != "absent" or K.upper is None:
        return model
    return replace(model, K=max(model.K, K.upper / _UPPER_LIMIT_OVER_RMS))


def compute_mean_error(models: Iterable[tuple[NoiseModel, float]], spectrum: Spectrum) -> float:
    """Return the standard deviation of the mean of a log about the bias at its beginning, SI.

    A random walk starts at 0: sigma^2 = N^2 / D + K^2 D / 3 and, of a process of variance v, 2 v
    T_B / D (1 - T_B / D (1 - e^(-D / T_B))), D long. A ramp contributes R D / 2, because a random
    walk in one log may look like a ramp. The models have normalised weights.
    """
    T, whole = 1.0 / spectrum.rate, spectrum.duration
    total = 0.0
    for model, share in models:
        # Terms that begin at 0 do so at the beginning of the log.
        terms = (term for term in model.realised(T, whole) if term.drive is not None)
        variance = sum(term.mean_variance(whole, 0.0) for term in terms)
        total += share * ((model.R * whole / 2.0) ** 2 + variance)
    return math.sqrt(total)


def compute_path_errors(
    regressors: Regressors, regression: Regression, weights: Array
) -> tuple[Array, Array]:
    """Return the effect of the errors of the drawn paths on an estimate, to first order.

    They are the changes of the p coefficients of temperature and the lag, (d, p + 1), and the mean
    density of the residual in each bin, shape (b,). ``weights``: as for `Regressors.at`.
    """
    path, p = regressors.path, regressors.thermal
    knots, slope = regressors.knots(regression.lag), regressors.slope(regression)
    step = max(
        0.05 * regression.lag, 0.5 * float(np.median(np.diff(path.sample))) / regressors.rate
    )
    by_lag = slope * (regressors.knots(regression.lag + step) - knots) / step
    columns = [
        *regressors.columns(regression.lag),
        *regressors.coefficients.of_knots(path, [by_lag]),
    ]
    full = np.zeros(len(regressors.used))
    full[regressors.used] = weights
    gram = regressors.coefficients.products(columns).gram
    information = np.einsum("b,bij->ij", full, gram)
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    # A poorly determined lag must not absorb the error of the path.
    inverse = np.linalg.inv(information / np.outer(scale, scale) + 1e-6 * np.eye(len(scale)))
    errors = [
        slope * apply_lag_to_path(path, draw - path.value, regressors.rate, regression.lag)
        for draw in path.draws
    ]
    moved, density = [], np.zeros(len(full))
    for other in regressors.coefficients.of_knots(path, errors):
        shared = regressors.coefficients.products([*columns, other]).gram[:, -1]
        own = inverse @ ((full @ shared[:, :-1]) / scale) / scale
        moved.append(own)
        density += shared[:, -1] - 2.0 * shared[:, :-1] @ own
        density += np.einsum("i,bij,j->b", own, gram, own)
    at = np.array(moved)
    changes = np.column_stack([at[:, :p], at[:, -1]])
    return changes, np.maximum(density / len(errors), 0.0)


def subtract_path_errors(
    left: Spectrum, used: NDArray[np.bool_], whittle: Whittle, terms: Terms, errors: Array
) -> Spectrum:
    """Return the spectrum of the noise alone, without the residual of path errors.

    ``errors``, shape (b,), is the density P of the residual. A bin with the density S of the noise
    has S / (S + P) of its density and (S / (S + P))^2 of its ordinates left, iterated. Bins that
    are not ``used`` are unchanged, and all bins if P is negligible. (D. A. Harville, "Maximum
    likelihood approaches to variance component estimation", J. Am. Stat. Assoc. 72, 1977.)
    """
    fitted, added = left.select(used), errors[used]
    density = whittle.density(whittle.of(fitted).maximum(terms))
    if not (added * np.sqrt(fitted.ordinates) > _MAX_NEGLIGIBLE_ERROR * density).any():
        return left
    part_of_noise = np.ones(len(added))
    for _ in range(_MAX_PATH_ROUNDS):
        before = part_of_noise
        part_of_noise = np.maximum(density / (density + added), _MIN_NOISE_FRACTION)
        if np.abs(part_of_noise - before).max() < _PATH_TOLERANCE:
            break
        own = whittle.of(_of_noise(fitted, part_of_noise))
        density = own.density(own.maximum(terms))
    everywhere = np.ones(len(used))
    everywhere[used] = part_of_noise
    return _of_noise(left, everywhere)


def _of_noise(spectrum: Spectrum, part: Array) -> Spectrum:
    """Return the spectrum of noise that is a fraction of the power of each bin."""
    return replace(
        spectrum,
        ordinates=spectrum.ordinates * part**2,
        density=spectrum.density * part,
        cross=spectrum.cross * part,
        ramp=spectrum.ramp * part,
    )
