"""Weighted least squares of the Allan variance (optimisation of Maia et al., section 3.2).

For a given T_B the model is linear in S_N, S_B and S_K, which are found by non-negative least
squares; the search is over T_B alone (variable projection).
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar, nnls

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.estimate import Estimate, Parameter, not_shown
from imubench_pipeline.estimators.limits import add_limits
from imubench_pipeline.noise import (
    PEAK_TAU,
    NoiseModel,
    compute_bias_instability,
    evaluate_gauss_markov_shape,
    evaluate_sampled_shape,
)
from imubench_pipeline.noise.terms.gauss_markov import CORRELATION_TIMES
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

_ACTIVE_SETS = [list(chosen) for p in (1, 2, 3) for chosen in combinations(range(3), p)]
"""Sets of nonzero columns among N, B and K."""

_RIDGE, _MIN_NORM = 1e-13, 1e-300  # For collinear columns, and of a column
_MIN_VARIANCE_FRACTION = 1e-9  # A term below this fraction of the variance at every tau is absent


class UnfitCurveError(ValueError):
    """An Allan variance to which no model can be fitted; the text says why."""


def fit(curve: AllanCurve, *, method: Method = "weighted", longest: float = 1 / 9) -> Estimate:
    """Fit N, B, T_B and K to an Allan variance.

    C = sum_i w_i (variance_i - model(tau_i))^2 with

    - ``weighted``: w = 1 / (2 sqrt(n/2L) variance)^2, the variance of the Allan variance;
    - ``paper``: w = 1 / (2 sqrt(n/2L) deviation)^2 (Maia et al., eq. 25), for the papers' figures.
      Its dimension differs from the cost: the bottom of the curve counts less, which makes little
      difference on these tau (`tests/papers/test_panel.py`).

    Parameters
    ----------
    curve : AllanCurve
    method : {"weighted", "paper"}
    longest : float
        Longest tau of the fit, as a part of the log. The shortest is where the curve begins to
        follow a model of its longer tau: the sensor's own filter bends it before.

    Returns
    -------
    Estimate
        SI, with 95 % limits from the covariance of the Allan variances. ``absent``: the fit is
        best without the term; ``at_bound``: T_B at the end of the search, which goes as far as
        the process still peaks inside the tau used; ``not_identified``: the log cannot determine
        the value, see `imubench_pipeline.estimators.limits.add_limits`.

    Raises
    ------
    UnfitCurveError
        If fewer than four points lie within ``longest``, or the Allan variance is 0 at one.
    ValueError
        If the method is not known.
    """
    return add_limits(*_solved(curve, method, longest))


def fit_if_possible(curve: AllanCurve, *, method: Method, longest: float) -> Estimate:
    """Fit as `fit` does; a curve that cannot be fitted is ``not_shown``, with the reason.

    Raises
    ------
    ValueError
        If the method is not known.
    """
    try:
        return fit(curve, method=method, longest=longest)
    except UnfitCurveError as error:
        return not_shown(method, str(error))


def solve(curve: AllanCurve, *, method: Method = "weighted", longest: float = 1 / 9) -> Estimate:
    """Fit N, B, T_B and K as `fit` does, without limits, which take most of its time.

    Parameters, errors and statuses are as in `fit`, except for ``not_identified``.
    """
    return _solved(curve, method, longest)[0]


def _solved(
    curve: AllanCurve, method: Method, longest: float
) -> tuple[Estimate, AllanCurve, NDArray[np.bool_]]:
    """Return the estimate without limits, the curve, and the tau that were fitted."""
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
    return Estimate(method, parameters), curve, used


def _find_first_unbent(curve: AllanCurve, used: NDArray[np.bool_], method: Method) -> int:
    """Return the smallest cluster size from which the curve follows a model of its longer tau.

    Filter and coarse steps bend the curve at the shortest tau, which weigh most. The bend fades as
    1/n: the fit begins where it is below the standard error of the curve.
    """
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

    def _shapes(self, times: Array) -> Array:
        """Return the shape of the process at each tau, one row for each T_B."""
        if self._sampled:
            return np.array([self._shape(T_B) for T_B in times])
        return np.asarray(evaluate_gauss_markov_shape(self._tau, times[:, None]))

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

    def _costs(self, shapes: Array) -> Array:
        """Return the squared costs of `_solved` for shapes (t, m), over all active sets at once."""
        columns = np.empty((len(shapes), 3, len(self._tau)))
        columns[:, 0], columns[:, 1], columns[:, 2] = self._white, shapes, self._walk
        columns *= self._root_weight
        columns /= np.maximum(np.linalg.norm(columns, axis=2, keepdims=True), _MIN_NORM)
        products = columns @ columns.transpose(0, 2, 1)
        target = columns @ self._target
        cost = np.full(len(shapes), self._target @ self._target)
        for chosen in _ACTIVE_SETS:
            part = products[:, chosen][:, :, chosen] + _RIDGE * np.eye(len(chosen))
            solution = np.linalg.solve(part, target[:, chosen, None])[..., 0]
            left = self._target @ self._target - (solution * target[:, chosen]).sum(axis=1)
            cost = np.where((solution >= 0.0).all(axis=1), np.minimum(cost, left), cost)
        return cost

    def estimate(self) -> Estimate:
        """Return the estimate at the best T_B."""
        scan = np.geomspace(self.shortest, self.longest, _SCAN_TIMES)
        best = int(np.argmin(self._costs(self._shapes(scan))))
        cost = self._solved(self._shape(float(scan[best])))[1]
        low, high = scan[max(best - 1, 0)], scan[min(best + 1, _SCAN_TIMES - 1)]
        minimum = minimize_scalar(
            lambda u: self._solved(self._shape(math.exp(u)))[1],
            bounds=(math.log(low), math.log(high)),
            method="bounded",
            options={"xatol": 1e-10},
        )
        T_B = math.exp(minimum.x) if minimum.fun < cost else float(scan[best])
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
        return Estimate(
            self._method,
            {
                "N": Parameter(math.sqrt(white)) if present["N"] else absent,
                "B": bias,
                "T_B": time,
                "K": Parameter(math.sqrt(walk)) if present["K"] else absent,
            },
        )
