"""Temperature effect of a channel: sensitivity, square, lag, and the bias at the mean temperature.

y(t) = bias + s (T_L(t) - T_0) + q (T_L(t) - T_0)^2 + noise, with T_L behind a first-order lag L and
T_0 the mean temperature (`regression`).
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.estimators.deterministic.means import average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates
from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.estimators.thermal.regression import Effect, Posterior, Regression, Shape
from imubench_pipeline.estimators.whittle import Maximum, make_noise_model
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as texts

_MIN_EXTRA_GAIN = 6.0  # least gain of log likelihood beyond BIC, by the square or by settling
_SETTLING_FRACTIONS = (1 / 64, 1 / 32, 1 / 16)  # times of settling, over the log
_MAX_RAMP_FRACTION = 0.95  # share of the information on s that a ramp has too; above: confused
_MAX_LAG_WIDTH = 0.5  # width of the interval of a lag that has a value, over the longest lag


@dataclass(frozen=True)
class ThermalFit:
    """Temperature dependence of a channel."""

    reference: float  # T_0, the mean temperature, °C
    sensitivity: Parameter  # s, SI per K
    quadratic: Parameter  # q, SI per K²; ``absent`` where it is not in the model
    lag: Parameter  # L, s
    bias: Parameter  # mean of the log, at T_0, SI
    compensated: bool  # the interval of s (or q) excludes 0, and BIC favours temperature
    reason: str  # for ``compensated``
    effect: Array  # (k,): of temperature at the knots of the path, SI; 0 without compensation
    relative_error: float  # standard deviation of the effect over its rms; 0 without compensation
    path: TemperaturePath

    def compensate(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Yield the blocks of the log, in order, SI, with the effect of temperature removed."""
        return add_temperature_effect(blocks, self.path, -self.effect)


def add_temperature_effect(
    blocks: Iterable[Array], path: TemperaturePath, effect: Array
) -> Iterator[Array]:
    """Yield the blocks of a log with ``effect`` added: SI, at the knots of ``path``, shape (k,)."""
    reached = 0
    for values in blocks:
        yield values + path.at(np.arange(reached, reached + len(values)), effect)
        reached += len(values)


def fit_temperature(
    blocks: Iterable[Array],
    samples: int,
    rate: float,
    path: TemperaturePath,
    *,
    highest: float | None = None,
) -> ThermalFit:
    """Estimate the temperature effect of a channel together with its noise.

    ``blocks`` are the log in order, in SI, NaN where a sample is missing; ``path`` is its
    temperature, in the same segments. The noise is used up to the frequency ``highest``, Hz, by
    default all. The square of the temperature is in the model if BIC favours it. The lag is at most
    a twentieth of the longest segment, and half an hour. Generalised least squares: A. C. Aitken,
    Proc. R. Soc. Edinburgh 55, 1935; restricted likelihood: H. D. Patterson and R. Thompson,
    Biometrika 58, 1971.
    """
    means = average_blocks(blocks, samples, rate, path.segments)
    if not means.parts:
        return _describe_nothing(path, Parameter(None, "not_identified", texts.SHORT_LOG))
    level = float(np.concatenate([part.mean for part in means.parts]).mean())
    ordinates = Ordinates(means, highest)
    if not ordinates.is_usable:
        return _describe_nothing(path, Parameter(level, "not_identified", texts.SHORT_LOG))
    regression = Regression(ordinates, path, rate)
    noise, density = regression.plain
    plain = regression.posterior(None, noise, density, np.zeros(1))
    length = sum(ordinates.sizes) * means.interval
    bias = _limit_bias(level, _compute_mean_error(noise, plain, length, rate))
    if not (path.range > 0.0 and path.range >= 2.0 * float(np.median(path.deviation))):
        return _describe_nothing(path, bias, texts.small_temperature_range(path.range))
    effect = _choose_shape(regression, length)
    lags = regression.bracket_likely_lags(effect)
    effect = regression.fit(effect.shape, lags)
    before = ordinates.log_likelihood(ordinates.coefficient, density)
    fitted = _describe(regression, effect, lags, before, bias, length)
    if not fitted.compensated:
        # Without an effect, the fitted lag only makes a random walk look like temperature.
        lags = np.zeros(1)
        effect = regression.fit(effect.shape, lags)
        fitted = replace(_describe(regression, effect, lags, before, bias, length), lag=fitted.lag)
    return fitted


def _choose_shape(regression: Regression, length: float) -> Effect:
    """Return the fit with the terms that the log supports: the square, and settling."""
    needed = 0.5 * math.log(regression.bins) + _MIN_EXTRA_GAIN
    effect = regression.fit(Shape(), regression.lags)
    for _ in range(2):
        shape = effect.shape
        wider = [] if shape.quadratic else [replace(shape, quadratic=True)]
        if not shape.settling:
            wider += [replace(shape, settling=part * length) for part in _SETTLING_FRACTIONS]
        gains = [regression.gain(effect, each) for each in (shape, *wider)]
        if not wider or max(gains) < gains[0] + needed:
            break
        other = regression.fit(wider[int(np.argmax(gains[1:]))], regression.lags)
        if other.log_likelihood < effect.log_likelihood + needed:
            break
        effect = other
    return effect


