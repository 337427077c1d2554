from dataclasses import replace
from typing import Any

import pytest

from imubench_pipeline.model.comparisons import RepeatabilityRow
from imubench_pipeline.report.datasheets import (
    compare_sensors_with_datasheets,
    compare_with_datasheet,
    format_repeatability,
)
from imubench_pipeline.report.view import RecordingView, gather_recordings
from tests.report.tables import DEGREE, HOUR, Rows, joined, recording_rows

FIGURE = {"statistic": "N", "quantity": "N", "printed": 0.3, "unit": "deg/sqrt(h)", "kind": "typ",
          "comparable": 0.3 * DEGREE / 60, "measured": 0.33 * DEGREE / 60,
          "lower": 0.3 * DEGREE / 60, "upper": 0.36 * DEGREE / 60,
          "delta": 0.1, "delta_lower": 0.0, "delta_upper": 0.2,
          "verdict": "as printed"}  # fmt: skip


def with_figures(
    *figures: dict[str, Any], sensor: str = "a", recording: str = "r", **given: Any
) -> Rows:
    rows = recording_rows(sensor, recording, **given)
    names = {"sensor": sensor, "recording": recording, "channel": "gyro_x"}
    rows["datasheet"] = [names | {"method": "likelihood"} | figure for figure in figures]
    return rows


def views(*several: Rows) -> list[RecordingView]:
    return gather_recordings(joined(*several))


def deltas(
    *figures: dict[str, Any],
    system: str = "practical",
    coverage: dict[tuple[str, str, str], str] | None = None,
) -> list[dict[str, Any]]:
    (view,) = views(with_figures(*figures))
    return list(compare_with_datasheet(view.channels()[0], coverage or {}, system))


def test_a_printed_figure_stands_beside_what_was_measured() -> None:
    (row,) = deltas(FIGURE | {"condition": "25 °C", "sidedness": "one-sided"})
    assert row["quantity"] == "N"
    assert row["printed"] == "0.3 deg/sqrt(h)"
    assert row["about"] == "typ, 25 °C"
    (reading,) = row["readings"]
    assert reading["as"] == "if one-sided"
    assert (reading["comparable"], reading["unit"]) == ("0.3", "°/√h")
    assert reading["measured"] == ["0.33", "0.3 to 0.36"]
    assert reading["delta"] == ["+10 %", "+0 % to +20 %"]
    assert row["verdict"] == "as printed"
    (row,) = deltas(FIGURE, system="si")
    (reading,) = row["readings"]
    assert (reading["comparable"], reading["unit"]) == ("8.73×10⁻⁵", "rad/s/√Hz")


def test_a_printed_figure_has_one_verdict_however_it_is_read() -> None:
    one, two = (FIGURE | {"sidedness": side} for side in ("one-sided", "two-sided"))
    (row,) = deltas(one, two)
    assert row["verdict"] == "as printed" and len(row["readings"]) == 2
    (row,) = deltas(one, two | {"verdict": "better than typ"})
    assert row["verdict"] == "depends on whether the density is one-sided"
    assert row["reason"] == "as one-sided: as printed; as two-sided: better than typ"
    # What vendors print as the bias instability is the lowest point.
    instability = FIGURE | {"quantity": "bias_instability", "statistic": "adev_minimum"}
    (row,) = deltas(instability, instability | {"statistic": "plateau", "verdict": "not sure"})
    assert row["verdict"] == "as printed"
    assert [reading["as"] for reading in row["readings"]] == [
        "by σ_min",
        "by 0.664 B",
    ]


def test_less_than_printed_has_a_minus() -> None:
    (row,) = deltas(FIGURE | {"delta": -0.257, "delta_lower": None, "delta_upper": None})
    (reading,) = row["readings"]
    assert reading["delta"] == ["−26 %"]
    assert reading["value"] == -0.257


def test_unpublished_and_incomparable_figures_are_shown_differently() -> None:
    nothing = dict.fromkeys(("comparable", "measured", "lower", "upper", "delta", "delta_lower",
                             "delta_upper"))  # fmt: skip
    missing = FIGURE | nothing | {"printed": None, "unit": None, "kind": None}
    other = FIGURE | nothing | {"verdict": "not comparable", "reasons": ["another convention"]}
    unpublished, incomparable = deltas(
        missing | {"verdict": "not published", "reasons": ["x"]}, other
    )
    assert (unpublished["published"], unpublished["printed"]) == (False, "–")
    assert unpublished["reason"] == ""
    assert incomparable["published"] is True
    (reading,) = incomparable["readings"]
    assert (reading["comparable"], reading["measured"]) == ("–", ["–"])
    assert reading["delta"] == ["–"]
    assert incomparable["reason"] == "another convention"


