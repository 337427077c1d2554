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
    assert "A robot" in printed and "not enough data" in printed
    assert (
        "one: its datasheet does not print all noise parameters: a log is needed; 100 % unknown"
        in printed
    )
    assert "by logs" not in printed
    assert ask(folder, requirement=str(folder / "requirements/robot.yaml")) == 0
    assert capsys.readouterr().out == printed


def test_a_sensor_with_usable_logs_is_judged_by_them(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = {"sensor": "one", "recording": "a"}
    rows = {
        "recordings": [names | {"device": "a", "kind": "static", "simulated": False,
                                "status": "ok", "decides": True}],
        "ranking": [names | {"requirement": "robot", "decides": True, "error": "heading",
                             "time": 600.0, "unit": "rad", "verdict": "meets",
                             "limit_verdict": "meets", "margin": 1.25, "noise_margin": 7.5}],
    }  # fmt: skip
    for name, listed in rows.items():
        write_arrow(build(name, listed), folder / f"results/tables/{name}.parquet")
    assert ask(folder, "--results", str(folder / "results")) == 0
    printed = capsys.readouterr().out
    (line,) = (line for line in printed.splitlines() if "one *" in line)
    assert line.split()[:6] == ["1", "one", "*", "meets", "1.25", "7.5"]
    assert "*: noise by logs; else as printed" in printed


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
