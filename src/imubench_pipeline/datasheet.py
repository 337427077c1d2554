"""Figures as printed -> comparable values, and the deltas of what was measured.

Two conventions ruin such a comparison. A printed noise density is mostly one-sided, and N is
that density over sqrt(2); where the datasheet does not say, both readings are given. A printed
bias instability is the minimum of the curve of Allan deviation, and is compared with the minimum of
the model's curve. Beside it stands the plateau 0.664 B: the two agree where the curve has a
plateau, and differ where N and K add to B at the minimum, or the curve dips beside the peak of a
Gauss-Markov process.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.noise import FLOOR
from imubench_pipeline.sensor import FIGURE_DIMENSIONS, Datasheet, PrintedFigure, quantity_of
from imubench_pipeline.units import to_si

_SIDEDNESS: dict[str, tuple[str, ...]] = {
    "one-sided": ("one-sided",),
    "two-sided": ("two-sided",),
    "unknown": ("one-sided", "two-sided"),
}


@dataclass(frozen=True)
class Delta:
    """One printed figure against one estimate, as a row of the table ``datasheet``."""

    quantity: str
    statistic: str
    printed: float | None
    unit: str | None
    kind: str | None
    sidedness: str | None
    comparable: float | None
    measured: float | None
    lower: float | None
    upper: float | None
    delta: float | None
    verdict: str
    reason: str | None


@dataclass(frozen=True)
class Comparable:
    """A printed figure in SI, in the convention of the estimate that it is compared with."""

    quantity: str
    statistic: str
    figure: PrintedFigure | None
    sidedness: str | None = None
    value: float | None = None
    reason: str | None = None


def comparables(datasheet: Datasheet, channel: str) -> Iterator[Comparable]:
    """Yield what a datasheet says of N, bias instability, K and T_B of a channel's quantity.

    Yields
    ------
    Comparable
        In SI; without a figure where the vendor does not publish the quantity.
    """
    quantity = quantity_of(channel)
    figures = getattr(datasheet, quantity)
    dimensions = FIGURE_DIMENSIONS[quantity]

    def printed(name: str) -> tuple[PrintedFigure | None, float | None]:
        figure: PrintedFigure | None = getattr(figures, name, None)
        if figure is None or figure.value is None:
            return None, None
        return figure, to_si(figure.value, figure.unit, dimensions[name])

    density, value = printed("noise_density")
    walk, walk_value = printed("random_walk")
    if density is not None and value is not None:
        for sidedness in _SIDEDNESS[density.sidedness]:
            one_sided = sidedness == "one-sided"
            assumed = ", assumed: the datasheet does not say" * (density.sidedness == "unknown")
            yield Comparable(
                "N",
                "N",
                density,
                sidedness,
                value / math.sqrt(2.0) if one_sided else value,
                f"{sidedness} density{assumed}; N is the density{' / sqrt(2)' * one_sided}",
            )
    if walk is not None:
        yield Comparable("N", "N", walk, None, walk_value, "random walk as printed is N")
    if density is None and walk is None:
        yield Comparable("N", "N", None)
    for name, quantity_name, statistic, reason in (
        ("bias_instability", "bias_instability", "adev_minimum", "minimum of the curve"),
        ("bias_instability", "bias_instability", "plateau", "the plateau alone: 0.664 B"),
        ("rate_random_walk", "K", "K", None),
        ("correlation_time", "T_B", "T_B", None),
    ):
        figure, value = printed(name)
        yield Comparable(quantity_name, statistic, figure, None, value, reason)


def deltas(
    datasheet: Datasheet,
    channel: str,
    estimate: Estimate,
    tau: NDArray[np.float64],
    tolerance: float,
) -> Iterator[Delta]:
    """Compare an estimate with what a datasheet prints.

    Parameters
    ----------
    datasheet : Datasheet
    channel : str
    estimate : Estimate
        In SI.
    tau : ndarray, shape (m,)
        Where the log shows the curve well enough for its minimum, s.
    tolerance : float
        Relative difference that still counts as printed.

    Yields
    ------
    Delta
        One a printed figure and reading of it; K and T_B are mostly not published.
    """
    for entry in comparables(datasheet, channel):
        parameter, factor = _measured(entry.statistic, estimate, tau)
        measured, lower, upper = (
            None if value is None else value * factor
            for value in (parameter.value, parameter.lower, parameter.upper)
        )
        delta = None
        if entry.figure is None or entry.value is None:
            verdict, reason = "not published", "the datasheet does not give it"
        elif measured is None:
            verdict = "not measured"
            reason = f"{parameter.status.replace('_', ' ')}: {parameter.reason}"
        else:
            delta = measured / entry.value - 1.0
            verdict, reason = _verdict(entry.figure.kind, delta, tolerance), entry.reason or ""
            if parameter.reason:
                reason = f"{reason}; {parameter.reason}".lstrip("; ")
        figure = entry.figure
        yield Delta(
            entry.quantity,
            entry.statistic,
            figure.value if figure else None,
            figure.unit if figure else None,
            figure.kind if figure else None,
            entry.sidedness,
            entry.value,
            measured,
            lower,
            upper,
            delta,
            verdict,
            reason or None,
        )


def _measured(
    statistic: str, estimate: Estimate, tau: NDArray[np.float64]
) -> tuple[Parameter, float]:
    bias = estimate.parameters["B"]
    if statistic == "plateau" or (statistic == "adev_minimum" and estimate.method == "curve"):
        return bias, FLOOR  # what is read from the curve is its minimum over 0.664
    if statistic == "adev_minimum":
        return _minimum(estimate, tau), 1.0
    return estimate.parameters[statistic], 1.0


def _minimum(estimate: Estimate, tau: NDArray[np.float64]) -> Parameter:
    """Return the minimum of the model's curve, if it lies inside the tau of the log."""
    deviation = np.sqrt(estimate.model.allan_variance(tau))
    lowest = int(np.argmin(deviation)) if len(tau) else 0
    if not 0 < lowest < len(tau) - 1:
        return Parameter(None, "not_shown", "the curve has no minimum inside the log's tau")
    return Parameter(float(deviation[lowest]))


def _verdict(kind: str, delta: float, tolerance: float) -> str:
    if kind == "max":
        return "worse than max" if delta > 0 else "as printed"
    if delta > tolerance:
        return "worse than typ"
    return "better than typ" if delta < -tolerance else "as printed"
