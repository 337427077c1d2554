"""Logs that vanish, grow, shrink or are replaced while they are read."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.settings.sensor import LogFormat

FORMAT = LogFormat.model_validate(
    {"rate": "100 Hz", "channels": {"gyro_x": {"column": "w", "unit": "rad/s"}}}
)
LINE = "0.12345678901234567890123456789\n"
ROWS = 300_000  # of 32 bytes: several batches


def vanish(path: Path) -> None:
    path.unlink()


def grow(path: Path) -> None:
    with path.open("a") as file:
        file.write(LINE * 1000)


def shrink(path: Path) -> None:
    os.truncate(path, 1000)


def replace(path: Path) -> None:
    other = path.with_suffix(".new")
    other.write_text("v\n1\n")
    other.replace(path)


@pytest.mark.parametrize(
    ("change", "least", "most"),
    [
        (vanish, ROWS, ROWS),  # what is open stays as it was
        (replace, ROWS, ROWS),
        (grow, ROWS, ROWS + 1000),
        (shrink, 1, ROWS),  # all of them, where they were read ahead of the change
    ],
)
def test_a_log_that_changes_while_it_is_read_is_read_or_rejected(
    change: Callable[[Path], None], least: int, most: int, tmp_path: Path
) -> None:
    path = tmp_path / "a.csv"
    path.write_text("w\n" + LINE * ROWS)
    (file,) = read(path, FORMAT)
    rows = 0
    try:
        for number, batch in enumerate(file.batches()):
            if number == 0:
                change(path)
            rows += len(batch)
            assert (batch.columns["gyro_x"][:-1] == float(LINE)).all()
    except RecordingError as error:
        assert "a.csv" in str(error)
        return
    assert least <= rows <= most


def test_a_log_that_is_gone_before_it_is_read_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("w\n" + LINE * 200)
    with pytest.raises(RecordingError, match=r"a\.csv"):
        path.unlink()
        for file in read(path, FORMAT):
            list(file.batches())


def test_a_log_that_goes_after_it_was_opened_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("w\n" + LINE * 200)
    (file,) = read(path, FORMAT)
    path.unlink()
    with pytest.raises(RecordingError, match=r"a\.csv"):
        list(file.batches())
