"""Drafted sensor file: entries with comments on their origin, and their YAML."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

import yaml
from pydantic import JsonValue

from imubench_pipeline.typing import JsonObject

UNKNOWN = "?"  # placeholder for a missing value; the sensor file is rejected until it is filled in
V_co = TypeVar("V_co", covariant=True)


@dataclass(frozen=True)
class Entry(Generic[V_co]):
    """A value in a sensor file, with a comment on its origin."""

    value: V_co
    comment: str = ""  # origin of a guessed value; empty if nothing was guessed


@dataclass(frozen=True, kw_only=True)
class Source:
    """A column of a log, with the keys of a sensor file."""

    file: str | None = None
    variable: str | None = None
    column: str | int
    date: str | int | None = None
    format: str | None = None
    unit: str | None = None
    scale: float | None = None
    wraps: int | None = None

    def to_json(self) -> dict[str, JsonValue]:
        """Return the keys that have a value, with their values."""
        return {key: value for key, value in vars(self).items() if value is not None}


@dataclass
class Draft:
    """A sensor file with the values that the log determines."""

    vendor: Entry[str]
    model: Entry[str]
    reader: Entry[str] | None = None
    rate: Entry[str] | None = None
    time: Entry[Source] | None = None
    channels: dict[str, Entry[Source]] = field(default_factory=dict)
    temperature: Entry[Source] | None = None
    left_over: list[str] = field(default_factory=list)  # remarks about columns that are not used

    @property
    def known(self) -> list[tuple[str, Entry[str | Source]]]:
        """The entries under ``log`` that have a value, without channels and temperature."""
        entries = ("reader", self.reader), ("rate", self.rate), ("time", self.time)
        return [(key, entry) for key, entry in entries if entry is not None]

    def log(self) -> dict[str, JsonValue]:
        """Return the values under ``log``."""
        entries = {key: _to_json(entry.value) for key, entry in self.known}
        entries["channels"] = {name: entry.value.to_json() for name, entry in self.channels.items()}
        if self.temperature is not None:
            entries["temperature"] = self.temperature.value.to_json()
        return entries

    def sensor(self) -> JsonObject:
        """Return the complete sensor file as values."""
        return {"vendor": self.vendor.value, "model": self.model.value, "log": self.log()}

    def with_units(self, unit_of: Callable[[str, str | None], str | None]) -> "Draft":
        """Return a draft with each unit replaced by ``unit_of(key, unit)``, unless it is None."""

        def change(key: str, entry: Entry[Source]) -> Entry[Source]:
            unit = unit_of(key, entry.value.unit)
            return replace(entry, value=replace(entry.value, unit=unit)) if unit else entry

        return replace(
            self,
            time=self.time and change("time", self.time),
            channels={name: change(name, entry) for name, entry in self.channels.items()},
            temperature=self.temperature and change("temperature", self.temperature),
        )

    def unfilled(self) -> list[str]:
        """Return the keys of the missing values."""
        return [".".join(key) for key in _find_unfilled(self.log(), ())]


def _find_unfilled(value: object, key: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _find_unfilled(inner, (*key, name))
    elif value == UNKNOWN:
        yield key


_MAX_YAML_WIDTH = 1 << 20
_MAX_TEXT_LENGTH = 600
_MAX_LINE_LENGTH = 110
_MAX_REMARKS = 20
_SAME_COMMENT = "the same"


class _Dumper(yaml.SafeDumper):
    """Writes unprintable characters as escapes, so that each entry stays on its line."""


def _represent_text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    style = None if value.isprintable() and value != UNKNOWN else '"'
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style=style)


_Dumper.add_representer(str, _represent_text)


def format_draft(draft: Draft, file: str) -> str:
    """Return a sensor file as YAML; ``file``: name of the log, for the first line."""
    lines = [f"# drafted from the log {make_printable(file)}"]
    lines += _format_entries([("vendor", draft.vendor), ("model", draft.model)], "")
    lines += ["log:", *_format_entries(draft.known, "  "), "  channels:"]
    lines += _format_entries(list(draft.channels.items()), "    ")
    if draft.temperature is not None:
        lines += _format_entries([("temperature", draft.temperature)], "  ")
    lines += ["datasheet:", "  document: null  # its name; enter the printed figures below"]
    lines += ["  gyro: {}", "  accel: {}"]
    lines += [f"# {make_printable(text)}" for text in draft.left_over[:_MAX_REMARKS]]
    if len(draft.left_over) > _MAX_REMARKS:
        lines.append(f"# ... and {len(draft.left_over) - _MAX_REMARKS} more")
    return "\n".join(lines) + "\n"


def make_printable(text: str) -> str:
    """Return a text as one shortened line without control characters."""
    shown = "".join(sign if sign.isprintable() else "?" for sign in text[: _MAX_TEXT_LENGTH + 1])
    return shown if len(shown) <= _MAX_TEXT_LENGTH else shown[:_MAX_TEXT_LENGTH] + " ..."


def _format_entries(entries: Sequence[tuple[str, Entry[str | Source]]], margin: str) -> list[str]:
    """Return the lines of entries with aligned comments, or with long comments above them."""
    written = [f"{margin}{key}: {_format_value(entry.value)}" for key, entry in entries]
    comments = [make_printable(entry.comment) for _, entry in entries]
    behind = [len(line) for line, comment in zip(written, comments, strict=True) if comment]
    width = max(behind, default=0)
    above = width + max(map(len, comments), default=0) > _MAX_LINE_LENGTH
    lines, before = [], ""
    for line, comment in zip(written, comments, strict=True):
        if comment and above:
            lines += ([] if comment == before else [f"{margin}# {comment}"]) + [line]
        elif comment:
            lines.append(f"{line:<{width}}  # {_SAME_COMMENT if comment == before else comment}")
        else:
            lines.append(line)
        before = comment
    return lines


def _to_json(value: str | Source) -> JsonValue:
    return value if isinstance(value, str) else value.to_json()


def _format_value(value: str | Source) -> str:
    """Return a value as YAML on one line of printable characters."""
    for as_it_is in (True, False):
        text = yaml.dump(_to_json(value), Dumper=_Dumper, default_flow_style=True, sort_keys=False,
                         width=_MAX_YAML_WIDTH, allow_unicode=as_it_is)  # fmt: skip
        text = text.removesuffix("...\n").strip()
        if text.isprintable():
            break
    return text
