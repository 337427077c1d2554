"""Noise parameters from an Allan variance: read from the curve, or fitted to it."""

from __future__ import annotations

from typing import Literal

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators import least_squares
from imubench_pipeline.estimators.estimate import Estimate


def estimate(
    curve: AllanCurve, method: Literal["curve", "paper", "weighted"], *, longest: float
) -> Estimate:
    """Estimate N, B, T_B and K by a method of that name (see `curve.read`, `least_squares.fit`).

    Where the log is too short for a fit, every parameter is ``not_shown`` with the reason.
    """
    if method == "curve":
        return reading.read(curve, longest=longest)
    return least_squares.fit(curve, method=method, longest=longest)
