"""The compiled error-state filter of one run: strapdown, sensor states, GNSS fixes.

The error states are true less estimated position, velocity and attitude (a turn in the frame), the
states of the noise of each axis, and the scale-factor errors that are states. The strapdown runs at
the sampling rate on samples corrected by the estimated errors. Transition and noise of the error
states are accumulated over steps, linearised about the estimate, and the covariance is propagated
from fix to fix. After each fix the error states correct the estimate (closed loop).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.extensions.aided.axis_states import StackedStates
from imubench_pipeline.extensions.aided.strapdown import (
    GRAVITY_GRADIENT,
    compute_rotation_vector,
    copy,
    multiply,
    propagate_sample,
    write_rotation,
)
from imubench_pipeline.typing import Array

NAVIGATION_STATES = 9  # position, velocity (north, east, down) and attitude

GROUPS = ("position", "velocity", "attitude", "gyro", "accel", "navigation")
"""Groups of states with a normalised squared error (NEES). The bias of an axis is the sum of its
states; ``navigation`` is the first three groups together."""

DEGREES_OF_FREEDOM = (3, 3, 3, 3, 3, 9)  # of each group


@njit(cache=True, nogil=True)
def _normalise_square(P: Array, e: Array, first: int, n: int) -> float:
    """Return e^T P^-1 e of n states from ``first``, by Cholesky; NaN if P is not positive."""
    L = np.zeros((n, n))
    y = np.empty(n)
    total = 0.0
    for i in range(n):
        for j in range(i + 1):
            s = P[first + i, first + j]
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                if s <= 0.0:
                    return math.nan
                L[i, i] = math.sqrt(s)
            else:
                L[i, j] = s / L[j, j]
        s = e[first + i]
        for k in range(i):
            s -= L[i, k] * y[k]
        y[i] = s / L[i, i]
        total += y[i] * y[i]
    return total


@njit(cache=True, nogil=True)
def run_filter(
    rate: Array,
    force: Array,
    T: float,
    earth: Array,
    fixes: Array,
    available: NDArray[np.bool_],
    spread: Array,
    position: Array,
    velocity: Array,
    attitude: Array,
    bias: Array,
    p: Array,
    v: Array,
    C: Array,
    start: Array,
    axes: StackedStates,
    width: int,
) -> tuple[Array, Array, Array, Array]:
    """Run the filter once on all readings and fixes; p, v and C are changed in place.

    ``rate`` and ``force``, shape (L, 3), are readings every T s, ``earth``, (3,), the Earth's rate.
    ``fixes``, (E, 7), are position, velocity and heading of GNSS at the end of each epoch, used
    where ``available``, (E,), with the standard deviations ``spread``, (7,); infinite: not used.
    ``position``, ``velocity``, (E, 3), and ``attitude``, (E, 3, 3), are the truth at these times,
    ``bias``, (E, 6), the true slow error of each axis; NaN if unknown. The covariance of the
    initial estimate p, v, C is ``start``, (9, 9); a step has ``width`` samples.

    Returned are the errors (true less estimated) and their variances, both (E, 9), their normalised
    squares by `GROUPS`, (E, 6), and the covariance of all states after the last epoch.
    """
    E, steps = len(fixes), len(axes.sum_observation)
    first, scale = axes.first, axes.scale
    m = first[6]
    of_scale = np.full(6, -1)
    total = NAVIGATION_STATES + m
    for a in range(6):
        if scale[a] > 0.0:
            of_scale[a] = total
            total += 1
    n_states = total - NAVIGATION_STATES
    P = np.zeros((total, total))
    copy(start, P)
    copy(axes.start, P[NAVIGATION_STATES:, NAVIGATION_STATES:])
    for a in range(6):
        if of_scale[a] >= 0:
            P[of_scale[a], of_scale[a]] = scale[a] ** 2
    x = np.zeros(n_states)
    for j in range(m):
        x[j] = axes.mean[j]
    axis_of = np.empty(m, np.int64)
    for a in range(6):
        axis_of[first[a] : first[a + 1]] = a

    errors, variances = np.empty((2, E, NAVIGATION_STATES))
    normalised = np.full((E, 6), math.nan)
    room = np.empty((4, 3, 3))
    C_mid, turn, turned = np.empty((3, 3, 3))
    A_step, A, A_new, Qnn, through = np.empty((5, NAVIGATION_STATES, NAVIGATION_STATES))
    M, MSQ = np.empty((2, NAVIGATION_STATES, 6))
    B, B_new, Qnx, Q_new = np.empty((4, NAVIGATION_STATES, n_states))
    identity = np.eye(NAVIGATION_STATES)
    estimated, moved = np.zeros(6), np.zeros(6)
    w, f, mean_force, error = np.empty((4, 3))
    dt = width * T
    k = 0
    for epoch in range(E):
        copy(identity, A)
        B[:] = 0.0
        Qnx[:] = 0.0
        Qnn[:] = 0.0
        for part in range(steps):
            # Estimated errors, subtracted from each sample of this step.
            for a in range(6):
                s = 0.0
                for j in range(first[a], first[a + 1]):
                    s += axes.first_observation[j] * x[j]
                estimated[a] = s / dt
                moved[a] = 0.0
            mean_force[:] = 0.0
            for sample in range(width):
                for i in range(3):
                    w[i] = rate[k, i] - estimated[i]
                    f[i] = force[k, i] - estimated[3 + i]
                    moved[i] += rate[k, i] * T
                    moved[3 + i] += force[k, i] * T
                    if of_scale[i] >= 0:
                        w[i] -= rate[k, i] * x[of_scale[i] - NAVIGATION_STATES]
                    if of_scale[3 + i] >= 0:
                        f[i] -= force[k, i] * x[of_scale[3 + i] - NAVIGATION_STATES]
                if sample == width // 2:
                    if width % 2 == 1:  # the middle of the step is in a sample
                        write_rotation(0.5 * T * w[0], 0.5 * T * w[1], 0.5 * T * w[2], turn)
                        multiply(C, turn, C_mid)
                    else:
                        copy(C, C_mid)
                propagate_sample(p, v, C, w, f, T, earth, room)
                for i in range(3):
                    mean_force[i] += room[3, 0, i] / width
                k += 1
            # Prediction of the sensor states.
            for a in range(6):
                for i in range(first[a], first[a + 1]):
                    s = 0.0
                    for j in range(first[a], first[a + 1]):
                        s += axes.step[i, j] * x[j]
                    B_new[0, i] = s
                for i in range(first[a], first[a + 1]):
                    x[i] = B_new[0, i]
            # Transition of the errors over the step, and their sensitivity to errors of the sums.
            fx, fy, fz = mean_force
            copy(identity, A_step)
            for i in range(3):
                A_step[i, 3 + i] = dt
            A_step[3, 0] = A_step[4, 1] = -GRAVITY_GRADIENT * dt
            A_step[5, 2] = 2.0 * GRAVITY_GRADIENT * dt
            A_step[3, 4], A_step[3, 5] = 2.0 * dt * earth[2], -2.0 * dt * earth[1]
            A_step[4, 3], A_step[4, 5] = -2.0 * dt * earth[2], 2.0 * dt * earth[0]
            A_step[5, 3], A_step[5, 4] = 2.0 * dt * earth[1], -2.0 * dt * earth[0]
            A_step[3, 7], A_step[3, 8] = dt * fz, -dt * fy
            A_step[4, 6], A_step[4, 8] = -dt * fz, dt * fx
            A_step[5, 6], A_step[5, 7] = dt * fy, -dt * fx
            for i in range(3):
                for j in range(6, 9):
                    A_step[i, j] = 0.5 * dt * A_step[3 + i, j]
            A_step[6, 7], A_step[6, 8] = dt * earth[2], -dt * earth[1]
            A_step[7, 6], A_step[7, 8] = -dt * earth[2], dt * earth[0]
            A_step[8, 6], A_step[8, 7] = dt * earth[1], -dt * earth[0]
            for i in range(3):
                for j in range(3):
                    M[6 + i, j] = -C_mid[i, j]
                    M[3 + i, 3 + j] = -C_mid[i, j]
                    M[i, 3 + j] = -0.5 * dt * C_mid[i, j]
                    M[6 + i, 3 + j] = 0.0
            for j in range(3):
                gx, gy, gz = M[6, j], M[7, j], M[8, j]
                M[3, j] = 0.5 * dt * (fz * gy - fy * gz)
                M[4, j] = 0.5 * dt * (fx * gz - fz * gx)
                M[5, j] = 0.5 * dt * (fy * gx - fx * gy)
                for i in range(3):
                    M[i, j] = dt / 3.0 * M[3 + i, j]
            # Covariances, first of the sums with the errors so far.
            MSQ[:] = 0.0
            for i in range(NAVIGATION_STATES):
                for j in range(m):
                    MSQ[i, axis_of[j]] += Qnx[i, j] * axes.first_observation[j]
            for i in range(NAVIGATION_STATES):
                for j in range(6):
                    s = 0.5 * M[i, j] * axes.sum_variance[part, j]
                    for r in range(NAVIGATION_STATES):
                        if A_step[i, r] != 0.0:
                            s += A_step[i, r] * MSQ[r, j]
                    A_new[i, j] = s
            _sandwich(A_step, Qnn, through)
            for i in range(NAVIGATION_STATES):
                for j in range(NAVIGATION_STATES):
                    s = 0.0
                    for r in range(6):
                        s += A_new[i, r] * M[j, r] + M[i, r] * A_new[j, r]
                    Qnn[i, j] += s
            for i in range(NAVIGATION_STATES):
                for j in range(n_states):
                    B_new[i, j] = 0.0
                    Q_new[i, j] = 0.0
                for r in range(NAVIGATION_STATES):
                    c = A_step[i, r]
                    if c != 0.0:
                        for j in range(n_states):
                            B_new[i, j] += c * B[r, j]
                        for j in range(m):
                            Q_new[i, j] += c * Qnx[r, j]
                for j in range(m):
                    B_new[i, j] += M[i, axis_of[j]] * axes.sum_observation[part, j]
                for a in range(6):
                    if of_scale[a] >= 0:
                        B_new[i, of_scale[a] - NAVIGATION_STATES] += M[i, a] * moved[a]
            copy(B_new, B)
            for i in range(NAVIGATION_STATES):
                for a in range(6):
                    for j in range(first[a], first[a + 1]):
                        s = M[i, a] * axes.sum_state_covariance[part, j]
                        for r in range(first[a], first[a + 1]):
                            s += axes.step[j, r] * Q_new[i, r]
                        Qnx[i, j] = s
            for i in range(NAVIGATION_STATES):
                for j in range(NAVIGATION_STATES):
                    s = 0.0
                    for r in range(NAVIGATION_STATES):
                        if A_step[i, r] != 0.0:
                            s += A_step[i, r] * A[r, j]
                    A_new[i, j] = s
            copy(A_new, A)
        _predict(P, A, B, Qnn, Qnx, axes.epoch, axes.noise, first)
        if available[epoch]:
            x_error = _update(P, fixes[epoch], p, v, C, spread)
            for i in range(3):
                p[i] += x_error[i]
                v[i] += x_error[3 + i]
            write_rotation(x_error[6], x_error[7], x_error[8], turn)
            multiply(turn, C, turned)
            copy(turned, C)
            for j in range(n_states):
                x[j] += x_error[NAVIGATION_STATES + j]
        _orthonormal(C)
        # Errors: a turn in the frame that leads from the estimate to the truth.
        whole = errors[epoch]
        for i in range(3):
            whole[i] = position[epoch, i] - p[i]
            whole[3 + i] = velocity[epoch, i] - v[i]
        for i in range(3):
            for j in range(3):
                turn[i, j], turned[i, j] = C[j, i], attitude[epoch, j, i]
        compute_rotation_vector(turn, turned, error)
        for i in range(3):
            whole[6 + i] = -error[i]
        for i in range(NAVIGATION_STATES):
            variances[epoch, i] = P[i, i]
        for g in range(3):
            normalised[epoch, g] = _normalise_square(P, whole, 3 * g, 3)
        normalised[epoch, 5] = _normalise_square(P, whole, 0, NAVIGATION_STATES)
        for g in range(2):
            if not math.isnan(bias[epoch, 3 * g]):
                normalised[epoch, 3 + g] = _of_biases(P, x, axes, bias[epoch], 3 * g)
    return errors, variances, normalised, P


@njit(cache=True, nogil=True)
def _sandwich(A: Array, Q: Array, room: Array) -> None:
    """Q = A Q A^T in place, skipping the zeros of A."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            room[i, j] = 0.0
        for r in range(n):
            if A[i, r] != 0.0:
                for j in range(n):
                    room[i, j] += A[i, r] * Q[r, j]
    for i in range(n):
        for j in range(n):
            s = 0.0
            for r in range(n):
                if A[j, r] != 0.0:
                    s += room[i, r] * A[j, r]
            Q[i, j] = s