@pytest.mark.parametrize(
    ("quantity", "figure"), [("N", "N"), ("bias_instability", "B"), ("K", "K"), ("T_B", "T_B")]
)
def test_figure_not_looked_up_is_not_shown_as_unpublished(quantity: str, figure: str) -> None:
    missing = FIGURE | {"printed": None, "quantity": quantity}
    known = {("a", "gyro", figure): "not looked up", ("a", "accel", figure): "yes"}
    (row,) = deltas(missing, coverage=known)
    assert row["coverage"] == "not looked up"
    (row,) = deltas(missing, coverage={("b", "gyro", figure): "not looked up"})
    assert row["coverage"] == "not looked up"


@pytest.mark.parametrize(
    ("statistic", "quantity", "name", "unit"),
    [
        ("adev_minimum", "bias_instability", "bias instability", "°/h"),
        ("plateau", "bias_instability", "bias instability", "°/h"),
        ("K", "K", "K", "°/h/√h"),
        ("T_B", "T_B", "T_B", "s"),
        ("mean", "zero_rate_offset", "zero rate offset", "°/h"),
    ],
)
def test_figures_have_names_and_units_of_their_own(
    statistic: str, quantity: str, name: str, unit: str
) -> None:
    (row,) = deltas(FIGURE | {"statistic": statistic, "quantity": quantity})
    assert (row["quantity"], row["readings"][0]["unit"]) == (name, unit)


def test_methods_that_are_not_recommended_are_left_out() -> None:
    rows = deltas(FIGURE | {"method": "curve"}, FIGURE | {"method": "mean", "printed": 7.0})
    assert [row["printed"] for row in rows] == ["7 deg/sqrt(h)"]


def test_one_line_a_figure_over_all_recordings_of_a_sensor() -> None:
    found = views(
        with_figures(FIGURE, recording="p"),
        with_figures(
            FIGURE | {"measured": 0.6 * DEGREE / 60, "delta": 1.0, "verdict": "worse than typ"},
            recording="q",
        ),
        with_figures(
            FIGURE | {"measured": 0.36 * DEGREE / 60, "delta": 0.2, "verdict": "worse than typ"},
            recording="r",
        ),
        with_figures(FIGURE | {"delta": None}, recording="s"),
        with_figures(FIGURE, sensor="b", simulated=True),
    )
    first, second = compare_sensors_with_datasheets(found, "practical")
    assert (first["sensor"], first["simulated"], first["channel"]) == ("a", False, "gyro_x")
    assert first["recordings"] == 3
    (reading,) = first["readings"]
    assert reading["measured"] == "0.33 to 0.6"
    assert reading["difference"] == "+10 % to +100 %"
    assert first["delta"] == 0.2
    assert first["verdicts"] == "as printed (1), worse than typ (2)"
    assert (first["printed"], first["about"]) == ("0.3 deg/sqrt(h)", "typ")
    assert (second["sensor"], second["simulated"]) == ("b", True)
    (reading,) = second["readings"]
    assert (reading["measured"], reading["difference"]) == ("0.33", "+10 %")
    assert second["verdicts"] == "as printed"


def test_both_readings_of_a_density_stand_in_one_line() -> None:
    other = {"sidedness": "two-sided", "delta": -0.2, "verdict": "better than typ"}
    found = views(with_figures(FIGURE | {"sidedness": "one-sided"}, FIGURE | other))
    (row,) = compare_sensors_with_datasheets(found, "practical")
    assert (row["about"], row["verdicts"]) == ("typ", "depends on whether the density is one-sided")
    assert [(one["as"], one["difference"]) for one in row["readings"]] == [
        ("if one-sided", "+10 %"),
        ("if two-sided", "−20 %"),
    ]


def test_turn_on_spread_is_compared_with_the_printed_figure() -> None:
    row = RepeatabilityRow(
        sensor="a",
        device="1",
        channel="gyro_x",
        recordings=3,
        power_cycled="yes",
        printed=4.0,
        unit="deg/h",
        kind="typ",
        comparable=4 * HOUR,
        measured=2 * HOUR,
        lower=HOUR,
        upper=12 * HOUR,
        delta=-0.5,
        verdict="not sure",
        reasons=("why",),
    )
    (line,) = format_repeatability([row, replace(row, sensor="b")], "a", "practical")
    assert (line["printed"], line["about"], line["delta"]) == ("4 deg/h", "typ", "−50 %")
    assert line["measured"] == ["2", "1 to 12"]
    assert (line["unit"], line["channel"], line["recordings"]) == ("°/h", "gyro x", 3)
