"""Bytes of chance are taken for no format; the beginnings of real logs are taken for theirs."""

from __future__ import annotations

import gzip
import re
from itertools import product
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.content import recognise_content
from imubench_pipeline.readers.contents import list_contents
from imubench_pipeline.readers.formats import FILE_FORMATS, TEXT
from imubench_pipeline.readers.other_formats import OTHER_FORMATS, find_other_format
from imubench_pipeline.settings.sensor import Reader
from tests.conftest import few
from tests.corpus import ENTRIES
from tests.readers.test_formats import SAMPLES
from tests.readers.text_logs import PLACED, columns, log_format, written

LENGTHS = few(
    [3, 4, 8, 16, 32, 257, 512, 4096, 70_000],
    [*({*range(5, 40)} - {8, 16, 32}), 64, 100, 1000, 20_000],
)


@pytest.mark.parametrize("length", LENGTHS)
def test_bytes_of_chance_are_no_binary_format(tmp_path: Path, length: int) -> None:
    for seed in range(20):
        path = written(tmp_path, np.random.default_rng([length, seed]).bytes(length), "a.bin")
        assert recognise_content(path) == (TEXT, "")
        with pytest.raises(RecordingError, match=r"^a\.bin") as raised:
            list_contents(path)
        if length >= 512:
            said = re.search(
                r"line (\d+): holds binary data .* the first bytes (\w\w)", str(raised.value)
            )
            if said is None:  # a zero byte comes first
                assert "as binary data do" in str(raised.value)
            else:
                line = path.read_bytes().split(b"\n")[int(said[1]) - 1]
                assert bytes.fromhex(said[2])[0] == line[0]
        with pytest.raises(RecordingError, match=r"^a\.bin"):
            columns(path, log_format(PLACED))


@pytest.mark.parametrize("mark", [b"\xb5\x62", b"$VN", b"\x1f\x8b", b"BZh", b"PAR1", b"FEA1"])
def test_a_mark_among_bytes_of_chance_is_not_enough(tmp_path: Path, mark: bytes) -> None:
    for seed in range(20):
        chance = np.random.default_rng(seed).bytes(2000)
        for data in (mark + b"\xff" + chance, chance[:1000] + mark * 20 + chance[1000:]):
            assert recognise_content(written(tmp_path, data)) == (TEXT, "")


@pytest.mark.parametrize("name", ["PAR1", "BZh", "FEA1", "ARROW1", "ULog", "MATLAB"])
def test_a_column_that_is_called_so_is_text(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, f"{name},wx,ax\n1,2,3\n4,5,6\n")
    assert len(columns(path, log_format())[0]["gyro_x"]) == 2


def beginnings(data: bytes) -> list[bytes]:
    return [data[: round(part * len(data))] for part in (0.02, 0.1, 0.5, 0.9, 0.999)]


@pytest.mark.parametrize("reader", get_args(Reader))
def test_the_beginning_of_a_log_is_of_its_format(tmp_path: Path, reader: Reader) -> None:
    whole = ENTRIES[SAMPLES[reader]].write(tmp_path)
    if whole.suffix in (
        ".npz",
        ".xlsx",
    ):  # of whose members the directory at the end tells, or a scan
        return
    for data in beginnings(whole.read_bytes()):
        path = written(tmp_path, data, "cut")
        assert recognise_content(path) == (FILE_FORMATS[reader], "")
        try:
            assert list_contents(path).about == FILE_FORMATS[reader].title
        except RecordingError as error:
            assert str(error).startswith("cut")


@pytest.mark.parametrize(
    ("begin", "said"),
    [
        (b"a.csv".ljust(257, b"\0") + b"ustar\x0000", "a tar archive.*unpack it"),
        (b"H Product:Blackbox flight data recorder by Nicholas Sherlock\n", "blackbox_decode"),
        (b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n", r"take the \.BIN"),
        (b"\xfa\xff\x32\xff", "of Xsens .*MT Manager"),
        (b"\xaa\x44\x13\x28", "NovAtel receiver.*RAWIMUSXA is read"),
        (b"$@\x12\x34", "Septentrio .*bin2asc"),
        (b"X\n\0\0\0\3\0\4\1\0", "data of R.*write.csv"),
        (gzip.compress(b"RDX3\nX\n\0\0\0\3", mtime=0), "data of R.*write.csv"),
        (b"\x80\x04\x95\x10", "a pickle of Python.*numpy.savez"),
        (b"\xd4\xc3\xb2\xa1\2\0\4\0", "a capture of network packets"),
        (b"\0\0\0\x20ftypisom", "a video.*telemetry"),
        (b"%PDF-1.7\n", "a PDF document"),
        (b"\x89PNG\r\n\x1a\n", "an image"),
        (b"\x7fELF\2\1\1", "a program"),
    ],
)
def test_a_format_that_is_not_read_is_named(tmp_path: Path, begin: bytes, said: str) -> None:
    path = written(tmp_path, begin if begin[:2] == b"\x1f\x8b" else begin + bytes(300))
    with pytest.raises(RecordingError, match=said):
        list_contents(path)
    with pytest.raises(RecordingError, match=said):
        columns(path, log_format())


def test_no_format_that_is_read_is_taken_for_another() -> None:
    marks = [mark for each in OTHER_FORMATS if each.place == 0 for mark in each.marks]
    begins = [mark for each in FILE_FORMATS.values() for mark in each.signature.begins]
    for mark, begin in product(marks, begins):
        assert not mark.startswith(begin) and not begin.startswith(mark)
    assert len(set(marks)) == len(marks)
    for text in ("time,gx\n", "# a log\n", "%RAWIMUSA,1", "$VNIMU,", "ue,x\n", "MZ,MX\n", "H 1\n"):
        assert find_other_format(text.encode()) is None