def _describe(
    regression: Regression,
    effect: Effect,
    lags: Array,
    before: float,
    bias: Parameter,
    length: float,
) -> ThermalFit:
    """Return the result; ``before`` is the log likelihood without an effect, ``bias`` that bias."""
    path = regression.path
    posterior = regression.posterior(effect, effect.noise, effect.density, lags)
    gained = 2.0 * (effect.log_likelihood - before) - effect.free * math.log(regression.bins)
    changes = regression.path_errors(effect)
    moved = changes.T @ changes / len(changes)
    p = len(effect.beta)
    covariance = posterior.covariance + moved[:p, :p]
    error = SIGMAS * np.sqrt(np.diag(covariance))
    lower, upper = effect.beta - error, effect.beta + error
    columns = np.vstack([regression.columns(effect.lag, Shape()), regression.time])
    information = (columns * regression.ordinates.weights(effect.density)) @ columns.T
    shared = float(information[0, 1] ** 2 / (information[0, 0] * information[1, 1]))
    confused = texts.temperature_like_ramp(shared) if shared > _MAX_RAMP_FRACTION else None
    of_temperature = slice(1 + effect.shape.quadratic)
    excluded = bool(((lower > 0.0) | (upper < 0.0))[of_temperature].any())
    compensated = excluded and confused is None and gained > 0.0
    excluding = texts.temperature_preferred(gained) if excluded else texts.SENSITIVITY_WITH_ZERO
    reason = confused or excluding
    if effect.shape.settling > 0.0:
        reason += f"; {texts.settling_excluded(effect.shape.settling)}"
    figures = [
        Parameter(None, "not_identified", confused, low, high, fitted=value)
        if confused
        else Parameter(value, "ok", None, low, high)
        for value, low, high in zip(
            *(each.tolist() for each in (effect.beta, lower, upper)), strict=True
        )
    ]
    q = figures[1] if effect.shape.quadratic else Parameter(None, "absent", texts.ABSENT)
    lag = _limit_lag(effect.lag, posterior, math.sqrt(moved[p, p]), float(regression.lags[-1]))
    if not compensated:
        lag = Parameter(None, "not_identified", texts.NO_EFFECT_TO_LAG)
        nothing = np.zeros(len(path.value))
        return ThermalFit(path.mean, figures[0], q, lag, bias, False, reason, nothing, 0.0, path)
    terms = regression.terms(effect.lag, effect.shape)
    at_knots = effect.beta @ terms
    shift = float(regression.means(at_knots).mean())
    # The error of T_0 is the error of the mean of the path.
    of_reference = float(np.std(path.draws.mean(axis=1))) * float(effect.beta[0])
    by_effect = terms.mean(axis=1) @ covariance @ terms.mean(axis=1)
    noise = _compute_mean_error(effect.noise, posterior, length, regression.rate)
    assert bias.value is not None  # the mean of the log
    bias = _limit_bias(bias.value - shift, math.sqrt(noise**2 + by_effect + of_reference**2))
    varying = terms - terms.mean(axis=1, keepdims=True)
    power = np.sum((effect.beta @ varying) ** 2)
    relative_error = float(np.sqrt(np.einsum("ik,ij,jk->", varying, covariance, varying) / power))
    described = figures[0], q, lag, bias, True, reason, at_knots, relative_error
    return ThermalFit(path.mean, *described, path)


def _limit_lag(value: float, posterior: Posterior, by_path: float, longest: float) -> Parameter:
    """Return the lag with its most likely 95 %: equal tails would often exclude a lag of 0."""
    order = np.argsort(posterior.lag_weights)[::-1]
    inside = 1 + int(np.searchsorted(np.cumsum(posterior.lag_weights[order]), 0.95))
    likely = posterior.lags[order[:inside]]
    lower = value - math.hypot(value - min(float(likely.min()), value), SIGMAS * by_path)
    upper = value + math.hypot(max(float(likely.max()), value) - value, SIGMAS * by_path)
    lower = max(lower, 0.0)
    if upper - lower > _MAX_LAG_WIDTH * longest:
        reason = texts.lag_range(lower, upper)
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    if lower == 0.0:
        reason = texts.interval_with_zero(at_limit=False)
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    return Parameter(value, "ok", None, lower, upper)


def _limit_bias(value: float, error: float) -> Parameter:
    return Parameter(value, lower=value - SIGMAS * error, upper=value + SIGMAS * error)


def _compute_mean_error(noise: Maximum, posterior: Posterior, length: float, rate: float) -> float:
    """Return the standard deviation of the mean of a log about the bias at its beginning, SI.

    A random walk starts at 0: sigma^2 = N^2 / D + K^2 D / 3 and, of a process of variance v, 2 v
    T_B / D (1 - T_B / D (1 - e^(-D / T_B))), D long.
    """
    model: NoiseModel = replace(make_noise_model(noise), K=posterior.mean_walk)
    # Terms that begin at 0 do so at the beginning of the log.
    terms = (term for term in model.realised(1.0 / rate, length) if term.drive is not None)
    return math.sqrt(sum(term.mean_variance(length, 0.0) for term in terms))


def _describe_nothing(
    path: TemperaturePath, bias: Parameter, reason: str = texts.SHORT_LOG
) -> ThermalFit:
    unknown = Parameter(None, "not_identified", reason)
    nothing = np.zeros(len(path.value))
    described = unknown, unknown, unknown, bias, False, reason, nothing, 0.0
    return ThermalFit(path.mean, *described, path)
