"""The low-pass filter of a sensor, in continuous time: first order, or Butterworth of order n."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from imubench_pipeline.typing import Array

_MAX_ORDER = 10


@dataclass(frozen=True)
class LowPass:
    """A low-pass filter of unit gain at 0 Hz: v' = F v + b u, y = c v, from input u to output y.

    It is a cascade of sections of first and second order, so that the states v have the magnitude
    of the signal at any cut-off frequency. Raises ValueError if cut-off or order is out of range.
    """

    cutoff: float  # frequency at which the power is halved (-3 dB), Hz, above 0
    order: int = 1  # 1, or the order of the Butterworth filter, to 10

    def __post_init__(self) -> None:
        if not (math.isfinite(self.cutoff) and self.cutoff > 0):
            raise ValueError(f"the cut-off is {self.cutoff} Hz, expected a frequency above 0")
        if not 1 <= self.order <= _MAX_ORDER:
            raise ValueError(f"the order is {self.order}, expected 1 to {_MAX_ORDER}")

    @property
    def angular_cutoff(self) -> float:
        """Angular cut-off frequency, rad/s."""
        return 2.0 * math.pi * self.cutoff

    @property
    def transition(self) -> Array:
        """State matrix F, shape (order, order), 1/s."""
        sections = self._sections()
        matrix = np.asarray(block_diag(*sections), dtype=np.float64)
        begin = 0
        for section, following in pairwise(sections):
            # The first state of a section is its output, and the last one receives its input.
            matrix[begin + len(section) + len(following) - 1, begin] = 1.0
            begin += len(section)
        return self.angular_cutoff * matrix

    @property
    def input(self) -> Array:
        """Input column b, shape (order,), 1/s."""
        column = np.zeros(self.order)
        column[len(self._sections()[0]) - 1] = self.angular_cutoff
        return column

    @property
    def output(self) -> Array:
        """Output row c, shape (order,)."""
        row = np.zeros(self.order)
        row[self.order - len(self._sections()[-1])] = 1.0
        return row

    @property
    def steady_state(self) -> Array:
        """Steady state for a constant input of 1, -F^-1 b, shape (order,)."""
        return np.concatenate([np.eye(len(section))[0] for section in self._sections()])

    def power(self, frequency: ArrayLike) -> Array:
        """Return |H|^2 = 1 / (1 + (f / cutoff)^(2 order)), in the shape of the frequency, Hz."""
        square = np.square(np.asarray(frequency, dtype=np.float64) / self.cutoff)
        # Products, since numpy takes ten times as long for a power above 2.
        return np.asarray(1.0 / (1.0 + math.prod([square] * (self.order - 1), start=square)))

    def response(self, frequency: float) -> complex:
        """Return H: gain and phase of a sinusoid of a frequency in Hz."""
        s = 1j * frequency / self.cutoff
        n = self.order
        poles = np.exp(1j * math.pi * (2 * np.arange(1, n + 1) + n - 1) / (2 * n))
        return complex(1.0 / np.prod((s - poles) / -poles))

    def _sections(self) -> list[Array]:
        """Return the matrices of the sections at a cut-off of 1 rad/s."""
        sections = []
        for j in range(1, self.order // 2 + 1):
            damping = math.sin(math.pi * (2 * j - 1) / (2 * self.order))
            sections.append(np.array([[0.0, 1.0], [-1.0, -2.0 * damping]]))
        if self.order % 2:
            sections.append(np.array([[-1.0]]))
        return sections
