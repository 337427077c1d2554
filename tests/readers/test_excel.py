"""Workbooks of Excel, as phyphox exports them."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.inspection import inspect
from imubench_pipeline.settings.sensor import LogFormat

Sheets = Mapping[str, Sequence[Sequence[Any]]]

_HEAD = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>'
_OPEN = "http://schemas.openxmlformats.org"
_MAIN = f'xmlns="{_OPEN}/spreadsheetml/2006/main"'
_OF_DOCUMENT = f"{_OPEN}/officeDocument/2006/relationships"
_PACKAGE = f"{_OPEN}/package/2006"


def cell(value: Any) -> str:
    if isinstance(value, str):
        return f'<c t="inlineStr"><is><t>{escape(value)}</t></is></c>' if value else "<c/>"
    return f"<c><v>{value!r}</v></c>"


def workbook(path: Path, sheets: Sheets) -> Path:
    """Write the few parts of a workbook that ECMA-376 requires."""
    numbers = range(1, len(sheets) + 1)
    relations = "".join(
        f'<Relationship Id="rId{n}" Type="{_OF_DOCUMENT}/worksheet" '
        f'Target="worksheets/sheet{n}.xml"/>'
        for n in numbers
    )
    listed = "".join(
        f'<sheet name="{escape(name)}" sheetId="{n}" r:id="rId{n}"/>'
        for n, name in zip(numbers, sheets, strict=True)
    )
    types = "".join(
        f'<Override PartName="/xl/worksheets/sheet{n}.xml" ContentType="application/vnd.'
        'openxmlformats-officedocument.spreadsheetml.worksheet+xml"/>'
        for n in numbers
    )
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{_PACKAGE}/content-types"><Default Extension="rels" '
        'ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Override '
        'PartName="/xl/workbook.xml" ContentType="application/vnd.openxmlformats-officedocument.'
        f'spreadsheetml.sheet.main+xml"/>{types}</Types>',
        "_rels/.rels": f'<Relationships xmlns="{_PACKAGE}/relationships"><Relationship Id="rId1" '
        f'Type="{_OF_DOCUMENT}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
        "xl/workbook.xml": f'<workbook {_MAIN} xmlns:r="{_OF_DOCUMENT}"><sheets>{listed}</sheets>'
        "</workbook>",
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_PACKAGE}/relationships">{relations}'
        "</Relationships>",
    }
    for n, rows in zip(numbers, sheets.values(), strict=True):
        body = "".join(f"<row>{''.join(map(cell, row))}</row>" for row in rows)
        parts[f"xl/worksheets/sheet{n}.xml"] = (
            f"<worksheet {_MAIN}><sheetData>{body}</sheetData></worksheet>"
        )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, _HEAD + text)
    return path


def phyphox(gyro: np.ndarray, accel: np.ndarray) -> Sheets:
    """The sheets of an export; a row of each array is time, x, y and z."""
    sheets: dict[str, Sequence[Sequence[Any]]] = {}
    for title, unit, rows in (("Gyroscope", "rad/s", gyro), ("Accelerometer", "m/s^2", accel)):
        names = ["Time (s)", *(f"{title} {axis} ({unit})" for axis in "xyz")]
        sheets[title] = [names, *rows.tolist()]
    sheets["Metadata Device"] = [["property", "value"], ["deviceModel", "a phone"]]
    sheets["Metadata Time"] = [["event", "experiment time"], ["START", "2024-05-01"]]
    return sheets


@pytest.fixture
def made(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    gyro = np.column_stack([np.arange(300) / 100, 0.01 * rng.standard_normal((300, 3))])
    accel = np.column_stack([np.arange(150) / 50, 0.01 * rng.standard_normal((150, 3))])
    accel[:, 3] += 9.81
    return gyro, accel


def test_an_export_of_phyphox_is_drafted_and_read(
    tmp_path: Path, made: tuple[np.ndarray, np.ndarray]
) -> None:
    path = workbook(tmp_path / "a.xlsx", phyphox(*made))
    found = inspect(path)
    assert found.complete
    assert "gyro 100 Hz, accel 50 Hz from the stamps" in found.proof.said
    assert "not taken: Metadata Device, Metadata Time (has no row of numbers" in found.block
    log = LogFormat.model_validate(found.draft.log())
    for file, truth in zip(
        sorted(read(path, log), key=lambda f: -len(next(f.batches()))), made, strict=True
    ):
        (batch,) = file.batches()
        quantity = next(iter(file.sources))[:-2]
        assert batch.time is not None
        np.testing.assert_allclose(batch.time, truth[:, 0], atol=1e-12)
        for place, axis in enumerate("xyz", start=1):
            np.testing.assert_array_equal(batch.columns[f"{quantity}_{axis}"], truth[:, place])


def test_lines_above_the_names_and_missing_cells(tmp_path: Path) -> None:
    rows = [
        ["A log of", "", ""],
        ["t", "wx", "note"],
        [0.0, 0.5, "a"],
        [0.1, "", "b"],
        [0.2, 0.7, ""],
    ]
    path = workbook(tmp_path / "a.xlsx", {"Sheet1": rows})
    channels = {"gyro_x": {"column": "wx", "unit": "rad/s"}}
    log = {"time": {"column": "t", "unit": "s"}, "channels": channels}
    (file,) = read(path, LogFormat.model_validate(log))
    (batch,) = file.batches()
    assert batch.columns["gyro_x"].tolist() == pytest.approx([0.5, np.nan, 0.7], nan_ok=True)
    log["channels"] = {"gyro_x": {"column": "note", "unit": "rad/s"}}
    (file,) = read(path, LogFormat.model_validate(log))
    with pytest.raises(RecordingError, match=r"'note' .* holds text; expected numbers"):
        list(file.batches())


def test_what_is_no_workbook_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.xls"
    path.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(2000))
    with pytest.raises(
        RecordingError, match=r"a\.xls: its sheets cannot be read .*export it as CSV"
    ):
        inspect(path)
