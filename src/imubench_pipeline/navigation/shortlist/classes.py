"""Ranges of unpublished figures, from the measured sensors of a price class."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.recordings.fitness import left_out
from imubench_pipeline.settings.sensor import quantity_of

_FIGURE_OF_PARAMETER = {"N": "N", "B_curve": "B", "K": "K", "T_B": "T_B"}
"""Figure for each parameter of the estimates: B is taken from the curve."""


@dataclass(frozen=True)
class Span:
    """Range of possible values of a figure."""

    # low, high: SI
    low: float
    high: float
    words: str = ""  # source of an assumed range; empty if printed


@dataclass(frozen=True)
class MeasuredRanges:
    """Ranges of measured parameters, by sensor, quantity and figure."""

    # (sensor, quantity, figure) -> (low, high), SI
    of_sensor: Mapping[tuple[str, str, str], tuple[float, float]]
    classes: Mapping[str, str]  # class of each sensor that states one
    # (sensor, quantity) -> (low, high) of B, SI, from datasheets: used if none is measured
    printed: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)

    def span(self, price_class: str | None, quantity: str, figure: str) -> Span | None:
        """Return the range of a figure (N, B, K or T_B) over the measured sensors of a class.

        If none of the class is measured, the range is over all measured sensors; if none is
        measured at all, the range of B is from datasheets. None if nothing is known.
        """
        by_sensor = {
            sensor: ends
            for (sensor, of, name), ends in self.of_sensor.items()
            if (of, name) == (quantity, figure)
        }
        source = "measured sensors"
        if not by_sensor and figure == "B":
            by_sensor = {name: ends for (name, of), ends in self.printed.items() if of == quantity}
            source = "datasheets"
        if not by_sensor:
            return None
        wanted = class_of(price_class)
        own = {s: ends for s, ends in by_sensor.items() if wanted and self.classes.get(s) == wanted}
        which = f"of class {wanted}" if own else "of any class, for there is none of its own"
        used = own or by_sensor
        named = ", ".join(sorted(used))
        low, high = min(ends[0] for ends in used.values()), max(ends[1] for ends in used.values())
        return Span(low, high, f"that of {source} {which} ({named})")


def class_of(price_class: str | None) -> str:
    """Return the name in a price class, such as ``consumer`` in ``consumer, about US$8``."""
    return re.split(r"[,(]", price_class or "")[0].strip().lower()


def measured_ranges(
    parameters: Iterable[ParameterRow],
    recordings: Iterable[RecordingRow],
    price_classes: Mapping[str, str | None],
) -> MeasuredRanges:
    """Return the measured ranges of a run, from real sensors and recordings that decide.

    They are the 95 % limits of parameters with a value. A random walk that is not significant in a
    log may be 0; its upper limit is used only if no log of the sensor determines one.
    """
    about = list(recordings)
    apart = left_out(about)
    real = {
        place
        for row in about
        if not row.simulated and (place := (row.sensor, row.recording)) not in apart
    }
    shown: dict[tuple[str, str, str], list[tuple[float, float]]] = {}
    absent: dict[tuple[str, str, str], list[float]] = {}
    for one in parameters:
        figure = _FIGURE_OF_PARAMETER.get(one.parameter)
        if figure is None or not one.recommended or one.component != 1:
            continue
        if (one.sensor, one.recording) not in real:
            continue
        key = (one.sensor, quantity_of(one.channel), figure)
        if one.status == "ok" and one.value is not None:
            low, high = (one.value if end is None else end for end in (one.lower, one.upper))
            shown.setdefault(key, []).append((low, high))
        elif one.status == "absent" and figure == "K":
            absent.setdefault(key, []).append(one.upper or 0.0)
    ranges = {}
    for key in {*shown, *absent}:
        several = shown.get(key, [(0.0, max(absent.get(key, [0.0])))])
        low = 0.0 if key in absent else min(ends[0] for ends in several)
        high = max(ends[1] for ends in several)
        if math.isfinite(high):
            ranges[key] = (low, high)
    classes = {sensor: class_of(text) for sensor, text in price_classes.items() if text}
    return MeasuredRanges(ranges, classes)
