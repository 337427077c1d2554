"""The papers as printed: one YAML file of ``data/`` for each."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import R
from imubench_pipeline.settings.validation import Strict, parse
from imubench_pipeline.settings.yaml_files import read_yaml

_FOLDER = Path(__file__).with_name("data")
KEYS = ("maia", "silva", "engers")  # names of the files, in the order of display

Basis = Literal["round trip", "simulated", "computed", "checked"]
"""Basis of a result; `Terms.bases` describes it."""

Verdict = Literal[
    "agrees", "differs", "possible", "refuted", "misprint", "new result", "not available"
]

_POWERS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻,", "0123456789-.")


class Drawn(Strict):
    """A curve that corresponds to figures of a paper."""

    figures: str  # of the paper
    sensor: str
    recording: str
    channel: str
    methods: str  # methods with a curve, in addition to the curve of the log


class Unit(Strict):
    """A unit as a paper prints it."""

    si: str
    scale: float = 1.0  # SI per printed unit


class Line(Strict):
    """One line of a paper; its texts are templates for `str.format`."""

    place: str  # "Table 3", "Figure 5", "Equation 26" or "Section 6", as numbered there
    quantity: str
    printed: str  # as printed, with its unit; or "derived: " and the derived value
    value: str = ""  # number in ``printed``, in the printed unit; empty: it is no number
    unit: str = "-"  # as printed
    find: tuple[str, ...] = ()  # "module.name" of its counterpart, and arguments
    found: str = ""  # result that needs no function, in the printed unit
    words: str = ""  # with the result, or instead of it
    verdict: Verdict | None = None  # None: it follows from the numbers
    why: str = ""  # why the two differ; shown only then
    missing: str = ""  # why there is no result where the function returns None
    basis: Basis
    page: str = ""  # page of the report with the counterpart, and its anchor if any
    check: str  # test or benchmark of the line: "tests/...::name" or a file
    tolerance: float = 0.05  # relative difference that still agrees
    fields: Mapping[str, str] = {}  # for the templates


class Paper(Strict):
    """A paper with its lines, in the order of the paper."""

    key: str  # "maia"
    name: str  # "Maia et al."
    title: str  # subject of the paper
    logs: tuple[tuple[str, str], ...]  # sensor and recording of its simulated logs
    declared: tuple[str, ...]  # sentences: assumptions, and sources of the input
    drawn: tuple[Drawn, ...] = ()
    units: Mapping[str, Unit]  # by the printed unit; others are SI
    figures: Mapping[str, tuple[Mapping[str, str], ...]]  # printed tables, row by row
    lines: tuple[Line, ...]


class Explained(Strict):
    """A verdict: its meaning, and the words after one line and after several."""

    meaning: str
    one: str
    several: str


class Terms(Strict):
    """Explanations of the bases and verdicts of the table ``published``."""

    bases: dict[Basis, str]
    verdicts: dict[Verdict, Explained]


@cache
def read_terms() -> Terms:
    """Return the explanations of the bases and verdicts."""
    path = _FOLDER / "terms.yaml"
    return parse(Terms, read_yaml(path), str(path))


def read_papers() -> list[Paper]:
    """Return all papers, in the order in which they are shown."""
    return [read_paper(key) for key in KEYS]


@cache
def read_paper(key: str) -> Paper:
    """Return a paper of `KEYS`; raise ConfigError if its file cannot be used."""
    path = _FOLDER / f"{key}.yaml"
    data: Any = read_yaml(path)
    lines = list(_expand(data.pop("lines"), data.pop("defaults"), {}, data["figures"]))
    return parse(Paper, data | {"key": key, "lines": lines}, str(path))


def _expand(
    entries: Sequence[Mapping[str, Any]],
    inherited: Mapping[str, Any],
    fields: Mapping[str, str],
    tables: Mapping[str, Sequence[Mapping[str, str]]],
) -> Iterator[dict[str, Any]]:
    """Yield the lines of entries; an entry may have several, one for each row of a table."""
    for entry in entries:
        own = {**inherited, **entry}
        each, lines = own.pop("each", [{}]), own.pop("lines", None)
        for row in tables[each.format(**fields)] if isinstance(each, str) else each:
            named = {**fields, **{key: str(value).format(**fields) for key, value in row.items()}}
            if lines is None:
                yield {**own, "fields": named}
            else:
                yield from _expand(lines, own, named, tables)


def parse_number(text: str) -> float:
    """Return a printed number, such as 8,4·10⁻⁵ or ±3."""
    digits = text.lstrip("±").translate(_POWERS)
    return float(digits.replace("·10", "e").replace(" × 10", "e"))


class Log(NamedTuple):
    """A channel of a recording."""

    sensor: str
    recording: str
    channel: str


@dataclass(frozen=True, kw_only=True)
class Result:
    """Result for a line of a paper: a number, a text, or numbers for the texts of the line."""

    value: float | None = None  # SI
    lower: float | None = None  # of an interval, SI
    upper: float | None = None
    printed: float | None = None  # value of the line if it has none, SI
    words: str | None = None  # replaces the words of the line
    verdict: Verdict | None = None  # None: the verdict of the line, or it follows from the numbers
    reason: str | None = None  # replaces the reason of the line
    fields: Mapping[str, object] = field(default_factory=dict)  # for the templates of the line


class Evidence:
    """The joined tables of a run, by name; a missing table counts as empty."""

    def __init__(self, tables: Mapping[str, pa.Table] | None = None) -> None:
        self._tables = dict(tables or {})

    def rows(self, of: type[R], **where: object) -> list[R]:
        """Return the rows of a table, by their class, where the columns have these values."""
        table = self._tables.get(of.table)
        if table is None:
            return []
        for name, value in where.items():
            column = table[name]
            table = table.filter(column.is_null() if value is None else pc.equal(column, value))
        return of.rows_of(table)

    def has(self, sensor: str, recording: str) -> bool:
        """Return whether the run has a usable recording of this name."""
        return bool(self.rows(RecordingRow, sensor=sensor, recording=recording, status="ok"))

    def of_log(self, of: type[R], log: Log, **where: object) -> list[R]:
        """Return the rows of a table, by their class, about a channel of a recording."""
        return self.rows(of, **log._asdict(), **where)

    def parameter(self, log: Log, name: str, method: str | None = None) -> ParameterRow | None:
        """Return the estimate of a parameter (component 1) by a method; None: the recommended."""
        by: dict[str, object] = {"recommended": True} if method is None else {"method": method}
        rows = self.of_log(ParameterRow, log, parameter=name, component=1, **by)
        return rows[0] if rows else None
