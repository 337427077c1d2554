import base64
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.extensions.figures import figures as static_files
from imubench_pipeline.report.publish import publish
from imubench_pipeline.run.cli import main
from tests.report.pages import Read
from tests.report.tables import joined, put_samples, put_tables, recording_rows, rejected_rows, site


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a finished run leaves."""
    folder = tmp_path_factory.mktemp("run") / "results"
    tables = joined(recording_rows("imu", "day 1"), rejected_rows())
    put_tables(tables, folder)
    put_samples(folder, "imu", "day 1")
    publish(site(tables, folder), folder / "report")
    return folder


def said(capsys: pytest.CaptureFixture[str]) -> tuple[str, str]:
    out, err = capsys.readouterr()
    return out, err


@pytest.mark.parametrize("flags", [[], ["--one-file", "r.html"], ["--output", "there"]])
def test_without_results_the_command_says_what_to_do(
    tmp_path: Path,
    flags: list[str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["report", "nowhere", *flags]) == 2
    out, err = said(capsys)
    assert out == ""
    assert err.startswith("nowhere: found no settings.json; expected the results of a finished run")
    assert err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.release
def test_results_without_a_table_are_not_those_of_a_finished_run(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    half = shutil.copytree(results, tmp_path / "half")
    (half / "tables/drift.parquet").unlink()
    assert main(["report", str(half)]) == 2
    assert "found no drift.parquet" in said(capsys)[1]


def test_report_writes_only_missing_files(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = shutil.copytree(results, tmp_path / "copy")
    assert main(["report", str(copy)]) == 0
    assert said(capsys) == (f"{copy}/report/index.html: 0 files written\n", "")
    (copy / "report/index.html").unlink()
    assert main(["report", str(copy)]) == 0
    assert said(capsys)[0] == f"{copy}/report/index.html: 1 files written\n"
    whole = (results / "report/index.html").read_bytes()
    assert (copy / "report/index.html").read_bytes() == whole


def test_a_report_elsewhere_has_the_same_pages_and_the_figures_for_print(
    results: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    drawn: list[Any] = []
    monkeypatch.setattr(static_files, "list_drawings", lambda *given: [lambda: drawn.append(given)])
    folder = tmp_path / "on the desk"
    assert main(["report", str(results), "--output", str(folder)]) == 0
    assert said(capsys)[0].startswith(f"{folder}/index.html: ")
    there = {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    here = results / "report"
    assert there == {p.relative_to(here): p.read_bytes() for p in here.rglob("*") if p.is_file()}
    ((tables, system, figures),) = drawn
    assert (system, figures.name) == ("practical", "figures")
    assert tables["parameters"].num_rows > 0


@pytest.mark.release  # long: it starts another process; every day test_publish.py compares two runs
def test_one_file_is_the_same_from_every_process(results: Path, tmp_path: Path) -> None:
    one, other = tmp_path / "one.html", tmp_path / "other.html"
    assert main(["report", str(results), "--one-file", str(one)]) == 0
    code = "import sys; from imubench_pipeline.run.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "report", str(results), "--one-file", str(other)]
    subprocess.run(command, check=True, env=os.environ | {"PYTHONHASHSEED": "7"})
    assert one.read_bytes() == other.read_bytes()


def test_all_pages_stand_in_one_file(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = tmp_path / "mail/one.html"
    assert main(["report", str(results), "--one-file", str(one)]) == 0
    out, err = said(capsys)
    assert re.fullmatch(rf"{re.escape(str(one))}: [0-9.]+ MB\n", out) and err == ""
    assert [path.name for path in one.parent.iterdir()] == ["one.html"]
    page = Read(one.read_text(encoding="utf-8"))
    assert page.faults == [] and page.external() == []
    templates = [element.attributes["id"] for element in page.elements if element.tag == "template"]
    assert "page:recordings/imu/day 1.html" in templates
    assert max(len(script.text) for script in page.scripts) > 1e6  # what draws the figures


def test_the_theory_is_drawn_and_fetches_nothing(results: Path) -> None:
    page = Read((results / "report/theory.html").read_text(encoding="utf-8"))
    (figure,) = re.findall(r"data:image/svg\+xml;base64,([^\"']+)", page.source)
    svg = base64.b64decode(figure).decode()
    assert svg.startswith("<?xml") and svg.rstrip().endswith("</svg>")
    assert re.findall(r"(?:href|src)=\"(?!#)[^\"]*\"|url\((?!#)", svg) == []
