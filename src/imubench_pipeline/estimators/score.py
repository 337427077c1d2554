"""How well a reconstruction repeats the measured curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Scores:
    """Scores of one reconstruction.

    Attributes
    ----------
    rms : float
        RMS over tau of the difference of the Allan deviations, rad/s or m/s² (000, Table 3).
    rms_log10 : float
        RMS over tau of the difference of their log10, decades.
    inside_band : float
        Share of the measured curve inside the band of the ensemble.
    """

    rms: float
    rms_log10: float
    inside_band: float


def score(measured: Array, reconstructed: Array, lower: Array, upper: Array) -> Scores:
    """Compare Allan deviations on the same tau, all of shape (m,), in rad/s or m/s².

    Raises
    ------
    ValueError
        If the shapes differ.
    """
    if not measured.shape == reconstructed.shape == lower.shape == upper.shape:
        raise ValueError(
            f"shapes differ: measured {measured.shape}, reconstructed {reconstructed.shape}, "
            f"band {lower.shape} and {upper.shape}"
        )
    return Scores(
        rms=float(np.sqrt(np.mean((reconstructed - measured) ** 2))),
        rms_log10=float(np.sqrt(np.mean(np.log10(reconstructed / measured) ** 2))),
        inside_band=float(np.mean((measured >= lower) & (measured <= upper))),
    )
