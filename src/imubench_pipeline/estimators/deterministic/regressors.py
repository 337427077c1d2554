"""Deterministic signals: steps, exponentials, sinusoids, ramps, and their cosine transforms.

They are sampled at the block means of one part of a log; time is in blocks from its start.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.fft

from imubench_pipeline.typing import Array

Kind = Literal["step", "exponential", "sinusoid", "ramp"]


@dataclass(frozen=True)
class Regressor:
    """A deterministic signal of unit amplitude in one part of a log."""

    kind: Kind
    """``step``: 0 before its place, 1 from there on, a line over a gap; ``exponential``: 1 at
    the start of the part; ``sinusoid``: a cosine and a sine; ``ramp``: slope 1 per block."""
    part: int  # number of the part
    where: float = 0.0
    """Place of a step, time constant of an exponential, both in blocks; frequency of a sinusoid in
    cycles per block."""
    length: float = 0.0  # of the gap that a step is in, blocks

    @property
    def columns(self) -> int:
        """Number of amplitudes."""
        return 2 if self.kind == "sinusoid" else 1

    def means(self, n: int) -> Array:
        """Return its means in n blocks, shape (columns, n)."""
        i = np.arange(n, dtype=np.float64)
        if self.kind == "step":
            first = self.where - 0.5 * self.length
            return np.clip((i + 1.0 - first) / (self.length + 1.0), 0.0, 1.0)[None]
        if self.kind == "exponential":
            return -self.where * math.expm1(-1.0 / self.where) * self.at(i)
        scale = np.sinc(self.where) if self.kind == "sinusoid" else 1.0
        return np.asarray(scale * self.at(i + 0.5))

    def coefficients(self, n: int) -> Array:
        """Return its orthonormal DCT-II coefficients 1 ... n - 1, shape (columns, n - 1)."""
        return np.asarray(scipy.fft.dct(self.means(n), type=2, norm="ortho", axis=1)[:, 1:])

    def at(self, blocks: Array) -> Array:
        """Return its values, shape (columns, s), at times in blocks from the start of its part."""
        if self.kind == "step":
            return (blocks >= self.where).astype(np.float64)[None]
        if self.kind == "exponential":
            return np.exp(-blocks / self.where)[None]
        if self.kind == "ramp":
            return blocks[None]
        phase = 2.0 * np.pi * self.where * blocks
        return np.array([np.cos(phase), np.sin(phase)])
