"""MATLAB v7.3 files, which are HDF5: matrices, or one vector a channel."""

from __future__ import annotations

from collections.abc import Iterator

import h5py
import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import Batch, LogFile, RecordingError

_BLOCK_ROWS = 1 << 18


class MatlabFile(LogFile):
    """A MATLAB v7.3 file.

    A column is a number, the column of a matrix as MATLAB shows it, counted from 1; or the
    name of a variable that is a vector.
    """

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        if not self.path.is_file():
            raise RecordingError(f"{self.path.name}: cannot be opened (no such file)")
        if not h5py.is_hdf5(self.path):
            raise RecordingError(
                f"{self.path.name}: not a MATLAB v7.3 file, or its beginning is damaged; save it "
                "with -v7.3"
            )
        try:
            with h5py.File(self.path, "r") as file:
                yield from self._read(file)
        except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
            if isinstance(error, RecordingError):
                raise
            raise RecordingError(
                f"{self.path.name}: corrupt data, or cut short ({error}); copy it again"
            ) from None

    def _read(self, file: h5py.File) -> Iterator[Batch]:
        columns = {
            name: self._column(file, source.column, source.variable, name)
            for name, source in self.sources.items()
        }
        time = self._time_column(file)
        lengths = {name: column.rows for name, column in columns.items()}
        if time is not None:
            lengths["time"] = time.rows
        if len(set(lengths.values())) > 1:
            raise RecordingError(f"{self.path.name}: columns of unequal length: {lengths}")
        rows = next(iter(lengths.values()))
        if rows == 0:
            raise RecordingError(f"{self.path.name}: no record")
        first = None
        for start in range(0, rows, _BLOCK_ROWS):
            stamps = None
            if time is not None and self.log.time is not None:
                read = time.block(start)
                finite = read[np.isfinite(read)]
                if first is None and len(finite):
                    first = finite[0]
                stamps = self.seconds(read, first or 0.0)
            yield Batch(
                stamps,
                {name: self.to_si(name, column.block(start)) for name, column in columns.items()},
            )

    def _time_column(self, file: h5py.File) -> _Column | None:
        if self.log.time is None:
            return None
        if self.log.time.format is not None:
            raise RecordingError(
                f"{self.path.name}: time stamps in text are not read from MATLAB files; "
                "expected numbers with a unit"
            )
        variable = next(iter(self.sources.values())).variable
        return self._column(file, self.log.time.column, variable, "time")

    def _column(
        self, file: h5py.File, column: str | int, variable: str | None, key: str
    ) -> _Column:
        present = _variables(file)
        name = column if isinstance(column, str) else variable
        if name is None:
            if len(present) != 1:
                raise RecordingError(
                    f"{self.path.name}: several variables ({', '.join(present)}); name the one "
                    f"of {key} with 'variable:'"
                )
            name = present[0]
        if name not in present:
            raise RecordingError(
                f"{self.path.name}: no variable {name!r} for {key}; the file has "
                f"{', '.join(present) or 'none'}"
            )
        found = _Column(file[name], 1 if isinstance(column, str) else column)
        if isinstance(column, str) and found.columns > 1:
            raise RecordingError(
                f"{self.path.name}: {name!r} for {key} is a matrix of {found.columns} columns; "
                f"name the column with 'column: 2, variable: {name}'"
            )
        if found.number > found.columns:
            raise RecordingError(
                f"{self.path.name}: no column {found.number} for {key}; {name} has "
                f"{found.columns} columns of {found.rows} samples"
            )
        return found


class _Column:
    """One column of a matrix; the longer side of the matrix is time."""

    def __init__(self, dataset: h5py.Dataset, number: int) -> None:
        shape = dataset.shape if dataset.ndim == 2 else (1, *dataset.shape)
        self._dataset = dataset
        self._along_rows = dataset.ndim == 2 and shape[0] > shape[1]
        self.columns, self.rows = (shape[1], shape[0]) if self._along_rows else shape
        self.number = number

    def block(self, start: int) -> NDArray[np.float64]:
        rows = slice(start, start + _BLOCK_ROWS)
        if self._dataset.ndim == 1:
            return np.asarray(self._dataset[rows], dtype=np.float64)
        key = (rows, self.number - 1) if self._along_rows else (self.number - 1, rows)
        return np.asarray(self._dataset[key], dtype=np.float64)


def _variables(file: h5py.File) -> list[str]:
    """Return the numeric arrays of one or two dimensions, by name."""
    names: list[str] = []

    def visit(name: str, item: object) -> None:
        if (
            isinstance(item, h5py.Dataset)
            and item.ndim in (1, 2)
            and item.dtype.kind in "fiu"
            and not str(name).startswith("#")
        ):
            names.append(str(name))

    file.visititems(visit)
    return sorted(names)
