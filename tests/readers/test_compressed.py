from __future__ import annotations

import bz2
import gzip
import io
import lzma
import re
import struct
import warnings
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from backports import zstd
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.readers import RecordingError, bounds, log_files, read
from imubench_pipeline.readers.contents import list_contents
from imubench_pipeline.recordings.drop_zone import _stem
from tests.conftest import few
from tests.readers.damage import examples
from tests.readers.text_logs import columns, log_format, written


def zipped(files: dict[str, bytes] | bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", method) as archive:
        for name, content in ({"log.csv": files} if isinstance(files, bytes) else files).items():
            archive.writestr(name, content)
    return held.getvalue()


def streamed_zip(files: dict[str, bytes]) -> bytes:
    """As phones write it: the sizes stand behind the data."""

    class Pipe(io.RawIOBase):
        def __init__(self) -> None:
            self.held = b""

        def writable(self) -> bool:
            return True

        def write(self, data: object) -> int:
            self.held += bytes(data)
            return len(bytes(data))

    pipe = Pipe()
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return pipe.held


PACKED: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "zst": zstd.compress,
    "xz": lambda text: lzma.compress(text, preset=0),
    "bz2": lambda text: bz2.compress(text, 1),
    "zip": zipped,
    "stored zip": lambda text: zipped(text, zipfile.ZIP_STORED),
    "streamed zip": lambda text: streamed_zip({"log.csv": text}),
}
STREAMS = ("gz", "zst", "xz", "bz2")
ROWS = 25_000
"""Of a log: more than a block of zstd or bzip2, with less than half of them in the last."""


@pytest.fixture(scope="module")
def text() -> bytes:
    data = np.random.default_rng(1).standard_normal((ROWS, 2))
    return ("wx,ax\n" + "".join(f"{a:.6f},{b:.6f}\n" for a, b in data)).encode()


@pytest.mark.parametrize("name", few(["log.xyz"], ["log.csv"]))
@pytest.mark.parametrize("way", PACKED)
def test_compression_is_told_by_content(tmp_path: Path, text: bytes, way: str, name: str) -> None:
    found, _, file = columns(written(tmp_path, PACKED[way](text), name), log_format())
    plain, _, _ = columns(written(tmp_path, text, "plain"), log_format())
    np.testing.assert_array_equal(found["gyro_x"], plain["gyro_x"])
    assert file.findings == []


@pytest.mark.parametrize("way", STREAMS)
def test_streams_one_after_another_are_one_log(tmp_path: Path, text: bytes, way: str) -> None:
    pack = PACKED[way]
    packed = pack(text[:1000]) + pack(b"") + pack(text[1000:])
    found, _, file = columns(written(tmp_path, packed), log_format())
    assert len(found["gyro_x"]) == ROWS
    assert file.findings == []


@pytest.mark.parametrize("way", STREAMS)
def test_zeros_may_follow_compressed_data_and_nothing_else(
    tmp_path: Path, text: bytes, way: str
) -> None:
    packed = PACKED[way](text)
    found, _, file = columns(written(tmp_path, packed + bytes(100_000)), log_format())
    assert len(found["gyro_x"]) == ROWS
    assert file.findings == []
    with pytest.raises(RecordingError, match="the compressed data are followed by other data"):
        columns(written(tmp_path, packed + text), log_format())


@pytest.mark.parametrize("kept", few([0.7, -8], [0.3]))
@pytest.mark.parametrize("way", PACKED)
def test_what_is_cut_short_is_read_as_far_as_it_goes(
    tmp_path: Path, text: bytes, way: str, kept: float
) -> None:
    packed = PACKED[way](text)
    cut = packed[: int(kept if kept < 0 else kept * len(packed))]
    found, _, file = columns(written(tmp_path, cut), log_format())
    part = 1.0 if kept < 0 else kept
    # zstd and bzip2 give whole blocks of 131072 and of about 100000 bytes.
    slack = 8000 if way in ("zst", "bz2") else 2500
    assert ROWS * part - slack < len(found["gyro_x"]) <= ROWS * part + 2500
    names = [finding.finding for finding in file.findings]
    # The end of a zip archive is its directory, without which the log may be whole.
    assert "truncated_file" in names or (kept < 0 and "zip" in way)


