"""Causal Kalman filter that fuses the samples of the sensors of a board.

Its steady state is computed by a doubling algorithm (`steady_covariance`).
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import block_diag, schur
from scipy.sparse import csr_array

from imubench_pipeline.extensions.fusion.board import Board, stochastic
from imubench_pipeline.noise import GaussMarkov, compute_bias_instability
from imubench_pipeline.noise.state_space import of_block_means
from imubench_pipeline.typing import Array

_MAX_DOUBLINGS = 80
_CONVERGENCE_TOLERANCE = 1e-13  # relative change of the covariance
_MAX_FLICKER_TAU = 1e5  # s, up to which the filter models flicker noise

_WALK_SURROGATE_TIME_RATIO = 100.0
"""Correlation time of the Gauss-Markov process that replaces a random walk, over the longest tau.

A walk that all sensors share is not observable in their differences and would have no steady state.
Its estimate does not matter: it is fused as a part of the signal.
"""


def steady_covariance(transition: Array, process_noise: Array, information: Array) -> Array:
    """Return the steady covariance P of a Kalman filter before a measurement, shape (m, m).

    The solution of the discrete algebraic Riccati equation

        P = Phi P (I + G P)^-1 Phi^T + Q,    G = H^T R^-1 H,

    by a structure-preserving doubling algorithm (B. D. O. Anderson, Int. J. Control 28(2), 1978; E.
    K.-W. Chu et al., Int. J. Control 77(8), 2004), accurate for a singular G and for
    eigenvalues near 1. Raises ValueError if an unobservable process is not stable.
    """
    scale = np.sqrt(np.max(np.diag(process_noise), initial=0.0)) or 1.0
    a = transition
    g = information * scale**2
    p = process_noise / scale**2
    identity = np.eye(len(transition))
    for _ in range(_MAX_DOUBLINGS):
        inner = np.linalg.solve((identity + p @ g).T, np.column_stack((a.T, g))).T
        # a (I + P G)^-1 and g (I + P G)^-1
        through, seen = inner[: len(a)], inner[len(a) :]
        grown = p + through @ p @ a.T
        g = g + a.T @ seen @ a
        a = through @ a
        grown, g = (grown + grown.T) / 2.0, (g + g.T) / 2.0
        change = np.max(np.abs(grown - p), initial=0.0) / np.max(np.abs(grown), initial=1e-300)
        p = grown
        if change < _CONVERGENCE_TOLERANCE:
            return np.asarray(p * scale**2)
    raise ValueError("the filter has no steady state: a growing process is not observable")


class KalmanFusion:
    """The best causal fusion in the steady state; ValueError if a sensor has no white noise.

    The common signal passes unchanged, without delay. The slow errors of the sensors are states,
    estimated from the differences between the sensors. With y = 1 s + H x + v, P the steady
    covariance of the predicted states and S = H P H^T + R,

        s^ = a^T (y - H x),    a = S^-1 1 / (1^T S^-1 1),
        x' = Phi (x + L (y - H x)),    L = P H^T (S^-1 - S^-1 1 a^T),

    as the Kalman filter of any n - 1 independent differences. Ramps and lines are not estimated.
    """

    def __init__(self, board: Board) -> None:
        self.sensors = board.sensors
        spaces, outputs = [], []
        white = np.zeros((board.sensors, board.sensors))
        of_sensors = zip(
            board.models, board.rates, board.blocks, np.eye(board.sensors), strict=True
        )
        shared = ((s.model, board.rate, 1, np.asarray(s.sensitivity)) for s in board.shared)
        for model, rate, size, gains in [*of_sensors, *shared]:
            noise = stochastic(model)
            if noise.K:  # the walk is replaced by a slow stable process
                time = _WALK_SURROGATE_TIME_RATIO * _MAX_FLICKER_TAU
                walk = GaussMarkov(compute_bias_instability(noise.K**2, time), time)
                noise = replace(noise, K=0.0, further=[*noise.further, walk])
            space = of_block_means(noise.state_space(rate, _MAX_FLICKER_TAU), size)
            spaces.append(space)
            outputs.append(np.outer(gains, space.output))
            white += space.measurement_noise * np.outer(gains, gains)
        transition = np.asarray(block_diag(*(space.transition for space in spaces)))
        process_noise = np.asarray(block_diag(*(space.process_noise for space in spaces)))
        output = np.concatenate(outputs, axis=1)
        if not np.all(np.diag(white) > 0.0):
            raise ValueError("a filter needs white noise, N, of every sensor")
        information = output.T @ _project_out_common(white) @ output
        covariance = steady_covariance(transition, process_noise, information)
        of_output = output @ covariance @ output.T + white
        solved = np.linalg.solve(of_output, np.ones(len(of_output)))
        self.weights = np.asarray(solved / solved.sum())
        gain = covariance @ output.T @ _project_out_common(of_output)
        # The rows must be orthogonal to the signal to machine precision.
        gain -= np.outer(gain.sum(axis=1), self.weights)
        self._output, self._transition, self._gain = output, transition, transition @ gain
        closed = transition - self._gain @ output
        self._triangle, basis = schur(closed, output="complex")
        self._row = self.weights @ output @ basis
        self._columns = basis.conj().T @ self._gain

    @property
    def states(self) -> int:
        """Number of states."""
        return len(self._transition)

    def response(self, omega: Array) -> NDArray[np.complex128]:
        """Return the transfer from each sensor, (m, n), at omega, rad per sample, shape (m,)."""
        # Loss of significance near frequency 0 is avoided: (z - 1) + (1 - F).
        turn = np.expm1(1j * omega)
        solved = np.zeros((self.states, len(omega)), dtype=np.complex128)
        for j in range(self.states):
            right_side = self._row[j] + self._triangle[:j, j] @ solved[:j]
            solved[j] = right_side / (turn + (1.0 - self._triangle[j, j]))
        return np.asarray(self.weights - solved.T @ self._columns)

    def fuse(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Yield the fused samples, block by block; they do not depend on the size of the blocks.

        The filter begins with states of 0: subtract the fixed bias of each sensor before. If a
        sensor has no sample (NaN), there is no fused sample, and the states are only predicted. The
        blocks are samples of all sensors at the fused rate (`at_fused_rate`), shape (k, n), in
        rad/s or m/s^2. Raises ValueError if a block has another number of sensors.
        """
        state = np.zeros(self.states)
        output, transition = csr_array(self._output), csr_array(self._transition)
        for block in blocks:
            if block.ndim != 2 or block.shape[1] != self.sensors:
                raise ValueError(
                    f"a block has the shape {block.shape}, expected {self.sensors} columns"
                )
            yield _run_filter(
                np.ascontiguousarray(block, dtype=np.float64),
                state,
                (output.indptr, output.indices, output.data),
                (transition.indptr, transition.indices, transition.data),
                np.ascontiguousarray(self._gain),
                self.weights,
            )


