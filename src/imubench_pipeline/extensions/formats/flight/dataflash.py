"""ArduPilot DataFlash logs (.BIN): messages ``IMU_0``, ``GYR_1`` with fields such as ``GyrX``.

See "Log Messages" and libraries/AP_Logger of ArduPilot. A message is two sync bytes, its type and
its fields, which a message FMT declares. The batch sampler (ISBH, ISBD) is not read.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

import numpy as np

from imubench_pipeline.extensions.formats.flight.messages import Kind, MessageFile, Messages

_SYNC = b"\xa3\x95"
_FMT, _FMT_BYTES = 0x80, 89
_INSTANCE = "I"  # field with the number of the sensor
_TYPES = {"b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4",
          "q": "<i8", "Q": "<u8", "g": "<f2", "f": "<f4", "d": "<f8", "c": "<i2", "C": "<u2",
          "e": "<i4", "E": "<u4", "L": "<i4", "n": "S4", "N": "S16", "Z": "S64",
          "a": "S64"}  # fmt: skip
_FACTORS = {**dict.fromkeys("cCeE", 0.01), "L": 1e-7}
_UNITS = {f"Gyr{axis}": "rad/s" for axis in "XYZ"} | {f"Acc{axis}": "m/s^2" for axis in "XYZ"}
_SENSORS = ("IMU", "ACC", "GYR")  # also with a number behind
"""Messages with the units of `_UNITS`, and a temperature T, degC; old logs do not state them."""


class DataFlashMessages(Messages):
    """The messages of an ArduPilot log with declared fields."""

    time_columns: ClassVar = {"TimeUS": "us", "SampleUS": "us", "TimeMS": "ms"}

    def __iter__(self) -> Iterator[tuple[str, bytes]]:
        lengths = [0] * 256
        lengths[_FMT] = _FMT_BYTES
        declared: dict[int, Kind] = {}
        instances: dict[int, int] = {}  # place of the instance in a message
        numbered: dict[tuple[int, int], Kind] = {}
        while True:
            data, at = self._data, self._at
            end = at + 3
            if end <= len(data):
                kind = data[at + 2]
                end = at + lengths[kind]
                if data[at : at + 2] != _SYNC or end == at:
                    kinds = bytes(number for number, length in enumerate(lengths) if length)
                    mark = re.compile(_SYNC + b"[" + re.escape(kinds) + b"]", re.DOTALL)
                    if not self._skip_to(mark, 3):
                        return
                    continue
            if end > len(data):
                if not self._read_more():
                    self.cut += bool(self._data[self._at :].strip(b"\0"))
                    return
                continue
            self._at, payload = end, data[at + 3 : end]
            if kind == _FMT:
                own, length = payload[:2]
                if length > 3 and (found := _parse_declaration(payload[2:])) is not None:
                    lengths[own], declared[own] = length, found
                    numbered = {key: each for key, each in numbered.items() if key[0] != own}
                    instances.pop(own, None)
                    if (_INSTANCE, "u1") in found.fields:
                        before = found.fields[: found.fields.index((_INSTANCE, "u1"))]
                        instances[own] = np.dtype(before).itemsize
                continue
            of_kind: Kind | None = declared.get(kind)
            if of_kind is not None and kind in instances:
                number = payload[instances[kind]]
                if (kind, number) not in numbered:
                    numbered[kind, number] = replace(of_kind, name=f"{of_kind.name}_{number}")
                of_kind = numbered[kind, number]
            if of_kind is not None and self._is_wanted(of_kind):
                yield of_kind.name, payload


def _parse_declaration(payload: bytes) -> Kind | None:
    """Return a kind of message, without instance; None if the declaration is damaged."""
    texts = (payload[:4], payload[4:20], payload[20:84])
    name, form, labels = (text.split(b"\0")[0].decode("ascii", "replace").strip() for text in texts)
    signs = dict(zip(labels.split(","), form, strict=False))
    if not name or len(signs) != len(form) or not set(form) <= _TYPES.keys() or "" in signs:
        return None
    fields = [(label, _TYPES[sign]) for label, sign in signs.items()]
    factors = {label: _FACTORS[sign] for label, sign in signs.items() if sign in _FACTORS}
    units = {label: unit for label, unit in _UNITS.items() if label in signs}
    units |= {"T": "degC"} if units and "T" in signs else {}
    sensor = name.rstrip("0123456789") in _SENSORS
    return Kind(name, fields, units if sensor else {}, factors)


class DataFlashFile(MessageFile):
    """One kind of message of an ArduPilot log."""

    messages = DataFlashMessages
