"""The command, with and without a run."""

from pathlib import Path

import pytest

from imubench_pipeline.run.cli import main
from imubench_pipeline.tables.files import build, write_arrow

ASKED = """
title: A robot
static_window: 30 s
limits: [{error: heading, after: 600 s, at_most: 5 deg}]
"""
SENSOR = """
vendor: V
model: M
price_class: consumer
log: {rate: 100 Hz, channels: {gyro_x: {column: 1, unit: deg/s}}}
datasheet:
  gyro: {random_walk: {value: 0.3, unit: deg/sqrt(h)}}
  accel: null
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in (("sensors/one.yaml", SENSOR), ("requirements/robot.yaml", ASKED)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def ask(folder: Path, *more: str, requirement: str = "robot") -> int:
    places = [f"--{name}={folder / name}" for name in ("sensors", "requirements")]
    return main(["shortlist", requirement, *places, *more])


def test_the_command_prints_the_verdicts(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert ask(folder) == 0
    printed = capsys.readouterr().out
    assert "A robot" in printed and "worth logging" in printed
    assert "one: gyro B, K and T_B: not published, and not measured of any sensor" in printed
    assert ask(folder, requirement=str(folder / "requirements/robot.yaml")) == 0
    assert capsys.readouterr().out == printed


def test_what_a_run_measured_fills_what_is_not_published(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {"sensor": "other", "recording": "a"}
    known = {"value": 1e-7, "lower": 1e-7, "upper": 1e-7, "status": "ok", "unit": "SI"}
    rows = {
        "recordings": [names | {"device": "a", "kind": "static", "simulated": False,
                                "status": "ok", "decides": True}],
        "parameters": [
            names | known | {"channel": "gyro_x", "method": "likelihood", "recommended": True,
                             "model": "N+F+K", "component": 1, "parameter": name}
            for name in ("B_curve", "K")
        ],
        "ranking": [],
    }  # fmt: skip
    for name, listed in rows.items():
        write_arrow(build(name, listed), folder / f"results/tables/{name}.parquet")
    assert ask(folder, "--results", str(folder / "results")) == 0
    printed = capsys.readouterr().out
    assert "meets the limits" in printed
    assert "K: 1.24 °/h/√h, as in measured sensors of any class" in printed


@pytest.mark.parametrize(
    ("more", "requirement", "said"),
    [
        ([], "none", "there are: robot"),
        ([], "none.yaml", "none.yaml"),
        (["--results", "/nowhere"], "robot", "nowhere"),
    ],
)
def test_what_is_wrong_is_said(
    folder: Path, capsys: pytest.CaptureFixture[str], more: list[str], requirement: str, said: str
) -> None:
    assert ask(folder, *more, requirement=requirement) == 2
    assert said in capsys.readouterr().err
