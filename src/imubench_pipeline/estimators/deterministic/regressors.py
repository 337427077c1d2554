"""Deterministic signals: steps, exponentials, sinusoids, ramps, and their cosine transforms.

They are sampled at the block means of one part of a log; time is in blocks from its start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
import scipy.fft

from imubench_pipeline.typing import Array

_MIN_BEAT_ANGLE = 1e-9  # half angle below which a beat is constant over any part

Kind = Literal["step", "restart", "exponential", "sinusoid", "ramp", "pulse"]


@dataclass(frozen=True)
class Regressor:
    """A deterministic signal of unit amplitude in one part of a log."""

    kind: Kind
    """``step``: 0 before its place, 1 from there on; ``restart``: the same at a pause, interpolated
    across it as the log is; ``exponential``: 1 at the start of the part; ``sinusoid``: a cosine and
    a sine; ``ramp``: slope 1 per block; ``pulse``: 1 in one block."""
    part: int  # number of the part
    where: float = 0.0
    """Place of a step or pulse, time constant of an exponential, both in blocks; frequency of a
    sinusoid in cycles per block."""
    length: float = 0.0  # of the pause of a restart, blocks

    @property
    def columns(self) -> int:
        """Number of amplitudes."""
        return 2 if self.kind == "sinusoid" else 1

    def means(self, n: int) -> Array:
        """Return its means in n blocks, shape (columns, n)."""
        i = np.arange(n, dtype=np.float64)
        if self.kind == "step":
            return np.clip(i + 1.0 - self.where, 0.0, 1.0)[None]
        if self.kind == "restart":
            first = self.where - 0.5 * self.length
            return np.clip((i + 1.0 - first) / (self.length + 1.0), 0.0, 1.0)[None]
        if self.kind == "pulse":
            return (i == self.where).astype(np.float64)[None]
        if self.kind == "ramp":
            return (i + 0.5)[None]
        if self.kind == "exponential":
            time = self.where
            return (time * -math.expm1(-1.0 / time) * np.exp(-i / time))[None]
        phase = 2.0 * np.pi * self.where * (i + 0.5)
        return np.asarray(np.sinc(self.where) * np.array([np.cos(phase), np.sin(phase)]))

    def coefficients(self, n: int) -> Array:
        """Return its orthonormal DCT-II coefficients 1 ... n - 1, shape (columns, n - 1)."""
        if self.kind == "sinusoid":
            return np.sinc(self.where) * _transform_sinusoid(n, 2.0 * np.pi * self.where)
        if self.kind == "exponential":
            # A geometric sum.
            left = math.exp(-1.0 / self.where)
            cos, sin, sign = _tabulate_half_angles(n)
            below = (1.0 - left) ** 2 + 4.0 * left * sin**2
            rows = ((1.0 - left**n * sign) * (1.0 - left) * cos / below)[None]
            return self.where * (1.0 - left) * (math.sqrt(2.0 / n) * rows)
        return np.asarray(scipy.fft.dct(self.means(n), type=2, norm="ortho", axis=1)[:, 1:])

    def at(self, blocks: Array) -> Array:
        """Return its values, shape (columns, s), at times in blocks from the start of its part."""
        if self.kind in ("step", "restart"):
            return (blocks >= self.where).astype(np.float64)[None]
        if self.kind == "pulse":
            return ((blocks >= self.where) & (blocks < self.where + 1.0)).astype(np.float64)[None]
        if self.kind == "ramp":
            return blocks[None]
        if self.kind == "exponential":
            return np.exp(-blocks / self.where)[None]
        phase = 2.0 * np.pi * self.where * blocks
        return np.array([np.cos(phase), np.sin(phase)])


@lru_cache(maxsize=8)
def _tabulate_half_angles(n: int) -> tuple[Array, Array, Array]:
    """Return cosine and sine of pi k / 2 n, and (-1)^k, for k = 1 ... n - 1."""
    k = np.arange(1, n, dtype=np.float64)
    half = np.asarray(0.5 * np.pi * k / n)
    return np.cos(half), np.sin(half), np.asarray(1.0 - 2.0 * (k % 2.0))


def _transform_sinusoid(n: int, angle: float) -> Array:
    """Return the coefficients of cos and sin of angle (i + 1/2), shape (2, n - 1)."""
    # sum_i cos(t (i + 1/2)) = sin(n t) / (2 sin(t / 2)), t the sum or difference of both angles.
    cos, sin, sign = _tabulate_half_angles(n)
    a, b = math.sin(0.5 * angle) * cos, math.cos(0.5 * angle) * sin
    both = np.zeros((2, n - 1))
    for half in (a + b, a - b):
        beats = np.abs(half) > _MIN_BEAT_ANGLE
        below = 1.0 / np.where(beats, 2.0 * half, 1.0)
        both[0] += np.where(beats, math.sin(n * angle) * sign * below, float(n))
        both[1] += np.where(beats, (1.0 - math.cos(n * angle) * sign) * below, 0.0)
    return 0.5 * math.sqrt(2.0 / n) * both
