"""Rows of tables as classes: columns, Arrow types and units derive from them."""

import ast
import math
import re
from collections.abc import Iterator
from typing import Annotated

import pyarrow as pa
import pytest

from imubench_pipeline.model.estimates import ParameterRow, ScoreRow
from imubench_pipeline.model.table import SensorRow, TableRow, columns_of, names_of, table
from imubench_pipeline.tables.files import build, make_schema
from imubench_pipeline.tables.schemas import ROWS, TABLES
from tests.test_architecture import PACKAGE


@table("example")
class ExampleRow(SensorRow):
    """All types of columns."""

    count: Annotated[int, "how many"]
    size: Annotated[float | None, "how large", "Hz"] = None
    many: Annotated[float | None, "of very many", "-", pa.float32()] = None
    right: Annotated[bool | None, "yes or no"] = None


def test_columns_derive_from_the_fields() -> None:
    found = [(c.name, c.type, c.unit, c.meaning, c.required) for c in columns_of(ExampleRow)]
    assert found == [
        ("sensor", pa.string(), "-", "name of the sensor file", True),
        ("count", pa.int64(), "-", "how many", True),
        ("size", pa.float64(), "Hz", "how large", False),
        ("many", pa.float32(), "-", "of very many", False),
        ("right", pa.bool_(), "-", "yes or no", False),
    ]


def test_a_row_needs_what_is_required_and_has_no_other_columns() -> None:
    row = ExampleRow(sensor="s", count=3)
    assert (row.size, row.right) == (None, None)
    with pytest.raises(TypeError, match="count"):
        ExampleRow(sensor="s")  # type: ignore[call-arg]  # what is tested
    with pytest.raises(AttributeError):
        row.number  # type: ignore[attr-defined]  # noqa: B018  # what is tested
    with pytest.raises(AttributeError):
        row.count = 4  # type: ignore[misc]  # what is tested


def test_a_row_is_a_mapping_of_its_columns() -> None:
    row = ExampleRow(sensor="s", count=3)
    assert dict(row) == {"sensor": "s", "count": 3, "size": None, "many": None, "right": None}
    assert row == dict(row) and row | {"count": 4} == {**row, "count": 4}
    assert "size" in row and "number" not in row


def test_rows_come_back_from_their_table() -> None:
    rows = [
        ScoreRow(sensor="s", recording="r", channel="gyro_x", method="curve", rms=1.0),
        ScoreRow(sensor="s", recording="r", channel="gyro_y", method="curve"),
    ]
    content = build("scores", rows)
    assert content.schema == make_schema("scores")
    assert ScoreRow.rows_of(content) == rows


def test_every_table_has_a_class_with_its_name() -> None:
    assert ROWS.keys() == TABLES.keys()
    for name, row in ROWS.items():
        assert issubclass(row, TableRow) and row.table == name
        assert names_of(row) == tuple(column.name for column in TABLES[name])
    assert ROWS["parameters"] is ParameterRow


def test_what_is_not_finite_becomes_null() -> None:
    row = ScoreRow(sensor="s", recording="r", channel="gyro_x", method="curve", rms=math.nan)
    assert ScoreRow.rows_of(build("scores", [row]))[0].rms is None


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Yield the room of each module that names such a dictionary, and its code."""
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if re.search(r"dict\[\s*str,\s*Any", text):
            yield path.relative_to(PACKAGE).parts[0], ast.parse(text)


def test_no_public_function_has_an_untyped_dictionary() -> None:
    found = [
        f"{room}: {node.name}"
        for room, module in modules()
        for node in ast.walk(module)
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
        if "dict[str, Any]" in f"{ast.unparse(node.args)} {ast.unparse(node.returns or node)}"
    ]
    assert found == []
