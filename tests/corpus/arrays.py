"""Formats of arrays and tables: NumPy, Parquet and Feather."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa

from tests.corpus.entry import Entry, Rejected, Written, changed, file, flipped, kept, part
from tests.corpus.signals import MATRIX, RATE, ROWS, STAMPED, matrix, rest
from tests.readers.test_arrow import saved as arrow_file
from tests.readers.test_npy import header


def npy(array: np.ndarray, pickled: bool = False) -> bytes:
    held = io.BytesIO()
    np.save(held, array, allow_pickle=pickled)
    return held.getvalue()


def npz(**made: np.ndarray) -> bytes:
    held = io.BytesIO()
    np.savez_compressed(held, **made)  # type: ignore[arg-type]  # its stub takes a flag among the arrays
    return held.getvalue()


def table(**columns: Any) -> pa.Table:
    return pa.table(rest() | columns)


def parquet(
    made: Callable[[], pa.Table] = table,
    name: str = "log.parquet",
    kind: str = "parquet",
    **keys: Any,
) -> Written:
    return lambda folder: arrow_file(folder / name, made(), kind, **keys)


def drifting() -> np.ndarray:
    rows = np.arange(150_000)
    noise = np.random.default_rng(6).standard_normal((2, len(rows)))
    return np.column_stack([(rows + 1e-8 * rows**2) / RATE, 1e-3 * noise[0], 9.8 + 1e-2 * noise[1]])


def with_holes() -> np.ndarray:
    made = matrix()
    made[10, 1], made[20, 2] = np.nan, np.inf
    return made


PLAIN: dict[str, Any] = {
    "compression": "none",
    "use_dictionary": False,
    "write_page_checksum": True,
}
CUT = "corrupt data, or cut short"
VARIABLE = {
    "channels": {name: source | {"variable": "m"} for name, source in MATRIX["channels"].items()}
}
NUMPY = [
    Entry("npy", file(lambda: npy(matrix()), "log.npy"), MATRIX, kept(ROWS)),
    Entry("npy turned", file(lambda: npy(matrix().T), "log.npy"), MATRIX, kept(ROWS)),
    Entry(
        "npy cut short",
        file(lambda: part(npy(matrix()), 0.7), "log.npy"),
        MATRIX,
        Rejected(r"log\.npy: the table promises 1000 x 3 values .*cut short"),
    ),
    Entry(
        "npy with more behind it",
        file(lambda: npy(matrix()) * 2, "log.npy"),
        MATRIX,
        Rejected(r"bytes follow after the table"),
    ),
    Entry(
        "npy that promises too much",
        file(header(shape=(10**15, 3)), "log.npy"),
        MATRIX,
        Rejected(r"promises 1000000000000000 x 3"),
    ),
    Entry(
        "npy of objects",
        file(lambda: npy(np.array([None] * 9), pickled=True), "log.npy"),
        MATRIX,
        Rejected(r"holds objects"),
    ),
    Entry(
        "npy of nothing",
        file(lambda: npy(np.zeros((0, 3))), "log.npy"),
        MATRIX,
        Rejected(r"is empty"),
    ),
    Entry(
        "npy of one value",
        file(lambda: npy(np.array(7.0)), "log.npy"),
        MATRIX,
        Rejected(r"is a single value"),
    ),
    Entry(
        "npy of three dimensions",
        file(lambda: npy(np.zeros((9, 3, 3))), "log.npy"),
        MATRIX,
        Rejected(r"has 3 dimensions"),
    ),
    Entry(
        "npy without a column",
        file(lambda: npy(matrix()[:, :2]), "log.npy"),
        MATRIX,
        Rejected(r"no column 3 for accel_z; the table has 2 columns of 1000 samples"),
    ),
    Entry(
        "npy whose clock drifts",
        file(lambda: npy(drifting()), "log.npy"),
        MATRIX,
        kept(150_000, "rate_drifts"),
    ),
    Entry(
        "npy with NaN and infinity",
        file(lambda: npy(with_holes()), "log.npy"),
        MATRIX,
        kept(ROWS, "empty_cells", "not_finite"),
    ),
    Entry(
        "npy of 0 bytes",
        file(b"", "log.npy"),
        MATRIX | {"reader": "numpy"},
        Rejected(r"log\.npy: the file is empty"),
    ),
    Entry("npz", file(lambda: npz(m=matrix()), "log.npz"), MATRIX, kept(ROWS)),
    Entry("npz of vectors", file(lambda: npz(**rest()), "log.npz"), STAMPED, kept(ROWS)),
    Entry(
        "npz of vectors of unequal length",
        file(lambda: npz(**rest() | {"az": rest()["az"][:-1]}), "log.npz"),
        STAMPED,
        Rejected(r"log\.npz: columns of unequal length"),
    ),
    Entry(
        "npz cut short",
        file(lambda: part(npz(m=matrix()), 0.7), "log.npz"),
        MATRIX,
        Rejected(rf"log\.npz: {CUT}"),
    ),
    Entry(
        "npz with a flipped bit",
        file(lambda: flipped(npz(m=matrix()), 0.5), "log.npz"),
        MATRIX,
        Rejected(rf"log\.npz: {CUT}"),
    ),
    Entry(
        "npz without the array that is named",
        file(lambda: npz(n=matrix()), "log.npz"),
        MATRIX | VARIABLE,
        Rejected(r"no variable 'm' for gyro_x; the file has n"),
    ),
]
ARROW = [
    Entry("parquet", parquet(row_group_size=300), STAMPED, kept(ROWS)),
    Entry("parquet with the name of MATLAB", parquet(name="log.mat"), STAMPED, kept(ROWS)),
    Entry(
        "parquet cut short",
        changed(parquet(), lambda data: part(data, 0.7)),
        STAMPED,
        Rejected(rf"log\.parquet: {CUT}"),
    ),
    Entry(
        "parquet with a wrong checksum",
        changed(parquet(**PLAIN), lambda data: flipped(data, 0.5)),
        STAMPED,
        Rejected(rf"log\.parquet: {CUT}.*CRC"),
    ),
    Entry(
        "parquet of a header",
        file(b"PAR1", "log.parquet"),
        STAMPED,
        Rejected(rf"log\.parquet: {CUT}"),
    ),
    Entry(
        "parquet with nulls",
        parquet(
            lambda: table(
                wx=pa.array([None if row == 7 else x for row, x in enumerate(rest()["wx"])])
            )
        ),
        STAMPED,
        kept(ROWS, "empty_cells"),
    ),
    Entry(
        "parquet without records",
        parquet(lambda: table()[:0]),
        STAMPED,
        Rejected(r"log\.parquet: no rows"),
    ),
    Entry(
        "parquet of text",
        parquet(lambda: table(wx=[str(x) for x in rest()["wx"]])),
        STAMPED,
        Rejected(r"column 'wx' of the table for gyro_x holds string; expected numbers"),
    ),
    Entry(
        "parquet with dates",
        parquet(lambda: table(t=np.datetime64("2024-05-01", "ns") + np.arange(ROWS) * 10**7)),
        STAMPED | {"time": {"column": "t", "format": "iso8601"}},
        kept(ROWS),
    ),
    Entry(
        "parquet with dates taken for numbers",
        parquet(lambda: table(t=np.datetime64("2024-05-01", "ns") + np.arange(ROWS) * 10**7)),
        STAMPED,
        Rejected(r"holds timestamp\[ns\]; .*give 'format: iso8601'"),
    ),
    Entry(
        "parquet without a column",
        parquet(lambda: table().drop_columns(["az"])),
        STAMPED,
        Rejected(r"no variable or column 'az' for accel_z; the file has column t"),
    ),
    Entry(
        "parquet with a name of 30 kB",
        parquet(lambda: table().rename_columns(["t", "wx", "n" * 30_000])),
        STAMPED,
        Rejected(
            r"no variable or column 'az' for accel_z; .* column n{90,}\.\.\.; correct 'column'"
        ),
    ),
    Entry("feather", parquet(name="log.feather", kind="feather"), STAMPED, kept(ROWS)),
    Entry(
        "feather cut short",
        changed(parquet(name="log.feather", kind="feather"), lambda data: part(data, 0.7)),
        STAMPED,
        Rejected(rf"log\.feather: {CUT}"),
    ),
    Entry(
        "feather of version 1",
        file(b"FEA1" + bytes(99), "log.feather"),
        STAMPED,
        Rejected(r"is Feather version 1; expected version 2"),
    ),
    Entry(
        "feather that is a stream cut short",
        changed(parquet(name="log.arrows", kind="stream"), lambda data: part(data, 0.7)),
        STAMPED | {"reader": "arrow"},
        Rejected(rf"log\.arrows: {CUT}"),
    ),
]

ENTRIES = [*NUMPY, *ARROW]
