"""Noise parameters from the Allan variance, with intervals that hold from one log to the next.

1. The Allan variance of the spectral lines is subtracted.
2. Terms are fitted by generalised least squares with non-negative squares (`active_sets`).
   The covariance is the exact one of the fitted model, plus an error of the model: no sum of a few
   terms is exact, and at short tau the sampling errors are so small that they would rule the fit.
3. As much of the short end as is bent, by a filter or a coarse register, is left out.
4. Curves are drawn around the measured one and fitted like it (randomised maximum likelihood), so
   that the limits contain the choice of terms, and are joint.
5. The parameters of parts of the log differ by more than a stationary log explains; the draws are
   spread by that excess (`parts`).

References
----------
A. Guerrier, R. Molinari and J. Skaloud, "Wavelet-variance-based estimation for composite stochastic
processes", JASA 108, 2013, for the fit to a variance by scale; D. Oliver, N. He and A. Reynolds,
"Conditioning permeability fields to pressure data", ECMOR V, 1996, for the draws; R. DerSimonian
and N. Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7, 1986, for the excess
of a spread.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, polygamma

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.curve_bias import (
    Models,
    compute_curve_bias,
    convert_noise_model,
    locate_minimum,
)
from imubench_pipeline.estimators.estimate import (
    BROADBAND_TIME,
    MAX_LIMIT_RATIO,
    Estimate,
    JointDraws,
    Parameter,
)
from imubench_pipeline.estimators.least_squares import UnfitCurveError
from imubench_pipeline.estimators.robust.active_sets import (
    FLICKER,
    PROCESS,
    RAMP,
    TERMS,
    WALK,
    WHITE,
    Solutions,
    TermSearch,
)
from imubench_pipeline.estimators.robust.parts import (
    LONGEST_OF_PARTS,
    PartVariances,
    estimate_excess,
)
from imubench_pipeline.estimators.whittle import Terms
from imubench_pipeline.noise import FLOOR, NoiseModel, Sinusoid
from imubench_pipeline.noise.variance_covariance import compute_variance_covariance
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import curves as texts
from imubench_pipeline.words.reasons import estimates as reasons

LONGEST = 1 / 6
"""Longest tau of the fit, as a part of the log."""

_MIN_POINTS = 6
_DRAWS = 400
_CORRELATION_TIMES = 80
_MAX_MODEL_ERROR = 0.01  # Relative, of a variance
_DECADES_OF_MODEL_ERROR = 0.4  # Decades of tau over which errors of the model are correlated
_LINE_ERROR = 0.3  # Relative error of a line's variance: lines are neither constant nor single
_MAX_LINE_SHARE = 0.98  # Share of a variance that may be lines
_MAX_BEND = 2.0  # Largest standardised residual of the first points that are fitted
_BENT_POINTS = 6
_MIN_RAMP = 3.0  # Least ramp, in standard deviations of the slope of a random walk
_GAIN_OF_BEND = 4.0  # Decrease of chi-squared by a correction of the short end
_MAX_CORRECTION = 0.15  # Of the first variance, by a filter; at shorter tau the shape differs
_MAX_RELATIVE_ERROR = 1.0  # Relative error of a variance
_MIN_EIGENVALUE = 0.02  # Eigenvalue of the correlation matrix that whitens
_ROUNDS = 4
_MIN_FLOOR_SLOPE = -0.25  # Least slope at a lowest point that counts as the floor
_PROFILE_POINTS = 60
_MIN_DURATION_OF_WALK = 600.0  # s; in less, a process of some seconds passes for a walk
_TIMES_OF_MINIMUM = 120
_MAX_DOUBTFUL_RATIO = 10.0  # Ratio of limits, up to which a bias or lowest point has a value
_MAX_SHARE_WITHOUT_MINIMUM = 0.025  # Share of the draws, above which tau_min has no value
_MIN_DECREASE = 0.5  # Least decrease of the residual by a later first point
_MAX_EXCESS = 1.0  # Variance of a logarithm between parts: nothing is identified beyond


def fit(
    curve: AllanCurve,
    parts: PartVariances,
    lines: Sequence[Sinusoid] = (),
    *,
    rng: np.random.Generator,
) -> Estimate:
    """Estimate N, B, T_B, K and R of an Allan variance, with limits that hold for the next log.

    ``curve`` and ``parts`` have the same m points, SI and s, without deterministic signals;
    ``lines`` are spectral lines. The values are in SI; their 95 % limits include sampling, choice
    of terms, error of the model, and changes of the sensor within the log. A term that may be
    absent, or has too wide limits, is ``not_identified``, with an upper limit. Raises
    UnfitCurveError if fewer than six points lie within a sixth of the log, or a variance is 0.
    """
    inside, points, fitted = _fit_curve(curve, lines)
    excesses = _estimate_excesses(points, fitted, parts.select(inside))
    draws = _draw(points, fitted, excesses, rng)
    factors = np.exp(excesses["sigma_min"] * rng.standard_normal(_DRAWS))
    estimate = _make_estimate(points, fitted, draws, factors)
    duration = curve.samples / curve.rate
    parameters = {
        symbol: replace(one, reason=texts.changes_between_parts(excesses[symbol]))
        if one.status == "ok" and excesses.get(symbol)
        else one
        for symbol, one in estimate.parameters.items()
    }
    estimate = replace(estimate, parameters=parameters)
    return estimate.revised(lambda _, one: _add_length(one, duration))


def fit_values(curve: AllanCurve, lines: Sequence[Sinusoid] = ()) -> dict[str, float]:
    """Return the values of `fit`, SI, without limits: 0 where a term is absent.

    The curve may contain deterministic signals. Raises UnfitCurveError as `fit` does.
    """
    _, points, fitted = _fit_curve(curve, lines)
    model, solution = fitted.model, fitted.solution
    end = float(points.curve.tau[-1])
    level = np.log(np.maximum(points.evaluate(solution), np.finfo(np.float64).tiny))
    lowest = locate_minimum(level[None], points.curve.tau)[0][0]
    bias = compute_curve_bias(convert_noise_model(model), end)[0][0]
    values = {"N": model.N, "B": model.B, "T_B": model.T_B or 0.0, "K": model.K, "R": model.R}
    return values | {"B_curve": float(bias), "sigma_min": float(lowest)}


def _fit_curve(
    curve: AllanCurve, lines: Sequence[Sinusoid]
) -> "tuple[NDArray[np.bool_], _Points, _Fitted]":
    """Return which points are within a sixth of the log, these points, and the best model."""
    inside = curve.cluster_size <= LONGEST * curve.samples
    if inside.sum() < _MIN_POINTS:
        raise UnfitCurveError(texts.few_points(int(inside.sum()), LONGEST, _MIN_POINTS))
    if not (curve.variance[inside] > 0).all():
        raise UnfitCurveError(texts.REPEATED_SAMPLES)
    points = _Points.of(curve, inside, lines)
    fitted = _fit_points(points)
    without = replace(points, search=points.search.exclude(RAMP))
    if fitted.model.R == 0.0:
        points = without
    else:
        fitted_without = _fit_points(without)
        # The mean slope of a random walk over a time T has the standard deviation K sqrt(1.2 / T).
        by_walk = fitted_without.model.K * np.sqrt(1.2 * curve.rate / curve.samples)
        if fitted.model.R <= _MIN_RAMP * by_walk:
            points, fitted = without, fitted_without
    return inside, points, fitted


@dataclass(frozen=True)
class _Points:
    """The points of a curve up to the longest tau, without lines."""

    curve: AllanCurve
    variance: Array  # (m,)
    line_error: Array  # (m,): relative
    search: TermSearch

    @classmethod
    def of(
        cls, curve: AllanCurve, inside: NDArray[np.bool_], lines: Sequence[Sinusoid]
    ) -> "_Points":
        curve = curve.select(inside)
        curve = replace(curve, variance=curve.deviation**2)  # tables keep the deviation
        of_lines = NoiseModel(sinusoids=lines).allan_variance(curve.tau, curve.rate)
        rest = np.maximum(curve.variance - of_lines, (1.0 - _MAX_LINE_SHARE) * curve.variance)
        shortest = min(max(BROADBAND_TIME, 20.0 / curve.rate), curve.tau[-1] / 4.0)
        times = np.geomspace(shortest, curve.tau[-1] / 2.0, _CORRELATION_TIMES)
        search = TermSearch(curve.tau, curve.rate, curve.averaged, times)
        line_error = np.minimum(_LINE_ERROR * of_lines / rest, _MAX_RELATIVE_ERROR)
        return cls(curve, rest, line_error, search)

    def evaluate(self, solutions: Solutions) -> Array:
        """Return the variance of the first solution, shape (m,)."""
        return self.search.design(float(solutions.times[0])) @ solutions.squares[0]

    def covariance(self, model: NoiseModel, expected: Array, samples: int) -> Array:
        """Return the covariance of relative Allan variances of a log with a model, shape (m, m)."""
        curve = self.curve
        covariance = compute_variance_covariance(
            replace(model, R=0.0), curve.rate, samples, curve.cluster_size
        )
        covariance /= np.outer(expected, expected) * np.sqrt(np.outer(curve.share, curve.share))
        error = np.sqrt(np.maximum(np.diag(covariance), np.finfo(np.float64).tiny))
        clipped = np.minimum(error, _MAX_RELATIVE_ERROR) / error
        return covariance * np.outer(clipped, clipped)

    def model_covariance(self, error: float) -> Array:
        """Return the covariance, (m, m), due to errors of the model and errors of the lines."""
        place = np.log10(self.curve.tau)
        near = np.exp(-np.abs(place[:, None] - place) / _DECADES_OF_MODEL_ERROR)
        return error**2 * near + np.outer(self.line_error, self.line_error)


@dataclass(frozen=True)
class _Fitted:
    """The best model of a curve."""

    solution: Solutions
    used: NDArray[np.bool_]
    expected: Array  # (m,): its variance
    whitening: Array  # (r, m)
    sampling: Array  # (m, m): covariance of the relative variances
    error: float  # relative, of the model
    weights: Array  # (r, m): the whitening before a correction of the short end
    filtered: bool  # whether a correction is considered

    @property
    def model(self) -> NoiseModel:
        return self.solution.model()


def _fit_points(points: _Points) -> _Fitted:
    """Fit the terms; covariance, error of the model and values are found in turns."""
    curve = points.curve
    relative = np.sqrt(2.0 / curve.edf)
    start = _find_start(points, relative)
    solution, expected, used = start.solution, start.expected, start.used
    error, whitening = _MAX_MODEL_ERROR, np.empty((0, 0))
    sampling = np.empty((0, 0))
    bent = start.bent
    for turn in range(_ROUNDS):
        sampling = points.covariance(solution.model(), expected, curve.samples)
        error = _estimate_model_error(points, used, expected, np.diag(sampling))
        covariance = sampling + points.model_covariance(error)
        weights = _whiten(covariance * np.outer(expected, expected), used)
        if turn == _ROUNDS - 1 and (bent or not used[0]):
            one = points.variance[None]
            _, chosen = _choose_correction(points, one, weights, points.search.solve(one, weights))
            bent = bool(chosen[0])
        solution, expected, whitening = _fit_whitened(points, weights, bent)
    filtered = start.bent or not used[0]
    return _Fitted(solution, used, expected, whitening, sampling, error, weights, filtered)


def _choose_correction(
    points: _Points, curves: Array, weights: Array, plain: Solutions
) -> tuple[Solutions, NDArray[np.bool_]]:
    """Return fits with the correction of the short end, and which are better than ``plain``."""
    column, image, free = _leave_out_correction(points, weights)
    bent = points.search.solve(curves, free)
    of_bent = [
        points.search.design(T) @ squares
        for T, squares in zip(bent.times.tolist(), bent.squares, strict=True)
    ]
    size = (curves - of_bent) @ weights.T @ image / (image @ image)
    first = int(np.flatnonzero(weights.any(axis=0))[0])
    small = size * column[first] > -_MAX_CORRECTION * curves[:, first]
    return bent, (plain.cost - bent.cost > _GAIN_OF_BEND) & small


def _leave_out_correction(points: _Points, weights: Array) -> tuple[Array, Array, Array]:
    """Return the correction of the short end, its image, and weights orthogonal to the image."""
    column = points.curve.averaged**-2.0
    image = weights @ column
    return column, image, weights - np.outer(image, image @ weights) / (image @ image)


@dataclass(frozen=True)
class _Start:
    """A fit with independent errors, from some point of the short end on."""

    solution: Solutions
    expected: Array  # (m,)
    used: NDArray[np.bool_]
    bent: bool  # with a correction for the filter or the rounding at short tau
    correction: float  # of the first variance, relative
    residual: float  # largest one of the first points, in standard errors


def _find_start(points: _Points, relative: Array) -> _Start:
    """Return the fit that leaves out as few points of the short end as are bent.

    Noise of short memory, by a filter or by rounding, has the Allan variance N²/tau + q/tau² above
    its memory, with q > 0 for rounding, down to the shortest tau, and q < 0 for a filter. This
    correction is fitted if the fit is much better with it.
    """
    best: _Start | None = None
    for first in range(len(relative) // 2):
        used = np.arange(len(relative)) >= first
        start = _fit_weighted(points, used, relative, bent=False)
        bent = _fit_weighted(points, used, relative, bent=True)
        gain = start.solution.cost[0] - bent.solution.cost[0]
        if gain > _GAIN_OF_BEND and (bent.correction < 0.0 or first == 0):
            start = bent
        if best is None or start.residual < best.residual - _MIN_DECREASE:
            best = start
        if best.residual < _MAX_BEND:
            break
    assert best is not None  # a curve has at least six points
    return best


def _fit_weighted(
    points: _Points, used: NDArray[np.bool_], relative: Array, *, bent: bool
) -> _Start:
    """Fit with independent relative errors, of the fit and not of the noisy curve."""
    total = np.sqrt(relative**2 + _MAX_MODEL_ERROR**2 + points.line_error**2)
    expected = points.variance
    for _ in range(3):
        whitening = np.diag(used / (total * expected))[used]
        solution, expected, _ = _fit_whitened(points, whitening, bent)
    off = (np.abs(points.variance / expected - 1.0) / total)[used][:_BENT_POINTS]
    correction = float((1.0 - points.evaluate(solution) / expected)[used][0])
    residual = float(off.max()) if correction >= -_MAX_CORRECTION else np.inf
    return _Start(solution, expected, used, bent, correction, residual)


def _fit_whitened(points: _Points, whitening: Array, bent: bool) -> tuple[Solutions, Array, Array]:
    """Return the solution, its variances, and the whitening that leaves out a correction."""
    column, image, free = _leave_out_correction(points, whitening)
    if not bent:
        free = whitening
    solution = points.search.solve(points.variance[None], free)
    expected = points.evaluate(solution)
    expected = np.maximum(expected, np.finfo(np.float64).tiny)
    if bent:  # at the tau that are left out it may be below 0
        rest = whitening @ (points.variance - expected)
        corrected = expected + column * (image @ rest) / (image @ image)
        expected = np.maximum(corrected, 0.5 * expected)
    return solution, expected, free


def _estimate_model_error(
    points: _Points, used: NDArray[np.bool_], expected: Array, sampling: Array
) -> float:
    """Return the error of the model that explains the residuals beyond sampling and lines."""
    known = (sampling + points.line_error**2)[used]
    residuals = (points.variance / expected - 1.0)[used]
    error = _MAX_MODEL_ERROR**2
    weight = 1.0 / (known + error) ** 2
    count = len(residuals) / max(len(residuals) - TERMS + 1, 1)
    excess = count * float(weight @ (residuals**2 - known)) / float(weight.sum())
    return float(np.sqrt(np.clip(excess, 0.0, error)))


def _whiten(covariance: Array, used: NDArray[np.bool_]) -> Array:
    """Return the matrix that makes the errors of the used points independent, shape (r, m)."""
    there = np.flatnonzero(used)
    part = covariance[np.ix_(there, there)]
    error = np.sqrt(np.diag(part))
    values, vectors = np.linalg.eigh(part / np.outer(error, error))
    whitening = np.zeros((len(there), len(used)))
    whitening[:, there] = (vectors / np.sqrt(np.maximum(values, _MIN_EIGENVALUE))).T / error
    return whitening


def _draw(
    points: _Points, fitted: _Fitted, excesses: Mapping[str, float], rng: np.random.Generator
) -> Solutions:
    """Return models drawn around the fitted one, spread by the excess between parts."""
    covariance = fitted.sampling + points.model_covariance(fitted.error)
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    normal = rng.standard_normal((_DRAWS // 2, len(values)))
    normal = np.concatenate((normal, -normal))
    half = 1.0 / np.maximum(np.diag(covariance), 1e-9)
    shift, scale = np.log(half) - digamma(half), np.sqrt(polygamma(1, half) * half)
    spread = shift + (normal @ root.T) * scale
    curves = points.variance * np.exp(spread)
    drawn = points.search.solve(curves, fitted.weights)
    if fitted.filtered:
        bent, chosen = _choose_correction(points, curves, fitted.weights, drawn)
        squares = np.where(chosen[:, None], bent.squares, drawn.squares)
        drawn = replace(drawn, squares=squares, times=np.where(chosen, bent.times, drawn.times))
    spread = rng.standard_normal((_DRAWS // 2, 3))
    spread = rng.permutation(np.concatenate((spread, -spread)))
    factors = np.ones((_DRAWS, TERMS))
    for column, (symbol, terms) in enumerate(_TERMS_OF.items()):
        factor = np.exp(2.0 * excesses[symbol] * spread[:, column])
        factors[:, terms] = factor[:, None]
    step = np.log(points.search.times[1] / points.search.times[0])
    times = drawn.times * np.exp(step * rng.uniform(-0.5, 0.5, _DRAWS))  # between those tried
    return replace(drawn, squares=drawn.squares * factors, times=times)


_TERMS_OF = {"N": [WHITE], "B": [FLICKER, PROCESS], "K": [WALK]}


def _estimate_excesses(
    points: _Points, fitted: _Fitted, parts: PartVariances
) -> Mapping[str, float]:
    """Return the excess deviation of the logarithms of N, B, K and sigma_min between parts."""
    curve, squares = points.curve, fitted.solution.squares[0]
    present = np.flatnonzero(squares)
    columns = points.search.design(float(fitted.solution.times[0]))[:, present]
    gain = np.zeros((TERMS, len(curve.tau)))
    gain[present] = np.linalg.pinv(fitted.whitening @ columns) @ fitted.whitening
    covariance = cache(partial(points.covariance, fitted.model, fitted.expected))
    influences = {
        symbol: gain[terms].sum(axis=0) * fitted.expected / (squares[terms].sum() or np.inf) / 2.0
        for symbol, terms in _TERMS_OF.items()
    }
    # The lowest point within the longest tau of the parts, averaged over three tau
    compared = curve.cluster_size <= LONGEST_OF_PARTS * curve.samples
    end = int(fitted.expected[compared].argmin()) + 1
    influences["sigma_min"] = np.zeros(len(curve.tau))
    influences["sigma_min"][max(end - 3, 0) : end] = 0.5 / min(end, 3)
    return {
        symbol: float(np.sqrt(min(estimate_excess(parts, curve, each, covariance), _MAX_EXCESS)))
        for symbol, each in influences.items()
    }


def _add_length(parameter: Parameter, duration: float) -> Parameter:
    """Return a parameter with the log length that would give it to 10 %, if it has no value."""
    value, upper = parameter.fitted, parameter.upper
    if parameter.status != "not_identified" or not value or upper is None:
        return parameter
    half = (upper / value - 1.0) / 0.1  # its 95 % interval falls as the root of the length
    return replace(parameter, duration_needed=duration * max(half, 1.0) ** 2)


def _make_estimate(points: _Points, fitted: _Fitted, drawn: Solutions, factors: Array) -> Estimate:
    curve, model = points.curve, fitted.model
    roots = np.sqrt(drawn.squares)
    times = np.where(np.isfinite(drawn.times), drawn.times, np.inf)
    biases = np.hypot(roots[:, FLICKER], roots[:, PROCESS])
    if model.further_processes:
        biases = roots[:, FLICKER]
    parameters = {
        "N": _limit(model.N, roots[:, WHITE]) if model.N else _bound_white(points, fitted.used),
        "B": _limit(model.B, biases, widest=_MAX_DOUBTFUL_RATIO),
        "T_B": _limit(model.T_B, times) if model.T_B else Parameter(None, "absent", reasons.ABSENT),
        "K": _limit_walk(points, fitted, roots[:, WALK]),
        "R": _limit(model.R, roots[:, RAMP]) if model.R else _bound_ramp(points, model.K),
    }
    further = [
        {"B": _limit(process.B, roots[:, PROCESS]), "T_B": _limit(process.T_B, times)}
        for process in model.further_processes
    ]
    end = float(curve.tau[-1])
    value = float(compute_curve_bias(convert_noise_model(model), end)[0][0])
    of_curve = np.concatenate([compute_curve_bias(each, end)[0] for each in _group(drawn)])
    figures = {"B_curve": _limit(value, of_curve, widest=_MAX_DOUBTFUL_RATIO)}
    figures |= _describe_lowest_point(points, fitted, drawn, factors)
    lowest = float(_bound_deviation(points)[fitted.used].min())
    for table, name in ((parameters, "B"), (figures, "B_curve")):
        if table[name].value is None and table[name].upper == 0.0:
            table[name] = replace(table[name], upper=lowest / FLOOR)
    return Estimate("robust", parameters, further=further, curve=figures, draws=_join(drawn))


def _describe_lowest_point(
    points: _Points, fitted: _Fitted, drawn: Solutions, factors: Array
) -> dict[str, Parameter]:
    """Return ``sigma_min`` and ``tau_min`` within the fit; ``factors`` spread the former."""
    curve = points.curve
    tau = np.geomspace(curve.tau[0], curve.tau[-1], _TIMES_OF_MINIMUM)
    search = TermSearch(tau, curve.rate, tau * curve.rate, points.search.times)
    squares = np.concatenate((fitted.solution.squares, drawn.squares))
    times = np.concatenate((fitted.solution.times, drawn.times))
    variance = [search.design(T) @ s for T, s in zip(times.tolist(), squares, strict=True)]
    level = np.log(np.maximum(variance, np.finfo(np.float64).tiny))
    sigma, place, inside = locate_minimum(level, tau)
    # The deviation need not rise again, but be flat.
    slope = (level[0, -1] - level[0, -2]) / np.log(tau[-1] / tau[-2]) / 2.0
    floor = _limit(float(sigma[0]), sigma[1:] * factors, widest=_MAX_DOUBTFUL_RATIO)
    if not inside[0] and slope <= _MIN_FLOOR_SLOPE:
        reason = texts.no_model_minimum(float(tau[-1]))
        floor = Parameter(None, "not_identified", reason, 0.0, floor.upper)
    time = _limit(float(place[0]), place[1:])
    if not inside[0] or np.mean(~inside[1:]) > _MAX_SHARE_WITHOUT_MINIMUM:
        time = Parameter(None, "not_identified", texts.MINIMUM_BEYOND, time.lower, None)
    return {"sigma_min": floor, "tau_min": time}


def _limit(
    value: float, draws: Array, most: float = np.inf, *, widest: float = MAX_LIMIT_RATIO
) -> Parameter:
    """Return a parameter with the limits of its draws; without a value where they are too wide."""
    lower, upper = np.quantile(draws, (0.025, 0.975), method="nearest").tolist()
    lower, upper = min(lower, value), max(min(upper, most), value)
    if not np.isfinite(upper):  # some draws have no process
        return Parameter(None, "not_identified", texts.MAY_BE_ABSENT, lower, None, fitted=value)
    if value == 0.0:
        return Parameter(None, "absent", reasons.ABSENT_BELOW, 0.0, upper)
    if not lower > 0.0 or upper > widest * lower:
        reason = reasons.wide_interval(upper / lower) if lower > 0.0 else texts.MAY_BE_ABSENT
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    if upper > MAX_LIMIT_RATIO * lower:
        return Parameter(value, "doubtful", reasons.wide_limits(upper / lower), lower, upper)
    return Parameter(value, "ok", None, lower, upper)


def _bound_ramp(points: _Points, K: float) -> Parameter:
    """Return R without a value, with a limit from the end of the curve and the slope of a walk."""
    curve = points.curve
    tau, error = curve.tau[-1], min(np.sqrt(2.0 / curve.edf[-1]), _MAX_RELATIVE_ERROR)
    alone = np.sqrt(2.0 * points.variance[-1] * np.exp(1.96 * error)) / tau
    by_walk = _MIN_RAMP * K * np.sqrt(1.2 * curve.rate / curve.samples)
    return Parameter(None, "absent", reasons.ABSENT_BELOW, 0.0, float(max(alone, by_walk)))


def _bound_white(points: _Points, used: NDArray[np.bool_]) -> Parameter:
    """Return N without a value, with the limit that the curve leaves for white noise."""
    upper = (_bound_deviation(points) * np.sqrt(points.curve.tau))[used].min()
    return Parameter(None, "not_identified", texts.MAY_BE_ABSENT, 0.0, float(upper))


def _bound_deviation(points: _Points) -> Array:
    """Return upper limits of the deviation, shape (m,)."""
    error = np.minimum(np.sqrt(2.0 / points.curve.edf), _MAX_RELATIVE_ERROR)
    return np.sqrt(points.variance * np.exp(1.96 * error))


def _limit_walk(points: _Points, fitted: _Fitted, draws: Array) -> Parameter:
    """Return K; its limits allow for all other terms in its place, however few support them."""
    curve = points.curve
    at = int(np.searchsorted(curve.cluster_size, curve.samples / 9.0)) - 1
    error = min(float(np.sqrt(2.0 / curve.edf[at])), _MAX_RELATIVE_ERROR)
    # The K whose random walk alone would explain the end of the curve.
    alone = float(np.sqrt(3.0 * curve.variance[at] / curve.tau[at] * np.exp(1.64 * error)))
    grid = np.append(0.0, np.geomspace(0.01 * alone, alone, _PROFILE_POINTS)) ** 2
    limits = points.search.find_limits(WALK, grid, points.variance, fitted.whitening)
    if curve.samples < _MIN_DURATION_OF_WALK * curve.rate:
        limits = 0.0, limits[1]
    K = _limit(fitted.model.K, np.append(draws, np.repeat(np.sqrt(limits), len(draws))), alone)
    if K.status == "absent":  # a high-pass, or means that were subtracted, may have removed it
        K = replace(K, status="not_identified", reason=texts.MAY_BE_ABSENT)
    return K


def _group(drawn: Solutions) -> list[Models]:
    """Return the draws as models of two groups: without a process, and with one."""
    roots = np.sqrt(drawn.squares)
    having = np.isfinite(drawn.times)
    groups = []
    for chosen, number in ((~having, 0), (having, 1)):
        if chosen.any():
            columns = roots[chosen][:, [WHITE, FLICKER, WALK, *[PROCESS] * number]]
            times = drawn.times[chosen, None][:, :number]
            groups.append(Models(Terms("NFK", number), columns, times))
    return groups


def _join(drawn: Solutions) -> JointDraws:
    N, F, G, K, R = np.sqrt(drawn.squares).T
    alone = F == 0.0
    first = np.column_stack(
        (np.zeros(len(N)), N, np.where(alone, G, F), np.where(alone, drawn.times, np.nan), K, R)
    )
    further = np.stack((np.where(alone, 0.0, G), np.where(alone, np.nan, drawn.times)), axis=-1)
    return JointDraws(first, further[:, None])