def _project_out_common(covariance: Array) -> Array:
    """Return S^-1 - S^-1 1 1^T S^-1 / (1^T S^-1 1): the information of the differences."""
    inverse = np.linalg.inv(covariance)
    inverse = (inverse + inverse.T) / 2.0
    rows = inverse.sum(axis=1)
    return np.asarray(inverse - np.outer(rows, rows) / rows.sum())


@njit(cache=True, nogil=True)
def _run_filter(
    samples: Array,
    state: Array,
    output: tuple[NDArray[np.int32], NDArray[np.int32], Array],
    transition: tuple[NDArray[np.int32], NDArray[np.int32], Array],
    gain: Array,
    weights: Array,
) -> Array:
    """Return the fused samples, and update the state in place."""
    sensors, states = weights.size, state.size
    fused, left, moved = np.empty(len(samples)), np.empty(sensors), np.empty(states)
    for k in range(len(samples)):
        signal = 0.0
        for i in range(sensors):
            seen = samples[k, i]
            for e in range(output[0][i], output[0][i + 1]):
                seen -= output[2][e] * state[output[1][e]]
            left[i] = seen
            signal += weights[i] * seen
        fused[k] = signal
        missing = not math.isfinite(signal)
        if missing:
            fused[k] = math.nan
        for j in range(states):
            total = 0.0
            for e in range(transition[0][j], transition[0][j + 1]):
                total += transition[2][e] * state[transition[1][e]]
            if not missing:
                # The gain is orthogonal to the signal: subtract it to keep precision.
                for i in range(sensors):
                    total += gain[j, i] * (left[i] - signal)
            moved[j] = total
        for j in range(states):
            state[j] = moved[j]
    return fused
