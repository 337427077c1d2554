"""Files of programs from printed figures alone."""

import math
from pathlib import Path

import pytest
import yaml

from imubench_pipeline.datasheets.class_limits import find_limit
from imubench_pipeline.extensions.exports.from_datasheet import build_printed_imu
from imubench_pipeline.extensions.exports.imu import ExportError
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.run.cli import main
from imubench_pipeline.settings.sensor import read_sensors
from tests.conftest import PROJECT

CATALOGUE = {n: s for n, s in read_sensors(PROJECT / "config/sensors").items() if s.sold}


def test_the_figures_are_those_of_the_datasheet_and_of_its_class(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """BMI088: 0.014 deg/s/sqrt(Hz), one-sided; the bias instability of its accelerometer is not
    printed."""
    assert main(["export", "--datasheet", "bmi088", "--target", "kalibr"]) == 0
    text = capsys.readouterr().out
    written = yaml.safe_load(text)
    assert written["gyroscope_noise_density"] == pytest.approx(
        math.radians(0.014) / math.sqrt(2), rel=1e-3
    )
    said = " ".join(text.replace("#", "").split())
    assert "CAUTION: these are figures of a datasheet and of its class, and not of a log" in said
    assert "gyro: B: the printed bias instability is the lowest point" in said
    (accel,) = (part for part in said.split("accel: ") if part.startswith("B: "))
    assert "NOT PRINTED: the worst of its class" in accel
    imu = build_printed_imu("bmi088", CATALOGUE["bmi088"])
    worst = find_limit("consumer", "accel", "B").worst
    assert imu.estimated["accel"].model.B == pytest.approx(worst / 0.6643, rel=1e-3)
    # The walk is as large as the lowest point after 500 s: K^2 500 s / 3.
    assert imu.estimated["accel"].model.K == pytest.approx(worst * math.sqrt(3 / 500))


@pytest.mark.parametrize("target", TARGETS)
def test_every_program_takes_the_sensors_of_the_catalogue(target: str) -> None:
    made = 0
    chosen = dict(list(CATALOGUE.items())[::8])
    for name, sensor in chosen.items():
        imu = build_printed_imu(name, sensor, rate=100.0)
        try:
            made += bool(TARGETS[target].write(imu))
        except ExportError as error:  # a program that needs an accelerometer
            assert sensor.datasheet.accel is None, (name, str(error))
    assert made >= len(chosen) - 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--datasheet", "bmi", "--target", "kalibr"], "there are: bmi055"),
        (["--datasheet", "nothing", "--target", "kalibr"], "lists all"),
        (["--datasheet", "bmi088", "--target", "nothing"], "there are: "),
        (["--datasheet", "bmi088", "--target", "kalibr", "--bounded"], "needs a log"),
        (["--target", "kalibr"], "add it, or --datasheet NAME"),
        (["no_results", "--target", "kalibr"], "no table recordings"),
        (["results", "--datasheet", "bmi088", "--target", "kalibr"], "omit one of the two"),
    ],
)
def test_a_wrong_request_says_what_is_expected(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_a_product_is_found_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "imu.yaml"
    asked = ["--target", "kalibr", "--output", str(file), "--rate", "200"]
    assert main(["export", "--datasheet", "MTi-7", *asked]) == 0
    assert "MTi-7" in file.read_text() and yaml.safe_load(file.read_text())["update_rate"] == 200.0
