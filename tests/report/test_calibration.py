"""The pages of gyros on a rate table, and at rest with a direction that is known."""

import math
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.extensions.calibration.pages import (
    describe_earth_rate,
    describe_scatter,
    summarise_calibration,
)
from imubench_pipeline.extensions.calibration.tables import CalibrationRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.report.publish import publish
from tests.alignment.test_of_sensor import outlook, put_triad
from tests.calibration.recordings import STEPS, UP, at_rest, on_table, run
from tests.earth_rate.recordings import put, put_at_rest
from tests.report.pages import Read, sound_pages
from tests.report.tables import Rows, joined, recording_rows, rejected_rows, site

pytestmark = pytest.mark.usefixtures("small_report")

ABOUT: dict[str, Any] = {"device": "7", "kind": "rate_table", "simulated": False, "status": "ok",
                         "rate": 32.0, "rate_from": "stated", "duration": 410.0,
                         "samples": 13_120}  # fmt: skip
GYRO = NoiseModel(N=3e-5)
EAST = {"latitude": "45 deg", "elevation": "10 deg"}


def some(folder: Path) -> list[Rows]:
    """What a run finds on a rate table, with and without a noise model, and at rest."""
    rest = put_at_rest(folder / "night")
    table = put(folder / "table", {"gyro_x": on_table()}, kind="rate_table")
    still = put(folder / "still", {"gyro_x": at_rest(1e-5)}, kind="static")
    declared = {"steps": STEPS, "axis": UP}
    names = [{"sensor": "s", "recording": name} | ABOUT for name in ("table", "unknown")]
    unknown = put(folder / "unknown", {"gyro_x": on_table()}, kind="rate_table")
    sound = put_triad(folder / "sound", {"gyro_x": GYRO, "accel_z": NoiseModel(N=1e-3)})
    return [
        recording_rows("s", "night"),
        recording_rows("s", "sound") | outlook([sound]),
        {"recordings": [names[0]]} | run(table, [rest], rate_table=declared),
        {"recordings": [names[1]]} | run(unknown, [], rate_table=declared),
        recording_rows("s", "still") | run(still, [rest], pointing=EAST),
        rejected_rows("s", "bad", "bad.yaml: rate_table.steps: missing", kind="rate_table"),
    ]


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Read]:
    folder = tmp_path_factory.mktemp("report")
    publish(site(joined(*some(tmp_path_factory.mktemp("kept")))), folder)
    return sound_pages(folder, {f"figures/allan_gyro_x.{kind}" for kind in ("svg", "pdf")})


def test_the_page_of_a_rate_table(read: dict[str, Read]) -> None:
    page = read["recordings/s/table.html"]
    assert "The scale factor error is" in page.text and "Noise explains" in page.text
    assert "it is not used for the Allan variance, noise parameters or ranking" in page.text
    assert "6 constant rates up to 50 °/s" in page.text
    assert "10.64 °/h (latitude 45°, elevation 90°), is subtracted" in page.text
    kinds = {one.attributes.get("data-kind") for one in page.elements if one.tag == "figure"}
    assert kinds == {"table_line", "table_residuals"}
    assert page.data["table"]["number"] == [1, 2, 3, 4, 5, 6]
    for name in ("scale factor", "quadratic term", "asymmetry", "linearity"):
        assert page.naming(name, "tr")


def test_the_page_of_a_gyro_at_rest_says_what_it_cannot_tell(read: dict[str, Read]) -> None:
    page = read["recordings/s/still.html"]
    assert "Bias without the Earth’s rate, gyro x" in page.text
    assert "the Earth's rate: In one position, only the sum of Earth's rate and bias" in page.text
    assert "heading: The heading is not known" in page.text and "no heading)" in page.text
    assert page.naming("bias at the end", "tr")
    assert "Bias without the Earth’s rate" not in read["recordings/s/night.html"].text


def test_the_page_of_all_has_them(read: dict[str, Read]) -> None:
    page = read["earth_rate.html"]
    assert "On a rate table" in page.text and "At rest, without turning" in page.text
    assert "Turned between north and south" not in page.text
    assert page.naming("table", "tr") and page.naming("still", "tr")
    assert "rate_table.steps: missing" in page.text


def test_each_sensor_has_its_alignment_and_its_needs(read: dict[str, Read]) -> None:
    page = read["earth_rate.html"]
    assert "Attitude and heading at rest" in page.text and "Required recordings" in page.text
    assert "At latitude 45° (earth_rate: latitude)" in page.text
    assert "20 mg (earth_rate.accelerometer_bias), assumed" in page.text
    assert "no gyro y and z, accelerometer x and y; the other axes replace them" in page.text
    assert "Check: 400 simulated triads" in page.text
    assert "No heading: The uncertainty of the gyro" in page.text
    (line,) = [one for one in page.naming("two opposite positions", "tr") if "60 min" in one.text
               and "fine" in one.text]  # fmt: skip
    assert "not determined" not in line.text
    for goal in ("100 %", "10 %", "1 %"):
        assert page.naming(goal, "td")
    drawn = page.data["alignments"]["s"]
    kinds = {(one["positions"], one["angle"], one["method"]) for one in drawn}
    assert (1, "heading", "fine") not in kinds and (2, "heading", "fine") in kinds


def test_what_gave_nothing_stands_on_the_start_page(read: dict[str, Read]) -> None:
    text = read["index.html"].text
    assert "1 recording without a calibration result" in text
    assert "The noise of this sensor is not known" in text
    assert "The noise of this sensor is not known" in read["recordings/s/unknown.html"].text
    assert "rate table" in read["recordings.html"].text


def calibrated(parameter: str, **given: float | None) -> CalibrationRow:
    about: dict[str, Any] = {"sensor": "s", "recording": "table", "channel": "gyro_x"}
    about |= {"run": "rate_table", "parameter": parameter, "unit": "rad/s", "status": "ok"}
    return CalibrationRow(**about | given)


def test_sentences() -> None:
    bias = calibrated("bias", value=1e-3, lower=0.9e-3, upper=1.1e-3)
    assert summarise_calibration([bias], "si") == "The bias is 0.001 ± 0.0001 rad/s (95 %)."
    assert summarise_calibration([], "si") == "This recording has no result."
    bent = calibrated("linearity", value=0.0125, chance=1e-3)
    assert "Noise does not explain" in summarise_calibration([bias, bent], "si")
    assert "from the line is 1.25 % of the largest rate" in summarise_calibration(
        [bias, bent], "si"
    )
    assert describe_scatter([calibrated("bias", scatter=None)]) == ""
    assert "scatter more than the noise" in describe_scatter([calibrated("bias", scatter=1e-4)])
    assert describe_earth_rate([calibrated("bias", earth_rate=None)], "si").startswith(
        "The bias includes the Earth's rate"
    )
    turned = calibrated(
        "bias",
        earth_rate=1e-5,
        earth_rate_sigma=1e-6,
        half_width=None,
        latitude=math.pi / 4,
        heading=0.5,
        elevation=0.0,
    )
    assert "determines it to 1×10⁻⁶ rad/s (1σ)." in describe_earth_rate([turned], "si")
