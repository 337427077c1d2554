"""Convert arrays and tables of users to channels with units.

Arrays are in SI unless units are given. For tables, the units must be stated: in the names of the
columns (``gyro_x [deg/s]``), in ``attrs``, or as an argument. A unit is never guessed from the
values.
"""

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from imubench_pipeline.settings.sensor import CHANNELS, QUANTITIES, TEMPERATURE, quantity_of
from imubench_pipeline.typing import Array
from imubench_pipeline.units import (
    SI_UNITS,
    UnitError,
    add_key_to_errors,
    find_conversion,
    parse_setting,
)

Channels = str | Sequence[str]
Units = Mapping[str, str]

_CHANNELS_OF_QUANTITY = {
    quantity: [f"{quantity}_{axis}" for axis in "xyz"] for quantity in QUANTITIES
}
_LABEL_PATTERN = re.compile(r"^\s*(.*?)\s*[\[(]\s*(.+?)\s*[\])]\s*$")
_TIME_COLUMNS = ("time", "t", "timestamp")


@dataclass(frozen=True)
class Column:
    """One channel, or the temperature, in its original unit."""

    values: Array  # shape (L,); NaN where a sample is missing
    unit: str

    def in_si(self, name: str) -> Array:
        """Return the samples in the SI unit of a channel, shape (L,)."""
        factor, offset = find_conversion(self.unit, get_dimension(name))
        return self.values if (factor, offset) == (1.0, 0.0) else factor * self.values + offset


def get_dimension(name: str) -> str:
    """Return the dimension of a channel or of the temperature."""
    return TEMPERATURE if name == TEMPERATURE else QUANTITIES[quantity_of(name)]


def read_rate(rate: float | str | None, data: object) -> float:
    """Return the sampling rate of samples, Hz; a table may state it in its ``attrs``.

    Raises ValueError if none is given, or it is not a frequency above 0 (`UnitError`: another
    dimension).
    """
    stated = rate if rate is not None else getattr(data, "attrs", {}).get("rate")
    if stated is None:
        raise ValueError(
            "no rate is given; expected the sampling rate of the samples, such as rate='100 Hz' or "
            "rate=100.0 (Hz)"
        )
    return parse_setting(stated, "frequency", "rate")


def convert_to_numbers(values: object, name: str) -> Array:
    """Return samples as floats, NaN where masked; ValueError if they are not real numbers."""
    filled = values.filled(np.nan) if isinstance(values, np.ma.MaskedArray) else values
    try:
        array = np.asarray(filled)
        if array.dtype.kind not in "fiu" and not (array.dtype.kind == "O" and array.size):
            raise ValueError(f"its dtype is {array.dtype}")
        return np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name} is no array of numbers ({error}); expected one such as numpy.loadtxt returns"
        ) from None


def read_columns(
    data: object, channels: Channels | None = None, units: Units | None = None
) -> dict[str, Column]:
    """Return the channels, and the temperature, of an array, a table or a mapping.

    Parameters
    ----------
    data : array_like, DataFrame or mapping of str to array_like
        Shape (L,), (L, 3) or (L, 6), rows are samples; or one column per channel.
    channels : str or sequence of str, optional
        Channels of the columns of an array; ``"gyro"`` and ``"accel"`` are three axes, or the x
        axis for shape (L,). By default six columns are gyro_x to accel_z, and shape (L,) is gyro_x.
        For a table or mapping, the selected channels.
    units : mapping of str to str, optional
        Units, by ``gyro``, ``accel`` or channel. By default SI; a table must state its units.

    Raises ValueError if the shape or a name is not one of these, or a channel has no finite number
    (`UnitError`: a unit is missing, not known or of another dimension).
    """
    known = (*QUANTITIES, *CHANNELS, TEMPERATURE)
    if units is not None and not isinstance(units, Mapping):
        raise ValueError(f"units are {units!r}; expected such as {{'gyro': 'deg/s', 'accel': 'g'}}")
    if unknown := [key for key in units or () if key not in known]:
        raise ValueError(f"units= has the key {unknown[0]!r}; expected one of {', '.join(known)}")
    is_table = _is_table(data)
    if has_columns(data):
        columns = dict(
            _select_columns(data, expand_channels(channels), units or {}, stated=is_table)
        )
    else:
        columns = dict(_name_columns(data, expand_channels(channels), units or {}))
    for name, column in columns.items():
        with add_key_to_errors(f"{name}: "):
            find_conversion(column.unit, get_dimension(name))
        if name != TEMPERATURE:
            check_present(column.values, name)
    return columns


def check_present(values: Array, name: str) -> None:
    """Raise ValueError if samples, shape (L,), contain no finite number."""
    if not len(values):
        raise ValueError(f"{name} is empty; expected two samples or more")
    if not np.isfinite(values).any():
        raise ValueError(
            f"{name}: none of the {len(values)} samples is a finite number; expected a recorded "
            "channel: leave it out, or check how the array was made"
        )


def has_columns(data: object) -> bool:
    """Return whether samples have column names, as in a table or a mapping."""
    return _is_table(data) or isinstance(data, Mapping)


def _is_table(data: object) -> bool:
    """Return whether data are a pandas DataFrame, without importing pandas."""
    pandas = sys.modules.get("pandas")
    return pandas is not None and isinstance(data, pandas.DataFrame)


