"""Standard deviations from the figures of a datasheet, and from the thermal fit of a log.

A typical ± figure is taken as 1 sigma; a range as a uniform distribution, sqrt(3) sigma at its
larger end; a maximum as 3 sigma. (In data sheets of the catalogue with both, the maximum is 1.9 to
3.5 times the typical figure.) A temperature coefficient from a log replaces the printed one.
"""

import math
from collections.abc import Iterable, Mapping

from imubench_pipeline.datasheets.comparable import Comparable, PrintedAxis
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.model.states import Cause
from imubench_pipeline.navigation.error_budget.in_use import Figure
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, Datasheet
from imubench_pipeline.words.reasons import budgets as texts

DATASHEET_KEY_OF_CAUSE: Mapping[Cause, str] = {
    "turn_on_bias": "offset",
    "repeatability": "bias_repeatability",
    "temperature": "temperature_coefficient",
    "scale_factor": "scale_factor_error",
    "nonlinearity": "nonlinearity",
    "g_sensitivity": "g_sensitivity",
    "vibration_rectification": "vibration_rectification",
}
"""Datasheet key of the figure for each cause."""

_SIGMA_CONVENTIONS: Mapping[str, tuple[float, str]] = {
    "1sigma": (1.0, texts.PRINTED_SIGMA),
    "typ": (1.0, texts.TYPICAL_AS_SIGMA),
    "derived": (1.0, texts.TYPICAL_AS_SIGMA),
    "range": (math.sqrt(3.0), texts.RANGE_AS_UNIFORM),
    "max": (3.0, texts.MAXIMUM_AS_SIGMAS),
}
"""By kind, in order of preference: number of sigmas of a figure, and description."""

SIGMAS = 1.96  # half the width of a 95 % interval

_CAUSE_OF_COEFFICIENT: Mapping[str, Cause] = {
    "sensitivity": "temperature",
    "quadratic": "temperature_squared",
}


def read_datasheet_figures(datasheet: Datasheet, channel: str) -> dict[Cause, Figure]:
    """Return the datasheet figures of the errors in use of a channel, SI."""
    axis = PrintedAxis.of(datasheet, channel)
    names = FIGURE_DIMENSIONS[axis.quantity]
    figures: dict[Cause, Figure] = {}
    for cause, name in DATASHEET_KEY_OF_CAUSE.items():
        if name not in names:
            continue
        like = Comparable(name, name, None)
        rows = axis.read(name, like, axis.si(name))
        by_kind: dict[str, list[float]] = {}
        for row in rows:
            if row.figure and row.value is not None:
                by_kind.setdefault(row.figure.kind, []).append(row.value)
        kind = next((kind for kind in _SIGMA_CONVENTIONS if kind in by_kind), None)
        if kind is None:
            obstacle = next((row.obstacle for row in rows if row.obstacle), None)
            figures[cause] = Figure(reason=obstacle or axis.unpublished(like, name).reason)
        else:
            sigmas, convention = _SIGMA_CONVENTIONS[kind]
            figures[cause] = Figure(
                sigma=max(by_kind[kind]) / sigmas,
                origin="datasheet",
                kind=kind,
                convention=convention,
            )
    return figures


def read_log_figures(rows: Iterable[TemperatureRow]) -> dict[Cause, Figure]:
    """Return the figures of the errors in use that the thermal fit of a channel determines, SI."""
    figures: dict[Cause, Figure] = {}
    for row in rows:
        if row.parameter not in _CAUSE_OF_COEFFICIENT or row.status != "ok" or row.value is None:
            continue
        spread = 0.0
        if row.lower is not None and row.upper is not None:
            spread = (row.upper - row.lower) / (2.0 * SIGMAS)
        figures[_CAUSE_OF_COEFFICIENT[row.parameter]] = Figure(
            sigma=abs(row.value), origin="measured", convention=texts.OF_THIS_UNIT, spread=spread
        )
    return figures


def collect_figures_in_use(
    datasheet: Datasheet, channels: Iterable[str], temperature: Iterable[TemperatureRow]
) -> dict[str, dict[Cause, Figure]]:
    """Return the figures of the errors in use by channel, from datasheet and log."""
    rows = list(temperature)
    return {
        channel: read_datasheet_figures(datasheet, channel)
        | read_log_figures(row for row in rows if row.channel == channel)
        for channel in channels
    }
