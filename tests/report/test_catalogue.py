"""The page of datasheets: the figures of all sensors, and the share that vendors publish."""

import math
from typing import Any

import pytest

from imubench_pipeline.datasheets.catalogue import list_catalogue
from imubench_pipeline.datasheets.coverage import coverage
from imubench_pipeline.model.comparisons import CoverageRow
from imubench_pipeline.report.catalogue import (
    compare_with_paper,
    make_catalogue_tables,
)
from imubench_pipeline.report.payload import Json
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.tables.files import build
from tests.test_coverage import figure, sensor

DEG = math.radians(1.0)


def covered(name: str, published: dict[str, str], **given: Any) -> list[dict[str, Any]]:
    about = {"sensor": name, "vendor": "V", "model": name.upper(), "quantity": "gyro"}
    return [
        about | {"figure": figure, "published": state, "document": "D-1"} | given
        for figure, state in published.items()
    ]


def read(*rows: dict[str, Any]) -> list[CoverageRow]:
    return CoverageRow.rows_of(build("coverage", rows))


def tables_of(sensors: dict[str, Sensor], system: Any = "practical") -> list[Json]:
    rows = coverage(sensors)
    return list(make_catalogue_tables(rows, list_catalogue(sensors), system))


def cell_of(table: Json, name: str) -> Json:
    names = [head["name"] for head in table["heads"]]
    return table["lines"][0]["cells"][names.index(name)]


def test_cells_have_each_kind_in_si_and_their_sources() -> None:
    sheet = {
        "random_walk": [figure(0.6, "deg/sqrt(h)", kind="max"), figure(0.3, "deg/sqrt(h)")],
        "noise_density": figure(0.006 * math.sqrt(2), "deg/s/sqrt(Hz)", place="page 3"),
        "bias_instability": {"value": None, "place": "page 4"},
        "drift": figure(3, "deg/h"),
        "nonlinearity": figure(0.1, "% FS", condition="25 degC", source="secondary"),
        "full_scale": {"value": [250, 2000], "unit": "deg/s", "kind": "choices"},
    }
    given = sensor(gyro=sheet, accel=None).model_copy(
        update={"aliases": ("P",), "grade": "tactical"}
    )
    (table,) = tables_of({"s": given})
    noise = cell_of(table, "N")
    (low, high, kind), largest = noise["parts"]
    assert kind == "typ" and largest[2] == "max"
    assert (low, high) == pytest.approx((0.3 * DEG / 60, 0.006 * DEG))
    assert noise["value"] == pytest.approx(0.006 * DEG)
    assert "noise density: 0.00848528 deg/s/sqrt(Hz) typ; page 3" in noise["sources"]
    other = cell_of(table, "B")
    assert (other["published"], other["parts"]) == ("other convention", [])
    assert other["akin"] == "3 deg/h typ"
    assert "bias instability: not published; page 4" in other["sources"]
    assert cell_of(table, "nonlinearity")["sources"] == [
        "nonlinearity: 0.1 % FS typ; 25 degC; secondary source"
    ]
    full = cell_of(table, "full scale")["parts"]
    assert full == [(pytest.approx(250 * DEG), pytest.approx(2000 * DEG), "choices")]
    assert cell_of(table, "K") == {
        "published": "not looked up", "parts": [], "value": None, "akin": "", "sources": []
    }  # fmt: skip
    line = table["lines"][0]
    assert (line["aliases"], line["grade"]) == ("P", "tactical")
    assert table["filters"] == {"vendor": ["V"], "grade": ["tactical"], "technology": []}


def test_heads_have_units_of_the_system() -> None:
    given = sensor(gyro={}, accel={})
    for system, gyro_signs, accel_signs in (
        ("practical", {"°/s", "°/s/g", "°/s/g²", "%", "%/K", "Hz"}, {"g", "mg/g²"}),
        ("si", {"rad/s", "rad/s/(m/s^2)", "1", "1/K", "Hz"}, {"m/s^2", "m/s^2/(m/s^2)^2"}),
    ):
        gyro, accel = tables_of({"s": given}, system)
        assert [head["name"] for head in gyro["heads"]][:4] == ["N", "B", "K", "T_B"]
        assert gyro["heads"][0]["ref"] == "gyro.N"
        assert accel["heads"][5] == {"name": "offset", "ref": "accel.signal", "unit": None}
        for table, signs in ((gyro, gyro_signs), (accel, accel_signs)):
            assert signs <= {head["unit"].sign for head in table["heads"] if head["unit"]}


def test_published_figures_are_counted_by_figure() -> None:
    rows = read(
        *covered("b", {"N": "yes", "temperature_coefficient": "not looked up"}),
        *covered("a", {"N": "yes", "temperature_coefficient": "other convention"}, vendor="u"),
        *covered("c", {"N": "no", "temperature_coefficient": "yes"}),
        *covered("c", {"N": "no", "offset": "not looked up"}, quantity="accel"),
    )
    gyro, accel = make_catalogue_tables(rows, [], "practical")
    assert gyro["counts"] == ["2 of 3", "2 of 2 (not checked: 1)"]
    assert [line["name"] for line in gyro["lines"]] == ["u A", "V B", "V C"]
    assert accel["counts"] == ["0 of 1", "0 of 0 (not checked: 1)"]
    assert list(make_catalogue_tables([], [], "practical")) == []


def test_the_claim_of_the_paper_has_the_numbers_of_the_catalogue() -> None:
    rows = read(
        *covered("a", dict.fromkeys(("N", "B", "K", "T_B"), "yes")),
        *covered("b", {"N": "yes", "B": "no", "K": "no", "T_B": "not looked up"}),
    )
    text = compare_with_paper(rows)
    assert (
        "1 of the 2 gyroscopes and accelerometers below have all of N, B, K and T_B published"
        in text
    )
    assert "2 of 2 print N, 1 of 2 print B, 1 of 2 print K and 1 of 1 print T_B." in text
