"""Number of sensors that reach the printed figures of a better class: the table ``grades``.

For n sensors with independent noise, white noise and the minimum of the curve are 1/√n of one
sensor: n = (own / printed)^2, for each figure separately. Common errors, such as from temperature,
do not average out. A fused log is treated as a separate sensor, and its rows include them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from imubench_pipeline.datasheets.comparable import Comparable, read_comparables
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.extensions.fusion.tables import GradeRow
from imubench_pipeline.navigation.compared import ComparedChannel
from imubench_pipeline.settings.printed import Datasheet

PARAMETER_OF_STATISTIC = {"N": "N", "adev_minimum": "sigma_min"}
"""Parameter that is compared with a printed figure, by its statistic."""


@dataclass(frozen=True)
class Grade:
    """A sensor of the better class."""

    sensor: str  # name in the catalogue
    name: str  # vendor and model
    datasheet: Datasheet

    def printed(self, channel: str) -> Iterator[tuple[str | None, Comparable]]:
        """Yield the printed N and floor, SI, of each option; without a value if not printed."""
        sheet = getattr(self.datasheet, channel.split("_")[0])
        if sheet is None:
            return
        names = ("noise_density", "random_walk", "bias_instability")
        figures = [figure for name in names for figure in sheet.printed(name)]
        options = dict.fromkeys(figure.option for figure in figures) or {None: None}
        for option in options:
            chosen = self.datasheet.model_copy(update={"options": [option] if option else []})
            for one in read_comparables(chosen, channel):
                of_option = one.figure is None or one.figure.option in (None, option)
                if one.statistic in PARAMETER_OF_STATISTIC and of_option:
                    yield option, one


def yield_grade_rows(
    candidates: Iterable[ComparedChannel], grades: Sequence[Grade]
) -> Iterator[GradeRow]:
    """Yield the rows of the table ``grades``: each sensor against each printed figure.

    The axis with the median N represents a sensor; measured axes are preferred to simulated ones.
    """
    by_sensor: dict[tuple[str, str], list[ComparedChannel]] = {}
    for channel in candidates:
        quantity = channel.channel.split("_")[0]
        by_sensor.setdefault((quantity, channel.sensor), []).append(channel)
    for (quantity, sensor), channels in sorted(by_sensor.items()):
        measured = [channel for channel in channels if not channel.simulated] or channels
        chosen = sorted(measured, key=lambda channel: channel.model.N)[len(measured) // 2]
        for grade in grades:
            if grade.sensor == sensor:
                continue
            for option, printed in grade.printed(chosen.channel):
                name = PARAMETER_OF_STATISTIC[printed.statistic]
                estimate = chosen.estimate
                of = estimate.parameters if name == "N" else estimate.curve or {}
                own = of.get(name, Parameter(None, "not_shown", "not estimated"))
                reason = printed.obstacle or printed.reason
                if printed.value is not None:
                    reason = None if own.value is not None else own.reason or own.status
                yield GradeRow(
                    quantity=quantity,
                    sensor=sensor,
                    recording=chosen.recording,
                    channel=chosen.channel,
                    simulated=chosen.simulated,
                    grade=grade.sensor,
                    grade_name=grade.name,
                    option=option,
                    statistic=name,
                    value=own.value,
                    lower=own.lower,
                    upper=own.upper,
                    printed=printed.value,
                    n=_divide(own.value, printed.value),
                    n_lower=_divide(own.lower, printed.value),
                    n_upper=_divide(own.upper, printed.value),
                    reason=reason,
                )


def _divide(own: float | None, printed: float | None) -> float | None:
    """Return the number of sensors that reach a printed figure."""
    if own is None or printed is None:
        return None
    return (own / printed) ** 2 if printed else math.inf
