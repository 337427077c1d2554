"""Files of strangers that once ended a run for all: each is one recording's fault."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pytest
import yaml

from imubench_pipeline.readers import bounds, log_files
from imubench_pipeline.readers.arrays import file as arrays
from imubench_pipeline.recordings.drop_zone import account_for, find_logs
from imubench_pipeline.report.run_summary import describe_drop_zone
from imubench_pipeline.run.checking import check
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.sensor import RecordingNotes, Sensor
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.settings.yaml_files import read_yaml
from imubench_pipeline.tables.files import write
from tests.workflow.project import put_log, put_sensor

STAMPED = {
    "time": {"column": "t", "unit": "s"},
    "channels": {"gyro_x": {"column": "wx", "unit": "rad/s"}},
}


def plan_of(folder: Path) -> Plan:
    put_sensor(folder / "sensors/one.yaml")
    put_sensor(folder / "sensors/two.yaml", log=STAMPED)
    put_log(folder / "logs/one/good.csv", 1, samples=2000)
    return Plan({"logs": str(folder / "logs"), "sensors": str(folder / "sensors"),
                 "results": str(folder / "results"), "simulated": None})  # fmt: skip


def test_a_figure_that_takes_the_square_of_its_length_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.yaml").write_text("log: {rate: 0x" + "f" * 5000 + "}")
    begin = time.process_time()
    with pytest.raises(ConfigError, match="of 5002 characters; expected at most 100") as caught:
        read_yaml(tmp_path / "notes.yaml")
    assert time.process_time() - begin < 10.0
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    "make",
    [
        lambda: {"start": ":".join(["59"] * 600_000)},  # of base 60
        lambda: {f"{i * (2**61 - 1)}": "x" for i in range(1, 40_000)},  # numbers of one hash
    ],
)
def test_what_would_take_the_square_as_a_number_is_a_text(
    tmp_path: Path, make: Callable[[], dict[str, str]]
) -> None:
    texts = make()
    written = ",".join(f"{key}: {value}" for key, value in texts.items())
    (tmp_path / "notes.yaml").write_text(f"log: {{{written}}}")
    begin = time.process_time()
    assert read_yaml(tmp_path / "notes.yaml") == {"log": texts}
    assert time.process_time() - begin < 10.0


@pytest.mark.parametrize(
    "name", ["0" * 26, "abc" * 30, "".join(chr(0x4E00 + i) for i in range(80))]
)
def test_a_name_that_a_run_cannot_bear_is_rejected_under_another(tmp_path: Path, name: str) -> None:
    put_log(tmp_path / f"logs/one/{name}.csv", 1, samples=10)
    (log,) = find_logs(tmp_path / "logs")
    assert log.error is not None and "rename the file" in log.error
    assert len(log.name.encode()) <= 160 and log.name != name


def test_a_file_of_no_text_for_a_name_is_rejected(tmp_path: Path) -> None:
    folder = tmp_path / "logs/one/run"
    folder.mkdir(parents=True)
    Path(f"{folder}/a\udcff.csv").write_text("1\n")
    (log,) = find_logs(tmp_path / "logs")
    assert log.error is not None and "a\\udcff.csv" in log.error


@pytest.mark.parametrize("target", [".", "..", "../.."])
def test_a_link_to_a_folder_that_it_lies_in_is_one_rejected_file(
    tmp_path: Path, target: str
) -> None:
    logs = tmp_path / "logs"
    for path in ("s/a.csv", "s/run/b.csv"):
        put_log(logs / path, 1, samples=10)
    (logs / "s/loop").symlink_to(target)
    found = {log.name: log for log in find_logs(logs)}
    assert found.keys() == {"a", "run", "loop"}
    assert "links to one of its parent folders" in (found["loop"].error or "")
    files = {file.file: file.recording for file in account_for(logs, found.values())}
    assert files == {"s/a.csv": "a", "s/run/b.csv": "run", "s/loop": "loop"}


def test_odd_files_are_not_taken_for_changed(tmp_path: Path) -> None:
    logs, results = tmp_path / "logs", tmp_path / "results"
    for name in ("tab\t.csv", "line\nend.csv", "a.csv"):
        put_log(logs / "s" / name, 1, samples=10)
    os.mkfifo(logs / "s/pipe.csv")
    (logs / "s/loop").symlink_to(".")
    found = account_for(logs, find_logs(logs))
    rows = [{"file": file.file, "status": "rejected"} for file in found]
    write("files", rows, results / "tables/files.parquet")
    (results / "report").mkdir()
    told = {"results": str(results), "logs": str(logs)}
    (results / "report/settings.json").write_text(json.dumps(told))
    assert describe_drop_zone(results) == ["5 files in the drop zone = 5 rejected"]


def test_two_logs_of_one_name_are_both_rejected_and_no_other(tmp_path: Path) -> None:
    for ending in ("csv", "txt"):
        put_log(tmp_path / f"logs/one/twice.{ending}", 1, samples=10)
    recordings = plan_of(tmp_path).recordings
    rejected = {name: log.error for (_, name), log in recordings.items() if log.error}
    assert rejected.keys() == {"twice", "twice (2)"}
    assert all("would both be the recording one/twice" in error for error in rejected.values())
    assert recordings["one", "good"].error is None


SAMPLES = 5000
STAMPS = {
    "denormal": np.arange(SAMPLES) * 5e-324,
    "beyond the age of the world": np.arange(SAMPLES) * 1e303,
    "a hole of 3e9 samples": np.arange(SAMPLES) * 1e-6
    + 3000.0 * (np.arange(SAMPLES) > SAMPLES // 2),
}
RATES = {"too fast": "1e300 Hz", "too slow": "1e-300 Hz"}


def nulls(path: Path) -> None:
    """394 bytes that say that they hold 67 million samples."""
    table = pa.table({"ax": pa.nulls(1 << 26), "wx": pa.nulls(1 << 26)})
    with pa.ipc.new_file(path, table.schema) as writer:
        writer.write_table(table)


def empty_chunks(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["t"] = np.arange(20_000.0)
        file.create_dataset("wx", data=np.arange(20_000.0), chunks=(1,))


def zeros(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name in ("t", "wx"):
            file.create_dataset(name, (60_000_000,), "i4", chunks=(1 << 22,), compression=9)
            packed = file[name]
            packed[: 1 << 22] = 1
            _, chunk = packed.id.read_direct_chunk((0,))
            for place in range(1 << 22, 60_000_000, 1 << 22):
                packed.id.write_direct_chunk((place,), chunk)


ROOMLESS: dict[str, tuple[Callable[[Path], None], str, str]] = {
    "nulls": (nulls, "one/nulls.arrow", "expected at most 800 times"),
    "chunks": (empty_chunks, "two/chunks.h5", "has 20000 chunks"),
    "zeros": (zeros, "two/zeros.h5", "expected at most 800 times"),
}
DEAD = "a dead channel"


def put_stamped(path: Path, stamps: Iterable[str], figures: Iterable[str]) -> None:
    rows = (f"{t},{w}\n" for t, w in zip(stamps, figures, strict=True))
    path.write_text("t,wx\n" + "".join(rows))


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """Return what is said of each recording, where all of these stand beside a good one."""
    folder = tmp_path_factory.mktemp("strangers")
    logs = folder / "logs"
    for sensor in ("one", "two"):
        (logs / sensor).mkdir(parents=True)
    noise = np.random.default_rng(1).standard_normal(SAMPLES)
    for name, stamps in STAMPS.items():
        figures = (f"{w:.5f}" for w in noise)
        put_stamped(logs / f"two/{name}.csv", map(repr, stamps.tolist()), figures)
    stamps = (f"{0.01 * i:.2f}" for i in range(SAMPLES))
    put_stamped(logs / f"two/{DEAD}.csv", stamps, map(repr, (noise * 1e-310).tolist()))
    for name, rate in RATES.items():
        put_log(logs / f"one/{name}.csv", 1, samples=10)
        (logs / f"one/{name}.yaml").write_text(yaml.safe_dump({"log": {"rate": rate}}))
    for make, log, _ in ROOMLESS.values():
        make(logs / log)
        assert log_files(logs / log)
    begin = time.process_time()
    with pytest.MonkeyPatch.context() as patch:
        # An eighth of what is allowed, so that less is read before it is refused.
        patch.setattr(arrays, "MIN_CHECKED_EXPANSION", arrays.MIN_CHECKED_EXPANSION // 8)
        patch.setattr(bounds, "MAX_CHUNKS", bounds.MAX_CHUNKS // 8)
        found = {name: quality.recording for _, name, quality in check(plan_of(folder))}
    assert time.process_time() - begin < 10.0
    return found


@pytest.mark.release
def test_a_good_recording_beside_them_is_read(said: dict[str, dict[str, Any]]) -> None:
    assert said["good"]["status"] == "ok"
    assert all(about["status"] == "rejected" for name, about in said.items() if name != "good")


@pytest.mark.parametrize("name", STAMPS)
def test_stamps_of_no_clock_are_rejected_with_their_reason(
    said: dict[str, dict[str, Any]], name: str
) -> None:
    assert "'unit' of 'time'" in said[name]["reason"]


def test_channel_with_underflowing_squares_is_rejected_as_constant(
    said: dict[str, dict[str, Any]],
) -> None:
    assert "gyro x never changes" in said[DEAD]["reason"]


@pytest.mark.parametrize("name", RATES)
def test_a_rate_of_no_sensor_is_refused(said: dict[str, dict[str, Any]], name: str) -> None:
    assert "expected 1e-06 to 1e+09 Hz" in said[name]["reason"]


@pytest.mark.parametrize("name", ROOMLESS)
def test_rows_that_take_no_room_are_no_log(said: dict[str, dict[str, Any]], name: str) -> None:
    assert ROOMLESS[name][2] in said[name]["reason"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("b\x1b[2J", r"holds the invisible character U\+001B"),
        ("b\u202e", r"holds the invisible character U\+202E"),
        ("b" * 1001, "1001 characters; expected at most 1000"),
    ],
)
def test_a_text_that_cannot_stand_on_a_page_is_refused(
    tmp_path: Path, text: str, reason: str
) -> None:
    sensor = {"vendor": "A", "model": "B", "log": STAMPED}
    parse(RecordingNotes, {"device": "b" * 1000}, "notes")
    with pytest.raises(ConfigError, match=f"notes: device: .*{reason}"):
        parse(RecordingNotes, {"device": text}, "notes")
    for key in ("vendor", "model", "price_class", "interface"):
        with pytest.raises(ConfigError, match=f"sensor: {key}: .*{reason}") as caught:
            parse(Sensor, sensor | {key: text}, "sensor")
        assert str(caught.value).isprintable() and len(str(caught.value)) < 300
