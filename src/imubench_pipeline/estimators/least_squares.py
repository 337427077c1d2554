"""Weighted least squares of the Allan variance (optimisation of Maia et al., section 3.2).

For a given T_B the model is linear in S_N, S_B and S_K, which are found by non-negative least
squares; the search is over T_B alone (variable projection).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar, nnls

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.allan.confidence import equivalent_degrees
from imubench_pipeline.estimators.curve_bias import (
    convert_noise_model,
    estimate_lowest_point,
    find_lowest_point,
    make_averaging_times,
)
from imubench_pipeline.estimators.estimate import BROADBAND_TIME, SIGMAS, Estimate, Parameter
from imubench_pipeline.noise import (
    PEAK_TAU,
    NoiseModel,
    compute_bias_instability,
    evaluate_gauss_markov_shape,
    evaluate_sampled_shape,
)
from imubench_pipeline.noise.terms.gauss_markov import CORRELATION_TIMES
from imubench_pipeline.noise.variance_covariance import compute_variance_covariance
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import curves as texts

Method = Literal["weighted", "paper"]

_MIN_POINTS = 4
_UNFILTERED_CLUSTER = 16  # Cluster size above which the effect of the sensor's filter is small
_MIN_BEND_SIGMAS = 4.0
_MAX_REFITS = 5
_MAX_FADED_BEND = 0.1
_MAX_SAMPLING_SIGMAS = 0.02
_SCAN_TIMES = 160  # Number of correlation times of the scan before optimisation

_MIN_VARIANCE_FRACTION = 1e-9  # A term below this fraction of the variance at every tau is absent


class UnfitCurveError(ValueError):
    """An Allan variance to which no model can be fitted; the message states the reason."""


def fit(
    curve: AllanCurve,
    *,
    method: Method = "weighted",
    longest: float = 1 / 9,
    with_limits: bool = True,
) -> Estimate:
    """Fit N, B, T_B and K to an Allan variance.

    The cost is sum_i w_i (variance_i - model(tau_i))^2. With n of L samples in a cluster,

    - ``weighted``: w = 1 / (2 sqrt(n/2L) variance)^2, the inverse variance of an Allan variance;
    - ``paper``: w = 1 / (2 sqrt(n/2L) deviation)^2 (Maia et al., eq. 25), for the papers' figures.
      This cost has a dimension, so that the bottom of the curve counts less, which makes little
      difference on these tau (`tests/papers/test_panel.py`).

    ``longest`` is the longest tau of the fit, as a fraction of the log. The shortest is the tau
    above which the curve follows the fitted model: below, the sensor's own filter bends the curve.

    The parameters are in SI, with 95 % limits from the covariance of the Allan variances. Without
    limits, which take most of the time, no parameter is ``not_identified``.
    ``absent``: the fit is best without the term; ``at_bound``: T_B is at the end of its range, in
    which the process peaks within the tau used; ``not_identified``: the log cannot determine the
    value (`add_limits`). Raises UnfitCurveError if fewer than four points lie within
    ``longest``, or a variance is 0; ValueError if the method is not known.
    """
    used = curve.cluster_size <= longest * curve.samples
    if used.sum() < _MIN_POINTS:
        raise UnfitCurveError(texts.few_points(int(used.sum()), longest, _MIN_POINTS))
    if not (curve.variance[used] > 0).all():
        raise UnfitCurveError(texts.REPEATED_SAMPLES)
    if method not in ("weighted", "paper"):
        raise ValueError(f"method {method!r} is not known, expected 'weighted' or 'paper'")
    used &= curve.cluster_size >= _find_first_unbent(curve, used, method)
    parameters = dict(_fit_curve(curve, used, method).parameters)
    first = int(np.flatnonzero(used)[0])
    if first > 0 and parameters["N"].value is not None:
        reason = texts.fitted_from(float(curve.tau[first]))
        parameters["N"] = replace(parameters["N"], reason=reason)
    estimate = Estimate(method, parameters)
    return add_limits(estimate, curve, used) if with_limits else estimate


def _find_first_unbent(curve: AllanCurve, used: NDArray[np.bool_], method: Method) -> int:
    """Return the smallest cluster size from which the curve follows a model of its longer tau."""
    # Filter and coarse steps bend the curve at the shortest tau. The bend fades as 1/n: the fit
    # begins where it is below the standard error of the curve.
    n = curve.cluster_size
    error = np.sqrt(2.0 / curve.edf)
    start = _UNFILTERED_CLUSTER
    for _ in range(_MAX_REFITS):
        certain = used & (n >= start)
        if certain.sum() < _MIN_POINTS:
            break
        first = int(np.flatnonzero(certain)[0])
        expected, unsure = _predict(curve, certain, _fit_curve(curve, certain, method).model)
        off = np.abs(curve.variance / expected - 1.0)[:first]
        bent = off > _MIN_BEND_SIGMAS * np.hypot(error, unsure)[:first]
        if not bent.any():
            break
        if start > _UNFILTERED_CLUSTER and off[-1] > _MAX_FADED_BEND:
            # No bend that fades: the curve has something else here, such as a sinusoid.
            return start
        fading = float((off * n[:first])[bent].max()) / n
        unbent = used & (fading <= error)
        unbent[: np.flatnonzero(bent)[-1] + 1] = False
        if unbent.sum() < _MIN_POINTS or n[unbent][0] <= start:
            return int(n[unbent][0]) if unbent.any() else start
        start = int(n[unbent][0])
    else:
        return start
    return int(n[0]) if start == _UNFILTERED_CLUSTER else start


def _predict(curve: AllanCurve, used: NDArray[np.bool_], model: NoiseModel) -> tuple[Array, Array]:
    """Return the extrapolation of a model to all tau, and its relative error."""
    rate = curve.rate
    expected = model.allan_variance(curve.tau, rate)
    # White noise is averaged over the samples present, fewer than n where some are missing.
    expected = expected + model.N**2 * (rate / curve.averaged - 1.0 / curve.tau)
    shapes = [NoiseModel(N=1.0), NoiseModel(K=1.0)]
    if model.T_B is not None:
        shapes.append(NoiseModel(B=1.0, T_B=model.T_B))
    relative = np.array([shape.allan_variance(curve.tau, rate) / expected for shape in shapes])
    # Estimates within an octave go together: a decade holds fewer than it has points.
    crowd = max(1.0, math.log10(2.0) / float(np.median(np.diff(np.log10(curve.tau[used])))))
    information = (relative[:, used] * curve.edf[used] / (2.0 * crowd)) @ relative[:, used].T
    covariance = np.linalg.pinv(information, hermitian=True)
    unsure = np.sqrt(np.maximum(np.einsum("ij,ik,kj->j", relative, covariance, relative), 0.0))
    return expected, unsure


def _fit_curve(curve: AllanCurve, used: NDArray[np.bool_], method: Method) -> Estimate:
    """Fit the continuous model, or the sampled one if the log resolves the difference."""
    fitted = _Search(curve, used, method, sampled=False).estimate()
    # Sampling adds (S_B + S_K) T^2 / (6 tau), which has the shape of white noise: left out, it
    # goes into N.
    tau = curve.tau[used]
    continuous = fitted.model.allan_variance(tau)
    difference = fitted.model.allan_variance(tau, curve.rate) - continuous
    error = 2.0 * np.sqrt(curve.cluster_size[used] / (2.0 * curve.samples)) * continuous
    if (np.abs(difference) > _MAX_SAMPLING_SIGMAS * error).any():
        return _Search(curve, used, method, sampled=True).estimate()
    return fitted


class _Search:
    """Least squares over (S_N, S_B, S_K) for a given T_B, and the search over T_B."""

    def __init__(
        self, curve: AllanCurve, used: NDArray[np.bool_], method: Method, *, sampled: bool
    ) -> None:
        self._tau, self._n = curve.tau[used], curve.cluster_size[used]
        self._interval = float(self._tau[0] / self._n[0])
        self._method, self._sampled = method, sampled
        self._variance = curve.variance[used]
        spread = np.sqrt(self._n / (2.0 * curve.samples))
        power = self._variance if method == "weighted" else np.sqrt(self._variance)
        self._root_weight = 1.0 / (2.0 * spread * power)
        self._target = self._root_weight * self._variance
        self._white = 1.0 / (curve.averaged[used] * self._interval)
        self._walk = self._tau / 3.0
        if sampled:
            self._walk = self._walk * (1.0 + 0.5 / self._n.astype(np.float64) ** 2)
        self.longest = self._tau[-1] / PEAK_TAU
        self.shortest = min(CORRELATION_TIMES.samples * self._interval, self.longest / 2.0)

    def _shape(self, T_B: float) -> Array:
        if self._sampled:
            return evaluate_sampled_shape(self._n, self._interval, T_B)
        return evaluate_gauss_markov_shape(self._tau, T_B)

    def _solved(self, shape: Array) -> tuple[Array, float]:
        """Return S_N, S_B, S_K that fit best with a process, and the root of the cost."""
        columns = np.column_stack([self._white, shape, self._walk]) * self._root_weight[:, None]
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        solution, residual = nnls(columns / size, self._target)
        return solution / size, float(residual)

    def estimate(self) -> Estimate:
        """Return the estimate at the T_B with the least cost."""
        scan = np.geomspace(self.shortest, self.longest, _SCAN_TIMES)
        costs = [self._solved(self._shape(T_B))[1] for T_B in scan.tolist()]
        best = int(np.argmin(costs))
        low, high = scan[max(best - 1, 0)], scan[min(best + 1, _SCAN_TIMES - 1)]
        minimum = minimize_scalar(
            lambda u: self._solved(self._shape(math.exp(u)))[1],
            bounds=(math.log(low), math.log(high)),
            method="bounded",
            options={"xatol": 1e-10},
        )
        T_B = math.exp(minimum.x) if minimum.fun < costs[best] else float(scan[best])
        shape = self._shape(T_B)
        (white, drive, walk), _ = self._solved(shape)
        parts = {"N": white * self._white, "B": drive * shape, "K": walk * self._walk}
        present = {
            name: bool((part > _MIN_VARIANCE_FRACTION * self._variance).any())
            for name, part in parts.items()
        }
        absent = Parameter(None, "absent", texts.FIT_WITHOUT_TERM)
        bias = Parameter(compute_bias_instability(drive, T_B)) if present["B"] else absent
        time = Parameter(T_B) if present["B"] else absent
        at_end = None
        if T_B > self.longest * 0.99:
            at_end = texts.no_peak(self.longest)
        elif T_B < self.shortest * 1.01:
            at_end = texts.like_white_noise(self.shortest)
        if present["B"] and at_end:
            bias = Parameter(bias.value, "at_bound", at_end)
            time = Parameter(T_B, "at_bound", at_end)
        N = Parameter(math.sqrt(white)) if present["N"] else absent
        K = Parameter(math.sqrt(walk)) if present["K"] else absent
        return Estimate(self._method, {"N": N, "B": bias, "T_B": time, "K": K})


_MAX_RELATIVE_ERROR = 0.5  # Relative standard error beyond which a parameter is not identified

_MAX_RELATIVE_ERROR_TIME = 0.75
"""Beyond it B is not identified either: in white logs B often seems known, T_B in 1 of 200."""

_MAX_RELATIVE_ERROR_HELD = 0.25  # The same for B with T_B fixed, and for N and K with B fixed
_CLIP_RELATIVE_ERROR = 10.0  # Larger ones would overflow in the limits
_LOG_TIME_STEP = 1e-3  # Step of log T_B in the finite difference
_LOG_PARAMETER_STEP = 0.05  # Step of the finite differences of the lowest point


@dataclass(frozen=True)
class Errors:
    """Covariance of the logarithms of the parameters of a fit."""

    names: Sequence[str]  # the parameters, m of them
    covariance: Array  # (m, m)

    def of(self, name: str) -> float:
        """Return the relative standard error of a parameter, at most 10."""
        variance = float(self._at(name, name))
        return min(math.sqrt(max(variance, 0.0)), _CLIP_RELATIVE_ERROR)

    def factors(
        self, name: str, doubtful: Sequence[str], beside: float | None = None
    ) -> tuple[float, float]:
        """Return the factors from a parameter to 95 % limits that also hold without doubtful terms.

        Without a term, the parameter moves by its regression on the density of that term.
        ``beside`` is its standard error with the doubtful terms fixed; by default they vary. If the
        square of an amplitude is less than 1.96 standard errors from 0, its lower limit is 0.
        """
        error = self.of(name) if beside is None else beside
        low, high = -SIGMAS * error, SIGMAS * error
        for term in doubtful:
            if term == name or not self.of(term) < _CLIP_RELATIVE_ERROR:
                continue
            slope = self._at(name, term) / self._at(term, term)
            # The density is the square: its decrease to 0 is -1/2 in the log of the amplitude.
            moved = -0.5 * slope
            rest = error
            if beside is None:
                rest = math.sqrt(max(error**2 - slope * self._at(name, term), 0.0))
            low = min(low, moved - SIGMAS * rest)
            high = max(high, moved + SIGMAS * rest)
        most = SIGMAS * _CLIP_RELATIVE_ERROR
        may_be_zero = name != "T_B" and 2.0 * error > 1.0 / SIGMAS
        return 0.0 if may_be_zero else math.exp(max(low, -most)), math.exp(min(high, most))

    def _at(self, first: str, second: str) -> float:
        return float(self.covariance[self.names.index(first), self.names.index(second)])


def fit_errors(
    curve: AllanCurve,
    used: NDArray[np.bool_],
    model: NoiseModel,
    method: str,
    *,
    held: Sequence[str] = (),
) -> Errors:
    """Return the errors of a weighted least squares fit at the values of its model.

    Cov = G C G^T, G = (J^T W J)^-1 J^T W, with J the derivatives by the log parameters, W the
    weights and C the true covariance of the Allan variances (H. White, Econometrica 48, 1980).

    ``used``, shape (m,), selects the tau of the fit, ``method`` its weights (see `fit`); ``held``
    are the fixed parameters.
    """
    expected, derivatives = _differentiate_model(curve, used, model)
    names = [name for name in derivatives if name not in held]
    if not names:
        return Errors(names, np.empty((0, 0)))
    jacobian = np.column_stack([derivatives[name] for name in names])
    # The weights of the relative variances: w times the variance squared, to a factor.
    weight = 1.0 / curve.cluster_size[used]
    if method == "paper":
        weight = weight * expected
    root = np.sqrt(weight)
    columns = jacobian * root[:, None]
    size = np.linalg.norm(columns, axis=0)
    if len(columns) < len(names) or not (size > 0).all():
        return Errors(names, np.diag(np.full(len(names), np.inf)))
    gain = np.linalg.pinv(columns / size) * root / size[:, None]
    # The covariance of the Allan variances over the model's. Gaps and segments leave fewer
    # differences: scale by the ratio of degrees of freedom.
    sizes, rate = curve.cluster_size[used], curve.rate
    whole = [
        equivalent_degrees(int(alpha), int(n), curve.samples - 2 * int(n) + 1)
        for alpha, n in zip(curve.exponent[used], sizes, strict=True)
    ]
    scale = np.sqrt(np.maximum(np.array(whole) / curve.edf[used], 1.0))
    scale = scale / model.allan_variance(curve.tau[used], rate)
    covariance = compute_variance_covariance(model, rate, curve.samples, sizes)
    covariance = covariance * np.outer(scale, scale)
    return Errors(names, gain @ covariance @ gain.T)


def _differentiate_model(
    curve: AllanCurve, used: NDArray[np.bool_], model: NoiseModel
) -> tuple[Array, dict[str, Array]]:
    """Return the model's Allan variances, and their relative derivatives by log parameters."""
    tau, rate = curve.tau[used], curve.rate
    parts: dict[str, Array] = {}
    if model.N > 0:
        # White noise is averaged over the samples present, fewer than n where some are missing.
        parts["N"] = model.N**2 * rate / curve.averaged[used]
    slope: Array | None = None
    if model.B > 0 and model.T_B is not None:
        earlier, parts["B"], later = (
            NoiseModel(B=model.B, T_B=model.T_B * math.exp(step)).allan_variance(tau, rate)
            for step in (-_LOG_TIME_STEP, 0.0, _LOG_TIME_STEP)
        )
        slope = (later - earlier) / (2.0 * _LOG_TIME_STEP)
    if model.K > 0:
        parts["K"] = NoiseModel(K=model.K).allan_variance(tau, rate)
    expected = np.asarray(np.sum(list(parts.values()), axis=0))
    derivatives = {name: 2.0 * part / expected for name, part in parts.items()}
    if slope is not None:
        derivatives["T_B"] = slope / expected
    return expected, derivatives


