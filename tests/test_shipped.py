"""What comes with the package, and what a folder of logs puts on top of it."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from imubench_pipeline.run.cli import COMMANDS, main
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.project import find_snakefile
from imubench_pipeline.run.verification.results import Results
from imubench_pipeline.settings.config import Run, read_run
from imubench_pipeline.settings.shipped import find_project, list_folders
from imubench_pipeline.settings.validation import ConfigError
from tests.conftest import PROJECT
from tests.workflow.project import put_sensor


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    assert main(["init", "."]) == 0
    return tmp_path


def test_in_a_checkout_the_catalogue_is_its_own_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(PROJECT)
    assert find_project() == PROJECT
    assert list_folders(Run().sensors, "sensors") == [Path("config/sensors")]
    assert len(Plan({}).sensors) == len(list(Path("config/sensors").glob("*.yaml")))


def test_files_of_a_folder_of_logs_come_on_top_of_the_catalogue(lab: Path) -> None:
    shipped = {path.stem for path in (PROJECT / "config/sensors").glob("*.yaml")}
    put_sensor(lab / "config/sensors/mine.yaml")
    put_sensor(lab / "config/sensors/mti_7.yaml")
    sensors = Plan({}).sensors
    assert sensors.keys() == shipped | {"mine"} and list(sensors) == sorted(sensors)
    assert sensors["mti_7"].vendor == "V" and sensors["bno055"].vendor != "V"
    assert Plan({}).requirements.keys() == {
        path.stem for path in (PROJECT / "config/requirements").glob("*.yaml")
    }


def test_a_folder_that_is_stated_stands_alone_and_must_be_there(lab: Path) -> None:
    put_sensor(lab / "config/sensors/mine.yaml")
    assert Plan({"sensors": "config/sensors"}).sensors.keys() == {"mine"}
    for stated in ("nosuch", ["catalogue", "nosuch"]):
        with pytest.raises(ConfigError, match="nosuch: no such folder; expected a YAML file"):
            Plan({"sensors": stated})
    with pytest.raises(ConfigError, match="sensors"):
        read_run({"sensors": []})


def test_a_log_without_a_sensor_file_is_told_the_folder_for_one(lab: Path) -> None:
    (lab / "logs/nosuch").mkdir()
    (lab / "logs/nosuch/run.csv").write_text("gx\n1\n")
    assert "no sensor file config/sensors/nosuch.yaml" in Plan({}).ingest_settings("nosuch", "run")


def test_a_folder_without_logs_says_what_it_expects(lab: Path) -> None:
    (lab / "logs").rmdir()
    with pytest.raises(ConfigError, match=r"logs: found 'logs', which is no folder"):
        Plan({})


def test_a_folder_has_the_workflow_of_the_package_unless_it_has_its_own(lab: Path) -> None:
    assert find_snakefile(lab) == PROJECT / "Snakefile"
    (lab / "workflow").mkdir()
    (lab / "workflow/Snakefile").touch()
    assert find_snakefile(lab) == lab / "workflow/Snakefile"
    with pytest.raises(ConfigError, match=r"found no config/config.yaml and no Snakefile"):
        find_snakefile(lab / "logs")


# Every day: that such a run of tests/workflow/test_nightly.py ends so, and `run` without Snakemake
# in tests/test_extras.py.
@pytest.mark.release
def test_a_run_ends_as_snakemake_does_and_says_why(lab: Path) -> None:
    command = [sys.executable, "-m", "imubench_pipeline.run.start", "run", ".", "--"]
    wrong = [*command, "--config", "sensors=nosuch"]
    done = subprocess.run(wrong, cwd=lab, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "nosuch: no such folder; expected a YAML file for each sensor" in done.stderr
    assert len(done.stderr.splitlines()) < 10 and not done.stdout


def test_what_makes_results_again_is_a_command_of_the_folder(
    lab: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Results(Path("results")).run_again == "imubench run"
    (lab / "results/report").mkdir(parents=True)
    (lab / "results/report/settings.json").write_text('{"given": ["logs=/data"]}')
    assert Results(Path("results")).run_again == "imubench run -- --config logs=/data"
    monkeypatch.chdir(PROJECT)
    assert Results(lab / "results").run_again == "snakemake -c2 --config logs=/data"


@pytest.mark.parametrize("name", COMMANDS)
def test_each_command_says_its_exit_statuses(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([name, "--help"])
    said = " ".join(capsys.readouterr().out.split())
    assert f"Exit status: 0 {COMMANDS[name].statuses[0]}" in said


COMPLETED = {
    "in": {"init", "inspect"},
    "nightly --se": {"--settle"},
    "show --units p": {"practical"},
    "run mylogs": {"mylogs"},
}
"""What is typed after the name of the command, and what a shell makes of it."""


def test_a_shell_completes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "mylogs").mkdir()
    assert main(["completion", "bash"]) == 0
    (tmp_path / "completion").write_text(capsys.readouterr().out)
    script = "source ./completion\n" + "".join(
        f"COMP_WORDS=(imubench {typed}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); COMPREPLY=(); "
        '_shtab_imubench; echo "${COMPREPLY[@]}"\n'
        for typed in COMPLETED
    )
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    said = [{word.rstrip("/") for word in line.split()} for line in done.stdout.splitlines()]
    assert said == list(COMPLETED.values())


def test_where_there_is_no_posix_it_says_so_at_once() -> None:
    # What is POSIX's alone cannot be imported there.
    script = (
        "import os, sys; os.name = 'nt'; sys.platform = 'win32'; "
        "sys.modules |= dict.fromkeys(['fcntl', 'resource', 'termios', 'pwd', 'grp']); "
        "from imubench_pipeline.run.start import main; sys.exit(main())"
    )
    done = subprocess.run(
        [sys.executable, "-S", "-c", script],
        env=os.environ | {"PYTHONPATH": str(PROJECT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2 and "expected Linux" in done.stderr and "WSL" in done.stderr


@pytest.mark.parametrize("files", [None, "https://example.org/raw/v1/"])
def test_the_description_for_an_index_has_no_relative_link(files: str | None) -> None:
    readme = (PROJECT / "README.md").read_text("utf-8")
    described = runpy.run_path(str(PROJECT / "setup.py"))["describe"](readme, files)
    links = re.findall(r"\]\(([^)]+)\)", described)
    assert all(link.startswith("https://") for link in links)
    if files is None:
        assert "![" not in described and "the tutorial" in described.lower()
    else:
        assert "![" in described and f"{files}docs/images/report.png" in links
        assert len(links) == len(re.findall(r"\]\(([^)]+)\)", readme))
