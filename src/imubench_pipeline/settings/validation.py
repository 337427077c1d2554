"""Settings checked against typed models, with errors that say what to mend."""

from __future__ import annotations

import difflib
import re
import reprlib
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from imubench_pipeline.units import quantity_to_si


class ConfigError(ValueError):
    """A setting that cannot be used; the text names file, key, value and what was expected."""


class UnavailableSettingsError(ConfigError):
    """A file of settings that cannot be read now, for a reason outside of it."""


class Strict(BaseModel):
    """A group of settings in which an unknown key is an error, and a number may be a text.

    As text it is what ``str`` makes of it: of a number from a file, as it is written there.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, coerce_numbers_to_str=True
    )


def _fraction(value: object) -> float:
    try:
        number = float(Fraction(str(value).strip()))
    except (ValueError, ZeroDivisionError) as error:
        raise ValueError("expected a fraction of the log such as 1/9") from error
    if not 0 < number <= 0.5:
        raise ValueError("expected a fraction of the log above 0 and at most 1/2")
    return number


_SHORT, _LONG = 100, 1000
"""Letters of what a file holds, and of an error, that are printed at most."""

_MOST_FAULTS = 20
"""Faults of one file that are printed."""

_BRIEF = reprlib.Repr()
_BRIEF.maxstring = _BRIEF.maxother = _BRIEF.maxlong = _SHORT


def cut(value: object, words: Callable[[object], str] = _BRIEF.repr, most: int = _SHORT) -> str:
    """Return what a file holds as it may be printed: a line of it at most.

    `words` makes text of it; by default, as Python writes it, the beginning of each list alone.
    `most`: letters.
    """
    text = words(value)
    return text if len(text) <= most else f"{text[: most - 3]}..."


def checked(
    dimension: str,
    expected: str | None = None,
    *,
    from_zero: bool = False,
    to_si: Callable[[str, str], float] = quantity_to_si,
) -> AfterValidator:
    """Return a check that a text is a figure with a unit of a dimension, and in its range.

    Parameters
    ----------
    dimension : str
        A key of `imubench_pipeline.units.SI_UNITS`.
    expected : str, optional
        What the error says of a figure that is not above 0; by default it may be any.
    from_zero : bool
        0 itself is in the range.
    to_si : callable
        How a text is read.
    """

    def check(text: str) -> str:
        value = to_si(text, dimension)
        if expected is not None and not (value > 0 or (from_zero and value == 0)):
            raise ValueError(f"expected {expected}")
        return text

    return AfterValidator(check)


def of_size(dimension: str) -> AfterValidator:
    """Return a check that a text is a number above zero with a unit of a dimension."""
    return checked(dimension, f"more than zero, with its unit of {dimension}")


def _between(ends: tuple[str, str]) -> tuple[str, str]:
    low, high = (quantity_to_si(end, "temperature") for end in ends)
    if not low < high:
        raise ValueError(f"found {ends[0]} to {ends[1]}; expected the lower temperature first")
    return ends


def _as_written(value: object) -> object:
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


NamedPath = Annotated[Path, BeforeValidator(_as_written, json_schema_input_type=Path)]
"""A path; it may look like a number, such as a folder 0017."""

FractionOfLog = Annotated[float, BeforeValidator(_fraction, json_schema_input_type=float | str)]
_LONGEST_TEXT = 1000
_UNSEEN = re.compile("[\\x00-\\x08\\x0b\\x0c\\x0e-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]")
"""What moves a cursor, ends a line or turns the direction of what follows."""


def _shown(text: str) -> str:
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"{len(text)} letters; expected at most {_LONGEST_TEXT}")
    if unseen := _UNSEEN.search(text):
        raise ValueError(f"holds U+{ord(unseen[0]):04X}; expected what can be seen")
    return text


Text = Annotated[str, AfterValidator(_shown)]
"""A text that stands in tables and on pages."""
Frequency = Annotated[
    Text, checked("frequency", "a frequency above zero"), Field(examples=["100 Hz"])
]
Between = Annotated[tuple[Text, Text], AfterValidator(_between)]
"""A lower and an upper temperature, with their units."""
Duration = Annotated[Text, checked("time", "a time above 0"), Field(examples=["10 h"])]


_Model = TypeVar("_Model", bound=BaseModel)


def parse(model: type[_Model], data: object, file: str) -> _Model:
    """Validate ``data`` as ``model``.

    Raises
    ------
    ConfigError
        One line for each fault: file, key, value found, what was expected.
    """
    if not isinstance(data, Mapping):
        raise ConfigError(f"{file}: found {cut(data)}, expected keys and values")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        faults = _first_faults(error.errors())
        lines = [_fault(file, fault, model) for fault in faults[:_MOST_FAULTS]]
        if len(faults) > _MOST_FAULTS:
            lines.append(f"{file}: and {len(faults) - _MOST_FAULTS} more")
        raise ConfigError("\n".join(lines)) from None


def _first_faults(faults: list[Any]) -> list[Any]:
    """Leave out that a list is too short where its elements cannot be used, which is said too."""
    inside = {fault["loc"][:n] for fault in faults for n in range(len(fault["loc"]))}
    return [f for f in faults if f["type"] != "too_short" or f["loc"] not in inside]


def _fault(file: str, fault: Any, model: type[BaseModel]) -> str:
    key = ".".join(cut(part, str) for part in fault["loc"]) or "(top level)"
    value = fault["input"]
    message = cut(re.sub(r"^(Value error|Assertion failed), ", "", fault["msg"]), str, _LONG)
    if fault["type"] == "extra_forbidden":
        known_keys = _known_keys(model, fault["loc"][:-1])
        close = difflib.get_close_matches(cut(fault["loc"][-1], str), known_keys, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        return f"{file}: {key}: unknown key; {hint}expected one of {', '.join(known_keys)}"
    if fault["type"] == "missing":
        return f"{file}: {key}: missing; expected a value here"
    if fault["type"] == "value_error" and isinstance(value, Mapping):
        return f"{file}: {key}: {message}"
    return f"{file}: {key}: found {cut(value)}; {message[0].lower()}{message[1:]}"


def _known_keys(model: type[BaseModel], path: tuple[Any, ...]) -> list[str]:
    """Return the keys that the schema allows at ``path``."""
    schema = model.model_json_schema()
    node: dict[str, Any] = schema
    for part in path:
        node = _resolve(schema, node)
        if isinstance(part, int) and "properties" in node:
            continue  # an element of a list that may also stand alone
        nested = node.get("properties", {}).get(part)
        node = nested or node.get("items") or node.get("additionalProperties") or {}
    node = _resolve(schema, node)
    names = node.get("properties") or node.get("propertyNames", {}).get("enum") or {}
    return sorted(names)


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    for option in node.get("anyOf", []) + node.get("allOf", []):
        if "$ref" in option:
            node = option
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", maxsplit=1)[-1]]
    return node