@pytest.mark.parametrize("way", [way for way in PACKED if way != "stored zip"])
@pytest.mark.parametrize("place", few([0.5], [60]))
def test_what_is_corrupt_inside_rejects(
    tmp_path: Path, text: bytes, way: str, place: float
) -> None:
    packed = bytearray(PACKED[way](text))
    begin = int(place if place > 1 else place * len(packed))
    packed[begin : begin + 64] = bytes(64)
    with pytest.raises(RecordingError, match=r"(a|log)\.csv"):
        columns(written(tmp_path, bytes(packed)), log_format())


@pytest.mark.parametrize(
    ("begin", "kind"),
    [
        (b"7z\xbc\xaf\x27\x1c", "7z"),
        (b"Rar!\x1a\x07\x01\x00", "rar"),
        (b"\x04\x22\x4d\x18", "lz4"),
        (b"\x1f\x9d\x90", "compress"),
    ],
)
def test_what_is_compressed_in_another_way_is_named(
    tmp_path: Path, begin: bytes, kind: str
) -> None:
    with pytest.raises(RecordingError, match=f"compressed with {kind}; expected gzip, zstd"):
        columns(written(tmp_path, begin + bytes(100)), log_format())


def two_files(unit: str = "rad/s") -> dict[str, dict[str, str]]:
    return {
        "gyro_x": {"column": "x", "unit": unit, "file": "sub/g.csv"},
        "accel_x": {"column": "x", "unit": "g", "file": "a.csv"},
    }


FILES = {
    "sub/g.csv": b"t,x\n0,1\n1,2\n",
    "a.csv": b"t,x\n0,3\n1,4\n2,5\n",
    "__MACOSX/._a.csv": b"\0\0\1",
    ".hidden": b"x",
}


@pytest.mark.parametrize("pack", [zipped, streamed_zip])
def test_an_archive_of_several_is_a_folder(
    tmp_path: Path, pack: Callable[[dict[str, bytes]], bytes]
) -> None:
    log = log_format(two_files(), time={"column": "t", "unit": "s"})
    path = written(tmp_path, pack(FILES), "r.zip")
    folder = tmp_path / "r"
    for name, content in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    assert log_files(path) == [path]
    assert log_files(folder) == [folder / "a.csv", folder / "sub/g.csv"]
    for recording in (path, folder):
        accel, gyro = read(recording, log)
        assert [file.path.name for file in (accel, gyro)] == ["a.csv", "g.csv"]
        assert [len(batch) for batch in accel.batches()] == [3]
        (batch,) = gyro.batches()
        assert batch.columns["gyro_x"].tolist() == [1.0, 2.0]
        # What stands in a sub-folder describes the log.
        (alone,) = read(recording, log_format({"gyro_x": {"column": "x", "unit": "rad/s"}}))
        assert alone.path.name == "a.csv"


def test_one_text_among_other_files_is_the_log(tmp_path: Path) -> None:
    files = {"photo.jpg": b"\xff\xd8\0\0" * 100, "log.txt": b"wx,ax\n1,2\n"}
    found, _, _ = columns(written(tmp_path, zipped(files), "r.zip"), log_format())
    assert found["gyro_x"].tolist() == [1.0]
    (tmp_path / "f").mkdir()
    found, _, _ = columns(written(tmp_path / "f", zipped(files), "r.zip").parent, log_format())
    assert found["gyro_x"].tolist() == [1.0]


def test_what_is_not_in_an_archive_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, zipped({"b.csv": b"1\n", "a.csv": b"1\n"}), "r.zip")
    with pytest.raises(RecordingError, match=r"r\.zip: no file 'sub/g\.csv' for gyro_x; the "):
        read(path, log_format(two_files()))
    with pytest.raises(RecordingError, match=r"expected one file, the archive has a\.csv, b\.csv"):
        read(path, log_format())
    with pytest.raises(RecordingError, match=r"the archive has no log"):
        read(written(tmp_path, zipped({}), "e.zip"), log_format())


