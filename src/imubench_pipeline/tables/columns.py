"""A column of a table: its name with type, unit and meaning."""

from __future__ import annotations

from dataclasses import dataclass

import pyarrow as pa


@dataclass(frozen=True)
class Column:
    """One column of a table; ``unit`` is ``-`` for a text, a count or a ratio."""

    name: str
    type: pa.DataType
    unit: str
    meaning: str
    required: bool = True


def text(name: str, meaning: str, required: bool = True) -> Column:
    """Return a column of texts."""
    return Column(name, pa.string(), "-", meaning, required)


def number(name: str, unit: str, meaning: str, required: bool = False) -> Column:
    """Return a column of numbers."""
    return Column(name, pa.float64(), unit, meaning, required)


def drawn(name: str, unit: str, meaning: str) -> Column:
    """Return a column of numbers of which there are many, in single precision."""
    return Column(name, pa.float32(), unit, meaning, required=False)


def count(name: str, meaning: str, required: bool = False) -> Column:
    """Return a column of counts."""
    return Column(name, pa.int64(), "-", meaning, required)


def flag(name: str, meaning: str, required: bool = True) -> Column:
    """Return a column of yes and no."""
    return Column(name, pa.bool_(), "-", meaning, required)


SENSOR = text("sensor", "name of the sensor file")
RECORDING = text("recording", "name of the recording")
CHANNEL = text("channel", "axis and quantity, gyro_x to accel_z")
KEYS = (SENSOR, RECORDING, CHANNEL)
"""What names a channel in every table."""


def curve_limits(unit: str) -> tuple[Column, ...]:
    """Return what every table of a measured Allan curve says of its limits."""
    return (
        number("lower", unit, "lower 95 % limit"),
        number("upper", unit, "upper 95 % limit"),
        number("edf", "-", "equivalent degrees of freedom of the Allan variance"),
        number("edf_upper", "-", "those of the upper 95 % limit: more where few clusters remain"),
        text("edf_source", "what they follow from: fitted spectrum, or power law at this tau"),
    )


def figure(
    parameters: str, statuses: str = "ok, doubtful, not_shown, at_bound, not_identified or absent"
) -> tuple[Column, ...]:
    """Return what every table says of an estimated figure."""
    return (
        text("parameter", parameters),
        number("value", "as in unit", "estimate; null where status says why"),
        number("lower", "as in unit", "lower 95 % limit"),
        number("upper", "as in unit", "upper 95 % limit"),
        text("unit", "SI unit of value, lower and upper; degC for T_0"),
        text("status", statuses),
        text("reason", "why there is no plain value", required=False),
    )
