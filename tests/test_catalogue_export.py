"""The rows of all figures of the catalogue: as the sensor files have them, and as CSV."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from imubench_pipeline.datasheets.catalogue import list_catalogue
from imubench_pipeline.model.comparisons import CatalogueRow
from imubench_pipeline.run.cli import main
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.tables.files import write_each
from tests.conftest import PROJECT, catalogue
from tests.test_coverage import figure, sensor

FOLDER = PROJECT / "config/sensors"
DEG = math.radians(1.0)


def rows_of(**datasheet: Any) -> list[CatalogueRow]:
    return list(list_catalogue({"s": sensor(**datasheet)}))


def expected(figures: Any) -> list[tuple[object, ...]]:
    """What a figure of a file gives: axes, value, end of a range, unit, kind, place."""
    listed = figures if isinstance(figures, list) else [figures or {"value": None}]
    found: list[tuple[object, ...]] = []
    for one in listed:
        value, place = one["value"], one.get("place")
        about = (one["unit"], one.get("kind", "typ"), place) if value is not None else ()
        match value:
            case None:
                found.append((None, None, None, None, None, place))
            case dict():
                found += [(axes, number, None, *about) for axes, number in value.items()]
            case list() if one["kind"] == "range":
                found.append((None, *value, *about))
            case list():
                found += [(None, number, None, *about) for number in value]
            case _:
                found.append((None, value, None, *about))
    return found


@pytest.mark.parametrize("name", ["bmi088", "stim300", "mpu9250"])
def test_rows_are_the_figures_of_the_file(name: str) -> None:
    written = yaml.safe_load((FOLDER / f"{name}.yaml").read_text())
    rows = list(list_catalogue({name: catalogue()[name]}))
    for quantity in ("gyro", "accel"):
        sheet: Mapping[str, Any] = written["datasheet"][quantity]
        own = [row for row in rows if row.quantity == quantity]
        assert {row.figure for row in own} > sheet.keys()
        for key in dict.fromkeys(row.figure for row in own):
            found = [row for row in own if row.figure == key]
            if key not in sheet:
                assert [row.state for row in found] == ["not looked up"]
                continue
            columns = [
                (row.axes, row.value, row.value_to, row.unit, row.kind, row.place) for row in found
            ]
            assert columns == expected(sheet[key])
            for row in found:
                assert (row.state == "not published") == (row.value is None)
                assert row.document == written["datasheet"]["document"]
                assert (row.vendor, row.grade) == (written["vendor"], written["grade"])


def test_values_are_converted_to_si_and_nothing_else() -> None:
    rows = rows_of(
        source="primary",
        gyro={
            "noise_density": figure(0.01, "deg/s/sqrt(Hz)", sidedness="one-sided"),
            "offset": {"value": [-1, 2], "unit": "deg/s", "kind": "range"},
            "bias_instability": figure(3, "deg/h", kind="derived", source="secondary"),
            "full_scale": {"value": [250, 500], "unit": "deg/s", "kind": "choices"},
            "temperature_coefficient": figure(36, "deg/h/K", option="A", condition="25 degC"),
        },
        accel=None,
    )
    by_figure = {row.figure: row for row in rows}
    density, offset = by_figure["noise_density"], by_figure["offset"]
    assert density.value_si == pytest.approx(0.01 * DEG)
    assert (density.unit_si, density.sidedness) == ("rad/s/sqrt(Hz)", "one-sided")
    assert (offset.value_si, offset.value_to_si) == pytest.approx((-DEG, 2 * DEG))
    assert (offset.sidedness, offset.source) == (None, "primary")
    derived = by_figure["bias_instability"]
    assert (derived.state, derived.source) == ("derived", "secondary")
    assert [row.value for row in rows if row.figure == "full_scale"] == [250, 500]
    coefficient = by_figure["temperature_coefficient"]
    assert (coefficient.option, coefficient.condition) == ("A", "25 degC")
    assert coefficient.value_si == pytest.approx(0.01 * DEG)
    assert by_figure["rate_random_walk"].state == "not looked up"
    assert {row.quantity for row in rows} == {"gyro"}


def test_the_command_and_a_run_write_the_same_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, table = tmp_path / "figures.csv", tmp_path / "catalogue.csv"
    arguments = ["sensors", "--sensors", str(FOLDER), "--csv", str(file)]
    assert main(arguments) == 0
    sensors: dict[str, Sensor] = dict(sorted(catalogue().items()))
    write_each({"catalogue": list_catalogue(sensors)}, [table])
    assert file.read_bytes() == table.read_bytes()
    with file.open(encoding="utf-8", newline="") as content:
        rows = list(csv.DictReader(content))
    assert capsys.readouterr().out == f"{len(rows)} rows of {len(sensors)} sensors\n"
    assert {row["sensor"] for row in rows} == {
        name for name, one in sensors.items() if one.datasheet.gyro or one.datasheet.accel
    }
    # An earlier file is replaced only on demand, here by the rows of fewer sensors.
    assert main([*arguments, "bmi088"]) == 2 and file.read_bytes() == table.read_bytes()
    assert main([*arguments, "bmi088", "--force"]) == 0
    assert len(file.read_text().splitlines()) < len(rows) / 10