def expand_channels(channels: Channels | None) -> list[str] | None:
    """Return the names of channels; ``gyro`` and ``accel`` are expanded to three axes.

    Raises ValueError if a name is not a channel, is repeated, or is not text.
    """
    if channels is None:
        return None
    asked: list[object] = [channels]
    with suppress(TypeError):
        asked = [channels] if isinstance(channels, str) else list(channels)
    if strange := [name for name in asked if not isinstance(name, str)]:
        raise ValueError(f"no channel {strange[0]!r}; expected names, as 'gyro' or ['gyro_z']")
    names = [name for each in map(str, asked) for name in _CHANNELS_OF_QUANTITY.get(each, [each])]
    if unknown := [name for name in names if name not in (*CHANNELS, TEMPERATURE)]:
        raise ValueError(
            f"no channel {unknown[0]!r}; expected one of {', '.join(CHANNELS)}, or gyro or accel "
            "for three axes"
        )
    if len(set(names)) < len(names):
        raise ValueError(f"channels are {', '.join(names)}; expected each of them once")
    return names


def _find_unit(name: str, units: Units) -> str | None:
    return units.get(name) or units.get(quantity_of(name))


def _name_columns(
    data: object, names: list[str] | None, units: Units
) -> Iterator[tuple[str, Column]]:
    array = convert_to_numbers(data, "the array")
    if array.ndim not in (1, 2) or not array.size:
        raise ValueError(
            f"the array has shape {array.shape}; expected (samples,), (samples, 3) or (samples, 6)"
        )
    table = array[:, None] if array.ndim == 1 else array
    count = table.shape[1]
    if names is None and count == len(CHANNELS):
        names = list(CHANNELS)
    if array.ndim == 1 and (names is None or names in _CHANNELS_OF_QUANTITY.values()):
        names = [names[0] if names else CHANNELS[0]]
    if names is None or len(names) != count:
        if table.shape[0] in (3, 6) and count > len(CHANNELS):
            mend = "expected a row for each sample: transpose it, with .T"
        elif names is None:
            mend = (
                "expected six columns, gyro_x to accel_z, or channels= that names them: "
                "'gyro', 'accel' or such as ['gyro_z']"
            )
        else:
            mend = f"expected a column for each of {', '.join(names)}"
        raise ValueError(f"the array has shape {array.shape}; {mend}")
    for place, name in enumerate(names):
        unit = _find_unit(name, units) or SI_UNITS[get_dimension(name)]
        yield name, Column(table[:, place], unit)


def _select_columns(
    data: Any, names: list[str] | None, units: Units, *, stated: bool
) -> Iterator[tuple[str, Column]]:
    """Yield the columns of a table or mapping by name; with ``stated``, units are required."""
    written = {label: _split_label(label) for label in (data.columns if stated else data)}
    there = {name: label for label, (name, _) in written.items()}
    if len(there) < len(written):
        raise ValueError(
            f"two of the columns {', '.join(map(str, written))} are the same channel; rename one"
        )
    passed = (TEMPERATURE, *_TIME_COLUMNS)
    if names is None:
        strange = [label for label, (name, _) in written.items() if name not in CHANNELS]
        strange = [label for label in strange if written[label][0] not in passed]
        if strange or not set(there) & set(CHANNELS):
            raise ValueError(
                f"found {f'the column {strange[0]!r}' if strange else 'no channel'}; expected "
                f"columns of {', '.join(CHANNELS)}, such as 'gyro_x [deg/s]'; rename the columns, "
                "or select channels with channels=[...]"
            )
        names = [name for name in (*CHANNELS, TEMPERATURE) if name in there]
    lengths = set()
    attrs = getattr(data, "attrs", {}).get("units", {}) if stated else {}
    for name in names:
        if name not in there:
            raise ValueError(f"no column {name}; found {', '.join(map(str, written))}: name one")
        values = convert_to_numbers(data[there[name]], name)
        if values.ndim != 1:
            raise ValueError(f"{name} has shape {values.shape}, expected one dimension")
        lengths.add(len(values))
        sources = {
            "the name of the column": written[there[name]][1],
            "units=": _find_unit(name, units),
            "attrs['units']": attrs.get(there[name]) or _find_unit(name, attrs),
        }
        factors = {}
        for source, unit in sources.items():
            if unit:
                with add_key_to_errors(f"{name}: "):
                    factors[find_conversion(unit, get_dimension(name))] = f"{unit!r} by {source}"
        if len(factors) > 1:
            raise UnitError(f"{name} is in {' and in '.join(factors.values())}; expected one unit")
        unit = next(filter(None, sources.values()), None)
        if unit is None and stated:
            raise UnitError(
                f"{name}: the table does not state its unit, which is never guessed; state it, as "
                "in units={'gyro': 'deg/s', 'accel': 'm/s^2'}, or rename the column, as in "
                f"'{name} [{SI_UNITS[get_dimension(name)]}]'"
            )
        yield name, Column(values, unit or SI_UNITS[get_dimension(name)])
    if len(lengths) > 1:
        raise ValueError(f"the channels have {sorted(lengths)} samples; expected equal numbers")


def _split_label(label: object) -> tuple[str, str | None]:
    """Return the name and the unit in the label of a column; None without a unit."""
    match = _LABEL_PATTERN.match(str(label))
    name, unit = (match[1], match[2]) if match else (str(label).strip(), None)
    return name.lower(), unit
