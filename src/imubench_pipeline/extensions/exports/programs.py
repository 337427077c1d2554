"""The numbers in the files of programs: parameter of the noise, unit and convention of each.

A program is declared once. Its writer computes and writes the numbers by this declaration, and the
page "Which numbers go into which filter" lists them.
"""

import json
import math
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.extensions.exports.imu import AXES, AxisNoise, ExportError, Imu, split_axes
from imubench_pipeline.extensions.exports.mapping import (
    Mapped,
    describe_terms,
    find_common_time,
    map_to_family,
)
from imubench_pipeline.extensions.exports.overbound import Family
from imubench_pipeline.noise import NoiseModel, compute_driving_density
from imubench_pipeline.tables.texts import escape_invisible
from imubench_pipeline.units import convert
from imubench_pipeline.words.numbers import number_text

_LINE_WIDTH = 96  # of comments

_UNITS = {"gyro": {"x": "rad/s", "dx": "rad/s^2"}, "accel": {"x": "m/s^2", "dx": "m/s^3"}}
"""SI units of a reading and of its rate of change."""


@dataclass(frozen=True)
class Form:
    """A form in which programs take a noise parameter, such as a density or a variance."""

    formula: str  # in N, K, T_B, sigma_B of the process, the rate, and the horizon h
    si: str  # unit, where {x} is the unit of a reading and {dx} of its rate of change
    convention: str  # continuous or per sample; density, variance or standard deviation; sides
    compute: Callable[[NoiseModel, float, float], float]
    """Value in SI, from a model that the program supports, the rate in Hz, and the horizon in s."""


def compute_process_deviation(model: NoiseModel) -> float:
    """Return the stationary standard deviation of the Gauss-Markov process of a model, SI."""
    if model.T_B is None or model.B == 0.0:
        return 0.0
    return math.sqrt(compute_driving_density(model.B, model.T_B) * model.T_B / 2.0)


_ROOT, _DENSITY = "continuous, root of a two-sided density", "continuous, two-sided density"
_DEVIATION, _VARIANCE = "per sample, standard deviation", "per sample, variance"
_FILTER, _STATIONARY = "per step of the filter, standard deviation", "standard deviation"

WHITE = Form("N", "{x}/sqrt(Hz)", _ROOT, lambda m, rate, h: m.N)
WALK = Form("K", "{dx}/sqrt(Hz)", _ROOT, lambda m, rate, h: m.K)
WHITE_DENSITY = Form("N^2", "({x})^2/Hz", _DENSITY, lambda m, rate, h: m.N**2)
WALK_DENSITY = Form("K^2", "({dx})^2/Hz", _DENSITY, lambda m, rate, h: m.K**2)
SAMPLE = Form("N sqrt(rate)", "{x}", _DEVIATION, lambda m, rate, h: m.N * rate**0.5)
STEP = Form("K sqrt(rate)", "{dx}", _DEVIATION, lambda m, rate, h: m.K * rate**0.5)
MIDPOINT = Form("N sqrt(2 rate)", "{x}", _DEVIATION, lambda m, rate, h: m.N * (2 * rate) ** 0.5)
SAMPLE_VARIANCE = Form("N^2 rate", "({x})^2", _VARIANCE, lambda m, rate, h: m.N**2 * rate)
STEP_VARIANCE = Form("K^2 rate", "({dx})^2", _VARIANCE, lambda m, rate, h: m.K**2 * rate)
FILTER_SAMPLE = replace(SAMPLE, formula="N / sqrt(dt)", convention=_FILTER)  # of the rate 1 / dt
FILTER_STEP = replace(STEP, formula="K / sqrt(dt)", convention=_FILTER)
AVERAGED = Form(
    "sqrt(N^2 / h + K^2 h / 3)",
    "{x}",
    _STATIONARY,
    lambda m, rate, h: (m.N**2 / h + m.K**2 * h / 3.0) ** 0.5,
)  # error of the mean over the horizon as the bias at its end
READING = Form(
    "N^2 rate + N^2 / h + 5/6 K^2 h",
    "({x})^2",
    _VARIANCE,
    lambda m, rate, h: m.N**2 * (rate + 1.0 / h) + 5.0 / 6.0 * m.K**2 * h,
)  # of readings over a horizon, without the mean over the horizon before
PROCESS = Form("sigma_B", "{x}", _STATIONARY, lambda m, rate, h: compute_process_deviation(m))
DRIVE = Form(
    "sigma_B sqrt(2 / T_B)",
    "{dx}/sqrt(Hz)",
    _ROOT,
    lambda m, rate, h: compute_process_deviation(m) * (2.0 / (m.T_B or h)) ** 0.5,
)
TIME = Form("T_B", "s", "time", lambda m, rate, h: m.T_B or h)  # h for a model without a process


