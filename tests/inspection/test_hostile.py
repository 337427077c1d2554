"""Whatever a file holds: a draft, or a reason; in bounded time and memory."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.contents import list_contents
from imubench_pipeline.readers.inspection import inspect
from tests.conftest import few
from tests.formats import test_rosbag, test_ubx
from tests.inspection.drafts import (
    NAMED,
    WRITERS,
    Columns,
    hdf5,
    logged,
    read_as_drafted,
    saved,
    sensor_of,
    text,
    three,
)
from tests.readers.array_files import damages as array_damages
from tests.readers.damage import examples
from tests.readers.test_text_hostile import FILES, LIKE


def survives(path: Path) -> None:
    """Inspect, or refuse with a reason; whatever is printed is YAML, and harmless."""
    try:
        found = inspect(path)
    except RecordingError as error:
        assert str(error)
        return
    data = yaml.safe_load(found.block)
    assert set(data) == {"vendor", "model", "log", "datasheet"}
    shown = found.listing + found.block + found.proof.said
    assert all(sign.isprintable() or sign == "\n" for sign in shown)
    assert len(shown) < 100_000
    if found.complete:
        read_as_drafted(path, sensor_of(found))


@pytest.mark.parametrize("name", ["nothing", "a folder", "an empty folder", "binary"])
def test_what_is_no_log_is_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "a"
    if name == "a folder":
        path.mkdir()
        (path / "picture.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
        (path / "notes").write_text("hello\n")
    elif name == "an empty folder":
        path.mkdir()
    elif name == "binary":
        path.write_bytes(np.random.default_rng(1).bytes(100_000))
    with pytest.raises(RecordingError):
        inspect(path)


@pytest.mark.release
def test_a_thousand_columns_are_looked_at_whatever_they_hold(tmp_path: Path) -> None:
    # Each of dates takes 3 ms, as its pattern is looked for.
    names = ["wx", "ax", *(f"n{place}" for place in range(8000))]
    path = saved(tmp_path, ",".join(names) + "\n" + ("1.5,2" + ",3" * 8000 + "\n") * 3)
    (table,) = list_contents(path).tables
    assert len(table.columns) == 1000


@pytest.mark.parametrize(
    "names", few([sorted(FILES.keys() - LIKE)], [sorted(LIKE)]), ids=["most", "the like"]
)
def test_hostile_texts(tmp_path: Path, names: list[str]) -> None:
    for name in names:
        path = saved(tmp_path, FILES[name](), name)
        begin = time.process_time()
        survives(path)
        assert time.process_time() - begin < 12, name


HOSTILE_NAMES = [
    *("gyro_x\x1b[31m", "gyro_y\u2028", "gyro_z\u202e", "gyro_x\xa0", "\N{GRINNING FACE}"),
    *("9**9**9**9**9", "gyro_x (9**9**9**9)", "gyro_x [rad/s^999999999]", "gyro_x (1/0)"),
    *("[rad/s]" * 50, "gyro_x (" * 20, "_" * 5000, "time " * 3000, "a" * 100_000, "gyro_y"),
    *("?", "- x", "!!python/object:os.system", "null", "~"),
]


def test_hostile_names(tmp_path: Path) -> None:
    rows = np.random.default_rng(3).standard_normal((len(HOSTILE_NAMES), 20)).tolist()
    path = saved(tmp_path, text(HOSTILE_NAMES, rows))
    begin = time.process_time()
    survives(path)
    assert time.process_time() - begin < 12
    pq.write_table(pa.table(rows, names=HOSTILE_NAMES), tmp_path / "b")
    survives(tmp_path / "b")
    pq.write_table(
        pa.table(rows[:3], names=["gyro_x\n- z", "gyro_y\t\x85", "gyro_z\0"]), tmp_path / "c"
    )
    survives(tmp_path / "c")


@given(st.text(max_size=60))
@examples(150)
def test_any_name(name: str) -> None:
    from imubench_pipeline.readers.inspection.names import interpret_label
    from imubench_pipeline.readers.stated_units import split_unit

    interpret_label(name)
    for dimension in ("time", "angular_rate", "acceleration", "temperature"):
        split_unit(name, dimension)


def test_cut_and_damaged_files(tmp_path: Path, si: Columns) -> None:
    held = {"t": si["time"], "gyro": three(si, "gyro"), "acc": three(si, "accel")}
    paths = []
    for kind, write in WRITERS.items():
        write(tmp_path / kind, held)
        paths.append(tmp_path / kind)
    rows = test_rosbag.figures(50)
    for kind in ("ros1", "sqlite-file", "mcap"):
        (tmp_path / f"bag-{kind}").mkdir()
        bag = test_rosbag.bag(
            tmp_path / f"bag-{kind}", kind, {"/imu": test_rosbag.imu_topic(kind, rows)}
        )
        paths += [p for p in [bag, *bag.glob("*.db3"), *bag.glob("*.mcap")] if p.is_file()]
    paths.append(saved(tmp_path, test_ubx.PUBLISHED * 5, "ubx"))
    for path in paths:
        whole = path.read_bytes()
        for cut in np.linspace(0, len(whole) - 1, 12, dtype=int):
            survives(saved(tmp_path, whole[:cut], "cut"))


@given(array_damages)
@examples(60)
def test_damaged_hdf5(tmp_path_factory: pytest.TempPathFactory, damage: Any) -> None:
    folder = tmp_path_factory.mktemp("damaged")
    rows = np.arange(120.0).reshape(40, 3)
    hdf5(folder / "whole", {"t": np.arange(40.0), "gyro": rows})
    with h5py.File(folder / "whole", "r+") as file:
        file["gyro"].attrs["units"] = np.bytes_("deg/s")
    survives(saved(folder, damage((folder / "whole").read_bytes()), "a"))


def most_kb() -> int:
    """Return the most memory that this process had."""
    return int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])


@pytest.mark.release
def test_a_long_log_is_not_read_to_its_end(tmp_path: Path, si: Columns) -> None:
    names, scales = NAMED["an x-io logger"]
    lines = logged(si, names, scales).encode()
    head, _, body = lines.partition(b"\n")
    path = tmp_path / "long.csv"
    with path.open("wb") as file:
        file.write(head + b"\n")
        for _ in range(400_000_000 // len(body)):
            file.write(body)
    Path("/proc/self/clear_refs").write_text("5")  # the peak is counted from now on
    before, begin = most_kb(), time.process_time()
    inspect(path)
    assert time.process_time() - begin < 15
    assert most_kb() - before < 300_000


def test_a_zip_of_many_files_is_bounded(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for number in range(500):
            archive.writestr(f"{number:03d}.csv", "t,wx\n0,1\n1,2\n2,3\n")
    found = inspect(tmp_path / "a.zip")
    assert "of 500 files" in found.listing and found.listing.count("\n") < 300