@njit(cache=True, nogil=True)
def _predict(
    P: Array, A: Array, B: Array, Qnn: Array, Qnx: Array, D: Array, noise: Array, first: Array
) -> None:
    """Carry the covariance from fix to fix, in place; D is block diagonal, a block an axis."""
    n, total = len(A), len(P)
    m, s_all = first[6], len(P) - len(A)
    BP = np.zeros((n, s_all))
    cross = np.empty((n, s_all))
    for i in range(n):
        for r in range(s_all):
            c = B[i, r]
            for j in range(s_all):
                BP[i, j] += c * P[n + r, n + j]
    for i in range(n):
        for j in range(s_all):
            s = BP[i, j]
            for r in range(n):
                s += A[i, r] * P[r, n + j]
            cross[i, j] = s  # Pnx before the states go on
    # Pnn = A Pnn A^T + A Pnx B^T + B Pxn A^T + B Pxx B^T + Qnn
    #     = A Pnn A^T + cross B^T + (A Pnx B^T)^T + Qnn
    fresh = np.empty((n, n))
    half = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            s = 0.0
            for r in range(n):
                s += A[i, r] * P[r, j]
            half[i, j] = s
    for i in range(n):
        for j in range(n):
            s = Qnn[i, j]
            for r in range(n):
                s += half[i, r] * A[j, r]
            for r in range(s_all):
                s += cross[i, r] * B[j, r] + (cross[j, r] - BP[j, r]) * B[i, r]
            fresh[i, j] = s
    for i in range(n):
        for j in range(n):
            P[i, j] = 0.5 * (fresh[i, j] + fresh[j, i])
    for i in range(n):
        for a in range(6):
            for j in range(first[a], first[a + 1]):
                s = Qnx[i, j]
                for r in range(first[a], first[a + 1]):
                    s += D[j, r] * cross[i, r]
                P[i, n + j] = P[n + j, i] = s
        for j in range(m, s_all):
            P[i, n + j] = P[n + j, i] = cross[i, j]
    # Pxx = D Pxx D^T + noise, by blocks.
    row = np.empty(total)
    for a in range(6):
        lo, hi = first[a], first[a + 1]
        block = np.zeros((hi - lo, s_all))
        for i in range(lo, hi):
            for r in range(lo, hi):
                c = D[i, r]
                if c != 0.0:
                    for j in range(s_all):
                        block[i - lo, j] += c * P[n + r, n + j]
        for i in range(lo, hi):
            for j in range(s_all):
                P[n + i, n + j] = block[i - lo, j]
    for i in range(s_all):
        for a in range(6):
            lo, hi = first[a], first[a + 1]
            for j in range(lo, hi):
                s = 0.0
                for r in range(lo, hi):
                    if D[j, r] != 0.0:
                        s += P[n + i, n + r] * D[j, r]
                row[j] = s
            for j in range(lo, hi):
                P[n + i, n + j] = row[j]
    for i in range(m):
        for j in range(m):
            P[n + i, n + j] += noise[i, j]
    for i in range(s_all):
        for j in range(i):
            both = 0.5 * (P[n + i, n + j] + P[n + j, n + i])
            P[n + i, n + j] = P[n + j, n + i] = both


