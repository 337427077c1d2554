"""What an error budget is made of: what each source adds, and what is not known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from imubench_pipeline.navigation.error_budget.in_use import (
    Cause,
    Figure,
    Figures,
    Measured,
    needed,
)

Quantity = Literal["attitude", "heading", "velocity", "position"]


@dataclass(frozen=True)
class Contribution:
    """What one source adds to an error.

    Attributes
    ----------
    source : str
        Such as ``gyro N``, ``accel GM 89.5 s``, ``gyro turn-on bias``.
    sigma : float
        1 sigma, rad, m/s or m.
    cause : str
        ``noise``, ``start`` (a stated angle), or of `in_use`.
    figure : Figure or None
        What it follows from, where that is no noise.
    """

    source: str
    sigma: float
    cause: Cause | Literal["noise", "start"] = "noise"
    figure: Figure | None = None


@dataclass(frozen=True)
class Missing:
    """A source whose figure is not known.

    Attributes
    ----------
    source : str
        As in `Contribution`.
    quantity : str
        ``gyro`` or ``accel``.
    cause : str
    lever : float
        The error that a figure of 1 SI unit makes.
    reason : str
        Why it is not known.
    """

    source: str
    quantity: Measured
    cause: Cause
    lever: float
    reason: str


@dataclass(frozen=True)
class Budget:
    """An error and what it is made of.

    Attributes
    ----------
    time : float
        s.
    quantity : str
        ``attitude`` (a tilt) and ``heading`` in rad, ``velocity`` in m/s, ``position`` in m.
    contributions : sequence of Contribution
        Independent of each other.
    assumptions : sequence of str
        What was not known, and what stands for it.
    missing : sequence of Missing
        What is left out because no figure is known.
    """

    time: float
    quantity: Quantity
    contributions: Sequence[Contribution]
    assumptions: Sequence[str] = ()
    missing: Sequence[Missing] = ()

    @property
    def total(self) -> float:
        """1 sigma: the root of the sum of the squares of the contributions."""
        return math.hypot(*(contribution.sigma for contribution in self.contributions))


def of_figure(
    measured: Measured, cause: Cause, source: str, lever: float, figures: Figures
) -> Contribution | Missing | None:
    """Return what a figure of a sensor adds to an error, or that it is not known.

    Parameters
    ----------
    measured : {"gyro", "accel"}
    cause : str
    source : str
        Name of the source.
    lever : float
        The error that a figure of 1 SI unit makes.
    figures : mapping of str to Figure
        Of the axis.

    Returns
    -------
    Contribution, Missing or None
        None: another figure says how large it may be.
    """
    figure = figures.get(cause, Figure(reason="the sensor file does not give it"))
    if figure.sigma is not None:
        return Contribution(source, lever * figure.sigma, cause, figure)
    if needed(measured, cause, figures):
        return Missing(source, measured, cause, lever, figure.reason or "not known")
    return None
