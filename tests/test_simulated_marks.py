"""A simulated log is one wherever it lies, and decides nothing beside measured logs."""

import gzip
import shutil
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import yaml

import imubench_pipeline as imu
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.readers import read
from imubench_pipeline.readers.text.header import SIMULATED
from imubench_pipeline.recordings.fitness import doubt_simulated_recordings, judge_recordings
from imubench_pipeline.run.cli import main
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.steps.tables import join_all_tables
from imubench_pipeline.tables.files import build, write_arrow
from tests.workflow.project import put_sensor

CHANNELS = {"gyro_x": {"column": "gyro_x", "unit": "rad/s"}}
SENSOR = {"vendor": "V", "model": "M", "log": {"rate": "100 Hz", "channels": CHANNELS}}
MARK = "# SIMULATED by imubench, not measured"
ROWS = "gyro_x\n" + "".join(f"{0.001 * (k % 7)}\n" for k in range(2000))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the same simulated log as text and as Parquet, and notes of each."""
    folder = tmp_path_factory.mktemp("made")
    put_sensor(folder / "sensors/two.yaml", log=SENSOR["log"])
    for name in ("text.csv", "table.parquet"):
        command = ["simulate", "two", "--sensors", str(folder / "sensors"), "--duration", "60 s"]
        assert main([*command, "--out", str(folder / name)]) == 0
    return folder


def as_it_is(path: Path, folder: Path) -> Path:
    return shutil.copy(path, folder)


def gzipped(path: Path, folder: Path) -> Path:
    copy = folder / f"{path.name}.gz"
    copy.write_bytes(gzip.compress(path.read_bytes()))
    return copy


def zipped(path: Path, folder: Path) -> Path:
    copy = folder / "log.zip"
    with zipfile.ZipFile(copy, "w") as archive:
        archive.write(path, "inside/gyro.csv")
    return copy


def of_a_spreadsheet(path: Path, folder: Path) -> Path:
    copy = folder / "saved.csv"
    first, *rest = path.read_text().splitlines()
    copy.write_text("\n".join([f'"{first}",,', *rest]) + "\n")
    return copy


@pytest.mark.parametrize(
    ("name", "altered"),
    [
        ("text.csv", as_it_is),
        ("text.csv", gzipped),
        ("text.csv", zipped),
        ("text.csv", of_a_spreadsheet),
        ("table.parquet", as_it_is),
    ],
)
def test_the_mark_is_found_whatever_holds_the_log(
    made: Path, tmp_path: Path, name: str, altered: Callable[[Path, Path], Path]
) -> None:
    log = imu.read_log(altered(made / name, tmp_path), SENSOR)
    assert log.simulated and "(simulated)" in repr(log)


def test_the_mark_is_found_in_one_file_of_a_folder(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "x.csv").write_text(ROWS)
    (folder / "y.csv").write_text(f"{MARK}\n{ROWS}")
    axes = {f"gyro_{a}": CHANNELS["gyro_x"] | {"file": f"{a}.csv"} for a in "xy"}
    assert imu.read_log(folder, {"rate": "100 Hz", "channels": axes}).simulated
    (folder / "y.csv").write_text(ROWS)
    assert not imu.read_log(folder, {"rate": "100 Hz", "channels": axes}).simulated


@pytest.mark.parametrize(
    "line",
    [
        "# simulated",
        "# simulated by imubench, not measured",
        f"{MARK}: temperature",
        "# gyro " + MARK,
    ],
)
def test_words_of_somebody_else_are_no_mark(tmp_path: Path, line: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"{line}\n{ROWS}")
    assert not imu.read_log(path, SENSOR).simulated


def test_a_table_that_was_written_again_has_the_notes(made: Path, tmp_path: Path) -> None:
    again = tmp_path / "table.parquet"
    pd.read_parquet(made / "table.parquet").to_parquet(again)
    assert not imu.read_log(again, SENSOR).simulated
    shutil.copy(made / "table.yaml", tmp_path)
    assert imu.read_log(again, SENSOR).simulated


@pytest.mark.parametrize(("stated", "found"), [(True, []), (False, ["simulated_by_mark"])])
def test_notes_do_not_overrule_the_mark(tmp_path: Path, stated: bool, found: list[str]) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"{MARK}\n{ROWS}")
    path.with_suffix(".yaml").write_text(yaml.safe_dump({"simulated": stated}))
    log = imu.read_log(path, SENSOR)
    assert log.simulated
    assert [f.finding for f in log.findings if f.finding == "simulated_by_mark"] == found
    path.write_text(ROWS)
    assert imu.read_log(path, SENSOR).simulated is stated


def row(sensor: str, recording: str, *, simulated: bool, status: str = "ok") -> RecordingRow:
    return RecordingRow(
        sensor=sensor,
        recording=recording,
        device=recording,
        kind="static",
        simulated=simulated,
        status=status,
    )


def joined(folder: Path, *rows: RecordingRow) -> dict[str, dict[str, Any]]:
    """Return the recordings of all sensors by name, each sensor judged by itself before."""
    parts: dict[str, list[Path]] = {"recordings": [], "doubts": [], "findings": []}
    for sensor in sorted({row.sensor for row in rows}):
        own = [row for row in rows if row.sensor == sensor]
        doubts = list(doubt_simulated_recordings(own))
        own_tables: dict[str, Sequence[TableRow]] = {
            "recordings": judge_recordings(own, doubts, ["one/sim", "two/sim"]),
            "doubts": doubts,
            "findings": [],
        }
        for name, of_sensor in own_tables.items():
            path = folder / f"{sensor}.{name}.parquet"
            write_arrow(build(name, of_sensor), path)
            parts[name].append(path)
    tables = join_all_tables(parts)
    doubted = {(d["sensor"], d["recording"]) for d in tables["doubts"].to_pylist()}
    recordings = tables["recordings"].to_pylist()
    assert doubted == {(r["sensor"], r["recording"]) for r in recordings if r["doubts"]}
    return {f"{row['sensor']}/{row['recording']}": row for row in recordings}


def test_simulated_recordings_decide_where_no_measured_one_is_analysed(tmp_path: Path) -> None:
    rows = row("one", "sim", simulated=True), row("two", "sim", simulated=True)
    rejected = row("three", "real", simulated=False, status="rejected")
    decide = {name: about["decides"] for name, about in joined(tmp_path, *rows, rejected).items()}
    assert decide == {"one/sim": True, "two/sim": True, "three/real": False}


def test_a_measured_recording_of_any_sensor_leaves_out_simulated_ones(tmp_path: Path) -> None:
    rows = row("one", "sim", simulated=True), row("two", "sim", simulated=True)
    found = joined(tmp_path, *rows, row("two", "real", simulated=False))
    assert {name: about["decides"] for name, about in found.items()} == {
        "one/sim": False,
        "two/sim": False,
        "two/real": True,
    }
    for name in ("one/sim", "two/sim"):
        assert found[name]["doubts"] == [
            {"recording": "sim", "code": "simulated_beside_measured", "channels": []}
        ]
        assert found[name]["fitness"] == "unfit"


GYRO = {"column": "gx", "unit": "rad/s"}


@pytest.mark.parametrize("skipped", [1, 3])
def test_the_mark_is_found_among_lines_that_are_skipped(skipped: int, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"# {SIMULATED}\n" + "#\n" * (skipped - 1) + "gx\n" + "1\n2\n" * 20)
    log = LogFormat.model_validate(
        {"rate": "10 Hz", "skip_lines": skipped, "channels": {"gyro_x": GYRO}}
    )
    (file,) = read(path, log)
    assert sum(map(len, file.batches())) == 40
    assert file.simulated
