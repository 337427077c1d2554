"""PX4 ULog: topics of uORB, as ``sensor_combined_0``, with fields such as ``gyro_rad[0]``.

See "ULog File Format" of the PX4 guide. The file is a header and messages: size, type, payload.
"""

import re
import struct
from collections.abc import Iterator, Mapping
from typing import ClassVar

from imubench_pipeline.extensions.formats.flight.messages import Kind, MessageFile, Messages
from imubench_pipeline.readers.bounds import MAX_TOPICS, MAX_ULOG_FIELDS
from imubench_pipeline.tables.findings import RecordingError

_MAGIC, _HEADER_BYTES = b"ULog\x01\x12\x35", 16
_SYNC = b"\x08\x00S\x2f\x73\x13\x20\x25\x0c\xbb\x12"  # a message that only marks its place
_MARK = re.compile(re.escape(_SYNC))
_KINDS = frozenset(b"FABDIMPQLCRSO")
_TYPES = {"int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4",
          "uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4",
          "double": "<f8", "bool": "?", "char": "S1"}  # fmt: skip
_FIELD = re.compile(r"(\w+)(?:\[(\d{1,5})\])? (\w+)")
_MAX_NESTING = 16
_RATES, _FORCES = dict.fromkeys("xyz", "rad/s"), dict.fromkeys("xyz", "m/s^2")
_UNITS: Mapping[str, Mapping[str, str]] = {
    "sensor_combined": {f"gyro_rad[{axis}]": "rad/s" for axis in range(3)}
    | {f"accelerometer_m_s2[{axis}]": "m/s^2" for axis in range(3)},
    "sensor_gyro": _RATES | {"temperature": "degC"},
    "sensor_accel": _FORCES | {"temperature": "degC"},
}
"""Units of the topics of raw sensors, as their declarations in PX4 state them."""


class UlogMessages(Messages):
    """The data messages of a ULog."""

    time_columns: ClassVar = {"timestamp": "us", "timestamp_sample": "us"}

    def __iter__(self) -> Iterator[tuple[str, bytes]]:
        self._read_more()
        if not self._data.startswith(_MAGIC):
            raise RecordingError(
                f"{self.file}: is no ULog: it begins with {self._data[:8].hex(' ')}; expected "
                f"{_MAGIC.hex(' ')}; correct 'reader' in the sensor file, or copy the file again"
            )
        self._at = _HEADER_BYTES
        declared: dict[str, str] = {}
        layouts: dict[str, list[tuple[str, str]]] = {}
        topics: dict[bytes, Kind] = {}
        appended: list[int] = []
        while True:
            data, at = self._data, self._at
            size, kind = struct.unpack_from("<HB", data, at) if at + 3 <= len(data) else (0, 0)
            begin, end, place = at + 3, at + 3 + size, self.read - len(data)
            if appended and place + at < appended[0] < place + end:
                self._at = min(appended.pop(0) - place, len(data))  # cut short where more begins
                continue
            if begin > len(data) or (kind in _KINDS and end > len(data)):
                if not self._read_more():
                    self.cut += bool(self._data[self._at :].strip(b"\0"))
                    return
                continue
            topic = topics.get(data[begin : begin + 2]) if kind == ord("D") else None
            if kind not in _KINDS or not size or (kind == ord("D") and topic is None):
                if not self._skip_to(_MARK, len(_SYNC)):
                    return
                continue
            self._at = end
            if topic is not None:
                if self._is_wanted(topic):
                    yield topic.name, data[begin + 2 : end]
            elif kind == ord("F") and len(declared) < MAX_TOPICS:
                name, _, layout = data[begin:end].decode("utf-8", "replace").partition(":")
                declared[name] = layout
            elif kind == ord("A") and len(topics) < MAX_ULOG_FIELDS:
                name = data[begin + 3 : end].decode("utf-8", "replace")
                if name not in layouts:
                    layouts[name] = _list_fields(declared, name)
                topics[data[begin + 1 : begin + 3]] = Kind(
                    f"{name}_{data[begin]}", layouts[name], _UNITS.get(name, {})
                )
            elif kind == ord("B") and size >= 40:
                offsets = struct.unpack_from("<3Q", data, begin + 16)
                appended = sorted(offset for offset in offsets if offset > place + end)


def _list_fields(declared: Mapping[str, str], topic: str) -> list[tuple[str, str]]:
    """Return label and type of the fields of a topic; none if they are impossible."""
    fields: list[tuple[str, str]] = []

    def add(name: str, before: str, depth: int) -> bool:
        for text in filter(None, declared.get(name, "").split(";")):
            match = _FIELD.fullmatch(text)
            if match is None or depth > _MAX_NESTING:
                return False
            own, count, label = match.groups()
            for each in [label] if count is None else [f"{label}[{n}]" for n in range(int(count))]:
                if len(fields) > MAX_ULOG_FIELDS:
                    return False
                if own in _TYPES:
                    fields.append((before + each, _TYPES[own]))
                elif own not in declared or not add(own, f"{before}{each}.", depth + 1):
                    return False
        return True

    if not add(topic, "", 0) or len(dict(fields)) < len(fields):
        return []
    while fields and fields[-1][0].startswith("_padding"):  # it is not written
        fields.pop()
    return fields


class UlogFile(MessageFile):
    """One topic of a PX4 log."""

    messages = UlogMessages
