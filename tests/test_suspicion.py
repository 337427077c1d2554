import math
from pathlib import Path

import pytest
import yaml

from imubench_pipeline.datasheets.suspicion import (
    Usual,
    printed_figures,
    suspicious,
    unusual_rows,
    usual_figures,
)
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.validation import parse
from imubench_pipeline.steps.sensor_tables import collect_findings
from imubench_pipeline.words.findings.plausibility import UnusualFigure
from tests.conftest import catalogue
from tests.rows import typed
from tests.test_configuration import SENSOR

CATALOGUE = catalogue()
DEG = math.pi / 180


def texts(found: list[UnusualFigure]) -> list[str]:
    return [data.text("") for data in found]


def test_the_c102_f9r_as_published_is_probably_in_degrees(shared: Path) -> None:
    papers = yaml.safe_load((shared / "facts/paper_tables.yaml").read_text())["papers"]
    published = papers[0]["table_2"]["rows"][1]
    figures = {"N": published["gyro_N"], "B": published["gyro_B"]}
    noise, bias = texts(suspicious("gyro", figures, usual_figures(CATALOGUE)))
    assert noise.startswith("N of gyro is 0.327 °/s/√Hz, ") and "times the median" in noise
    assert noise.endswith("in degrees, and not rad, the value is 0.0057 °/s/√Hz: check its unit")
    assert bias.startswith("B of gyro is 701 °/h, ")
    assert bias.endswith("in degrees, and not rad, the value is 12.2 °/h: check its unit")
    in_degrees = {figure: value * DEG for figure, value in figures.items()}
    assert suspicious("gyro", in_degrees, usual_figures(CATALOGUE)) == []
    accel = {"N": published["acc_N"], "B": published["acc_B"]}
    assert suspicious("accel", accel, usual_figures(CATALOGUE)) == []


def test_every_other_sensor_of_the_papers_is_usual() -> None:
    # MTi-7, SiRRS01-03, and Engers' three read as N = 60 x the printed figure
    for N in (8.4e-5, 0.0122 * DEG, 0.0045 * DEG, 0.0516 * DEG):
        assert suspicious("gyro", {"N": N}, usual_figures(CATALOGUE)) == []


USUAL = {
    ("gyro", "N"): Usual(0.005 * DEG, 0.001 * DEG, 0.01 * DEG, 9),
    ("accel", "N"): Usual(1e-3, 4e-4, 3e-3, 9),
}


@pytest.mark.parametrize(
    ("quantity", "N", "said"),
    [
        (
            "gyro",
            0.11 * DEG,
            "22 times the median of 9 sensors (0.005 °/s/√Hz). If it is in deg",
        ),
        ("gyro", 0.099 * DEG, None),
        ("gyro", 6e-5 * DEG, None),  # below a twentieth of the median, not of the least
        ("gyro", 4e-5 * DEG, "25 times below the least of 9 sensors (0.001 °/s/√Hz). If it is in"),
        ("gyro", 20.0 * DEG, "If it is in thousandths of its unit, the value is 0.02 °/s/√Hz"),
        ("gyro", 100.0 * DEG, "Check whether its unit is right"),
        ("accel", 0.98, "If it is in thousandths of its unit, the value is 99.9 µg/√Hz"),
        ("accel", 2.1e-2, "If it is in m/s², and not g, the value is 218 µg/√Hz"),
        ("accel", 0.1, "Check whether its unit is right"),
        ("accel", 1.9e-2, None),
    ],
)
def test_twenty_times_off(quantity: str, N: float, said: str | None) -> None:
    found = texts(suspicious(quantity, {"N": N, "B": 1.0}, USUAL))
    assert len(found) == (said is not None)
    assert (said or "") in "".join(found)