def test_a_cut_archive_still_has_its_first_files(tmp_path: Path, text: bytes) -> None:
    channels = {
        "gyro_x": {"column": "wx", "unit": "rad/s", "file": "a.csv"},
        "accel_x": {"column": "ax", "unit": "g", "file": "b.csv"},
    }
    for pack in (zipped, streamed_zip):
        packed = pack({"a.csv": text, "b.csv": text, "c.csv": text})
        path = written(tmp_path, packed[: len(packed) // 2], "r.zip")
        first, second = read(path, log_format(channels))
        assert sum(map(len, first.batches())) == ROWS
        assert first.findings == []
        assert ROWS / 3 < sum(map(len, second.batches())) < ROWS * 2 / 3
        assert "truncated_file" in [finding.finding for finding in second.findings]
        channels["accel_x"]["file"] = "c.csv"
        with pytest.raises(RecordingError, match=r"no file 'c\.csv' for accel_x"):
            read(path, log_format(channels))
        channels["accel_x"]["file"] = "b.csv"


def test_an_archive_of_many_without_its_directory_is_refused(
    tmp_path: Path, text: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {f"{number}.jpg": b"\xff\xd8\0\0" for number in range(9)} | {"log.csv": text}
    packed = zipped(files).split(b"PK\1\2")[0]
    assert len(columns(written(tmp_path, packed, "r.zip"), log_format())[0]["gyro_x"]) == ROWS
    monkeypatch.setattr(bounds, "MAX_MEMBERS", 5)
    with pytest.raises(RecordingError, match=r"cut short and has more than 5 files"):
        columns(written(tmp_path, packed, "s.zip"), log_format())


def test_names_in_an_archive_lead_nowhere_else(tmp_path: Path) -> None:
    secret = written(tmp_path, "wx,ax\n7,7\n", "secret.csv")
    (tmp_path / "logs").mkdir()
    for name in (str(secret), "../secret.csv", "a/../../secret.csv", "x" * 600, "/"):
        path = written(tmp_path / "logs", zipped({name: b"wx,ax\n1,2\n"}), "r.zip")
        try:
            found, _, _ = columns(path, log_format())
        except RecordingError:
            continue
        assert found["gyro_x"].tolist() == [1.0]


def test_encrypted_and_odd_members_are_named(tmp_path: Path, text: bytes) -> None:
    packed = bytearray(zipped(text))
    at = packed.index(b"PK\1\2")
    for flag in (at + 8, 6):
        packed[flag] |= 1
    with pytest.raises(RecordingError, match=r"is encrypted; unpack the archive with its passw"):
        columns(written(tmp_path, bytes(packed), "r.zip"), log_format())
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        with pytest.raises(RecordingError, match=r"is packed by method \d+"):
            columns(written(tmp_path, zipped(text[:1000], method), "r.zip"), log_format())


@pytest.mark.parametrize("way", ["gz", "zst", "xz", "bz2", "zip"])
def test_bombs_are_stopped(tmp_path: Path, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounds, "MIN_CHECKED_EXPANSION", 1 << 22)
    path = written(tmp_path, PACKED[way](b"wx,ax\n1,2\n" + bytes(8 << 20)), "r.csv")
    with pytest.raises(RecordingError, match=r"expands to more than 800 times its size"):
        columns(path, log_format())


@pytest.mark.parametrize("way", PACKED)
@examples(40)
@given(data=st.data())
def test_nothing_but_a_recording_error_comes_of_damage(
    tmp_path: Path, way: str, data: st.DataObject
) -> None:
    text = b"wx,ax\n" + b"".join(b"%d,%d\n" % (n, n * n % 97) for n in range(300))
    packed = bytearray(PACKED[way](text))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(packed) - 1))
        change = data.draw(st.sampled_from(["set", "cut", "add", "drop"]))
        if change == "set":
            packed[at] = data.draw(st.integers(0, 255))
        elif change == "cut":
            del packed[at + 1 :]
        elif change == "add":
            packed[at:at] = data.draw(st.binary(max_size=40))
        elif len(packed) > 1:
            del packed[at]
    with suppress(RecordingError):
        columns(written(tmp_path, bytes(packed)), log_format(reader="csv"))


def test_sizes_of_a_lying_directory(tmp_path: Path, text: bytes) -> None:
    packed = bytearray(zipped(text))
    at = packed.index(b"PK\1\2") + 24
    struct.pack_into("<I", packed, at, 0x7FFFFFFF)
    found, _, _ = columns(written(tmp_path, bytes(packed), "r.zip"), log_format())
    assert len(found["gyro_x"]) == ROWS
    struct.pack_into("<I", packed, at, 10_000)
    with pytest.raises(RecordingError, match=r"r\.zip/log\.csv: corrupt compressed data"):
        columns(written(tmp_path, bytes(packed), "r.zip"), log_format())


@pytest.mark.parametrize("suffix", [".gz", ".zst", ".xz", ".bz2", ".zip", ".ZIP"])
def test_a_recording_has_the_name_of_its_file_without_suffixes(suffix: str) -> None:
    assert _stem(Path(f"day1.csv{suffix}")) == "day1"
    assert _stem(Path(f"day1{suffix}")) == "day1"


def archive_of(path: Path, members: list[tuple[str, bytes]], end: bool = True) -> Path:
    with zipfile.ZipFile(path, "w") as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a name stands twice
        for name, data in members:
            archive.writestr(name, data)
    if not end:
        data = path.read_bytes()
        path.write_bytes(data[: data.index(b"PK\x01\x02")])
    return path


@pytest.mark.parametrize("end", [True, False])
@pytest.mark.parametrize("second", ["imu.csv", "./imu.csv", "/imu.csv"])
@pytest.mark.parametrize("stated", [{}, {"file": "imu.csv"}])
def test_two_members_of_one_name_are_refused(
    tmp_path: Path, second: str, stated: dict[str, str], end: bool
) -> None:
    one, two = b"wx,ax\n1,2\n3,4\n", b"wx,ax\n5,6\n"
    path = archive_of(tmp_path / "a.zip", [("imu.csv", one), (second, two)], end)
    channels = {"gyro_x": {"column": "wx", "unit": "rad/s"} | stated}
    place = 30 + len("imu.csv") + len(one)
    said = (
        rf"^a\.zip: imu\.csv \({len(one)} bytes, at byte 0\) and {re.escape(second)} "
        rf"\({len(two)} bytes, at byte {place}\) have the same name; expected each name once"
    )
    with pytest.raises(RecordingError, match=said):
        columns(path, log_format(channels))
    with pytest.raises(RecordingError, match=said):
        list_contents(path)


@pytest.mark.parametrize("folder", [False, True])
def test_a_name_is_found_however_its_accents_are_kept(tmp_path: Path, folder: bool) -> None:
    text = b"wx,ax\n1,2\n3,4\n"
    apart, composed = "cafe\u0301.csv", "caf\u00e9.csv"
    channels = {"gyro_x": {"column": "wx", "unit": "rad/s", "file": composed}}

    def made(names: list[str]) -> Path:
        if not folder:
            return archive_of(tmp_path / "a.zip", [(name, text) for name in names])
        (tmp_path / "a").mkdir(exist_ok=True)
        for name in names:
            (tmp_path / "a" / name).write_bytes(text)
        return tmp_path / "a"

    found, _, _ = columns(made([apart, "b.csv"]), log_format(channels))
    assert found["gyro_x"].tolist() == [1, 3]
    with pytest.raises(RecordingError, match=r"2 files .* for gyro_x; the folder has"):
        columns(made([apart, composed]), log_format(channels))
