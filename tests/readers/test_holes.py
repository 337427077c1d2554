"""Zeros that are no part of a log are counted; holes of sparse files are not read."""

from __future__ import annotations

import gzip
import lzma
import os
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.holes import ZeroRuns, find_next_data
from tests.readers.text_logs import columns, log_format, written

TERABYTES = 2 << 40


def sparse(path: Path, size: int, **parts: bytes) -> Path:
    """Write parts at their places, ``at_<offset>``, into a file that is else one hole."""
    path.touch()
    os.truncate(path, size)
    with path.open("r+b") as file:
        for place, part in parts.items():
            file.seek(int(place.removeprefix("at_")))
            file.write(part)
    return path


@pytest.fixture(autouse=True)
def has_holes(tmp_path: Path) -> None:
    with sparse(tmp_path / "probe", 1 << 20).open("rb") as probe:
        if find_next_data(probe.fileno(), 0) is not None:
            # Holes need a file system with sparse files.
            pytest.skip("this file system stores every zero")


RECORDS = b"wx,ax\n1,2\n3,4\n5,6\n"


def note_of_zeros(path: Path, rows: int) -> tuple[str, float, str]:
    found, _, file = columns(path, log_format())
    assert len(found["gyro_x"]) == rows
    (note,) = [finding for finding in file.findings if finding.finding == "zero_bytes"]
    return note.severity, note.value, note.detail


@pytest.mark.parametrize("behind", [b"", b"7,8"])
@pytest.mark.parametrize("count", [1, 5000, 3 << 30, TERABYTES])
def test_zeros_behind_a_text_are_counted(tmp_path: Path, behind: bytes, count: int) -> None:
    text = RECORDS + behind
    path = sparse(tmp_path / "a.csv", len(text) + count, at_0=text)
    severity, value, detail = note_of_zeros(path, 3)
    assert (severity, value) == ("note", count)
    assert f"{count} zero byte" in detail and "from line 5 to the end of the file" in detail


def test_zeros_of_letters_of_two_bytes_are_counted_in_bytes(tmp_path: Path) -> None:
    text = RECORDS.decode().encode("utf-16") + bytes(1000)
    assert note_of_zeros(written(tmp_path, text), 3)[1] == 1000


@pytest.mark.parametrize("before", [0, 7, 70_000])
@pytest.mark.parametrize(
    ("middle", "rows", "lost"),
    [
        (b"%s7,8\n", 4, "the text of 1 line that has them"),  # 7 may be the end of 17
        (b"7,%s8\n", 4, "the text of 1 line that has them"),
        (b"%s\n", 4, ""),
        (b"7%swx,ax\n", 4, ""),
    ],
)
def test_zeros_in_the_middle_of_a_text_are_counted(
    tmp_path: Path, before: int, middle: bytes, rows: int, lost: str
) -> None:
    zeros = bytes(40_000)
    text = RECORDS + b"1,2\n" * before + middle % zeros + b"9,10\n"
    severity, value, detail = note_of_zeros(written(tmp_path, text), rows + before)
    assert (severity, value) == ("warning", len(zeros))
    assert f"in line {5 + before};" in detail
    assert (lost in detail) if lost else ("text of" not in detail)
    assert ("shifted in time" in detail) == bool(lost)


def test_a_long_hole_in_the_middle_is_passed_over(tmp_path: Path) -> None:
    parts = {"at_0": RECORDS, f"at_{1 << 40}": b"\n7,8\n"}
    path = sparse(tmp_path / "a.csv", (1 << 40) + 5, **parts)
    assert note_of_zeros(path, 4)[:2] == ("warning", (1 << 40) - len(RECORDS))


@pytest.mark.parametrize("ways", [gzip.compress, lzma.compress])
def test_a_hole_behind_compressed_data_ends_them(
    tmp_path: Path, ways: Callable[[bytes], bytes]
) -> None:
    packed = ways(RECORDS)
    found, _, _ = columns(sparse(tmp_path / "a", TERABYTES, at_0=packed), log_format())
    assert len(found["gyro_x"]) == 3


@pytest.mark.parametrize("reader", [None, "csv", "vectornav", "ubx"])
def test_a_file_that_is_one_hole_is_rejected_at_once(tmp_path: Path, reader: str | None) -> None:
    path = sparse(tmp_path / "a", TERABYTES)
    with pytest.raises(RecordingError) as raised:
        columns(path, log_format({"gyro_x": {"column": "gyro_x", "unit": "rad/s"}}, reader=reader))
    assert "empty" not in str(raised.value)
    assert reader not in (None, "csv") or "has zero bytes and no text" in str(raised.value)


@pytest.mark.parametrize("least", [1, 3])
def test_zeros_are_counted_however_a_stream_is_cut(rng: np.random.Generator, least: int) -> None:
    for _ in range(200):
        stream = bytes(rng.choice([0, 0, 10, 65], 60).tolist())
        runs = [run for run in re.finditer(rb"\0+", stream) if len(run[0]) >= least]
        zeros = ZeroRuns(least)
        cuts = [0, *sorted(rng.integers(0, 60, 4).tolist()), 60]
        for begin, end in pairwise(cuts):
            zeros.add(stream[begin:end])
        assert zeros.count == sum(len(run[0]) for run in runs)
        assert zeros.places == len(runs)
        assert zeros.at_end == bool(runs and runs[-1].end() == 60)
        if runs:
            first = runs[0].start()
            assert zeros.first == (first, stream.count(b"\n", 0, first) + 1)
