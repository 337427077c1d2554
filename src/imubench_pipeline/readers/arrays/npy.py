"""NumPy files: one array (NPY), or several in a zip archive (NPZ), streamed in both cases.

An array is a matrix, a vector, or a vector of records. ``variable`` names an array in an archive.
Dates (datetime64) are time stamps with ``format: iso8601``. Arrays of Python objects are rejected:
unpickling them would execute code in the file.
"""

import io
import math
import struct
import zipfile
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from functools import partial
from typing import IO

from numpy.lib import format as npy

from imubench_pipeline.readers.arrays import table
from imubench_pipeline.readers.arrays.file import ArrayFile
from imubench_pipeline.readers.bounds import MAX_NPY_HEADER
from imubench_pipeline.readers.compressed import open_archive

_SUFFIX = ".npy"
_HEADER_SIZE_FORMATS = {(1, 0): "<H", (2, 0): "<I", (3, 0): "<I"}


class NumpyFile(ArrayFile):
    """An NPY or NPZ file."""

    def tables(self, stack: ExitStack) -> Iterable[table.Table]:
        """Return the arrays from their headers (see `ArrayFile.tables`)."""
        with self.path.open("rb") as file:
            begin = file.read(len(npy.MAGIC_PREFIX))
        if begin == npy.MAGIC_PREFIX:
            size = self.path.stat().st_size
            return [_read_array_header("", lambda: self.path.open("rb"), size, checked=False)]
        if not begin.startswith(b"PK"):
            raise table.UnusableError(
                "not a NumPy file, or its beginning is damaged; expected the output of numpy.save "
                "or numpy.savez: correct 'reader' in the sensor file, or copy the file again"
            )
        archive = stack.enter_context(open_archive(self.path))
        size = self.path.stat().st_size
        tables = []
        for info in archive.infolist():
            if not info.filename.endswith(_SUFFIX):
                continue
            name = info.filename.removesuffix(_SUFFIX)
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise table.UnusableError(
                    f"{name} is packed by method {info.compress_type}; expected stored or "
                    "deflated: save it with numpy.savez or numpy.savez_compressed"
                )
            most = table.MAX_DEFLATE_RATIO * (info.compress_size + 8)
            if info.compress_size > size or info.file_size > most:
                raise table.UnusableError(
                    f"{name} is stated to have {info.file_size} bytes, which cannot result from "
                    f"{info.compress_size} packed bytes in a file of {size} bytes; the file is "
                    "corrupt: copy it again"
                )
            opened = partial(archive.open, info)
            tables.append(_read_array_header(name, opened, info.file_size, checked=True))
        return tables


def _read_array_header(
    name: str, opened: Callable[[], IO[bytes]], size: int, checked: bool
) -> table.StreamedArray:
    shown = name or "the table"
    with opened() as stream:
        version = npy.read_magic(stream)
        if version not in _HEADER_SIZE_FORMATS:
            raise table.UnusableError(
                f"{shown} has format version {version}; expected 1.0 to 3.0: save it again"
            )
        length = table.read_exactly(stream, struct.calcsize(_HEADER_SIZE_FORMATS[version]))
        (header_size,) = struct.unpack(_HEADER_SIZE_FORMATS[version], length)
        if header_size > MAX_NPY_HEADER:
            raise table.UnusableError(
                f"{shown} has a header of {header_size} bytes; expected at most "
                f"{MAX_NPY_HEADER}: save fewer fields, or copy the file again"
            )
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, dtype = read(io.BytesIO(length + table.read_exactly(stream, header_size)))
        offset = stream.tell()
    if version == (3, 0) and dtype.names is not None:  # differs from 2.0 by UTF-8
        dtype.names = tuple(name.encode("latin1").decode("utf-8") for name in dtype.names)
    array = table.StreamedArray(name, shape, dtype, fortran, opened, offset, checked)
    promised = offset + math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or (promised > size and not dtype.hasobject):
        raise table.UnusableError(
            f"{shown} promises {table.describe_shape(shape)} values of {dtype.itemsize} bytes, "
            f"{promised} bytes with the header, but {size} are there; the file is cut short or "
            "corrupt: copy it again"
        )
    if promised < size and not dtype.hasobject:
        raise table.UnusableError(
            f"{size - promised} bytes follow after {shown} ({table.describe_shape(shape)} values); "
            "expected one array: save several with numpy.savez"
        )
    return array
