"""Header comments of exported files: source of the numbers, and their convention."""

import re
import textwrap
from collections.abc import Mapping, Sequence

from imubench_pipeline.extensions.exports.imu import AXES, Imu, split_axes
from imubench_pipeline.extensions.exports.mapping import Mapped, describe_terms
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
    each: bool = False,
) -> list[str]:
    """Return the header of a file as printable statements.

    `program` is the program that loads the file; `convention` describes its numbers; `mapped`: the
    replacements of the models; `temperature`: the file contains the effect on the biases; `each`:
    it contains a number of each axis.
    """
    statements = [f"Noise of {imu.sensor} for {program}, by imubench."]
    if imu.simulated:
        statements.append("The recordings are SIMULATED, not measured.")
    if imu.mode:
        statements.append(f"{imu.mode}.")
    statements += [f"CAUTION: {caution}." for caution in imu.cautions]
    statements.append(convention)
    units = {"gyro": "rad, s", "accel": "m, s"}
    missing = [name for name in units if name not in imu.estimated]
    statements += [f"{name}: not included, as there is no estimate." for name in missing]
    described = split_axes(imu.estimated) if each else imu.estimated
    for name, axis in described.items():
        if name in units and any(f"{name} {letter}" in described for letter in AXES):
            statements.append(f"{name}: the axes without an estimate have the following noise.")
        statements.append(f"{name}: {axis.origin}.")
        terms = describe_terms(axis.model.terms)
        statements.append(f"{name} model ({units[name.split()[0]]}; N two-sided): {terms}.")
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


def _join_lines(statement: str) -> str:
    return escape_invisible(re.sub(r"[\t\n]", " ", statement))


def format_decimal(value: float) -> str:
    """Return a number without an exponent, and with a point."""
    text = f"{value:.9f}".rstrip("0")
    return text + "0" if text.endswith(".") else text
