from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.report.comparison import Comparison, gather_recording
from imubench_pipeline.report.view import RecordingView, gather_recordings
from tests.report.tables import HOUR, KNOWN, MODEL, WITHOUT_K, joined, recording_rows, rejected_rows

NAMES = {"a": "Vendor A", "b": "Vendor B"}


def views(*several: Any) -> list[RecordingView]:
    return gather_recordings(joined(*several))


def together(recordings: Iterable[RecordingView]) -> Comparison:
    return Comparison([gather_recording(one, "practical") for one in recordings], NAMES)


def lines(*several: Any) -> list[dict[str, Any]]:
    (table,) = together(views(*several)).tables()
    return table["lines"]


def test_each_quantity_has_a_table_with_the_channels_of_all_sensors() -> None:
    found = views(
        recording_rows("a", "r", ("gyro_x", "accel_z")),
        recording_rows("b", "r", ("gyro_y",), simulated=True),
        rejected_rows("b", "bad"),
    )
    gyro, accel = together(found).tables()
    assert (gyro["title"], accel["title"]) == ("Gyroscope", "Accelerometer")
    assert gyro["filters"] == {
        "axis": ["x", "y"],
        "sensor": ["Vendor A", "Vendor B"],
        "method": ["recommended", "model N+GM+K"],
    }
    assert accel["filters"]["sensor"] == ["Vendor A"]
    seen = [(line["view"].sensor, line["channel"], line["asked"]) for line in gyro["lines"]]
    assert seen == [
        ("a", "gyro_x", "recommended"),
        ("a", "gyro_x", "model N+GM+K"),
        ("b", "gyro_y", "recommended"),
        ("b", "gyro_y", "model N+GM+K"),
    ]
    assert [line["view"].simulated for line in gyro["lines"]] == [False, False, True, True]


def test_recommended_papers_model_has_one_line() -> None:
    rows = recording_rows("a", "r")
    rows["parameters"] = [
        replace(row, recommended=row.method == "likelihood_gm") for row in rows["parameters"]
    ]
    assert [line["asked"] for line in lines(rows)] == ["recommended"]


def test_a_table_has_the_parameters_that_any_of_its_channels_has() -> None:
    ramp = KNOWN | {"R": Parameter(1e-9, lower=5e-10, upper=2e-9)}
    none = KNOWN | {"Q": Parameter(None, "absent")}
    found = views(recording_rows("a", "r", parameters=none), recording_rows("b", "r"))
    (table,) = together(found).tables()
    assert table["symbols"] == ["N", "B", "T_B", "K"]
    found = views(recording_rows("a", "r", parameters=ramp), recording_rows("b", "r"))
    (table,) = together(found).tables()
    assert table["symbols"] == ["N", "B", "T_B", "K", "R"]
    assert [("R" in line["cells"]) for line in table["lines"]] == [True, True, False, False]


def test_a_cell_has_value_interval_and_status() -> None:
    (line, _) = lines(recording_rows("a", "r", parameters=WITHOUT_K))
    (n,) = line["cells"]["N"]["parts"]
    assert (n["value"], n["status"]) == (MODEL.N, "")
    assert (n["lower"], n["upper"]) == pytest.approx((18 * HOUR, 22 * HOUR))
    assert line["cells"]["N"]["words"] == ""
    k = line["cells"]["K"]
    assert k["value"] is None
    assert k["parts"][0]["status"] == "absent"
    assert k["parts"][0]["lower"] is None and k["parts"][0]["upper"] == 0.5 * MODEL.K
    # 0.05 °/h/√s is 3 °/h/√h.
    assert k["words"] == "K is not in the model: the data do not support it; below 3 °/h/√h."


def test_comparison_lines_have_the_warnings_of_the_channel() -> None:
    findings = [{"finding": "missing_samples"}, {"finding": "lines", "severity": "note"}]
    assert [line["warnings"] for line in lines(recording_rows("a", "r", findings=findings))] == [
        ["missing_samples"]
    ] * 2


def test_curves_stand_by_channel_and_datasheets_once_a_sensor() -> None:
    found = views(recording_rows("a", "r"), recording_rows("a", "q"), recording_rows("b", "r"))
    page = together(found).page
    named = [(one["sensor"], one["recording"], one["channel"]) for one in page["channels"]]
    assert named == [("a", "r", "gyro_x"), ("a", "q", "gyro_x"), ("b", "r", "gyro_x")]
    assert {name: list(own) for name, own in page["datasheets"].items()} == {
        "a": ["gyro_x"],
        "b": ["gyro_x"],
    }
    # Three recordings with the same curves: each array stands once.
    places = {one["adev"] for one in page["channels"]}
    assert len(places) == 1
    assert len(page["arrays"]) < 12


def test_nothing_to_compare_is_no_table() -> None:
    nothing = together(views(rejected_rows("b", "bad")))
    assert list(nothing.tables()) == []
    assert nothing.page == {"channels": [], "datasheets": {}, "arrays": []}
