"""Tables as CSV hold no formulas and nothing that does not show, whatever the logs are named."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.tables.files import build, read, write_arrow
from imubench_pipeline.tables.texts import escape_cell, escape_invisible

FORMULAS = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
SIGNS = st.sampled_from([*FORMULAS, *"';\" ,\t\r\n\x00\x1b\x7f\x85\u2028\u2029\u202e\u2066\ufeff"])
texts = st.text(st.characters(codec="utf-8") | SIGNS, max_size=12)


def of_cell(cell: str) -> str:
    """What stands before a sign of a formula has an apostrophe more than the text."""
    return re.sub(r"((?:^|;)[\s\"]*)'('*[=+\-@\uff1d\uff0b\uff0d\uff20])", r"\1\2", cell)


def score(text: str, number: float) -> dict[str, Any]:
    return {"sensor": text, "recording": "r", "channel": text, "method": "m", "rms": number}


def cells(path: Path, delimiter: str) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file, delimiter=delimiter))


@settings(settings.default, max_examples=settings.default.max_examples)
@given(st.lists(st.tuples(texts, st.floats(-1e300, 1e300)), min_size=1, max_size=3))
def test_no_cell_is_a_formula_and_each_text_can_be_told(
    tmp_path_factory: pytest.TempPathFactory, given_rows: list[tuple[str, float]]
) -> None:
    folder = tmp_path_factory.mktemp("t")
    table = build("scores", [score(*row) for row in given_rows])
    write_arrow(table, folder / "t.csv")
    write_arrow(table, folder / "t.parquet")
    head, *rows = cells(folder / "t.csv", ",")
    assert len(rows) == len(given_rows)
    for row, (text, number) in zip(rows, given_rows, strict=True):
        held = dict(zip(head, row, strict=True))
        assert of_cell(held["sensor"]) == of_cell(held["channel"]) == escape_invisible(text)
        assert float(held["rms"]) == number  # a negative number has no apostrophe
        assert all(cell.isprintable() for cell in row)
        assert not held["sensor"].lstrip(' "').startswith(FORMULAS)
    # one that takes semicolons between cells finds no formula among the texts either
    for row in cells(folder / "t.csv", ";")[1:]:
        for cell in row:
            assert not cell.lstrip(' "').startswith(FORMULAS)
    assert read("scores", [folder / "t.parquet"]).equals(table)


def test_what_a_text_is_changed_to(tmp_path: Path) -> None:
    for text, cell in (
        ("=1+1", "'=1+1"),
        ("-", "'-"),
        ("mti-7", "mti-7"),
        ("'tis", "'tis"),
        ("'=1", "''=1"),
        (" @x", " '@x"),
        ("a;=1", "a;'=1"),
        ("\t=1", r"\t=1"),
        ("a\u202e\x1b[2J", r"a\u202e\x1b[2J"),
        ("µ °C – 5", "µ °C – 5"),
    ):
        assert (escape_cell(text), of_cell(cell)) == (cell, escape_invisible(text))
    # nulls stay empty, and a column that is no text stays as it is
    table = pa.table({"a": ["=1", None], "b": [-1.5, None], "c": [-3, None]})
    write_arrow(table, tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text() == '"a","b","c"\n"\'=1",-1.5,-3\n,,\n'
