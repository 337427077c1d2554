"""On what a verdict rests beside the errors that are known: figures that are not, and musts.

A sensor that is known not to have what a requirement says it must is excluded. One whose known
errors pass, but of which a figure is not known that the use brings into play, passes if that
figure is below the largest that leaves the limit kept; several that are not known share what room
there is, so that with all of them at their largest the limit is just reached. One whose printed
turn-on bias alone breaks a limit passes if it is calibrated to what there is room for.
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
"""The verdicts that a condition changes: what fails without it fails with it, too."""

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
"""By cause: the condition, and the unit of the figure of a gyro and of an accelerometer."""

_FIGURE_NAMES = {
    "temperature": "temperature coefficient",
    "scale_factor": "scale factor error",
    "g_sensitivity": "g-sensitivity",
    "vibration_rectification": "vibration rectification",
}
"""Of the figures that a datasheet can tell of every specimen."""

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
    """What a verdict on a sensor rests on."""

    lacking: tuple[str, ...]  # what it must have and has not
    unknown: tuple[str, ...]  # what it must have, and nobody knows whether it has
    # figures that are not known, or too large, by ``gyro`` or ``accel`` and cause, with the largest
    # with which every limit is kept, SI
    figures: Mapping[tuple[str, str], float]

    @classmethod
    def of(cls, must: Must, has: Abilities, conditions: Iterable[ErrorBudgetRow]) -> Rests:
        """Return what the verdict on a sensor rests on.

        Of what it must have and has, and the rows of the table ``error_budget`` that a limit rests
        on, of all limits.
        """
        lacking, unknown = judge(must, has)
        figures: dict[tuple[str, str], float] = {}
        for row in conditions:
            if row.cause is None:
                continue  # a condition has one
            key = _get_quantity(row), row.cause
            largest = row.largest or 0.0
            figures[key] = min(figures.get(key, largest), largest)
        return cls(tuple(lacking), tuple(unknown), figures)

    def verdict(self, words: str) -> tuple[str, str | None]:
        """Return a verdict on the known errors with what it rests on, and the latter in words."""
        if self.lacking:
            return EXCLUDED, "; ".join(self.lacking)
        conditions = list(self._conditions())
        if words not in CONDITIONAL_VERDICTS or not conditions:
            return words, None
        return CONDITIONAL_VERDICTS[words], "; ".join(conditions)

    def unknown_figures(self) -> list[str]:
        """Return the names of the figures that its file does not say, but for turn-on biases."""
        causes = [
            f"{SENSORS[measured]} {_FIGURE_NAMES[cause]}"
            for measured, cause in self.figures
            if cause in _FIGURE_NAMES
        ]
        return [*causes, *self.unknown]

    def _conditions(self) -> Iterator[str]:
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
    """Return a number above 0 cut to three digits: rounded up it would no more keep the limit."""
    step = Decimal(1).scaleb(Decimal(value).adjusted() - 2)
    return float(Decimal(value).quantize(step, rounding=ROUND_DOWN))


def in_words(verdict: str, conditions: str | None) -> str:
    """Return a verdict of the table ``ranking`` with the conditions that it rests on.

    Such as ``passes if its gyros are calibrated to ...``.
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
    """Return the verdict on an error when the biases that break its limit are calibrated.

    A bias is in every draw of the total by its square, and so in the limits of the total. ``words``
    is the verdict as it is; limit, sigma and upper are those of the error; conditions are the
    sources that the limit rests on.
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
    """Return the sources of an error with their parts of the variance, the largest first.

    Of a total, 1 sigma, and its sources; parts below ``least`` are left out.
    """
    if total <= 0.0:
        return None
    shares = ((row, (sigma / total) ** 2) for row, sigma in with_sigma(sources))
    shown = sorted((pair for pair in shares if pair[1] >= least), key=lambda pair: -pair[1])
    return "; ".join(f"{named(row)} {100 * share:.0f} %" for row, share in shown) or None


def named(row: ErrorBudgetRow) -> str:
    """Return the name of a source, marked where it is printed."""
    return row.source + f" (datasheet, {row.kind})" * (row.origin == "datasheet")
