"""Units that logs state themselves, held against those that the sensor file states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from imubench_pipeline.readers.spellings import divided, unit_of
from imubench_pipeline.settings.sensor import CHANNELS, QUANTITIES, ColumnSource, quantity_of
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.units import conversion

_OTHER = 1.5
"""Ratio of two units that are not the same: the nearest ones, mg and cm/s², are 1.02 apart, and no
logger writes both; then come mrad/s and °/s, 17 apart. A scale may hold a calibration."""

_LONGEST = 60


@dataclass(frozen=True)
class StatedUnit:
    """The unit of a channel as the log itself states it."""

    unit: str
    """As a sensor file would state it."""
    where: str
    """The place in the log."""


def stated(channel: str, beside: Iterable[tuple[str | None, str]], label: str) -> StatedUnit | None:
    """Return the unit that a log states of a channel; None: none that is understood.

    Parameters
    ----------
    channel : str
        Or what is beside channels, of which nothing is returned.
    beside : iterable of (str or None, str)
        What stands where units do, and where that is.
    label : str
        The name of the column, which may have the unit in it.
    """
    if channel not in CHANNELS:
        return None
    dimension = QUANTITIES[quantity_of(channel)]
    for text, where in beside:
        unit = unit_of(text or "", dimension)
        if unit is not None:
            return StatedUnit(unit, where)
    unit = unit_of(label, dimension) or divided(label, dimension)[1]
    return None if unit is None else StatedUnit(unit, f"the name {label[:_LONGEST]!r}")


def contradictions(
    file: str, sources: Mapping[str, ColumnSource], units: Mapping[str, StatedUnit]
) -> list[Finding]:
    """Return the channels of which log and sensor file state units that are not the same.

    Parameters
    ----------
    file : str
        Name of the log.
    sources : mapping of str to ColumnSource
        What the sensor file states.
    units : mapping of str to StatedUnit
        What the log states.
    """
    found = []
    for channel, said in units.items():
        source = sources[channel]
        dimension = QUANTITIES[quantity_of(channel)]
        read = conversion(source.unit, dimension)[0] * abs(source.scale)
        factor = conversion(said.unit, dimension)[0] / read
        if 1.0 / _OTHER < factor < _OTHER:
            continue
        scaled = "" if source.scale == 1 else f", times {source.scale:g}"
        detail = (
            f"{file} states {said.unit} for {channel} ({said.where}), the sensor file "
            f"{source.unit}{scaled} (log.channels.{channel}.unit), which is used; if the log is "
            f"right, the figures are to be multiplied by {factor:.5g}: mend the one that is wrong"
        )
        found.append(Finding("unit_contradicts", "warning", detail, factor, channel))
    return found