@dataclass(frozen=True)
class Entry:
    """A number in the file of a program."""

    name: str  # in the file
    quantity: Literal["gyro", "accel", "both"]  # both: one number for gyro and accelerometer
    form: Form
    si: str
    unit: str  # in the file

    def compute(self, model: NoiseModel, rate: float, horizon: float) -> float:
        """Return the number in the file; the rate is in Hz, the horizon in s."""
        value = self.form.compute(model, rate, horizon)
        return value if self.unit == self.si else float(convert(value, self.si, self.unit))


YAML = "{name}: {x}  # {about}"
PYTHON_HEAD = "# -*- coding: utf-8 -*-\n{head}"
"""Without the encoding (PEP 263), Python could take one from the comments, which contain names
chosen by users."""


@dataclass(frozen=True, kw_only=True)
class Program:
    """A program that a noise model can be exported to, its convention, and the form of its file."""

    name: str  # in commands and settings
    title: str  # for people
    file_name: str  # the usual name of its file
    family: Family  # terms that it supports; an overbound for it has these
    source: str  # address of the text that defines the numbers
    convention: str = ""  # words for the file, with {rate}
    entries: Sequence[Entry] = ()  # none for a file of matrices
    each: bool = False  # whether it takes a number of each axis
    positive: bool = False  # whether it takes no 0
    one_time: bool = False  # whether all processes have the same T_B
    mark: str = "#"  # of comments
    line: str = YAML  # template of a number (`format_entries`)
    layout: str = "{head}{lines}"  # template of the file (`fill_layout`)
    writer: Callable[[Imu], str | bytes] | None = None  # of a file that is more than its layout

    def write(self, imu: Imu) -> str | bytes:
        """Return the content of the file.

        Raises ExportError if a needed quantity has no estimate, or a density is 0 but must not be.
        """
        return self.writer(imu) if self.writer else fill_layout(imu, self)


def declare(
    name: str,
    title: str,
    file_name: str,
    source: str,
    convention: str,
    *rows: tuple[Any, ...],
    family: Family = "N+K",
    **more: Any,
) -> Program:
    """Return a program, with a row for each kind of number.

    A row is a `Form`, the names of the gyro's and the accelerometer's number, and optionally the
    unit of each (default SI). If the second name is None, one number serves both.
    """
    made = []
    for form, gyro, accel, *units in rows:
        names: dict[Literal["gyro", "accel", "both"], str]
        names = {"gyro": gyro, "accel": accel} if accel else {"both": gyro}
        for place, (quantity, own) in enumerate(names.items()):
            si = form.si.format(**_UNITS.get(quantity, {}))
            made.append(Entry(own, quantity, form, si, units[place] if units else si))
    return Program(
        name=name,
        title=title,
        file_name=file_name,
        family=family,
        source=source,
        convention=convention,
        entries=made,
        **more,
    )


