"""How well a log tells what temperature does to it: intervals, and what cannot be told apart.

The noise is drawn from its posterior, over the models that the log does not rule out; the lag from
its likelihood for that noise (flat from 0 to the longest); s and q from their Gaussian for both.
What the register leaves open of the temperature moves the estimate as its drawn paths do.

`mean_error` says how well the mean of a log is known, with the noise that it has.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.posterior import sample
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.thermal.path_errors import path_errors
from imubench_pipeline.estimators.thermal.regression import Regression, Regressors
from imubench_pipeline.estimators.whittle import Maximum, Whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_DRAWS = 1_000
_NOISES = 250
"""Draws of the noise that are kept, over all models."""

_LAGS = 48
_WITHIN = 8.0
"""Log likelihood below the best at which lags are no longer of interest."""

_LEAST_SHARE = 0.05
_LEAST_WALK = 0.3
"""Share of a random walk among the models of the noise, at least."""

_FAVOURED = 4.0
"""BIC by which temperature must be the better: a walk is easily taken for it."""

_AS_TIME = 0.95
"""Share of what the log says of s that a ramp takes: beyond, temperature is time."""

_MONOTONE = 0.9
_EXPLAINED = 0.5
_WIDE_LAG = 0.5
_AS_SHORT = 1.02
"""Width of the interval from 0 over that of the shortest, up to which it is that from 0: draws are
uneven."""

_UPPER_OF_RMS = 2.24
"""The 97.5 % limit of the size of a normal variate, over its standard deviation."""


@dataclass(frozen=True)
class Verdict:
    """What the log tells."""

    sensitivity: Parameter
    quadratic: Parameter
    lag: Parameter
    compensated: bool
    reason: str
    temperature_error: float
    """Standard deviation of the mean of what temperature adds to the log, SI."""
    path_errors: Array
    """(b,): density of what errors of the path leave in each bin, (rad/s)²/Hz or (m/s²)²/Hz."""


def judge(
    regressors: Regressors,
    regression: Regression,
    whittle: Whittle,
    candidates: Sequence[Candidate],
    lags: Array,
    *,
    gained: float,
    rng: np.random.Generator,
) -> Verdict:
    """Say what a settled fit tells.

    ``whittle`` and the noise models, the best first, are of what temperature leaves; the lags,
    shape (l,), s, are those that were scanned; ``gained`` is BIC of the best noise without
    temperature, less that of the fit.
    """
    weights = whittle.spectrum.ordinates / whittle.density(candidates[0].maximum)
    p = regressors.thermal
    errors = path_errors(regressors, regression, weights)
    fine = _fine(regressors, weights, lags)
    betas, drawn_lags = _drawn(regressors, whittle, candidates, fine, rng)
    moved = np.sqrt(np.mean(errors.moved**2, axis=0))
    extra = rng.standard_normal((len(betas), 1)) * moved[None, :]
    betas, drawn_lags = betas[:, :p] + extra[:, :p], np.maximum(drawn_lags + extra[:, p], 0.0)
    lower, upper = np.quantile(betas, [0.025, 0.975], axis=0)
    lower, upper = np.minimum(lower, regression.beta[:p]), np.maximum(upper, regression.beta[:p])
    at_mean = regressors.means(regression.lag)
    excluded = any(lower[i] > 0.0 or upper[i] < 0.0 for i in range(1 + regressors.quadratic))
    confused = _confused(regressors, regression, weights, excluded)
    compensated = excluded and confused is None and gained > _FAVOURED
    reason = confused or _reason(excluded, gained)
    if regressors.settling > 0.0:
        reason += (
            f"; the first {regressors.settling:.0f} s follow it otherwise and do not count for the "
            "sensitivity"
        )
    s = _parameter(float(regression.beta[0]), float(lower[0]), float(upper[0]), confused)
    q = Parameter(None, "absent", "the data do not ask for it")
    if regressors.quadratic:
        q = _parameter(float(regression.beta[1]), float(lower[1]), float(upper[1]), confused)
    return Verdict(
        s,
        q,
        lag_parameter(regression.lag, drawn_lags, float(lags[-1]), compensated),
        compensated,
        reason,
        float(np.std(betas @ at_mean)),
        errors.density,
    )


def _reason(excluded: bool, gained: float) -> str:
    if not excluded:
        return "the interval of the sensitivity contains 0"
    if gained <= _FAVOURED:
        return f"BIC favours the noise with temperature by {gained:.1f} only"
    return f"BIC favours the noise with temperature by {gained:.1f}"


def _parameter(value: float, lower: float, upper: float, confused: str | None) -> Parameter:
    if confused is not None:
        return Parameter(None, "not_identified", confused, lower, upper, fitted=value)
    return Parameter(value, "ok", None, lower, upper)


def lag_parameter(value: float, draws: Array, longest: float, compensated: bool) -> Parameter:
    """Return the lag as it is told, with the shortest interval that holds 95 % of its draws.

    Equal tails would leave out a lag of 0 in every other log that has none. ``value`` is the most
    likely lag, ``longest`` the longest that was looked for, ``draws`` have shape (d,), all in s;
    ``compensated`` says that temperature is taken out of the noise.
    """
    if longest == 0.0:
        return Parameter(None, "absent", "no lag was asked for")
    if not compensated:
        return Parameter(None, "not_identified", "temperature explains nothing that would lag")
    lower, upper = _shortest(draws)
    # A lag at its lower end: one limit, of the whole 5 %.
    below = float(np.quantile(draws, 0.95))
    if value == 0.0 or below < _AS_SHORT * (upper - lower):
        lower, upper = 0.0, below
    lower, upper = min(lower, value), max(upper, value)
    if upper - lower > _WIDE_LAG * longest:
        reason = f"the log allows lags from {lower:.3g} to {upper:.3g} s"
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    if lower == 0.0:
        reason = "its interval contains 0; only that is given"
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    return Parameter(value, "ok", None, lower, upper)


def _shortest(draws: Array) -> tuple[float, float]:
    """Return the shortest interval that holds 95 % of the draws."""
    ordered = np.sort(draws)
    inside = math.ceil(0.95 * len(ordered))
    widths = ordered[inside - 1 :] - ordered[: len(ordered) - inside + 1]
    first = int(np.argmin(widths))
    return float(ordered[first]), float(ordered[first + inside - 1])


def _confused(
    regressors: Regressors, regression: Regression, weights: Array, excluded: bool
) -> str | None:
    """Return why temperature and time cannot be told apart, or None where they can."""
    both = regressors.also(ramp=True).at(regression.lag, weights)
    of_s, of_time = both.information[0, 0], both.information[-1, -1]
    shared = both.information[0, -1] ** 2 / (of_s * of_time)
    if shared > _AS_TIME:
        return (
            "the temperature is too close to a ramp: time alone would explain "
            f"{100 * shared:.0f} % of what the log says of the sensitivity"
        )
    value = regressors.path.value
    if abs(value[-1] - value[0]) > _MONOTONE * regressors.path.range:
        z = both.beta[0] / both.error
        if excluded and abs(z) < SIGMAS:
            return "the temperature only rises or falls, and a drift with time explains as much"
    if not excluded and _explained(regressors, regression) > _EXPLAINED:
        return (
            "temperature follows most of the slow drift, but a random walk as strong as the "
            "log's own would do so by chance"
        )
    return None


def _explained(regressors: Regressors, regression: Regression) -> float:
    """Return the part of the drift, at the frequencies of the temperature, that it follows."""
    products = regressors.products(regression.lag)
    plain = regressors.coefficients.density()[regressors.used]
    nu = regressors.ordinates
    power = nu * products.gram[:, 0, 0]
    upto = int(np.searchsorted(np.cumsum(power), 0.95 * power.sum())) + 1
    part = slice(0, max(upto, 8))
    cross = float(nu[part] @ products.cross[part, 0])
    return cross**2 / float(power[part].sum() * (nu[part] @ plain[part]) + 1e-300)


def _fine(regressors: Regressors, weights: Array, lags: Array) -> Array:
    """Return lags that lie densely where the log allows them, s."""
    low, high = _about_the_likely(regressors, weights, lags)
    if high == low:
        return np.array([low])
    low, high = _about_the_likely(regressors, weights, np.linspace(low, high, _LAGS))
    return np.linspace(low, high, _LAGS)


def _about_the_likely(regressors: Regressors, weights: Array, lags: Array) -> tuple[float, float]:
    """Return the lags of a scan between which, and next to which, the likely ones lie."""
    regressors.prepare(lags)
    gains = np.array([regressors.at(float(lag), weights).log_likelihood_gain for lag in lags])
    likely = np.flatnonzero(gains > gains.max() - _WITHIN)
    return float(lags[max(likely[0] - 1, 0)]), float(lags[min(likely[-1] + 1, len(lags) - 1)])


def shares(candidates: Sequence[Candidate]) -> list[tuple[Candidate, float]]:
    """Return the noise models that the log does not rule out, each with its share of 1.

    They come with the best first.
    """
    chosen = candidates[0]
    alike = {
        place: c.akaike_weight
        for place, c in enumerate(candidates)
        if c is chosen or (c.akaike_weight >= _LEAST_SHARE and not c.terms.ramp)
    }
    walks = (
        place for place, c in enumerate(candidates) if "K" in c.terms.linear and not c.terms.ramp
    )
    walk = next(walks, None)
    if walk is not None:
        # What temperature takes from a walk leaves the fit without one all too easily.
        alike.setdefault(walk, candidates[walk].akaike_weight)
        alike[walk] = max(alike[walk], _LEAST_WALK * sum(alike.values()))
    total = sum(alike.values())
    return [(candidates[place], share / total) for place, share in alike.items()]


def _drawn(
    regressors: Regressors,
    whittle: Whittle,
    candidates: Sequence[Candidate],
    lags: Array,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Return draws of beta (d, p) and of the lag (d,)."""
    alike = shares(candidates)
    regressors.prepare(lags)
    products_of_lags = [regressors.products(float(lag)) for lag in lags]
    cross = np.array([products.cross for products in products_of_lags])
    gram = np.array([products.gram for products in products_of_lags])
    betas, chosen_lags = [], []
    for candidate, share in alike:
        number = max(8, round(_NOISES * share))
        densities = _densities(whittle, candidate.maximum, number, rng)
        weights = regressors.ordinates / densities
        information = np.einsum("db,lbij->dlij", weights, gram, optimize=True)
        information += (
            1e-12
            * information.diagonal(axis1=2, axis2=3)[..., None]
            * np.eye(information.shape[-1])
        )
        target = np.einsum("db,lbi->dli", weights, cross, optimize=True)
        beta = np.linalg.solve(information, target[..., None])[..., 0]
        gain = 0.5 * np.einsum("dli,dli->dl", target, beta)
        mass = np.exp(gain - gain.max(axis=1, keepdims=True)).cumsum(axis=1)
        for _ in range(_DRAWS // _NOISES):
            level = rng.random(number) * mass[:, -1]
            place = np.minimum((mass < level[:, None]).sum(axis=1), len(lags) - 1)
            row = np.arange(number)
            root = np.linalg.cholesky(np.linalg.inv(information[row, place]))
            normal = rng.standard_normal((number, root.shape[-1]))
            betas.append(beta[row, place] + np.einsum("dij,dj->di", root, normal))
            chosen_lags.append(lags[place])
    return np.concatenate(betas), np.concatenate(chosen_lags)


def _densities(whittle: Whittle, maximum: Maximum, number: int, rng: np.random.Generator) -> Array:
    """Return densities of the noise drawn from its posterior, shape (number, b)."""
    posterior = sample(whittle, maximum, rng, 8 * number)
    rows = []
    for row in range(0, 8 * number, 8):
        powers, times = posterior.parameters[row] ** 2, posterior.times[row]
        rows.append(whittle.matrix(maximum.terms, times) @ powers)
    return np.array(rows)


def with_likely_walk(model: NoiseModel, K: Parameter) -> NoiseModel:
    """Return a model with a random walk as strong as it may be where the log does not show one.

    The most likely walk is then often none at all, which would leave the mean all too sure: the rms
    of K over its posterior, half a normal distribution, is taken, from its upper limit.
    """
    if K.status != "absent" or K.upper is None:
        return model
    return replace(model, K=max(model.K, K.upper / _UPPER_OF_RMS))


def mean_error(models: Iterable[tuple[NoiseModel, float]], spectrum: Spectrum) -> float:
    """Return the standard deviation of the mean of a log about the bias at its beginning, SI.

    A random walk counts from 0 at the beginning of the log: sigma^2 = N^2 / D + K^2 D / 3 and, of a
    process of variance v, 2 v T_B / D (1 - T_B / D (1 - e^(-D / T_B))), D long. The models are
    those that the log does not rule out, with their shares of 1: a walk that is too weak to be the
    choice may still carry the mean away. A ramp does by R D / 2, and a walk of one log may look
    like it.
    """
    return math.sqrt(sum(share * _variance(model, spectrum) for model, share in models))


def _variance(model: NoiseModel, spectrum: Spectrum) -> float:
    T, whole = 1.0 / spectrum.rate, spectrum.duration
    # What begins at 0 has been on since the beginning of the log.
    return (model.R * whole / 2.0) ** 2 + sum(
        term.mean_variance(whole, 0.0)
        for term in model.realised(T, whole)
        if term.drive is not None
    )
