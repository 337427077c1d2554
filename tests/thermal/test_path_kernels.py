"""The recursions of a path against the whole covariance of an integrated Wiener process."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import log_ndtr, ndtr
from scipy.stats import multivariate_normal

from imubench_pipeline.estimators.thermal.path_kernels import (
    compute_cell_moments,
    draw_paths,
    propagate,
)

STEPS = np.array([1.0, 1.0, 2.5, 1.0, 1.5, 3.0, 1.0])
Q, SPREAD = 0.3, 2.0
PRECISION = np.array([4.0, 0.0, 1.5, 9.0, 0.0, 2.0, 5.0])
SHIFT = PRECISION * np.array([0.3, 0.0, -0.4, 1.2, 0.0, 2.9, 2.2])


def prior(steps=STEPS):
    """Of a level and a slope that are next to unknown, and of twice integrated white noise."""
    t = np.cumsum(steps) - steps[0]
    first, last = np.minimum.outer(t, t), np.maximum.outer(t, t)
    known = 1e3 * SPREAD**2 * (1.0 + np.outer(t, t) / steps.max() ** 2)
    return known + Q * first**2 * (3.0 * last - first) / 6.0


@dataclass
class Dense:
    """The posterior of all blocks at once."""

    mean: np.ndarray
    covariance: np.ndarray
    evidence: float


def dense(precision, shift, steps=STEPS):
    inside = np.eye(len(steps)) + prior(steps) * precision
    covariance = np.linalg.solve(inside, prior(steps))
    mean = covariance @ shift
    return Dense(mean, covariance, 0.5 * (shift @ mean - np.linalg.slogdet(inside)[1]))


def propagated(cell=(), low=0.0, high=0.0, noise=0.01):
    n = len(STEPS)
    cells = np.isin(np.arange(n), cell)
    precision, shift = np.where(cells, 0.0, PRECISION), np.where(cells, 0.0, SHIFT)
    edges = [np.broadcast_to(edge, n).astype(float) for edge in (low, high, noise)]
    found = propagate(STEPS, Q, SPREAD, cells, *edges, precision, shift)
    return *found, precision, shift


def cavity(truth, precision, shift, i):
    """What all other blocks say of one."""
    v = 1.0 / (1.0 / truth.covariance[i, i] - precision[i])
    return v * (truth.mean[i] / truth.covariance[i, i] - shift[i]), v


def in_cell(m, v, low, high, noise):
    """Log of the chance, mean and variance, by quadrature."""

    def moment(k):
        return quad(
            lambda x: (
                x**k
                * (ndtr((high - x) / noise**0.5) - ndtr((low - x) / noise**0.5))
                * math.exp(-((x - m) ** 2) / (2.0 * v))
                / math.sqrt(2.0 * math.pi * v)
            ),
            low - 2.0,
            high + 2.0,
            limit=200,
        )[0]

    chance, first, second = (moment(k) for k in range(3))
    return math.log(chance), first / chance, second / chance - (first / chance) ** 2


def test_measured_blocks_give_the_posterior_of_all_at_once():
    path, variance, evidence, *_ = propagated()
    truth = dense(PRECISION, SHIFT)
    np.testing.assert_allclose(path, truth.mean, rtol=1e-8)
    np.testing.assert_allclose(variance, np.diag(truth.covariance), rtol=1e-8)
    assert evidence == pytest.approx(truth.evidence, rel=1e-10)


def test_draws_have_mean_and_covariance_of_the_posterior():
    n = len(STEPS)
    normals = np.concatenate([np.zeros((1, n, 2)), np.eye(2 * n).reshape(2 * n, n, 2)])
    paths = draw_paths(STEPS, Q, SPREAD, PRECISION, SHIFT, normals)
    truth, root = dense(PRECISION, SHIFT), paths[1:] - paths[0]
    np.testing.assert_allclose(paths[0], truth.mean, rtol=1e-8)
    np.testing.assert_allclose(root.T @ root, truth.covariance, rtol=1e-6, atol=1e-9)


def test_a_block_in_a_cell_has_the_moments_of_its_cell():
    path, variance, evidence, *_ = propagated([4], 1.5, 2.5, 0.02)
    others = dense(np.where(np.arange(7) == 4, 0.0, PRECISION), SHIFT)
    log_p, mean, var = in_cell(others.mean[4], others.covariance[4, 4], 1.5, 2.5, 0.02)
    assert (path[4], variance[4]) == pytest.approx((mean, var), rel=1e-5)
    # The cell tells of the others by what it tells of its own block.
    gain = others.covariance[:, 4] / others.covariance[4, 4]
    np.testing.assert_allclose(path, others.mean + gain * (mean - others.mean[4]), rtol=1e-5)
    left = np.diag(others.covariance) + gain**2 * (var - others.covariance[4, 4])
    np.testing.assert_allclose(variance, left, rtol=1e-5)
    assert evidence == pytest.approx(others.evidence + log_p, abs=1e-5)


def test_blocks_in_cells_agree_with_each_other():
    cells, low = [1, 2, 4, 5], np.array([0.0, -0.5, -0.5, 0.0, 1.5, 2.5, 0.0])
    path, variance, evidence, precision, shift = propagated(cells, low, low + 1.0, 0.03)
    truth = dense(precision, shift)
    np.testing.assert_allclose(path, truth.mean, rtol=1e-6)
    np.testing.assert_allclose(variance, np.diag(truth.covariance), rtol=1e-6)
    expected = truth.evidence
    for i in cells:
        m, v = cavity(truth, precision, shift, i)
        log_p, mean, var = in_cell(m, v, low[i], low[i] + 1.0, 0.03)
        assert (path[i], variance[i]) == pytest.approx((mean, var), rel=1e-3)
        # Less what the Gaussian in the place of the cell has added.
        grown = 1.0 + v * precision[i]
        stood = (2.0 * m * shift[i] - m * m * precision[i] + v * shift[i] ** 2) / grown
        expected += log_p - 0.5 * (stood - math.log(grown))
    assert evidence == pytest.approx(expected, abs=1e-3)


def test_evidence_of_two_cells_is_nearly_the_chance_of_their_rectangle():
    found = propagated([1, 4], 0.0, 1.0, 0.02)[2]
    others = dense(np.where(np.isin(np.arange(7), [1, 4]), 0.0, PRECISION), SHIFT)
    both = np.ix_([1, 4], [1, 4])
    normal = multivariate_normal(
        others.mean[[1, 4]], others.covariance[both] + 0.02 * np.eye(2), seed=1
    )
    chance = math.log(normal.cdf([1.0, 1.0], lower_limit=[0.0, 0.0]))
    assert found - others.evidence == pytest.approx(chance, abs=0.03)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_moments_far_from_a_cell_are_those_of_the_tail(side):
    m, v, noise = side * 40.0, 0.9, 0.1
    low, high = (-0.5, 0.5)
    log_p, mean, variance = compute_cell_moments(m, v, low, high, noise)
    a = 39.5
    assert log_p == pytest.approx(log_ndtr(-a), rel=1e-5)
    # Of a normal variate beyond a: by its density over its tail.
    beyond = math.exp(-0.5 * a * a - 0.5 * math.log(2.0 * math.pi) - log_ndtr(-a))
    assert mean == pytest.approx(m - side * v * beyond, abs=1e-4)
    assert variance == pytest.approx(v - v**2 * (1.0 - (1.0 + a * beyond - beyond**2)), rel=1e-3)
