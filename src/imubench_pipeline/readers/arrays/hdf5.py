"""HDF5 files: data sets that are vectors, matrices, or vectors of records (compound types).

``variable`` is the path of a data set, such as ``imu/gyro``; a column is a number, a field of the
records, or a data set in the group that ``variable`` names. HDF5 has no dates of its own.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers import bounds
from imubench_pipeline.readers.arrays.file import ArrayFile
from imubench_pipeline.readers.arrays.table import Array, Table, UnusableError
from imubench_pipeline.readers.bounded import run_bounded

_CACHE_SLOTS, _CACHE_PREEMPTION, _MIN_CACHE = 521, 0.75, 1 << 20
"""Defaults of the library: slots, preemption weight (w0) and bytes of the chunk cache."""

_EXTERNAL_FAULT = "is stored in other files; expected one file: repack it with h5repack"


class Hdf5File(ArrayFile):
    """An HDF5 file."""

    def tables(self, stack: ExitStack) -> Iterable[Table]:
        """Return a table for each data set (see `ArrayFile.tables`)."""
        if not h5py.is_hdf5(self.path):
            raise UnusableError(
                "not an HDF5 file, or its beginning is damaged; correct 'reader' in the sensor "
                "file, or copy the file again"
            )
        return list_data_sets(stack.enter_context(h5py.File(self.path, "r")))


def list_data_sets(file: h5py.File, time_axis: int = 0, passed_over: str = "\0") -> "list[DataSet]":
    """Return the data sets of a file by name; only hard links are followed.

    ``time_axis``: see `Array`. ``passed_over``: prefix of names at the root that are not data.
    Raises `UnusableError` if there are too many objects, or groups nested too deeply.
    """
    objects = 0
    seen = {_get_identity(file)}

    def below(group: h5py.Group, above: str, depth: int) -> Iterator[DataSet]:
        nonlocal objects
        # The `visit` of the library crashes the process on deeply nested groups.
        if depth > bounds.MAX_GROUP_DEPTH:
            raise UnusableError(
                f"groups are nested {bounds.MAX_GROUP_DEPTH + 1} deep; expected the log of one "
                "sensor: copy its data sets into a separate file"
            )
        if objects + len(group) > bounds.MAX_OBJECTS:
            raise UnusableError(
                f"more than {bounds.MAX_OBJECTS} objects; expected the log of one sensor: copy its "
                "data sets into a separate file"
            )
        for key in sorted(group, key=lambda key: key.encode() if isinstance(key, str) else key):
            objects += 1
            name = key if isinstance(key, str) else key.decode("utf-8", "replace")
            hard = isinstance(group.get(key, getlink=True), h5py.HardLink)
            if not hard or (not above and name.startswith(passed_over)):
                continue
            item = group[key]
            if (identity := _get_identity(item)) in seen:
                continue
            seen.add(identity)
            if isinstance(item, h5py.Dataset):
                yield DataSet(item, above + name, time_axis)
            elif isinstance(item, h5py.Group):
                yield from below(item, f"{above}{name}/", depth + 1)

    return list(below(file, "", 0))


def _get_identity(item: h5py.Group | h5py.Dataset) -> tuple[int, int]:
    info = h5py.h5o.get_info(item.id)
    return info.fileno, info.addr


class DataSet(Array):
    """A data set of an HDF5 file, read by blocks; ``time_axis``: see `Array`."""

    def __init__(self, data: h5py.Dataset, name: str, time_axis: int) -> None:
        try:
            dtype = data.dtype
        except (TypeError, ValueError):
            dtype = np.dtype(object)  # a type without equivalent in NumPy
        properties = data.id.get_create_plist()
        # Reading the shape of a virtual data set opens its source files, which may be pipes.
        virtual = properties.get_layout() == h5py.h5d.VIRTUAL
        shape = None if virtual else data.shape
        super().__init__(name, shape if shape is not None else (0,), dtype, time_axis)
        if virtual:
            self.fault = _EXTERNAL_FAULT
        elif self.fault is None and not _is_sound(dtype):
            self.fault = "has a damaged or unusual type; expected standard numbers: copy it again"
        self._chunk = 0
        if properties.get_layout() == h5py.h5d.CHUNKED:
            self._chunk = math.prod(properties.get_chunk()) * data.id.get_type().get_size()
        self._file, self._path = data.file, h5py.h5i.get_name(data.id)

    @property
    def data(self) -> h5py.Dataset:
        """The data set, newly opened, so that no unpacked chunks stay in memory."""
        access = h5py.h5p.create(h5py.h5p.DATASET_ACCESS)
        # With this cache, a chunk that spans several blocks is unpacked only once.
        access.set_chunk_cache(_CACHE_SLOTS, max(self._chunk, _MIN_CACHE), _CACHE_PREEMPTION)
        return h5py.Dataset(h5py.h5d.open(self._file.id, self._path, access))

    def unit(self, position: int) -> str | None:
        """Return the unit of the columns, if an attribute states it."""
        data = self.data
        name = next((name for name in _UNIT_ATTRIBUTES if name in data.attrs), None)
        if name is None:
            return None
        kind = data.attrs.get_id(name)
        if kind.shape != () or kind.dtype.itemsize > _MAX_STORED_LENGTH:
            return None
        if kind.dtype.kind == "S":
            text = bytes(data.attrs[name]).decode("utf-8", "replace")
        elif h5py.check_string_dtype(kind.dtype) is not None:
            path = Path(data.file.filename).resolve()
            status = path.stat()
            units = _read_variable_length_texts(str(path), status.st_mtime_ns, status.st_size)
            text = units.get(str(data.name), "")
        else:
            return None
        return text.strip("\0 \t\r\n")[:_MAX_UNIT_LENGTH] or None

    def held_bytes(self, positions: Sequence[int]) -> int:
        """Return the memory, bytes, that reading these columns takes in addition to the blocks."""
        return self._chunk

    def row_bytes(self, positions: Sequence[int]) -> int:
        """Return the memory per record for reading these columns, bytes."""
        names = self.fields(positions)
        if names:
            return sum(self.dtype[name].itemsize for name in names)
        return self.dtype.itemsize * (max(positions) - min(positions) + 1)

    def blocks(self, positions: Sequence[int], rows: int) -> Iterator[list[NDArray[Any]]]:
        """Yield these columns, ``rows`` records at a time or fewer (see `Table.blocks`)."""
        assert self.rows is not None  # from the shape
        data_set = self.data
        _check_written(data_set, self.name, self._chunk)
        names = self.fields(positions)
        data = data_set.fields(names) if names else data_set
        # A record is read as a whole, at position 0.
        low, high = (0, 1) if self.labels else (min(positions), max(positions) + 1)
        for start in range(0, self.rows, rows):
            time = slice(start, start + rows)
            if len(self.shape) == 1:
                block = np.asarray(data[time])
            elif self.time_axis == 0:
                block = np.asarray(data[time, low:high])
            else:
                block = np.asarray(data[low:high, time]).T
            block = block.reshape(-1) if self.labels else block.reshape(len(block), -1)
            yield [self.column_in(block, position - low) for position in positions]


def _is_sound(dtype: np.dtype[Any]) -> bool:
    """Return whether the library converts a type without access outside of its memory."""
    if dtype.names is None:
        return dtype.base.kind != "f" or dtype.base.itemsize <= 8
    assert dtype.fields is not None  # a type with names has them
    places = sorted((offset, offset + kind.itemsize) for kind, offset, *_ in dtype.fields.values())
    apart = all(end <= start for (_, end), (start, _) in pairwise(places))
    fits = apart and places[-1][1] <= dtype.itemsize
    return fits and all(_is_sound(dtype[name]) for name in dtype.names)


def _check_written(data: h5py.Dataset, name: str, unpacked: int) -> None:
    """Raise if values were not written, are in other files, or cannot be unpacked in blocks."""
    properties = data.id.get_create_plist()
    layout = properties.get_layout()
    if layout == h5py.h5d.CONTIGUOUS and properties.get_external_count():
        raise UnusableError(f"{name} {_EXTERNAL_FAULT}")
    size = data.id.get_type().get_size()  # as stored; NumPy may have no equivalent
    if layout == h5py.h5d.CONTIGUOUS and data.id.get_storage_size() < data.size * size:
        raise UnusableError(f"{name} was never written; expected {data.size} values: record again")
    if layout != h5py.h5d.CHUNKED:
        return
    for number in range(properties.get_nfilters()):
        code, _, _, title = properties.get_filter(number)
        if not h5py.h5z.filter_avail(code):
            raise UnusableError(
                f"{name} is compressed with filter {code} ({title.decode('ascii', 'replace')}), "
                "which is not installed; expected gzip: repack it with h5repack -f GZIP=4"
            )
    if unpacked > bounds.MAX_CHUNK_BYTES:
        raise UnusableError(
            f"{name} has chunks of {unpacked} bytes; expected at most {bounds.MAX_CHUNK_BYTES}: "
            "repack it with h5repack -l"
        )
    chunks = math.prod(
        -(-side // chunk) for side, chunk in zip(data.shape, data.chunks, strict=True)
    )
    written = data.id.get_num_chunks()
    if written < chunks:
        raise UnusableError(
            f"{written} of {chunks} chunks of {name} were written, the others would read as "
            "zeros; cut it to the recorded samples, or copy the file again"
        )
    if chunks > bounds.MAX_CHUNKS:
        raise UnusableError(
            f"{name} has {chunks} chunks; expected at most {bounds.MAX_CHUNKS}: repack it with "
            "h5repack -l"
        )


_UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")
_MAX_WAIT = 3.0
_MAX_UNIT_LENGTH = 40
_MAX_STORED_LENGTH = 1 << 12
_MAX_MEMORY = 1 << 29


@lru_cache(maxsize=4)
def _read_variable_length_texts(path: str, *_: int) -> dict[str, str]:
    """Return the units by data set, read by a process, as damaged texts may crash the library."""
    units: dict[str, str] = {}

    def visit(name: str, item: h5py.HLObject) -> str | None:
        for key in _UNIT_ATTRIBUTES if isinstance(item, h5py.Dataset) else ():
            if key in item.attrs:
                text = item.attrs[key]
                if len(text) > _MAX_STORED_LENGTH:
                    return "no unit"
                units[f"/{name}"] = text if isinstance(text, str) else text.decode()
        return None

    def read() -> dict[str, str]:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
        return units

    try:
        return run_bounded(_MAX_WAIT, _MAX_MEMORY, read)
    except Exception:  # the library raises nearly every kind on damaged files
        return {}
