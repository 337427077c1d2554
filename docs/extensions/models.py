"""The reference of configuration files: of the pydantic models, through their JSON Schema."""

from __future__ import annotations

import json
import re
from typing import Any

from pydantic import BaseModel

from extensions.markdown import cell, code, table
from imubench_pipeline.settings.config import Run
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import RecordingNotes, Sensor
from imubench_pipeline.settings.simulated_recordings import Board, Simulated
from imubench_pipeline.settings.simulated_sensor import ModelSettings


def configuration() -> str:
    """Return the settings of a run."""
    return _sections("run", Run)


def sensor_file() -> str:
    """Return the file of a sensor."""
    return _sections("sensor", Sensor)


def notes() -> str:
    """Return the notes beside a log."""
    return _sections("notes", RecordingNotes)


def requirement() -> str:
    """Return the file of a requirement."""
    return _sections("requirement", Requirement)


def simulated() -> str:
    """Return the files of simulated recordings, of boards and of models."""
    models: dict[str, type[BaseModel]] = {
        "simulated": Simulated,
        "board": Board,
        "models": ModelSettings,
    }
    return "\n".join(_sections(name, model) for name, model in models.items())


def _sections(page: str, model: type[BaseModel]) -> str:
    """Return a section for the model and each that it holds, in the order in which they occur."""
    schema = model.model_json_schema()
    groups: dict[str, Any] = schema.get("$defs", {})
    order = [name for name in _reached(schema, groups) if groups[name].get("properties")]
    linked = {name: f"{page}-{name.lower()}" for name in order}
    parts = [_section(f"({page}-top)=", "Top level", schema, linked)]
    parts += [_section(f"({linked[name]})=", _title(name), groups[name], linked) for name in order]
    return "\n".join(parts)


def _reached(schema: dict[str, Any], groups: dict[str, Any]) -> list[str]:
    order: list[str] = []
    for name in re.findall(r'"#/\$defs/(\w+)"', json.dumps(_without_defs(schema))):
        for found in [name, *_reached(groups[name], groups)]:
            if found not in order:
                order.append(found)
    return order


def _without_defs(schema: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in schema.items() if key != "$defs"}


def _title(name: str) -> str:
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.removesuffix("Settings")).lower()
    return words.capitalize()


def _section(label: str, title: str, schema: dict[str, Any], linked: dict[str, str]) -> str:
    needed = schema.get("required", [])
    rows = [
        (
            code(key),
            _kind(value, linked),
            "needed" if key in needed else _default(value),
            cell(_meaning(value)),
        )
        for key, value in schema.get("properties", {}).items()
    ]
    about = " ".join(schema.get("description", "").split("\n\n")[0].split())
    heads = ("key", "what it takes", "default", "meaning")
    return f"{label}\n## {title}\n\n{cell(about)}\n\n{table(heads, rows)}"


def _meaning(value: dict[str, Any]) -> str:
    words = value.get("description", "")
    examples = value.get("examples") or [
        example for option in value.get("anyOf", []) for example in option.get("examples", [])
    ]
    shown = ", ".join(map(str, examples))
    return f"{words}{'; ' if words else ''}such as {shown}" if shown else words


def _kind(value: dict[str, Any], linked: dict[str, str]) -> str:
    """Return what a key takes, in words."""
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        if name not in linked:  # such as any JSON value
            return "any value"
        return f"[{_title(name).lower()}](#{linked[name]})"
    if options := value.get("anyOf") or value.get("oneOf") or value.get("allOf"):
        return " or ".join(dict.fromkeys(_kind(option, linked) for option in options))
    if "const" in value:
        return code(value["const"])
    if "enum" in value:
        return ", ".join(map(code, value["enum"]))
    kind = value.get("type", "any")
    if kind == "array":
        if "prefixItems" in value:
            return "list of " + " and ".join(_kind(one, linked) for one in value["prefixItems"])
        return f"list of {_kind(value.get('items', {}), linked)}"
    if kind == "object":
        inner = value.get("additionalProperties")
        names = value.get("propertyNames", {}).get("enum")
        of = f" of {_kind(inner, linked)}" if isinstance(inner, dict) else ""
        keys = f" by {', '.join(map(code, names))}" if names else ""
        return f"keys{of}{keys}"
    return _plain(kind, value)


def _plain(kind: str, value: dict[str, Any]) -> str:
    words = {"string": "text", "integer": "whole number", "boolean": "true or false"}.get(
        kind, kind
    )
    signs = {
        "minimum": "≥",
        "exclusiveMinimum": "above",
        "maximum": "≤",
        "exclusiveMaximum": "below",
    }
    bounds = [f"{sign} {value[key]:g}" for key, sign in signs.items() if key in value]
    return f"{words} {', '.join(bounds)}" if bounds else words


def _default(value: dict[str, Any]) -> str:
    if "default" not in value:
        return ""
    default = value["default"]
    if isinstance(default, dict):
        return "as below" if "$ref" in value or default else code("{}")
    if isinstance(default, float) and default == 1 / 9:
        return code("1/9")
    return code(json.dumps(default, ensure_ascii=False).strip('"'))
