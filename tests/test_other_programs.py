"""Every example of docs/how-to/other_programs.md finds the same numbers and meanings."""

import csv
import json
import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.tables.datapackage import describe_tables
from imubench_pipeline.tables.files import write_arrow, write_json
from imubench_pipeline.tables.schemas import TABLES
from tests.conftest import PROJECT
from tests.report.tables import joined, recording_rows

pytestmark = pytest.mark.release

PAGE = (PROJECT / "docs/how-to/other_programs.md").read_text(encoding="utf-8")


def example(language: str, number: int = 0) -> str:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)[number]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    channels = ("gyro_x", "accel_z")
    tables = joined(*(recording_rows(of, "day 1", channels) for of in ("imu", "other")))
    for name, table in tables.items():
        for kind in ("parquet", "csv"):
            write_arrow(table, tmp_path / f"results/tables/{name}.{kind}")
    write_json(describe_tables({}), tmp_path / "results/tables/datapackage.json")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(params=["file", "folder"])
def parted(folder: Path, request: pytest.FixtureRequest) -> Path:
    """The same, and with parts of the parameters in place of one file."""
    path = folder / "results/tables/parameters.parquet"
    if request.param == "folder":
        table = pq.read_table(path)
        path.unlink()
        for sensor in ("imu", "other"):
            part = table.filter(pc.field("sensor") == sensor)
            write_arrow(part, path / f"{sensor}.parquet")
    return folder


NOISE = ("sensor", "recording", "channel", "value", "lower", "upper", "unit")


def check(folder: Path, noise: Sequence[Any], columns: Sequence[Any]) -> None:
    """Compare with the CSV, as Python reads it, and with the declarations of the columns."""
    with (folder / "results/tables/parameters.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["recommended"] == "true"]
    expected = sorted([row[name] for name in NOISE] for row in rows if row["parameter"] == "N")
    assert len(expected) == 4
    found = sorted([str(cell) for cell in row[:7]] for row in noise)
    for one, other in zip(found, expected, strict=True):
        assert one[:3] + one[6:] == other[:3] + other[6:]
        assert [float(x) for x in one[3:6]] == pytest.approx(
            [float(x) for x in other[3:6]], rel=1e-4
        )
    meanings = [(one.name, one.unit, one.meaning) for one in TABLES["parameters"]]
    assert [tuple(row) for row in columns] == meanings


def test_duckdb(parted: Path) -> None:
    duckdb = pytest.importorskip("duckdb", reason="pip install duckdb; some 20 MB")
    noise, columns = (duckdb.sql(example("sql", number)).fetchall() for number in (0, 1))
    check(parted, noise, columns)


def test_polars(parted: Path) -> None:
    pytest.importorskip("polars", reason="pip install polars; some 40 MB")
    found: dict[str, Any] = {}
    exec(example("python"), found)
    check(parted, found["noise"].rows(), found["columns"].rows())


def run(folder: Path, program: str, script: str) -> str:
    if shutil.which(program) is None:
        pytest.skip(f"needs {program}: r-base-core and r-cran-jsonlite, or octave and octave-io")
    (folder / "script").write_text(script)
    done = subprocess.run(
        [program, "script"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_r(folder: Path) -> None:
    end = 'cat("<<", jsonlite::toJSON(list(noise, columns), "values", digits = 12), ">>")'
    text = run(folder, "Rscript", f"{example('r')}\n{end}\n")
    noise, columns = json.loads(text.partition("<<")[2].partition(">>")[0])
    check(folder, noise, columns)


def test_octave(folder: Path) -> None:
    rows = "arrayfun(@(k) noise(k, :), 2:rows(noise), 'UniformOutput', false)"
    end = f'printf("<<%s>>", jsonencode({rows}));'
    text = run(folder, "octave-cli", f"{example('octave')}\n{end}\n")
    columns = [line.split("\t") for line in text.splitlines() if line.count("\t") == 2]
    check(folder, json.loads(text.partition("<<")[2].partition(">>")[0]), columns)