def add_limits(estimate: Estimate, curve: AllanCurve, used: NDArray[np.bool_]) -> Estimate:
    """Return an estimate with 95 % limits, and without values that the log does not determine.

    A parameter with a relative standard error above 50 % is ``not_identified``. So are B and T_B
    if the error of T_B exceeds 75 %, or if T_B is at its bound and the error of B exceeds 25 %.
    N and K are then tested with B fixed, against 25 %.

    The lower limit of an amplitude that is not identified is 0; a limit is None where it cannot be
    bounded. A B or T_B that stays ``at_bound`` has no limits. ``estimate`` must have a value for
    every term of its model; ``used``, shape (m,), selects the tau that were fitted.
    """
    model = estimate.model
    if not model.terms:
        nothing = Parameter(None, "not_shown", texts.NO_NOISE)
        return replace(
            estimate,
            curve={"B_curve": estimate.parameters["B"], "sigma_min": nothing, "tau_min": nothing},
        )
    errors = fit_errors(curve, used, model, estimate.method)
    unknown: dict[str, str] = {}
    if estimate.parameters["T_B"].status == "at_bound":
        error = fit_errors(curve, used, model, estimate.method, held=["T_B"]).of("B")
        if error > _MAX_RELATIVE_ERROR_HELD:
            reason = texts.large_error("B", error, _MAX_RELATIVE_ERROR_HELD)
            unknown = dict.fromkeys(("B", "T_B"), reason)
    elif "B" in errors.names:
        unknown = _explain_unknown_bias(errors.of("B"), errors.of("T_B"))
    apart = errors
    if "B" in unknown:
        apart = fit_errors(curve, used, model, estimate.method, held=["B", "T_B"])
    for name in ("N", "K"):
        if name not in errors.names or errors.of(name) <= _MAX_RELATIVE_ERROR:
            continue
        if "B" in unknown and apart.of(name) <= _MAX_RELATIVE_ERROR_HELD:
            # The term is visible; only a B that is not identified could replace it.
            continue
        unknown[name] = texts.large_error(name, errors.of(name), _MAX_RELATIVE_ERROR)
    doubtful = [name for name in ("B", "K") if name in unknown]
    parameters = dict(estimate.parameters)
    for name, parameter in estimate.parameters.items():
        if parameter.value is None:
            continue
        parameters[name] = replace(parameter, fitted=parameter.value)
        if name in unknown:
            limited = errors.of(name) < _CLIP_RELATIVE_ERROR
            lower, upper = None, None
            if name == "T_B" and limited:
                lower, upper = (parameter.value * each for each in errors.factors(name, []))
            elif name != "T_B":
                # Linear in the amplitude, which may be 0: a logarithmic limit would diverge.
                lower = 0.0
                upper = parameter.value * (1.0 + SIGMAS * errors.of(name)) if limited else None
            reason = f"{parameter.reason}; {unknown[name]}" if parameter.reason else unknown[name]
            parameters[name] = Parameter(
                None, "not_identified", reason, lower, upper, fitted=parameter.value
            )
        elif parameter.status == "ok":
            # Above 50 % the parameter has a value only with the doubtful B fixed.
            error_beside_bias = apart.of(name) if errors.of(name) > _MAX_RELATIVE_ERROR else None
            low, high = errors.factors(name, doubtful, error_beside_bias)
            parameters[name] = replace(
                parameters[name], lower=parameter.value * low, upper=parameter.value * high
            )
    bias = parameters["B"]
    if bias.status == "ok" and model.T_B is not None and model.T_B < BROADBAND_TIME:
        bias = bias.withheld(texts.broadband_process(model.T_B))
    return Estimate(
        estimate.method,
        parameters,
        curve={"B_curve": bias} | _estimate_lowest_point(model, errors, curve),
    )


