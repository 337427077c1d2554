"""Compare measured values with printed figures.

A verdict applies to the whole 95 % interval of the measurement. If the interval crosses a boundary,
the verdict is ``not sure``, and the reason names the possible ones.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.datasheets.comparable import (
    SENSITIVITY,
    Comparable,
    read_bias_comparables,
    read_comparables,
)
from imubench_pipeline.datasheets.measured import (
    NO_TEMPERATURE_READINGS,
    compute_fixed_bias,
    get_measured,
)
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.words.reasons import datasheets as texts
from imubench_pipeline.words.reasons.pools import status_reason

_TYPICAL_KINDS = ("typ", "1sigma", "derived")


@dataclass(frozen=True)
class Delta:
    """Comparison of one printed figure with one estimate: a row of the table ``datasheet``."""

    quantity: str
    statistic: str
    printed: float | None
    unit: str | None
    kind: str | None
    condition: str | None
    sidedness: str | None
    comparable: float | None
    comparable_lower: float | None
    comparable_upper: float | None
    measured: float | None
    lower: float | None
    upper: float | None
    delta: float | None
    delta_lower: float | None
    delta_upper: float | None
    verdict: str
    reasons: tuple[str, ...]


def deltas(
    datasheet: Datasheet,
    channel: str,
    estimate: Estimate,
    tau: NDArray[np.float64],
    tolerance: float,
) -> Iterator[Delta]:
    """Compare an estimate, SI, with a datasheet: one row for each interpretation of its figures.

    tau, shape (m,), s, are the averaging times at which the curve is accurate enough to find its
    minimum. The tolerance is the relative difference that still counts as printed.
    """
    for entry in read_comparables(datasheet, channel):
        yield compare(entry, get_measured(entry, estimate, tau), tolerance)


def bias_deltas(
    datasheet: Datasheet,
    channel: str,
    means: Mapping[str, float],
    tolerance: float,
    sensitivity: Parameter | None = None,
) -> Iterator[Delta]:
    """Compare the fixed bias of a recording and its temperature sensitivity with the datasheet.

    The rows are the offset; the temperature coefficient, if one is printed; and the printed figures
    of repeatability and temperature that cannot be compared with one log.

    Parameters
    ----------
    datasheet : Datasheet
    channel : str
    means : mapping of str to float
        Mean of every channel of the recording, rad/s or m/s².
    tolerance : float
        Relative difference that still counts as printed.
    sensitivity : Parameter, optional
        From `datasheets.measured.compute_sensitivity`; None without readings of the temperature.
    """
    bias = compute_fixed_bias(channel, means)
    for entry in read_bias_comparables(datasheet, channel):
        if entry.statistic == SENSITIVITY:
            yield compare(entry, sensitivity or NO_TEMPERATURE_READINGS, tolerance)
        elif entry.quantity != "offset":
            yield compare(entry, Parameter(None), tolerance)
        elif bias.value is None and entry.figure:
            hidden = replace(entry, value=None, lower=None, upper=None, obstacle=bias.reason)
            yield compare(hidden, bias, tolerance)
        else:
            yield compare(entry, bias, tolerance)


def compare(entry: Comparable, parameter: Parameter, tolerance: float) -> Delta:
    """Compare a printed figure with its measured value, SI.

    Without limits, the verdict follows from the value alone. ``delta`` is measured / comparable -
    1, with its least and largest value within both intervals. The tolerance is as in `deltas`.
    """
    figure = entry.figure
    value, lower, upper = parameter.value, parameter.lower, parameter.upper
    row = Delta(
        quantity=entry.quantity,
        statistic=entry.statistic,
        printed=entry.printed,
        unit=figure.unit if figure else None,
        kind=figure.kind if figure else None,
        condition=figure.condition if figure else None,
        sidedness=entry.sidedness,
        comparable=entry.value,
        comparable_lower=entry.lower,
        comparable_upper=entry.upper,
        measured=value,
        lower=lower,
        upper=upper,
        delta=None,
        delta_lower=None,
        delta_upper=None,
        verdict="not published" if entry.looked_up else "not looked up",
        reasons=(entry.reason,) if entry.reason else (),
    )
    if figure is None:
        return row
    if entry.value is None:
        return replace(
            row, verdict="not comparable (condition)", reasons=tuple(filter(None, [entry.obstacle]))
        )
    if value is None:
        reason = status_reason(parameter.status, parameter.reason)
        if upper is not None:
            least = _classify_value(entry, lower or 0.0, tolerance)
            if least == _classify_value(entry, upper, tolerance) != "as printed":
                return replace(row, verdict=least, reasons=(texts.limits_decide(reason),))
        return replace(row, verdict="not measured", reasons=(reason,))
    row = replace(
        row,
        delta=_compute_relative_difference(value, entry.value),
        delta_lower=_compute_relative_difference(lower, entry.upper),
        delta_upper=_compute_relative_difference(upper, entry.lower),
    )
    low, high = (value, value) if lower is None or upper is None else (lower, upper)
    least, largest = (_classify_value(entry, end, tolerance) for end in (low, high))
    reasons = [reason for reason in (entry.reason, parameter.reason) if reason]
    if least != largest:
        reasons.append(texts.interval_spans(least, largest))
    verdict = least if least == largest else "not sure"
    return replace(row, verdict=verdict, reasons=tuple(reasons))


def _classify_value(entry: Comparable, value: float, tolerance: float) -> str:
    """Return the verdict on one value by its position relative to a printed figure."""
    assert entry.figure is not None and entry.value is not None
    if entry.figure.kind in ("max", "range"):
        if value > entry.value:
            return "worse than max"
        return "better than typ" if value < (entry.least or 0.0) else "as printed"
    if value > entry.value * (1.0 + tolerance):
        return "worse than typ"
    return "better than typ" if value < entry.value * (1.0 - tolerance) else "as printed"


def _compute_relative_difference(value: float | None, printed: float | None) -> float | None:
    """Return the relative difference; None without two numbers, the printed one positive."""
    if value is None or printed is None or printed <= 0:
        return None
    return value / printed - 1.0


@dataclass(frozen=True)
class CurveRms:
    """Distance between a measured curve and the lines of a datasheet."""

    # noise, floor: the printed figures of the two lines
    noise: Comparable | None
    floor: Comparable | None
    rms: float  # root mean square over tau of measured minus printed Allan deviation, rad/s or m/s²
    rms_log10: float  # rms of the difference of log10, decades


def curve_rms(
    printed: Sequence[Comparable], tau: NDArray[np.float64], adev: NDArray[np.float64]
) -> list[CurveRms]:
    """Compare a measured curve with the lines N/√τ and bias instability of a datasheet.

    The two add as variances: σ²(τ) = N²/τ + floor². If a datasheet prints only one of them, that
    line is used alone. A density of unknown sidedness gives two curves. Typical figures are
    preferred.

    Parameters
    ----------
    printed : sequence of Comparable
        Figures of a channel, from `comparable.comparables`.
    tau, adev : ndarray, shape (m,)
        s, and measured Allan deviation, rad/s or m/s².

    Raises
    ------
    ValueError
        If the shapes of the arrays differ, or a deviation is not above 0.
    """
    if tau.shape != adev.shape or not tau.size or np.any(adev <= 0):
        raise ValueError(
            f"tau of shape {tau.shape} and Allan deviations of shape {adev.shape}; expected as "
            "many, and deviations above 0"
        )
    noises: list[Comparable | None] = [*_select_typical(printed, "N")]
    floors: list[Comparable | None] = [*_select_typical(printed, "adev_minimum")]
    distances = []
    for noise, floor in product(noises or [None], floors[:1] or [None]):
        if noise is None and floor is None:
            continue
        white = noise.value if noise and noise.value else 0.0
        bottom = floor.value if floor and floor.value else 0.0
        line = np.sqrt(white**2 / tau + bottom**2)
        absolute, relative = adev - line, np.log10(adev / line)
        rms, rms_log10 = (float(np.sqrt(np.mean(each**2))) for each in (absolute, relative))
        distances.append(CurveRms(noise, floor, rms, rms_log10))
    return distances


def _select_typical(printed: Sequence[Comparable], statistic: str) -> list[Comparable]:
    """Return the typical figures of a statistic, or the others if there are none."""
    with_value = [row for row in printed if row.statistic == statistic and row.value is not None]
    typical = [row for row in with_value if row.figure and row.figure.kind in _TYPICAL_KINDS]
    return typical or with_value
