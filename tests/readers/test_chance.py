"""Bytes of chance are taken for no format; the beginnings of real logs are taken for theirs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.content import recognise_content
from imubench_pipeline.readers.contents import list_contents
from imubench_pipeline.readers.formats import FILE_FORMATS, TEXT
from imubench_pipeline.settings.sensor import Reader
from tests.corpus import ENTRIES
from tests.readers.test_formats import SAMPLES
from tests.readers.text_logs import PLACED, columns, log_format, written

LENGTHS = [*range(3, 40), 64, 100, 257, 512, 1000, 4096, 20_000, 70_000]


@pytest.mark.parametrize("length", LENGTHS)
def test_bytes_of_chance_are_no_binary_format(tmp_path: Path, length: int) -> None:
    for seed in range(20):
        path = written(tmp_path, np.random.default_rng([length, seed]).bytes(length), "a.bin")
        assert recognise_content(path) == (TEXT, "")
        with pytest.raises(RecordingError, match=r"^a\.bin") as raised:
            list_contents(path)
        if length >= 512:
            said = re.search(
                r"line (\d+): holds binary data .* the bytes (\w\w)", str(raised.value)
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
    if whole.suffix == ".npz":  # of whose members the directory at the end tells, or a scan
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
        (b"ULog\x01\x12\x35\x01", "a log of PX4 .*'ulog2csv'"),
        (b"\xa3\x95\x80\x80\x59FMT", "a log of ArduPilot .*'mavlogdump.py"),
        (b"a.csv".ljust(257, b"\0") + b"ustar\x0000", "a tar archive.*unpack it"),
    ],
)
def test_a_format_that_is_not_read_is_named(tmp_path: Path, begin: bytes, said: str) -> None:
    path = written(tmp_path, begin + bytes(300))
    with pytest.raises(RecordingError, match=said):
        list_contents(path)
    with pytest.raises(RecordingError, match=said):
        columns(path, log_format())