def map_models(imu: Imu, program: Program) -> dict[str, Mapped]:
    """Replace the models of gyro and accelerometer by models of the program's family.

    For a program with numbers of each axis, the result has each axis with an estimate
    (`imu.split_axes`). The chosen axis replaces an axis with a 0 that the program does not take.
    Raises ExportError if a quantity is missing, or the chosen axis has such a 0.
    """
    imu.require_both()
    axes = split_axes(imu.axes) if program.each else imu.axes
    models = [axis.model for axis in axes.values()]
    time = find_common_time(models, imu.horizon) if program.one_time else None

    letters = ("N", "K" if program.family == "N+K" else "B") if program.positive else ()

    def map_axis(axis: AxisNoise) -> tuple[Mapped, list[str]]:
        """Return the model for the program, and the words against it."""
        one = map_to_family(axis.model, program.family, imu.horizon, imu.rate, time)
        zeros = [letter for letter in letters if not getattr(one.model, letter) > 0.0]
        return one, [
            f"{letter} is 0, and {program.title} takes values above 0 only" for letter in zeros
        ]

    mapped = {}
    for name, axis in axes.items():
        mapped[name], against = map_axis(axis)
        if against and name not in imu.axes:
            words = [f"{words}; the noise of the chosen axis is used" for words in against]
            chosen, against = map_axis(imu.axes[name.split()[0]])
            mapped[name] = replace(chosen, words=[*words, *chosen.words])
        if against:
            raise ExportError(f"{name}: {against[0]}; use a longer log, or the mode bounded")
    return mapped


def describe(
    imu: Imu,
    program: Program,
    mapped: Mapping[str, Mapped] | None = None,
    *,
    temperature: bool = False,
) -> list[str]:
    """Return the sentences of the header of a program's file, all characters printable.

    `mapped`: the replacements of the models; `temperature`: the file contains the effect on the
    biases.
    """
    statements = [f"Noise of {imu.sensor} for {program.title}, by imubench."]
    if imu.simulated:
        statements.append("The recordings are SIMULATED, not measured.")
    if imu.mode:
        statements.append(f"{imu.mode}.")
    statements += [f"CAUTION: {caution}." for caution in imu.cautions]
    statements.append(program.convention.format(rate=imu.rate))
    units = {"gyro": "rad, s", "accel": "m, s"}
    missing = [name for name in units if name not in imu.estimated]
    statements += [f"{name}: not included, as there is no estimate." for name in missing]
    described = split_axes(imu.estimated) if program.each else imu.estimated
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


def compute_values(entry: Entry, imu: Imu, mapped: Mapping[str, Mapped]) -> list[float]:
    """Return the numbers of x, y and z; the chosen axis replaces an axis without an estimate."""
    quantity = "gyro" if entry.quantity == "both" else entry.quantity
    models = [mapped.get(f"{quantity} {axis}") or mapped[quantity] for axis in AXES]
    return [entry.compute(one.model, imu.rate, imu.horizon) for one in models]


def format_entries(program: Program, imu: Imu, mapped: Mapping[str, Mapped], of: str = "") -> str:
    """Return lines with the numbers, by the template `Program.line`; `of`: only one quantity.

    The template has ``{name}``, ``{x}``, ``{y}`` and ``{z}`` for the number of an axis or ``{xyz}``
    for three with commas, and ``{about}`` for formula and unit. A list in brackets becomes one
    number if gyro and accelerometer share it.
    """
    text = ""
    for entry in program.entries:
        if of in ("", entry.quantity):
            x, y, z = (f"{value:.6e}" for value in compute_values(entry, imu, mapped))
            line = program.line
            if entry.quantity == "both":
                line = line.replace("[{xyz}]", "{x}")
            about = f"{entry.form.formula}, {entry.unit}"
            text += line.format(name=entry.name, x=x, y=y, z=z, xyz=f"{x}, {y}, {z}", about=about)
            text += "\n"
    return text


def fill_layout(
    imu: Imu, program: Program, remark: Callable[[Mapping[str, Mapped]], list[str]] | None = None
) -> str:
    """Return the file by the template `Program.layout`; `remark` returns further header lines.

    The template has ``{head}``, the header as comments; ``{lines}``, or ``{gyro}``, ``{accel}`` and
    ``{both}`` for the numbers; ``{rate}`` and ``{gravity}`` without an exponent; ``{topic}`` in
    quotes; and ``{imu}`` for its other values.
    """
    mapped = map_models(imu, program)
    about = describe(imu, program, mapped) + (remark(mapped) if remark else [])
    return program.layout.format(
        head=format_comments(about, program.mark),
        lines=format_entries(program, imu, mapped),
        **{of: format_entries(program, imu, mapped, of) for of in ("gyro", "accel", "both")},
        imu=imu,
        rate=format_decimal(imu.rate),
        gravity=format_decimal(STANDARD_GRAVITY),
        topic=json.dumps(imu.ros_topic),
    )