def _estimate_lowest_point(
    model: NoiseModel, errors: Errors, curve: AllanCurve
) -> dict[str, Parameter]:
    """Return the lowest point of the fitted curve, with limits from the errors of the fit."""
    tau = make_averaging_times(curve.rate, curve.samples / curve.rate)
    lowest = estimate_lowest_point(convert_noise_model(model), [], tau)
    finite = bool(np.isfinite(errors.covariance).all())
    if not finite or any(parameter.value is None for parameter in lowest.values()):
        return lowest
    ends = []
    for sign in (-1.0, 1.0):
        factor = math.exp(sign * _LOG_PARAMETER_STEP)
        moved = [replace(model, **{name: getattr(model, name) * factor}) for name in errors.names]
        ends.append([find_lowest_point(convert_noise_model(each), tau)[:2] for each in moved])
    slopes = np.log(np.array(ends[1]) / np.array(ends[0]))[:, :, 0].T / (2.0 * _LOG_PARAMETER_STEP)
    described = {}
    for (name, parameter), slope in zip(lowest.items(), slopes, strict=True):
        variance = max(float(slope @ errors.covariance @ slope), 0.0)
        error = min(math.sqrt(variance), _CLIP_RELATIVE_ERROR)
        if error > _MAX_RELATIVE_ERROR:
            reason = texts.large_error(name, error, _MAX_RELATIVE_ERROR)
            described[name] = Parameter(None, "not_identified", reason, fitted=parameter.value)
            continue
        factor = math.exp(SIGMAS * error)
        assert parameter.value is not None
        described[name] = replace(
            parameter, lower=parameter.value / factor, upper=parameter.value * factor
        )
    return described


def _explain_unknown_bias(error: float, error_of_time: float) -> dict[str, str]:
    if error > _MAX_RELATIVE_ERROR:
        of_bias = texts.large_error("B", error, _MAX_RELATIVE_ERROR)
        return {"B": of_bias, "T_B": f"{of_bias}; {texts.large_error('T_B', error_of_time)}"}
    if error_of_time > _MAX_RELATIVE_ERROR_TIME:
        return {
            "B": texts.no_significant_peak(error_of_time, error),
            "T_B": texts.no_significant_peak(error_of_time),
        }
    if error_of_time > _MAX_RELATIVE_ERROR:
        return {"T_B": texts.large_error("T_B", error_of_time, _MAX_RELATIVE_ERROR)}
    return {}
