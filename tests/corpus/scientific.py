"""Formats of programs for science and the office: MATLAB, HDF5 and Excel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tests.corpus.entry import Entry, Rejected, Written, changed, file, flipped, kept, part
from tests.corpus.signals import MATRIX, ROWS, STAMPED, matrix, rest
from tests.readers.test_excel import workbook
from tests.readers.test_matlab import by_hand, variable, version_5


def mat_5(name: str = "log.mat", packed: bool = False, **made: Any) -> Written:
    return lambda folder: version_5(folder / name, made or {"m": matrix()}, packed)


def mat_73(**attributes: Any) -> Written:
    def write(folder: Path) -> Path:
        path = folder / "log.mat"
        with h5py.File(path, "w", userblock_size=512) as made:
            data = made.create_dataset("m", data=matrix().T, chunks=(3, 100), compression="gzip")
            data.attrs.update(attributes)
        data_of_file = path.read_bytes()
        path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + data_of_file[128:])
        return path

    return write


def hdf5(make: Callable[[h5py.File], object]) -> Written:
    def write(folder: Path) -> Path:
        path = folder / "log.h5"
        with h5py.File(path, "w") as made:
            make(made)
        return path

    return write


def vectors(made: h5py.File, **keys: Any) -> None:
    for name, values in rest().items():
        made.create_dataset(name, data=values, **keys)


def half_written(made: h5py.File) -> None:
    data = made.create_dataset("m", shape=(ROWS, 3), dtype="f8", chunks=(100, 3))
    data[:500] = matrix()[:500]


def elsewhere(made: h5py.File) -> None:
    made.create_dataset("m", shape=(ROWS, 3), dtype="f8", external=[("/dev/zero", 0, 24 * ROWS)])


def damaged_chunk(data: bytes) -> bytes:
    """Return a file with one bit flipped in a sample of the gyro."""
    sample = rest()["wx"][550].tobytes()
    return data.replace(sample, flipped(sample, 0.5))


CUT = "corrupt data, or cut short"
MATLAB = [
    Entry("matlab 5", mat_5(), MATRIX, kept(ROWS)),
    Entry("matlab 5 compressed", mat_5(packed=True), MATRIX, kept(ROWS)),
    Entry("matlab 5 with a name of text", mat_5("log.csv"), MATRIX, kept(ROWS)),
    Entry(
        "matlab 5 cut short",
        changed(mat_5(), lambda data: part(data, 0.7)),
        MATRIX,
        Rejected(r"log\.mat: cut short: a variable ends at byte"),
    ),
    Entry(
        "matlab 5 of a header",
        changed(mat_5(), lambda data: data[:128]),
        MATRIX,
        Rejected(r"log\.mat: no numeric array for gyro_x; the file has none"),
    ),
    Entry(
        "matlab 5 with a flipped bit",
        changed(mat_5(packed=True), lambda data: flipped(data, 0.6)),
        MATRIX,
        Rejected(rf"log\.mat: {CUT}"),
    ),
    Entry(
        "matlab 5 that promises too much",
        lambda folder: by_hand(folder / "log.mat", "<", variable("<", "m", (10**9, 3), bytes(64))),
        MATRIX,
        Rejected(r"log\.mat: corrupt data"),
    ),
    Entry(
        "matlab 5 of text",
        mat_5(m="some text"),
        MATRIX,
        Rejected(r"m for gyro_x holds text; expected numbers"),
    ),
    Entry(
        "matlab 5 of two matrices",
        mat_5(m=matrix(), n=matrix()),
        MATRIX,
        Rejected(r"several variables \(m, n\); name the one"),
    ),
    Entry(
        "matlab 5 of complex numbers",
        mat_5(m=matrix() * 1j),
        MATRIX,
        Rejected(r"holds complex numbers"),
    ),
    Entry("matlab 7.3", mat_73(), MATRIX, kept(ROWS)),
    Entry(
        "matlab 7.3 cut short",
        changed(mat_73(), lambda data: part(data, 0.7)),
        MATRIX,
        Rejected(rf"log\.mat: {CUT}"),
    ),
    Entry(
        "matlab 7.3 with a flipped bit",
        changed(mat_73(), lambda data: flipped(data, 0.7)),
        MATRIX,
        Rejected(rf"log\.mat: {CUT}"),
    ),
    Entry(
        "matlab 7.3 of text",
        mat_73(MATLAB_class=np.bytes_("char")),
        MATRIX,
        Rejected(r"m for gyro_x holds text"),
    ),
]
HDF5 = [
    Entry("hdf5", hdf5(vectors), STAMPED, kept(ROWS)),
    Entry(
        "hdf5 in chunks",
        hdf5(lambda made: vectors(made, chunks=(100,), compression="gzip")),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "hdf5 cut short",
        changed(hdf5(vectors), lambda data: part(data, 0.7)),
        STAMPED,
        Rejected(rf"log\.h5: {CUT}.*truncated"),
    ),
    Entry(
        "hdf5 with a wrong checksum",
        changed(hdf5(lambda made: vectors(made, chunks=(100,), fletcher32=True)), damaged_chunk),
        STAMPED,
        Rejected(rf"log\.h5: {CUT}"),
    ),
    Entry(
        "hdf5 that was half written",
        hdf5(half_written),
        MATRIX,
        Rejected(r"log\.h5: 5 of 10 chunks of m were written"),
    ),
    Entry(
        "hdf5 that is kept elsewhere",
        hdf5(elsewhere),
        MATRIX,
        Rejected(r"log\.h5: m is stored in other files"),
    ),
    Entry("hdf5 of a header", file(b"\x89HDF\r\n\x1a\n", "log.h5"), STAMPED, Rejected(r"log\.h5")),
    Entry(
        "hdf5 without data",
        hdf5(lambda made: made.create_group("imu")),
        STAMPED,
        Rejected(r"log\.h5: no variable or column 'wx' for gyro_x; the file has none"),
    ),
]


def excel(folder: Path) -> Path:
    rows = [["t", "wx", "az"], *matrix().tolist()]
    return workbook(folder / "log.xlsx", {"log": rows, "notes": [["a phone"]]})


EXCEL = [
    Entry("excel", excel, STAMPED, kept(ROWS)),
    Entry(
        "excel without the sheet",
        excel,
        STAMPED | {"channels": {"gyro_x": {"variable": "imu", "column": "wx", "unit": "rad/s"}}},
        Rejected(r"log\.xlsx: no variable 'imu' for gyro_x; the file has log"),
    ),
    Entry(
        "excel that is damaged",
        changed(excel, lambda data: flipped(data, 0.6)),
        STAMPED,
        Rejected(r"log\.xlsx: its sheets cannot be read"),
    ),
]

ENTRIES = [*MATLAB, *HDF5, *EXCEL]
