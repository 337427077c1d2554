"""Confidence limits of the parameters of a weighted fit, and the parameters that are identified.

A fit weighs the Allan variances as if they were independent. Its errors follow from their true
covariance C under the fitted model. J are the derivatives of the relative Allan variance by the
logarithms of the parameters, and W the weights (the "sandwich" estimator: H. White, Econometrica
48, 1980):

    Cov = G C G^T,   G = (J^T W J)^-1 J^T W.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.allan.confidence import equivalent_degrees
from imubench_pipeline.estimators.curve_bias import (
    convert_noise_model,
    estimate_lowest_point,
    find_lowest_point,
    make_averaging_times,
)
from imubench_pipeline.estimators.estimate import BROADBAND_TIME, SIGMAS, Estimate, Parameter
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.variance_covariance import compute_variance_covariance
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import curves as texts

_MAX_RELATIVE_ERROR = 0.5  # Relative standard error beyond which a parameter is not identified

_MAX_RELATIVE_ERROR_TIME = 0.75
"""Beyond it B is not identified either: in white logs B often seems known, T_B in 1 of 200."""

_MAX_RELATIVE_ERROR_HELD = 0.25  # Of B with T_B fixed, and of N and K with B fixed
_CLIP_RELATIVE_ERROR = 10.0  # Larger ones would overflow in the limits
_LOG_TIME_STEP = 1e-3  # Step of log T_B in the finite difference
_LOG_PARAMETER_STEP = 0.05  # Of the finite differences of the lowest point


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
        """Return the factors from a parameter to its 95 % limits, with and without doubtful terms.

        Without a term, the parameter moves by its regression on the density of that term.
        ``beside`` is the standard error with those terms fixed; by default they vary. If the square
        of an amplitude is less than 1.96 standard errors from 0, its lower limit is 0.
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

    ``used`` selects the tau of the fit, ``method`` its weights
    (`imubench_pipeline.estimators.least_squares.fit`); ``held`` are the fixed parameters.
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
    covariance = compute_variance_covariance(model, rate, curve.samples, sizes) * np.outer(
        scale, scale
    )
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
    every term of its model; ``used`` selects the tau that were fitted.
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
        reason = texts.broadband_process(model.T_B)
        bias = replace(bias, value=None, status="not_identified", reason=reason, fitted=model.B)
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
    best = convert_noise_model(model)
    at = [getattr(model, name) for name in errors.names]
    lowest = estimate_lowest_point(best, [], tau)
    finite = bool(np.isfinite(errors.covariance).all())
    if not finite or any(parameter.value is None for parameter in lowest.values()):
        return lowest
    ends = []
    for sign in (-1.0, 1.0):
        moved = [
            convert_noise_model(
                replace(model, **{name: value * math.exp(sign * _LOG_PARAMETER_STEP)})
            )
            for name, value in zip(errors.names, at, strict=True)
        ]
        ends.append([find_lowest_point(models, tau)[:2] for models in moved])
    slopes = np.log(np.array(ends[1]) / np.array(ends[0]))[:, :, 0].T / (2.0 * _LOG_PARAMETER_STEP)
    described = {}
    for (name, parameter), slope in zip(lowest.items(), slopes, strict=True):
        error = min(
            math.sqrt(max(float(slope @ errors.covariance @ slope), 0.0)), _CLIP_RELATIVE_ERROR
        )
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
    """Return reasons if B and T_B, or T_B alone, are not identified."""
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
