"""The formats of log files that can be read, with functions that import the code that reads them.

The names are as in `imubench_pipeline.settings.sensor.Reader`. Extensions add formats; a format
without a name there, or a name without a format, fails the import of this module.
"""

import re
from collections.abc import Mapping
from typing import get_args

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature
from imubench_pipeline.readers.other_formats import EXTENSION_MARKS
from imubench_pipeline.registry import Hook
from imubench_pipeline.settings.sensor import Reader

_ARROW_MAGIC = re.compile(rb"(?:PAR1|FEA1|ARROW1)(?:[\0-\x08\x0e-\x1f]|\Z)")
"""The control character excludes texts that begin with these letters."""


def _load_csv() -> Code:
    from imubench_pipeline.readers.text import csv

    return Code(csv.CsvFile, csv.describe_table)


def _load_matlab() -> Code:
    from imubench_pipeline.readers.arrays import file, matlab

    return Code(matlab.MatlabFile, file.list_tables)


def _load_numpy() -> Code:
    from imubench_pipeline.readers.arrays import file, npy

    return Code(npy.NumpyFile, file.list_tables)


def _load_arrow() -> Code:
    from imubench_pipeline.readers.arrays import arrow, file

    return Code(arrow.ArrowFile, file.list_tables)


def _load_hdf5() -> Code:
    from imubench_pipeline.readers.arrays import file, hdf5

    return Code(hdf5.Hdf5File, file.list_tables)


def _load_excel() -> Code:
    from imubench_pipeline.readers.arrays import excel, file

    return Code(excel.ExcelFile, file.list_tables)


_DECLARED = (
    FileFormat(
        name="csv",
        title="text",
        endings=(".csv", ".txt", ".tsv", ".dat", ".log", ".asc"),
        signature=Signature(),
        streamed=True,
        clock_of="file",
        settings=("delimiter", "header", "skip_lines", "comment", "decimal"),
        code=_load_csv,
    ),
    FileFormat(
        name="matlab",
        title="MATLAB file",
        endings=(".mat",),
        signature=Signature(begins=(b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file")),
        settings=("variable",),
        code=_load_matlab,
        extra="hdf5",
    ),
    FileFormat(
        name="numpy",
        title="NumPy arrays",
        endings=(".npy", ".npz"),
        signature=Signature(begins=(b"\x93NUMPY",), archive_has=".npy"),
        settings=("variable",),
        code=_load_numpy,
    ),
    FileFormat(
        name="arrow",
        title="Parquet, Feather or Arrow table",
        endings=(".parquet", ".feather", ".arrow"),
        signature=Signature(tells=lambda begin: _ARROW_MAGIC.match(begin) is not None),
        code=_load_arrow,
    ),
    FileFormat(
        name="hdf5",
        title="HDF5 file",
        endings=(".h5", ".hdf5"),
        signature=Signature(begins=(b"\x89HDF\r\n\x1a\n",)),
        settings=("variable",),
        code=_load_hdf5,
        extra="hdf5",
    ),
    FileFormat(
        name="excel",
        title="Excel workbook",
        endings=(".xlsx", ".xls"),
        signature=Signature(begins=(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1",), archive_has=".rels"),
        clock_of="variable",
        settings=("variable",),
        code=_load_excel,
        extra="excel",
    ),
)
_ADDED: Hook[FileFormat] = Hook("formats")
_formats = {found.name: found for found in (*_DECLARED, *_ADDED.objects())}
if _missing := (_formats.keys() ^ get_args(Reader)) - (EXTENSION_MARKS.keys() - _formats.keys()):
    raise ImportError(
        f"{', '.join(sorted(_missing))}: a format of log files needs a declaration (in "
        "readers/formats.py or an extension) and its name in settings.sensor.Reader; add the "
        "missing one"
    )

FILE_FORMATS: Mapping[Reader, FileFormat] = {
    name: _formats[name] for name in get_args(Reader) if name in _formats
}
"""All formats by the value of ``reader`` in a sensor file."""

TEXT = FILE_FORMATS["csv"]  # format of files without a known signature: text has none