def test_a_figure_is_held_against_its_own_datasheet() -> None:
    loud = {"N": 0.2 * DEG}
    assert suspicious("gyro", {"N": 0.3 * DEG}, USUAL, loud) == []
    (said,) = texts(suspicious("gyro", {"N": 0.3 * DEG}, USUAL, {"N": 0.002 * DEG}))
    assert said.endswith("in degrees, and not rad, the value is 0.00524 °/s/√Hz: check its unit")
    (said,) = texts(suspicious("gyro", {"N": 0.3 * DEG}, USUAL, {"N": 0.04 * DEG}))
    assert said.endswith("Check whether its unit is right")
    (said,) = texts(suspicious("gyro", {"N": 57.3 * 0.2 * DEG}, USUAL, loud))
    assert said.endswith("the value is 0.2 °/s/√Hz: check its unit")


def with_walk(value: float) -> Sensor:
    walk = {"value": value, "unit": "deg/sqrt(h)"}
    return parse(Sensor, SENSOR | {"datasheet": {"gyro": {"random_walk": walk}}}, "s.yaml")


def test_a_printed_figure_is_held_against_the_others() -> None:
    sensors = {f"s{i}": with_walk(0.3) for i in range(5)} | {"odd": with_walk(19.6)}
    assert printed_figures(sensors["odd"], "gyro") == {"N": pytest.approx(19.6 / 60 * DEG)}
    usual = usual_figures(sensors)
    said = {
        name: suspicious("gyro", printed_figures(sensor, "gyro"), usual)
        for name, sensor in sensors.items()
    }
    assert [name for name in said if said[name]] == ["odd"]
    assert usual_figures({name: sensors[name] for name in ("s0", "s1", "odd")}) == {}


def test_an_estimate_is_told_by_the_name_and_digits_that_its_table_prints() -> None:
    printed = {"gyro": {"bias_instability": {"value": 6, "unit": "deg/h"}}}
    sensors = {f"s{i}": parse(Sensor, SENSOR | {"datasheet": printed}, "s.yaml") for i in range(5)}
    # 397.8 °/h, known to 30: the first digit of that is the last of the figure.
    value, lower, upper = (x / 3600 * DEG for x in (397.8, 343.0, 408.5))
    row = {"sensor": "odd", "recording": "r", "channel": "gyro_x", "value": value,
           "lower": lower, "upper": upper}  # fmt: skip
    rows = typed(ParameterRow, [row | {"parameter": name} for name in ("B", "sigma_min")])
    found = unusual_rows(rows, sensors, usual_figures(sensors))
    (said,) = (finding.detail for finding in found)
    # The papers' B is another figure, and 1.5 times as large.
    assert said.startswith("σ_min of gyro x is 400 °/h, 66.3 times the median of 5 sensors (6 °/h)")


@pytest.mark.parametrize(
    ("found", "channel", "N", "expected"),
    [
        (None, None, 1e-9, {"impossible_noise"}),  # m/s^2/sqrt(Hz): a dead or computed axis
        ("slow_sampling", None, 1e-9, {"impossible_noise"}),
        ("suspicious_unit", "gyro_x", 1e-9, {"impossible_noise"}),
        ("suspicious_unit", "accel_x", 1e-9, set()),
        ("motion", "gyro_x", 1e-9, set()),
        (None, None, 0.1, {"unusual_figure"}),
        ("slow_sampling", None, 0.1, set()),  # noise of higher frequencies is folded into N
        ("slow_sampling", None, 1e-3, set()),
    ],
)
def test_noise_far_below_all_sensors_is_impossible_unless_explained(
    found: str | None, channel: str | None, N: float, expected: set[str]
) -> None:
    place = {"sensor": "s", "recording": "r"}
    earlier = typed(FindingRow, [place | {"finding": found, "channel": channel}] if found else [])
    quality = Quality(typed(RecordingRow, [place])[0], earlier, {})
    row = place | {"channel": "accel_x", "parameter": "N", "value": N}
    rows = collect_findings([quality], [], [], typed(ParameterRow, [row]), {}, USUAL)
    assert {f.finding for f in rows if f not in earlier} == expected
