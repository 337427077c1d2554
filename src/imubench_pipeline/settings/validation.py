"""Validate settings with typed models; errors state the fault and the correction."""

import difflib
import re
import reprlib
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from imubench_pipeline.units import parse_quantity


class ConfigError(ValueError):
    """An invalid setting; the message states file, key, value and the expected value."""


class UnavailableSettingsError(ConfigError):
    """A file of settings that cannot be read now, for a reason outside of the file."""


class Strict(BaseModel):
    """A group of settings: an unknown key is an error, and a number may be a text, as written."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, allow_inf_nan=False, coerce_numbers_to_str=True
    )


def _parse_fraction(value: object) -> float:
    try:
        number = float(Fraction(str(value).strip()))
    except (ValueError, ZeroDivisionError) as error:
        raise ValueError("expected a fraction of the log such as 1/9") from error
    if not 0 < number <= 0.5:
        raise ValueError("expected a fraction of the log above 0 and at most 1/2")
    return number


_MAX_SHOWN_LENGTH, _MAX_ERROR_LENGTH = 100, 1000
"""Largest number of characters of a value, and of an error, that are shown."""

_MAX_SHOWN_FAULTS = 20  # largest number of faults of a file that are shown
_SHORT_REPR = reprlib.Repr()
_SHORT_REPR.maxstring = _SHORT_REPR.maxother = _SHORT_REPR.maxlong = _MAX_SHOWN_LENGTH


def cut(
    value: object, words: Callable[[object], str] = _SHORT_REPR.repr, most: int = _MAX_SHOWN_LENGTH
) -> str:
    """Return a value as text for messages, made by ``words`` and cut to ``most`` characters."""
    text = words(value)
    return text if len(text) <= most else f"{text[: most - 3]}..."


def make_validator(
    dimension: str,
    expected: str | None = None,
    *,
    from_zero: bool = False,
    within: tuple[float, float] | None = None,
    to_si: Callable[[str, str], float] = parse_quantity,
) -> AfterValidator:
    """Return a validator for a number with a unit of a dimension, and its range.

    ``expected``: the valid numbers, for errors: above 0 (``from_zero``: 0 and above), and
    ``within`` two limits in SI. None: any number. ``to_si`` converts text and dimension.
    """

    def check(text: str) -> str:
        value = to_si(text, dimension)
        if within is not None and not within[0] <= value <= within[1]:
            raise ValueError(f"found {text}; expected {expected}")
        if expected is not None and not (value > 0 or (from_zero and value == 0)):
            raise ValueError(f"expected {expected}")
        return text

    return AfterValidator(check)


def make_size_validator(dimension: str) -> AfterValidator:
    """Return a validator for a number above zero with a unit of a dimension."""
    return make_validator(dimension, f"more than zero, with its unit of {dimension}")


def _check_order(ends: tuple[str, str]) -> tuple[str, str]:
    low, high = (parse_quantity(end, "temperature") for end in ends)
    if not low < high:
        raise ValueError(f"found {ends[0]} to {ends[1]}; expected the lower temperature first")
    return ends


def _keep_as_written(value: object) -> object:
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


NamedPath = Annotated[Path, BeforeValidator(_keep_as_written, json_schema_input_type=Path)]
"""A path; it may look like a number, such as a folder 0017."""

FractionOfLog = Annotated[
    float, BeforeValidator(_parse_fraction, json_schema_input_type=float | str)
]
_MAX_TEXT_LENGTH = 1000
_INVISIBLE_CHARACTERS = re.compile(
    "[\\x00-\\x08\\x0b\\x0c\\x0e-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]"
)
"""Characters that move the cursor, end a line, or change the direction of text."""


def _check_visible(text: str) -> str:
    if len(text) > _MAX_TEXT_LENGTH:
        raise ValueError(f"has {len(text)} characters; expected at most {_MAX_TEXT_LENGTH}")
    if unseen := _INVISIBLE_CHARACTERS.search(text):
        raise ValueError(f"holds the invisible character U+{ord(unseen[0]):04X}; remove it")
    return text


Text = Annotated[str, AfterValidator(_check_visible)]  # a text that is shown in tables and on pages
Frequency = Annotated[
    Text, make_validator("frequency", "a frequency above zero"), Field(examples=["100 Hz"])
]
Between = Annotated[tuple[Text, Text], AfterValidator(_check_order)]
"""A lower and an upper temperature, with their units."""
Duration = Annotated[Text, make_validator("time", "a time above 0"), Field(examples=["10 h"])]


def _from_zero(dimension: str) -> AfterValidator:
    return make_validator(dimension, "0 or more", from_zero=True)


TimeFromZero = Annotated[Text, _from_zero("time"), Field(examples=["2 s"])]
Angle = Annotated[Text, make_validator("angle"), Field(examples=["30 deg"])]
AngleFromZero = Annotated[Text, _from_zero("angle"), Field(examples=["0.5 deg"])]
Rate = Annotated[Text, make_validator("angular_rate"), Field(examples=["-10 deg/s"])]
RateFromZero = Annotated[Text, _from_zero("angular_rate"), Field(examples=["0.05 deg/s"])]
AccelerationFromZero = Annotated[Text, _from_zero("acceleration"), Field(examples=["20 mg"])]

_Model = TypeVar("_Model", bound=BaseModel)


def parse(model: type[_Model], data: object, file: str) -> _Model:
    """Validate ``data`` as ``model``; raises a `ConfigError` with one line for each fault."""
    if not isinstance(data, Mapping):
        raise ConfigError(f"{file}: found {cut(data)}, expected keys and values")
    try:
        return model.model_validate(data)
    except ValidationError as error:
        listed = error.errors()
        # A list is not too short if faults of its elements are reported.
        inside = {fault["loc"][:n] for fault in listed for n in range(len(fault["loc"]))}
        faults = [f for f in listed if f["type"] != "too_short" or f["loc"] not in inside]
        lines = [_describe_fault(file, fault, model) for fault in faults[:_MAX_SHOWN_FAULTS]]
        if len(faults) > _MAX_SHOWN_FAULTS:
            lines.append(f"{file}: and {len(faults) - _MAX_SHOWN_FAULTS} more")
        raise ConfigError("\n".join(lines)) from None


def _describe_fault(file: str, fault: Any, model: type[BaseModel]) -> str:
    key = ".".join(cut(part, str) for part in fault["loc"]) or "(top level)"
    value = fault["input"]
    message = cut(
        re.sub(r"^(Value error|Assertion failed), ", "", fault["msg"]), str, _MAX_ERROR_LENGTH
    )
    if fault["type"] == "extra_forbidden":
        # List the keys that the schema of the model allows there.
        schema = model.model_json_schema()
        node: dict[str, Any] = schema
        for part in fault["loc"][:-1]:
            node = _resolve(schema, node)
            if isinstance(part, int) and "properties" in node:
                continue  # an element of a list that may also be given without the list
            nested = node.get("properties", {}).get(part)
            node = nested or node.get("items") or node.get("additionalProperties") or {}
        node = _resolve(schema, node)
        names = node.get("properties") or node.get("propertyNames", {}).get("enum") or {}
        known_keys = sorted(names)
        close = difflib.get_close_matches(cut(fault["loc"][-1], str), known_keys, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        return f"{file}: {key}: unknown key; {hint}expected one of {', '.join(known_keys)}"
    if fault["type"] == "missing":
        return f"{file}: {key}: missing; expected a value here"
    if fault["type"] == "value_error" and isinstance(value, Mapping):
        return f"{file}: {key}: {message}"
    return f"{file}: {key}: found {cut(value)}; {message[0].lower()}{message[1:]}"


def _resolve(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    for option in node.get("anyOf", []) + node.get("allOf", []):
        if "$ref" in option:
            node = option
    while "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", maxsplit=1)[-1]]
    return node
