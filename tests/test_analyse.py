"""`imubench analyse`: logs at once. That its numbers are those of a run: tests/workflow."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import yaml

from imubench_pipeline.extensions.figures import figures as static_files
from imubench_pipeline.report import publish
from imubench_pipeline.run.analysis import chain, compilation
from imubench_pipeline.run.analysis.project import Stated, UnfilledError, lay_out
from imubench_pipeline.run.cli import main
from imubench_pipeline.settings.validation import ConfigError
from tests.conftest import few
from tests.workflow.project import put_log, put_sensor

UNITS = ["--rate", "100 Hz", "--gyro-unit", "deg/s", "--accel-unit", "m/s^2"]
FEW = {"estimate": {"methods": ["likelihood"]}}


def laid_out(folder: Path, *logs: Path, sensor: Path | None = None, **stated: str) -> dict:
    project = folder / "project"
    project.mkdir()
    catalogue = folder / "catalogue"
    catalogue.mkdir(exist_ok=True)
    return lay_out(logs, sensor, Stated(**stated), [catalogue], project)


def log(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        "t,gyro_x [deg/s],acc_z [g]\n" + "".join(f"{i / 100},0.1,1\n" for i in range(9))
    )
    return path


def test_a_log_that_says_all_needs_no_sensor_file(tmp_path: Path) -> None:
    paths = laid_out(tmp_path, log(tmp_path / "run 1.csv"))
    written = json.loads(Path(paths["sensors"], "run 1.yaml").read_text())["log"]
    assert written["channels"]["gyro_x"]["unit"] == "deg/s"
    assert Path(paths["logs"], "run 1/run 1.csv").resolve() == tmp_path / "run 1.csv"


def test_what_a_log_does_not_say_is_asked_for(tmp_path: Path) -> None:
    put_log(tmp_path / "a.csv", 1, samples=100)
    with pytest.raises(UnfilledError) as raised:
        laid_out(tmp_path, tmp_path / "a.csv", accel_unit="m/s^2")
    assert "a.csv: the log does not state: rate, gyro unit\n" in str(raised.value)
    assert "--rate '100 Hz'" in str(raised.value)
    assert "--accel-unit" not in str(raised.value)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ({"gyro_unit": "furlong"}, "furlong"),
        ({"gyro_unit": "m/s^2"}, "m/s^2"),
        ({"rate": "100 s"}, "100 s"),
    ],
)
def test_what_is_stated_wrongly_is_refused(tmp_path: Path, stated: dict, words: str) -> None:
    put_log(tmp_path / "a.csv", 1, samples=100)
    right = {"rate": "100 Hz", "gyro_unit": "deg/s", "accel_unit": "m/s^2"}
    with pytest.raises(ConfigError, match=r"drafted from .*a.csv") as raised:
        laid_out(tmp_path, tmp_path / "a.csv", **right | stated)
    assert words in str(raised.value)


def test_logs_of_one_name_have_that_of_their_folder(tmp_path: Path) -> None:
    logs = [log(tmp_path / folder / "run.csv") for folder in ("a", "b")]
    put_sensor(tmp_path / "s.yaml")
    paths = laid_out(tmp_path, *logs, sensor=tmp_path / "s.yaml")
    assert sorted(path.name for path in Path(paths["logs"], "s").iterdir()) == [
        "a_run.csv",
        "b_run.csv",
    ]


def test_a_log_that_stands_twice_is_an_error(tmp_path: Path) -> None:
    one = log(tmp_path / "run.csv")
    with pytest.raises(ConfigError, match="give each log once"):
        laid_out(tmp_path, one, one)


def test_a_sensor_is_named_by_its_file_or_in_the_catalogue(tmp_path: Path) -> None:
    one = log(tmp_path / "run.csv")
    put_sensor(tmp_path / "catalogue/s.yaml")
    paths = laid_out(tmp_path, one, sensor=Path("s"))
    assert Path(paths["sensors"], "s.yaml").resolve() == tmp_path / "catalogue/s.yaml"


@pytest.mark.parametrize("sensor", ["nobody", "folder/s.yaml"])
def test_a_sensor_that_is_not_there_is_an_error(tmp_path: Path, sensor: str) -> None:
    with pytest.raises(ConfigError, match="no such sensor file"):
        laid_out(tmp_path, log(tmp_path / "run.csv"), sensor=Path(sensor))


def test_a_sensor_file_beside_a_log_of_its_name_is_no_notes(tmp_path: Path) -> None:
    put_sensor(tmp_path / "run.yaml")
    one = log(tmp_path / "run.csv")
    paths = laid_out(tmp_path, one, sensor=tmp_path / "run.yaml")
    assert [path.name for path in Path(paths["logs"], "run").iterdir()] == ["run.csv"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["missing.csv"], "missing.csv: no such file"),
        (["run.csv", "--sensor", "s.yaml", "--rate", "1 Hz"], "into the sensor file"),
        (["s.yaml"], "s.yaml"),
    ],
)
def test_what_cannot_be_analysed_says_why(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    log(tmp_path / "run.csv")
    put_sensor(tmp_path / "s.yaml")
    assert main(["analyse", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_parameters_doubts_and_rejections_are_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    put_log(tmp_path / "good.csv", 1, samples=5000)
    (tmp_path / "bad.csv").write_text("wx,ax\n1,2\n1,x\n" + "0.5,9.81\n" * 500)
    config = tmp_path / "config.yaml"
    config.write_text(yaml.safe_dump(FEW))
    sensor = tmp_path / "one.yaml"
    put_sensor(sensor)
    logs = [str(tmp_path / name) for name in ("good.csv", "bad.csv")]
    status = main(["analyse", *logs, "--sensor", str(sensor), "--config", str(config)])
    said = capsys.readouterr().out
    assert status == 1
    assert "good: at rest; usable; 50 s at 100 Hz, 2 channels\n" in said
    assert "rejected: bad.csv, line 3, column 'ax': found 'x'" in said
    assert "Gyroscopes" in said and "°/√h" in said and " to " in said
    assert "1 other finding; all findings and parameters: --verbose" in said


# Every day pages are made of one log, in tests/workflow/test_failures.py, and figures in the
# demonstration of .ci/run.
@pytest.mark.release
@pytest.mark.parametrize("drawn", few([False], [True]))
def test_a_step_that_fails_leaves_its_log_out_and_no_number_waits_for_the_pages(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    drawn: bool,
) -> None:
    asked: dict[str, Any] = {}
    if not drawn:
        monkeypatch.setattr(publish, "make_site", lambda *given: asked.update(page=given[0]))
        monkeypatch.setattr(publish, "render_one_file", lambda site: "a page")
        monkeypatch.setattr(
            static_files, "list_drawings", lambda *given, kinds: asked.update(kinds=kinds) or []
        )
    for name in ("whole", "unread", "unrebuilt"):
        path = tmp_path / f"{name}.csv"
        put_log(path, 1, samples=2000)
        only = [line.partition(",")[0] for line in path.read_text().splitlines()]
        path.write_text("\n".join(only))  # of a gyro: each channel more is eight figures more
    steps = {"unread": "write_recording", "unrebuilt": "reconstruct_recording"}
    for name, step in steps.items():
        monkeypatch.setattr(chain, step, failing(getattr(chain, step), name))
    printed: list[str] = []
    monkeypatch.setattr(
        chain.Analysis,
        "for_pages",
        lambda self, rest=chain.Analysis.for_pages: (
            printed.append(capsys.readouterr().out) or rest(self)
        ),
    )
    config = tmp_path / "config.yaml"
    config.write_text(yaml.safe_dump(FEW))
    logs = [str(tmp_path / f"{name}.csv") for name in ("whole", *steps)]
    made = tmp_path / "made"
    status = main(["analyse", *logs, *UNITS, "--config", str(config), "--output", str(made)])
    assert status == 1
    (numbers,) = printed
    assert "whole: at rest; usable; 20 s at 100 Hz, 1 channel\n" in numbers and "°/√h" in numbers
    assert "unrebuilt: at rest; usable; 20 s at 100 Hz, 1 channel\n" in numbers
    assert "failed: the step ingest failed: RuntimeError: no such luck" in numbers
    said = capsys.readouterr()
    assert said.out == f"{made}/report.html: open it in a browser\n"
    assert "unrebuilt: the step reconstruct failed: RuntimeError: no such luck" in said.err
    written = pd.read_csv(made / "recordings.csv").set_index("recording")["status"]
    assert dict(written) == {"whole": "ok", "unread": "failed", "unrebuilt": "failed"}
    assert (made / "report.html").stat().st_size > 0
    if not drawn:
        assert asked["kinds"] == ("comparison", "forest")
        assert asked["page"]["recordings"].num_rows == 3
        return
    assert {path.name for path in (made / "figures").iterdir()} == {
        f"{figure}_gyro_x.{kind}" for figure in ("allan", "forest") for kind in ("svg", "pdf")
    }


def failing(step: Any, name: str) -> Any:
    """Return a step that fails for the recording of a name."""

    def called(first: Any, *rest: Any) -> Any:
        if any(name in str(given) for given in (first, *rest)):
            raise RuntimeError("no such luck")
        return step(first, *rest)

    return called


@pytest.mark.parametrize("expected", [False, True])
def test_who_is_told_of_an_error_at_once_is_told_of_no_compilation(
    expected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compilation, "_MESSAGE_DELAY", 0.0)
    monkeypatch.setattr(compilation, "compile_kernels", lambda: time.sleep(600.0))
    said: list[str] = []
    told = threading.Event()

    def tell(text: str) -> None:
        said.append(text)
        told.set()

    with compilation.Compilation(tell) as compiling:
        if expected:
            compiling.expected()
            assert told.wait(60.0)
    assert len(said) == expected
