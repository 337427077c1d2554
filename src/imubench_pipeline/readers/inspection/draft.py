"""A sensor file in the making: entries, each with a comment that says where it is from; YAML."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import yaml

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


_WIDEST = 1 << 20
_LONGEST_TEXT = 600
_LONGEST_LINE = 110
_MOST_LEFT = 20
_LIKEWISE = "likewise"


class _Dumper(yaml.SafeDumper):
    """Writes what cannot be printed as escapes, so that each entry stays on its line."""


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    style = None if value.isprintable() and value != UNKNOWN else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style=style)


_Dumper.add_representer(str, _text)


def block(draft: Draft, file: str) -> str:
    """Return a sensor file.

    ``file``: the name of the log, for the first line.
    """
    above = (("reader", draft.reader), ("rate", draft.rate), ("time", draft.time))
    inside = [(key, entry) for key, entry in above if entry is not None]
    lines = [f"# drafted from the log {printable(file)}"]
    lines += _entries([("vendor", draft.vendor), ("model", draft.model)], "")
    lines += ["log:", *_entries(inside, "  "), "  channels:"]
    lines += _entries(list(draft.channels.items()), "    ")
    if draft.temperature is not None:
        lines += _entries([("temperature", draft.temperature)], "  ")
    lines += ["datasheet:", "  document: null  # its name; and below, the figures as printed"]
    lines += ["  gyro: {}", "  accel: {}"]
    lines += [f"# {printable(text)}" for text in draft.left_over[:_MOST_LEFT]]
    if len(draft.left_over) > _MOST_LEFT:
        lines.append(f"# ... and {len(draft.left_over) - _MOST_LEFT} more")
    return "\n".join(lines) + "\n"


def printable(text: str) -> str:
    """Return a text of one line, shortened, without what a terminal would act upon."""
    shown = "".join(sign if sign.isprintable() else "?" for sign in text[: _LONGEST_TEXT + 1])
    return shown if len(shown) <= _LONGEST_TEXT else shown[:_LONGEST_TEXT] + " ..."


def _entries(entries: Sequence[tuple[str, Entry]], margin: str) -> list[str]:
    """Return the lines of some entries, with their comments one below another.

    Where a line would be long, the comment stands above it.
    """
    written = [f"{margin}{key}: {_flow(entry.value)}" for key, entry in entries]
    comments = [printable(entry.comment) for _, entry in entries]
    behind = [len(line) for line, comment in zip(written, comments, strict=True) if comment]
    width = max(behind, default=0)
    above = width + max(map(len, comments), default=0) > _LONGEST_LINE
    lines, before = [], ""
    for line, comment in zip(written, comments, strict=True):
        if comment and above:
            lines += ([] if comment == before else [f"{margin}# {comment}"]) + [line]
        elif comment:
            lines.append(f"{line:<{width}}  # {_LIKEWISE if comment == before else comment}")
        else:
            lines.append(line)
        before = comment
    return lines


def _flow(value: Any) -> str:
    """Return a value on one line, of printable signs."""
    written = [
        yaml.dump(
            value,
            Dumper=_Dumper,
            default_flow_style=True,
            sort_keys=False,
            width=_WIDEST,
            allow_unicode=as_it_is,
        )
        .removesuffix("...\n")
        .strip()
        for as_it_is in (True, False)
    ]
    return next((text for text in written if text.isprintable()), written[-1])