@njit(cache=True, nogil=True)
def _update(P: Array, fix: Array, p: Array, v: Array, C: Array, spread: Array) -> Array:
    """Update with a fix, one component at a time; return the estimated errors, shape (total,)."""
    total = len(P)
    x = np.zeros(total)
    column = np.empty(total)
    for i in range(7):
        if math.isinf(spread[i]):
            continue
        state = i if i < 6 else 8  # a heading is the turn about the vertical, near the level
        if i < 3:
            off = fix[i] - p[i]
        elif i < 6:
            off = fix[i] - v[i - 3]
        else:
            off = (fix[i] - math.atan2(C[1, 0], C[0, 0]) + math.pi) % (2.0 * math.pi) - math.pi
        s = P[state, state] + spread[i] ** 2
        innovation = off - x[state]
        for j in range(total):
            column[j] = P[j, state]
        for j in range(total):
            gain = column[j] / s
            x[j] += gain * innovation
            for r in range(total):
                P[j, r] -= gain * column[r]
    return x


@njit(cache=True, nogil=True)
def _orthonormal(C: Array) -> None:
    """Orthonormalise an attitude, in place: one step towards the nearest rotation."""
    square, cube = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            square[i, j] = C[0, i] * C[0, j] + C[1, i] * C[1, j] + C[2, i] * C[2, j]
    multiply(C, square, cube)
    for i in range(3):
        for j in range(3):
            C[i, j] = 1.5 * C[i, j] - 0.5 * cube[i, j]


@njit(cache=True, nogil=True)
def _of_biases(P: Array, x: Array, axes: StackedStates, true: Array, offset: int) -> float:
    """Return the normalised error squared of the slow errors of three axes, from ``offset`` on."""
    first, output = axes.first, axes.output
    covariance, error = np.zeros((3, 3)), np.empty(3)
    for a in range(3):
        own = range(first[offset + a], first[offset + a + 1])
        error[a] = true[offset + a]
        for i in own:
            error[a] -= output[i] * x[i]
        for b in range(3):
            for i in own:
                for j in range(first[offset + b], first[offset + b + 1]):
                    covariance[a, b] += (
                        output[i] * output[j] * P[NAVIGATION_STATES + i, NAVIGATION_STATES + j]
                    )
    return _normalise_square(covariance, error, 0, 3)
