"""A sensor file in the making: its entries, each with a comment that says where it is from."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

UNKNOWN = "?"
"""What stands where the file does not tell: the sensor file is refused until it is filled in."""


@dataclass(frozen=True)
class Entry:
    """One entry of a sensor file."""

    value: Any
    comment: str = ""
    """What was guessed and from what; empty: nothing was."""


@dataclass
class Draft:
    """A sensor file as far as the log tells."""

    vendor: Entry
    model: Entry
    reader: Entry | None = None
    rate: Entry | None = None
    time: Entry | None = None
    channels: dict[str, Entry] = field(default_factory=dict)
    temperature: Entry | None = None
    left_over: list[str] = field(default_factory=list)
    """What was not taken, and why, for a human to finish."""

    def log(self) -> dict[str, Any]:
        """Return what stands under ``log``."""
        entries = {
            key: entry.value
            for key, entry in (("reader", self.reader), ("rate", self.rate), ("time", self.time))
            if entry is not None
        }
        entries["channels"] = {name: dict(entry.value) for name, entry in self.channels.items()}
        if self.temperature is not None:
            entries["temperature"] = dict(self.temperature.value)
        return entries

    def sensor(self) -> dict[str, Any]:
        """Return the whole sensor file."""
        return {"vendor": self.vendor.value, "model": self.model.value, "log": self.log()}

    def unfilled(self) -> list[str]:
        """Return the keys of what is left to fill in."""
        return [".".join(key) for key in _unfilled(self.log(), ())]


def _unfilled(value: object, key: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _unfilled(inner, (*key, name))
    elif value == UNKNOWN:
        yield key
