"""Holes of sparse files are found without reading them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from imubench_pipeline.readers.holes import end_of_data

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
    if end_of_data(sparse(tmp_path / "probe", 1 << 20)):
        pytest.skip("this file system stores every zero")


def test_the_hole_at_the_end_is_found(tmp_path: Path) -> None:
    assert end_of_data(sparse(tmp_path / "hole", TERABYTES)) == 0
    assert end_of_data(sparse(tmp_path / "empty", 0)) == 0
    for at in (0, 1 << 20, 1 << 40):
        end = end_of_data(sparse(tmp_path / str(at), TERABYTES, **{f"at_{at}": b"1"}))
        assert at < end <= at + (1 << 16)  # a block of the file system
    whole = tmp_path / "whole"
    whole.write_bytes(bytes(12_345))
    assert end_of_data(whole) == 12_345
