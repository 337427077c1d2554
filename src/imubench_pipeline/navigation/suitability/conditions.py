"""Conditions of a verdict other than the known errors: unknown figures and hard requirements.

A sensor that does not meet a hard requirement is excluded. If its known errors pass, but a figure
that matters in this use is not known, it passes if that figure is below the largest one within the
limit. Several unknown figures share the remaining error budget: with all of them at their largest,
the limit is just reached. If the printed turn-on bias alone exceeds a limit, the sensor passes if
it is calibrated to within the remaining error budget.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from decimal import ROUND_DOWN, Decimal

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.navigation.suitability.abilities import Abilities, judge
from imubench_pipeline.settings.printed import SENSORS
from imubench_pipeline.settings.requirements import Must
from imubench_pipeline.units import from_si

EXCLUDED = "excluded"

CONDITIONAL_VERDICTS = {"passes": "passes if", "probably passes": "probably passes if"}
"""Verdicts that a condition changes. A sensor that fails without a condition fails with it."""

_CONDITION_TEXTS = {
    "turn_on_bias": ("its {sensor}s are calibrated to {largest}", "deg/s", "mg"),
    "temperature": (
        "its {sensor} temperature coefficient is below {largest}",
        "deg/s/K",
        "mg/K",
    ),
    "scale_factor": ("its {sensor} scale factor error is below {largest}", "ppm", "ppm"),
    "g_sensitivity": ("its {sensor} g-sensitivity is below {largest}", "deg/s/g", ""),
    "vibration_rectification": (
        "its {sensor} vibration rectification is below {largest}",
        "deg/s/g^2",
        "mg/g^2",
    ),
}
"""By cause: the condition, and the unit of the figure for a gyro and an accelerometer."""

_FIGURE_NAMES = {
    "temperature": "temperature coefficient",
    "scale_factor": "scale factor error",
    "g_sensitivity": "g-sensitivity",
    "vibration_rectification": "vibration rectification",
}
"""Names of the figures that a datasheet can give for every specimen."""

_DIMENSION_OF_UNIT = {
    "deg/s": "angular_rate",
    "mg": "acceleration",
    "deg/s/K": "gyro_temperature_coefficient",
    "mg/K": "accel_temperature_coefficient",
    "ppm": "ratio",
    "deg/s/g": "gyro_acceleration_coefficient",
    "deg/s/g^2": "gyro_vibration_coefficient",
    "mg/g^2": "accel_vibration_coefficient",
}


@dataclass(frozen=True)
class Rests:
    """Conditions of a verdict on a sensor."""

    lacking: tuple[str, ...]  # hard requirements that it does not meet
    unknown: tuple[str, ...]  # hard requirements with unknown properties
    # figures that are not known, or too large, by ``gyro`` or ``accel`` and cause: the largest one
    # within every limit, SI
    figures: Mapping[tuple[str, str], float]

    @classmethod
    def of(cls, must: Must, has: Abilities, conditions: Iterable[ErrorBudgetRow]) -> Rests:
        """Return the conditions of the verdict on a sensor.

        ``must`` are the hard requirements, ``has`` the properties of the sensor. ``conditions`` are
        the rows of the table ``error_budget`` that the limits depend on.
        """
        lacking, unknown = judge(must, has)
        figures: dict[tuple[str, str], float] = {}
        for row in conditions:
            if row.cause is None:
                continue  # every condition has a cause
            key = _get_quantity(row), row.cause
            largest = row.largest or 0.0
            figures[key] = min(figures.get(key, largest), largest)
        return cls(tuple(lacking), tuple(unknown), figures)

    def verdict(self, words: str) -> tuple[str, str | None]:
        """Return the verdict with its conditions applied, and the conditions in words."""
        if self.lacking:
            return EXCLUDED, "; ".join(self.lacking)
        conditions = list(self._list_conditions())
        if words not in CONDITIONAL_VERDICTS or not conditions:
            return words, None
        return CONDITIONAL_VERDICTS[words], "; ".join(conditions)

    def unknown_figures(self) -> list[str]:
        """Return the names of figures missing from its file, other than turn-on biases."""
        causes = [
            f"{SENSORS[measured]} {_FIGURE_NAMES[cause]}"
            for measured, cause in self.figures
            if cause in _FIGURE_NAMES
        ]
        return [*causes, *self.unknown]

    def _list_conditions(self) -> Iterator[str]:
        for (measured, cause), largest in self.figures.items():
            text, *units = _CONDITION_TEXTS[cause]
            unit = units[measured == "accel"]
            size = (
                f"{_round_down(from_si(largest, unit, _DIMENSION_OF_UNIT[unit])):g} "
                f"{unit} (1 sigma)"
            )
            yield text.format(sensor=SENSORS[measured], largest=size)
        if self.unknown:
            yield f"it has what it must (not known: {', '.join(self.unknown)})"


def _round_down(value: float) -> float:
    """Return a positive number, rounded down to three digits to stay within the limit."""
    step = Decimal(1).scaleb(Decimal(value).adjusted() - 2)
    return float(Decimal(value).quantize(step, rounding=ROUND_DOWN))


def in_words(verdict: str, conditions: str | None) -> str:
    """Return a verdict of the table ``ranking`` with its conditions, in words.

    An example is ``passes if its gyros are calibrated to ...``.
    """
    if not conditions:
        return verdict
    return f"{verdict}{':' * (verdict == EXCLUDED)} {conditions}"


def _get_quantity(row: ErrorBudgetRow) -> str:
    """Return the quantity that a source belongs to: ``gyro`` or ``accel``."""
    return next(word for word in row.source.split() if word in SENSORS)


def is_condition(row: ErrorBudgetRow) -> bool:
    """Return whether meeting a limit depends on the figure of a source."""
    return row.largest_unit is not None and row.cause in _CONDITION_TEXTS


def once_calibrated(
    words: str,
    limit: float | None,
    sigma: float | None,
    upper: float | None,
    conditions: Iterable[ErrorBudgetRow],
) -> str:
    """Return the verdict on an error after calibration of the biases that exceed its limit.

    The square of a bias is a term of every draw of the total, and so of the squared limits of the
    total. ``words`` is the verdict without calibration; limit, sigma and upper belong to the error;
    conditions are the sources that the verdict depends on.
    """
    squares = [size**2 for _, size in with_sigma(conditions)]
    if not squares or words in CONDITIONAL_VERDICTS or limit is None:
        return words
    for size, better in ((upper, "passes"), (sigma, "probably passes")):
        if size is not None and size**2 - math.fsum(squares) < limit**2:
            return better
    return words


def with_sigma(rows: Iterable[ErrorBudgetRow]) -> list[tuple[ErrorBudgetRow, float]]:
    """Return the rows with a figure, each with its standard deviation."""
    return [(row, row.sigma) for row in rows if row.sigma is not None]


def parts_of(total: float, sources: Iterable[ErrorBudgetRow], least: float = 0.01) -> str | None:
    """Return the sources of an error with their shares of the variance, the largest first.

    ``total`` is 1 sigma. Shares below ``least`` are left out.
    """
    if total <= 0.0:
        return None
    shares = ((row, (sigma / total) ** 2) for row, sigma in with_sigma(sources))
    shown = sorted((pair for pair in shares if pair[1] >= least), key=lambda pair: -pair[1])
    return "; ".join(f"{named(row)} {100 * share:.0f} %" for row, share in shown) or None


def named(row: ErrorBudgetRow) -> str:
    """Return the name of a source, with a note if it is from the datasheet."""
    return row.source + f" (datasheet, {row.kind})" * (row.origin == "datasheet")
