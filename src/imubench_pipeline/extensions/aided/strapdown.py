"""Strapdown mechanisation (motion from inertial samples), and its inverse.

The frame is the tangent plane of the Earth where a drive begins: x north, y east, z down, turning
with the Earth. In it

    p' = v,    v' = C f + g(p) - 2 w_ie x v,    C' = C [w x] - [w_ie x] C,

with C from the axes of the sensor to the frame, f the specific force and w the rate that it senses.
Gravity decreases with height, to first order, which includes Schuler feedback and holds for a drive
of some 10 km. A sample is the mean of w and f over the interval that it ends; in it the
mechanisation is of second order, with `invert_mechanisation` its exact inverse. Kernels loop over
scalars, since numba compiles slices and sums of arrays into slow code.
"""

import math

import numpy as np
from numba import njit

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.typing import Array

EARTH_RADIUS = 6371000.0  # mean, m
GRAVITY_GRADIENT = (
    STANDARD_GRAVITY / EARTH_RADIUS
)  # horizontal, 1/s^2; the vertical one is twice it


@njit(cache=True, nogil=True)
def write_rotation(x: float, y: float, z: float, into: Array) -> None:
    """Write the matrix exp([r x]), shape (3, 3), of the rotation vector r = (x, y, z), rad."""
    square = x * x + y * y + z * z
    if square > 1e-8:
        angle = math.sqrt(square)
        s, c = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
    else:
        s, c = 1.0 - square / 6.0, 0.5 - square / 24.0
    into[0, 0], into[1, 1], into[2, 2] = (
        1.0 - c * (y * y + z * z),
        1.0 - c * (x * x + z * z),
        1.0 - c * (x * x + y * y),
    )
    into[0, 1], into[1, 0] = c * x * y - s * z, c * x * y + s * z
    into[0, 2], into[2, 0] = c * x * z + s * y, c * x * z - s * y
    into[1, 2], into[2, 1] = c * y * z - s * x, c * y * z + s * x


@njit(cache=True, nogil=True)
def multiply(a: Array, b: Array, into: Array) -> None:
    """Write the product of two matrices, shapes (3, 3)."""
    for i in range(3):
        for j in range(3):
            into[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, nogil=True)
def copy(a: Array, into: Array) -> None:
    """Write a matrix into another one of its shape."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            into[i, j] = a[i, j]


@njit(cache=True, nogil=True)
def propagate_sample(
    p: Array, v: Array, C: Array, w: Array, f: Array, T: float, earth: Array, room: Array
) -> None:
    """Propagate by one sampling interval T, s; p, v, C are changed in place.

    p, v, w, f and ``earth`` (w_ie) have the shape (3,), in SI, C (3, 3). ``room`` (4, 3, 3) is work
    space; on return, [3, 0] has the specific force in the frame.
    """
    middle, half, other = room[0], room[1], room[2]
    force, back = room[3, 0], -0.5 * T
    write_rotation(0.5 * T * w[0], 0.5 * T * w[1], 0.5 * T * w[2], half)
    multiply(C, half, other)
    write_rotation(back * earth[0], back * earth[1], back * earth[2], C)
    multiply(C, other, middle)
    multiply(middle, half, other)
    copy(C, half)
    multiply(half, other, C)
    for i in range(3):
        force[i] = middle[i, 0] * f[0] + middle[i, 1] * f[1] + middle[i, 2] * f[2]
    ax = force[0] - GRAVITY_GRADIENT * p[0] - 2.0 * (earth[1] * v[2] - earth[2] * v[1])
    ay = force[1] - GRAVITY_GRADIENT * p[1] - 2.0 * (earth[2] * v[0] - earth[0] * v[2])
    az = force[2] + (STANDARD_GRAVITY + 2.0 * GRAVITY_GRADIENT * p[2])
    az -= 2.0 * (earth[0] * v[1] - earth[1] * v[0])
    p[0] += T * (v[0] + 0.5 * T * ax)
    p[1] += T * (v[1] + 0.5 * T * ay)
    p[2] += T * (v[2] + 0.5 * T * az)
    v[0] += T * ax
    v[1] += T * ay
    v[2] += T * az


@njit(cache=True, nogil=True)
def compute_rotation_vector(C: Array, after: Array, into: Array) -> None:
    """Write the rotation vector from one matrix to another, rad: log(C^T after)."""
    trace = x = y = z = 0.0
    for i in range(3):
        trace += C[i, 0] * after[i, 0] + C[i, 1] * after[i, 1] + C[i, 2] * after[i, 2]
        x += C[i, 2] * after[i, 1] - C[i, 1] * after[i, 2]
        y += C[i, 0] * after[i, 2] - C[i, 2] * after[i, 0]
        z += C[i, 1] * after[i, 0] - C[i, 0] * after[i, 1]
    sine = 0.5 * math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (trace - 1.0))
    scale = 0.5 * (angle / sine if sine > 1e-12 else 1.0)
    into[0], into[1], into[2] = scale * x, scale * y, scale * z


@njit(cache=True, nogil=True)
def invert_mechanisation(
    start: Array, velocity: Array, attitude: Array, T: float, earth: Array
) -> tuple[Array, Array, Array]:
    """Return positions, shape (L + 1, 3), and ideal rates and forces, (L, 3), of a motion."""
    L = len(velocity) - 1
    position, rate, force = np.empty((L + 1, 3)), np.empty((L, 3)), np.empty((L, 3))
    for i in range(3):
        position[0, i] = start[i]
    a = np.empty(3)
    back, on, half, middle, lifted = np.empty((5, 3, 3))
    write_rotation(T * earth[0], T * earth[1], T * earth[2], back)
    write_rotation(-0.5 * T * earth[0], -0.5 * T * earth[1], -0.5 * T * earth[2], on)
    for k in range(L):
        multiply(back, attitude[k + 1], lifted)  # without the turn of the Earth
        compute_rotation_vector(attitude[k], lifted, rate[k])
        write_rotation(0.5 * rate[k, 0], 0.5 * rate[k, 1], 0.5 * rate[k, 2], half)
        multiply(attitude[k], half, lifted)
        multiply(on, lifted, middle)
        v, p = velocity[k], position[k]
        for i in range(3):
            a[i] = (velocity[k + 1, i] - v[i]) / T
        a[0] += GRAVITY_GRADIENT * p[0] + 2.0 * (earth[1] * v[2] - earth[2] * v[1])
        a[1] += GRAVITY_GRADIENT * p[1] + 2.0 * (earth[2] * v[0] - earth[0] * v[2])
        a[2] += 2.0 * (earth[0] * v[1] - earth[1] * v[0])
        a[2] -= STANDARD_GRAVITY + 2.0 * GRAVITY_GRADIENT * p[2]
        for i in range(3):
            force[k, i] = middle[0, i] * a[0] + middle[1, i] * a[1] + middle[2, i] * a[2]
            position[k + 1, i] = p[i] + 0.5 * T * (v[i] + velocity[k + 1, i])
            rate[k, i] /= T
    return position, rate, force
