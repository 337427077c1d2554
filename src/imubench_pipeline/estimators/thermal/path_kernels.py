"""The compiled recursions of the path of a temperature: expectation propagation on its blocks.

The temperature is an integrated random walk, x'' white of density q. The likelihood of a block is
exp(-precision x^2 / 2 + shift x) if it measures x, or P(x + noise in the cell) if it only gives
the cell of the register; the latter is replaced by the Gaussian with equal moments.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

_MAX_SWEEPS = 40
_TOLERANCE = 1e-4
_VAGUE = 1e3
_SQRT_HALF = math.sqrt(0.5)
_ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
_FAR = 30.0


@njit(cache=True)
def compute_cell_moments(
    m: float, v: float, low: float, high: float, noise: float
) -> tuple[float, ...]:
    """Return log P, mean and variance of x ~ N(m, v), given that x + noise lies in a cell.

    ``low`` and ``high`` are the edges of the cell, ``noise`` is the variance of the noise.
    """
    spread = math.sqrt(v + noise)
    a, b = (low - m) / spread, (high - m) / spread
    sign = 1.0
    if a + b < 0.0:  # the cell below: mirror it, so that no digits are lost in 1 - small
        a, b, sign = -b, -a, -1.0
    if a > _FAR:
        # Mills' ratio: far in the tail the normal density is exponential.
        first = a + 1.0 / a
        z_mean, z_variance = first, 1.0 / (a * a)
        log_p = -0.5 * a * a - math.log(a * _ROOT_TWO_PI)
    else:
        p = 0.5 * (math.erfc(a * _SQRT_HALF) - math.erfc(b * _SQRT_HALF))
        if not p > 0.0:
            p = 1e-300
        at_a = math.exp(-0.5 * a * a) / _ROOT_TWO_PI / p
        at_b = math.exp(-0.5 * b * b) / _ROOT_TWO_PI / p
        z_mean = at_a - at_b
        z_variance = 1.0 + a * at_a - b * at_b - z_mean * z_mean
        z_variance = min(max(z_variance, 1e-12), 1.0)
        log_p = math.log(p)
    gain = v / spread
    return log_p, m + sign * gain * z_mean, v - gain * gain * (1.0 - z_variance)


@njit(cache=True)
def _log_mass(m: float, v: float, precision: float, shift: float) -> float:
    """Return log of the mean of exp(-precision x^2 / 2 + shift x) over N(m, v)."""
    grown = 1.0 + v * precision
    return (
        -0.5 * math.log(grown)
        + 0.5 * (2.0 * m * shift - m * m * precision + v * shift * shift) / grown
    )


@njit(cache=True)
def _ahead(
    x: float, s: float, a: float, b: float, c: float, h: float, q: float
) -> tuple[float, float, float, float]:
    """Return x, and the covariance (a, b; b, c) of x and its slope s, after a time h."""
    return (
        x + h * s,
        a + 2.0 * h * b + h * h * c + q * h**3 / 3.0,
        b + h * c + q * h * h / 2.0,
        c + q * h,
    )


@njit(cache=True)
def _measured(
    x: float, s: float, a: float, b: float, c: float, precision: float, shift: float
) -> tuple[float, float, float, float, float]:
    """Return state and covariance after a measurement exp(-precision x^2 / 2 + shift x)."""
    grown = 1.0 + precision * a
    pull = (shift - precision * x) / grown
    return x + a * pull, s + b * pull, a / grown, b / grown, c - b * b * precision / grown


@njit(cache=True)
def _filtered(
    steps: Array, q: float, spread: float, precision: Array, shift: Array, means: Array, covs: Array
) -> float:
    """Filter; set the filtered means (n, 2) and covariances (n, 3), return log evidence."""
    n = precision.size
    total = 0.0
    x, s = 0.0, 0.0
    a, b, c = _VAGUE * spread**2, 0.0, _VAGUE * spread**2 / steps.max() ** 2
    for i in range(n):
        if i > 0:
            x, a, b, c = _ahead(x, s, a, b, c, steps[i], q)
        if precision[i] > 0.0:
            total += _log_mass(x, a, precision[i], shift[i])
            x, s, a, b, c = _measured(x, s, a, b, c, precision[i], shift[i])
        means[i, 0], means[i, 1] = x, s
        covs[i, 0], covs[i, 1], covs[i, 2] = a, b, c
    return total


@njit(cache=True)
def _gain(h: float, q: float, cov: Array) -> tuple[float, ...]:
    """Return the smoother's gain G, row by row, and the residual covariance P - G P' G^T.

    G = P F^T P'^-1 = F^-1 (1 - Q P'^-1), with P' = F P F^T + Q: no digits are lost if q is small.
    """
    a, b, c = cov[0], cov[1], cov[2]
    qa, qb, qc = q * h**3 / 3.0, q * h * h / 2.0, q * h
    pa, pb, pc = a + 2.0 * h * b + h * h * c + qa, b + h * c + qb, c + qc
    det = max(pa * pc - pb * pb, 1e-14 * pa * pc)
    w00, w01 = (qa * pc - qb * pb) / det, (qb * pa - qa * pb) / det
    w10, w11 = (qb * pc - qc * pb) / det, (qc * pa - qb * pb) / det
    la = max(qa - w00 * qa - w01 * qb, 0.0)
    lb = qb - w00 * qb - w01 * qc
    lc = max(qc - w10 * qb - w11 * qc, 0.0)
    return (
        1.0 - w00 + h * w10,
        -w01 - h * (1.0 - w11),
        -w10,
        1.0 - w11,
        max(la - 2.0 * h * lb + h * h * lc, 0.0),
        lb - h * lc,
        lc,
    )


@njit(cache=True)
def _smoothed(
    steps: Array, q: float, means: Array, covs: Array, path: Array, variance: Array
) -> None:
    """Smooth backwards: the mean and the variance of x in every block."""
    n = path.size
    x, s = means[n - 1, 0], means[n - 1, 1]
    a, b, c = covs[n - 1, 0], covs[n - 1, 1], covs[n - 1, 2]
    path[n - 1], variance[n - 1] = x, a
    for i in range(n - 2, -1, -1):
        h = steps[i + 1]
        j, k, r, m, la, lb, lc = _gain(h, q, covs[i])
        dx, ds = x - means[i, 0] - h * means[i, 1], s - means[i, 1]
        x, s = means[i, 0] + j * dx + k * ds, means[i, 1] + r * dx + m * ds
        la += j * j * a + 2.0 * j * k * b + k * k * c
        lb += j * r * a + (j * m + k * r) * b + k * m * c
        lc += r * r * a + 2.0 * r * m * b + m * m * c
        a, b, c = la, lb, lc
        path[i], variance[i] = x, max(a, 1e-300)


@njit(cache=True)
def _messages(steps: Array, q: float, precision: Array, shift: Array, future: Array) -> None:
    """Set the messages from later blocks: precision (3) and shift (2) of the state, (n, 5)."""
    n = precision.size
    future[n - 1] = 0.0
    for i in range(n - 2, -1, -1):
        h = steps[i + 1]
        a, b, c = future[i + 1, 0] + precision[i + 1], future[i + 1, 1], future[i + 1, 2]
        e, f = future[i + 1, 3] + shift[i + 1], future[i + 1, 4]
        qa, qb, qc = q * h**3 / 3.0, q * h * h / 2.0, q * h
        # (1 + Lambda Q)^-1, row by row.
        j, k = 1.0 + a * qa + b * qb, a * qb + b * qc
        r, m = b * qa + c * qb, 1.0 + b * qb + c * qc
        det = j * m - k * r
        j, k, r, m = m / det, -k / det, -r / det, j / det
        a, b, c = j * a + k * b, j * b + k * c, r * b + m * c
        e, f = j * e + k * f, r * e + m * f
        future[i, 0], future[i, 1] = a, b + h * a
        future[i, 2] = c + 2.0 * h * b + h * h * a
        future[i, 3], future[i, 4] = e, f + h * e


@njit(cache=True)
def propagate(
    steps: Array,
    q: float,
    spread: float,
    cell: NDArray[np.bool_],
    low: Array,
    high: Array,
    noise: Array,
    precision: Array,
    shift: Array,
) -> tuple[Array, Array, float]:
    """Return mean and variance of the path, shapes (n,), °C and °C², and the log evidence.

    ``steps``, shape (n,): time since the previous block, in blocks; ``q``: density of x'', °C² per
    block³; ``spread``: range of the readings, °C, for a vague prior of the first x; ``cell``:
    blocks that give the cell of x, with the edges ``low`` and ``high``, °C, and the variance
    ``noise``, °C², of the noise between x and these edges; ``precision``, 1/°C², and ``shift``,
    1/°C: measurements (0: none), set in place for cells. The evidence is -inf if the iteration does
    not converge.
    """
    n = precision.size
    means, covs = np.empty((n, 2)), np.empty((n, 3))
    path, variance = np.empty(n), np.empty(n)
    future = np.empty((n, 5))
    any_cell = False
    for i in range(n):
        if cell[i]:
            any_cell = True
            width = (high[i] - low[i]) ** 2 / 12.0 + noise[i]
            precision[i], shift[i] = 1.0 / width, 0.5 * (low[i] + high[i]) / width
    settled = not any_cell
    for _ in range(_MAX_SWEEPS):
        if settled:
            break
        _messages(steps, q, precision, shift, future)
        moved = 0.0
        # Forwards, each block after those before it: all at once would overshoot.
        x, s = 0.0, 0.0
        a, b, c = _VAGUE * spread**2, 0.0, _VAGUE * spread**2 / steps.max() ** 2
        for i in range(n):
            if i > 0:
                x, a, b, c = _ahead(x, s, a, b, c, steps[i], q)
            if cell[i]:
                m, v = _joined(x, s, a, b, c, future[i])
                _, mean, var = compute_cell_moments(m, v, low[i], high[i], noise[i])
                wanted = max(1.0 / var - 1.0 / v, 1e-12 / (high[i] - low[i]) ** 2)
                wanted_shift = mean * (wanted + 1.0 / v) - m / v
                before = (m / v + shift[i]) / (1.0 / v + precision[i])
                moved = max(moved, abs(mean - before) / (high[i] - low[i]))
                precision[i], shift[i] = wanted, wanted_shift
            if precision[i] > 0.0:
                x, s, a, b, c = _measured(x, s, a, b, c, precision[i], shift[i])
        settled = moved < _TOLERANCE
    evidence = _filtered(steps, q, spread, precision, shift, means, covs)
    _smoothed(steps, q, means, covs, path, variance)
    for i in range(n):
        if cell[i]:
            rest = 1.0 / variance[i] - precision[i]
            v = 1.0 / max(rest, 1e-9 / variance[i])
            m = v * (path[i] / variance[i] - shift[i])
            log_p = compute_cell_moments(m, v, low[i], high[i], noise[i])[0]
            evidence += log_p - _log_mass(m, v, precision[i], shift[i])
    return path, variance, evidence if settled and np.isfinite(evidence) else -np.inf


@njit(cache=True)
def _joined(x: float, s: float, a: float, b: float, c: float, future: Array) -> tuple[float, float]:
    """Return mean and variance of x, given a Gaussian state and the message from later blocks."""
    fa, fb, fc, fe, ff = future[0], future[1], future[2], future[3], future[4]
    # (1 + P Lambda)^-1 times (state + P shift), and times P.
    j, k = 1.0 + a * fa + b * fb, a * fb + b * fc
    r, m = b * fa + c * fb, 1.0 + b * fb + c * fc
    det = j * m - k * r
    right, below = x + a * fe + b * ff, s + b * fe + c * ff
    return (m * right - k * below) / det, (m * a - k * b) / det


@njit(cache=True)
def draw_paths(
    steps: Array, q: float, spread: float, precision: Array, shift: Array, normals: Array
) -> Array:
    """Return draws of the path from its Gaussian posterior, shape (draws, n), °C.

    ``precision`` and ``shift`` are from `propagate`; ``normals``: normal deviates, (draws, n, 2).
    """
    draws, n = normals.shape[0], normals.shape[1]
    means, covs = np.empty((n, 2)), np.empty((n, 3))
    _filtered(steps, q, spread, precision, shift, means, covs)
    paths = np.empty((draws, n))
    for d in range(draws):
        x, s = 0.0, 0.0
        for i in range(n - 1, -1, -1):
            mx, ms = means[i, 0], means[i, 1]
            a, b, c = covs[i, 0], covs[i, 1], covs[i, 2]
            if i < n - 1:
                h = steps[i + 1]
                j, k, r, m, a, b, c = _gain(h, q, covs[i])
                dx, ds = x - mx - h * ms, s - ms
                mx, ms = mx + j * dx + k * ds, ms + r * dx + m * ds
            first = math.sqrt(max(a, 0.0))
            x = mx + first * normals[d, i, 0]
            cross = b / first if first > 0.0 else 0.0
            s = ms + cross * normals[d, i, 0]
            s += math.sqrt(max(c - cross * cross, 0.0)) * normals[d, i, 1]
            paths[d, i] = x
    return paths
