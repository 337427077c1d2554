import pytest

from imubench_pipeline.datasheets.coverage import by_vendor, coverage
from imubench_pipeline.model.comparisons import CoverageRow
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor
from imubench_pipeline.settings.validation import parse
from tests.conftest import catalogue
from tests.test_configuration import SENSOR

FIGURES = (
    *("N", "B", "K", "T_B", "temperature_coefficient", "offset", "scale_factor_error"),
    *("scale_factor_temperature", "nonlinearity", "cross_axis", "g_sensitivity"),
    *("vibration_rectification", "full_scale", "bandwidth"),
)


def sensor(vendor: str = "V", **datasheet: object) -> Sensor:
    return parse(Sensor, SENSOR | {"vendor": vendor, "datasheet": datasheet}, "s.yaml")


def published(found: list[CoverageRow]) -> dict[str, str]:
    return {row.figure: row.published for row in found if row.quantity == "gyro"}


def figure(value: float, unit: str, **further: object) -> dict[str, object]:
    return {"value": value, "unit": unit, **further}


def test_published_or_not_or_not_looked_up() -> None:
    gyro = {
        "random_walk": figure(0.1, "deg/sqrt(h)"),
        "bias_instability": None,
        "rate_random_walk": {"value": None},
        "offset": figure(1, "deg/s"),
        "misalignment": figure(1, "mrad"),
        "bandwidth": None,
    }
    assert published(coverage({"s": sensor(gyro=gyro)})) == dict.fromkeys(
        FIGURES, "not looked up"
    ) | {
        "N": "yes",
        "B": "no",
        "K": "no",
        "offset": "yes",
        "cross_axis": "yes",
        "bandwidth": "no",
    }


@pytest.mark.parametrize(
    ("key", "given", "covered"),
    [
        ("rms_noise", figure(0.1, "deg/s rms", bandwidth="47 Hz"), "N"),
        ("noise_density", figure(0.01, "deg/s/sqrt(Hz)", kind="derived"), "N"),
        ("drift", figure(3, "deg/h", kind="max"), "B"),
        ("allan_deviation", figure(1, "deg/h", tau="600 s"), "B"),
        ("temperature_total", figure(30, "deg/s"), "temperature_coefficient"),
        ("temperature_rms", figure(10, "deg/h"), "temperature_coefficient"),
        ("bias_repeatability", figure(4, "deg/h"), "offset"),
    ],
)
def test_something_akin_is_another_convention(
    key: str, given: dict[str, object], covered: str
) -> None:
    found = coverage({"s": sensor(gyro={key: given})})
    said = published(found)
    assert said.pop(covered) == "other convention"
    assert set(said.values()) == {"not looked up"}


def test_a_row_says_what_is_printed_and_where() -> None:
    noise = [
        figure(0.1, "deg/sqrt(h)", option="A"),
        figure(0.2, "deg/sqrt(h)", kind="max", source="secondary"),
    ]
    given = sensor(
        document="D",
        revision="C",
        source="primary",
        gyro={
            "random_walk": noise,
            "rms_noise": figure(0.1, "deg/s", bandwidth="47 Hz"),
            "offset": {"value": [-250, 250], "unit": "deg/h", "kind": "range"},
            "bias_instability": {"value": {"x": 1, "yz": 2}, "unit": "deg/h"},
        },
        accel=None,
    )
    rows = coverage({"s": given})
    assert {row.quantity for row in rows} == {"gyro"}
    by_figure = {row.figure: row for row in rows}
    assert by_figure["N"] == CoverageRow(
        sensor="s",
        vendor="V",
        model="M",
        quantity="gyro",
        figure="N",
        published="yes",
        as_printed=(
            "0.1 deg/sqrt(h) typ (A)",
            "0.2 deg/sqrt(h) max",
            "0.1 deg/s typ over 47 Hz",
        ),
        document="D, revision C",
        source="primary and secondary",
    )
    assert by_figure["offset"].as_printed == ("-250 to 250 deg/h range",)
    assert by_figure["B"].as_printed == ("x 1, yz 2 deg/h typ",)
    assert by_figure["K"].as_printed == ()


def test_vendors_are_counted() -> None:
    walk = {"random_walk": figure(0.1, "deg/sqrt(h)")}
    sensors = {
        "a": sensor("W", gyro=walk, accel=None),
        "b": sensor("V", gyro={"random_walk": None}, accel=None),
        "c": sensor("W", gyro={"rms_noise": figure(1, "deg/s")}, accel=None),
    }
    rows = by_vendor(coverage(sensors))
    assert [row.vendor for row in rows] == ["V"] * len(FIGURES) + ["W"] * len(FIGURES)
    assert [row.figure for row in rows[: len(FIGURES)]] == list(FIGURES)
    noise = {row.vendor: row for row in rows if row.figure == "N"}
    assert (noise["V"].sensors, noise["V"].no) == (1, 1)
    assert (noise["W"].yes, noise["W"].other_convention, noise["W"].no) == (1, 1, 0)
    assert all(
        row.yes + row.other_convention + row.no + row.not_looked_up == row.sensors for row in rows
    )


def test_what_the_first_paper_asks_of_the_catalogue() -> None:
    """Vendors print white noise and hardly what else a filter needs: no K, no T_B."""
    sensors = catalogue()
    rows = coverage(sensors)
    sold = [one.datasheet for one in sensors.values() if one.sold]
    quantities = sum(getattr(sheet, q) is not None for sheet in sold for q in QUANTITIES)
    gyros = sum(sheet.gyro is not None for sheet in sold)
    assert len(rows) == quantities * (len(FIGURES) - 1) + gyros
    assert not any(row.figure == "g_sensitivity" for row in rows if row.quantity == "accel")
    said = {(row.sensor, row.quantity, row.figure): row.published for row in rows}
    assert not any(
        row.published in ("yes", "other convention") for row in rows if row.figure in ("K", "T_B")
    )
    for quantity in QUANTITIES:
        for name in ("N", "B", "K", "T_B"):
            assert said["c102_f9r", quantity, name] == "no"
        assert (said["mti_7", quantity, "N"], said["mti_7", quantity, "K"]) == ("yes", "no")
    assert said["bmi055", "accel", "B"] in ("no", "not looked up")
    assert said["stim300", "gyro", "temperature_coefficient"] == "other convention"
    assert said["mpu9250", "gyro", "B"] == "no"
