"""Header comments of exported files: source of the numbers, and their convention."""

import re
import textwrap
from collections.abc import Mapping, Sequence

from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.mapping import Mapped, describe_terms
from imubench_pipeline.tables.texts import escape_invisible
from imubench_pipeline.words.numbers import number_text

_LINE_WIDTH = 96


def describe_model(
    imu: Imu,
    program: str,
    convention: str,
    mapped: Mapping[str, Mapped] | None = None,
    *,
    temperature: bool = False,
) -> list[str]:
    """Return the header of a file as printable statements.

    `program` is the program that loads the file; `convention` describes its numbers; `mapped`: the
    replacements of the models; `temperature`: the file contains the effect on the biases.
    """
    statements = [f"Noise of the {imu.sensor} for {program}, by imubench."]
    if imu.simulated:
        statements.append("The recordings are SIMULATED, not measured.")
    if imu.mode:
        statements.append(f"{imu.mode}.")
    statements += [f"CAUTION: {caution}." for caution in imu.cautions]
    statements.append(convention)
    units = {"gyro": "rad, s", "accel": "m, s"}
    estimated = {"gyro": imu.gyro, "accel": imu.accel}
    missing = [name for name, axis in estimated.items() if axis is None]
    statements += [f"{name}: not included, as there is no estimate." for name in missing]
    for name, axis in imu.axes.items():
        statements.append(f"{name}: {axis.origin}.")
        terms = describe_terms((estimated[name] or axis).model.terms)
        statements.append(f"{name} model ({units[name]}; N two-sided): {terms}.")
        statements += [f"{name}: {note}." for note in axis.notes]
    if temperature:
        statements += [
            f"{name} and temperature: {note}."
            for name, effect in imu.temperature.items()
            for note in effect.notes
        ]
        statements.append(
            "Fixed biases are not included, as they change from one start to the next."
        )
    else:
        statements.append(
            "The file contains noise only. Fixed biases change from one start to the next, and "
            "they and their dependence on temperature are not included."
        )
    if imu.inflation != 1.0:
        statements.append(
            f"INFLATED: all densities and amplitudes below are {number_text(imu.inflation)} times "
            f"those above, because: {imu.because or ''}."
        )
    printed = [_join_lines(words) for words in statements]
    replacements = (mapped or {}).items()
    return printed + [f"{name}: {words}." for name, model in replacements for words in model.words]


def format_comments(statements: Sequence[str], mark: str = "#") -> str:
    """Return statements as comment lines, each beginning with a mark.

    Characters that are not safe in a comment of every format, such as a Unicode line separator in
    the name of a recording, are escaped. Words longer than a line are divided.
    """
    lines = []
    for statement in statements:
        wrapped = textwrap.wrap(
            _join_lines(statement), _LINE_WIDTH - len(mark) - 1, subsequent_indent="  "
        )
        lines += [f"{mark} {line}" for line in wrapped]
    return "\n".join(lines) + "\n"


def format_python_comments(statements: Sequence[str]) -> str:
    """Return statements as comments at the top of a file of Python.

    The first line declares the encoding (PEP 263). Without it, Python could take an encoding from
    the comments, which contain names chosen by users.
    """
    return "# -*- coding: utf-8 -*-\n" + format_comments(statements)


def _join_lines(statement: str) -> str:
    return escape_invisible(re.sub(r"[\t\n]", " ", statement))


def format_setting(key: str, value: str, comment: str, indent: str = "") -> str:
    """Return a line of YAML with its comment."""
    return f"{indent}{key}: {value}  # {comment}\n"


def format_exponential(value: float) -> str:
    """Return a number as a float of every YAML reader: with a point and a signed exponent."""
    return f"{value:.6e}"


def format_decimal(value: float) -> str:
    """Return a number without an exponent, and with a point."""
    text = f"{value:.9f}".rstrip("0")
    return text + "0" if text.endswith(".") else text
