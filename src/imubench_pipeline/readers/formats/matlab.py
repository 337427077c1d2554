"""MATLAB files of version 4, 5 and 7.3."""

from imubench_pipeline.readers.arrays.matlab_4 import HEADER_BYTES, parse_header
from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.arrays import file, matlab

    return Code(matlab.MatlabFile, file.list_tables)


FORMAT = FileFormat(
    name="matlab",
    title="MATLAB file",
    endings=(".mat",),
    signature=Signature(
        begins=(b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"),
        tells=lambda begin: parse_header(begin[:HEADER_BYTES]) is not None,
    ),
    settings=("variable",),
    code=_code,
    extra="hdf5",
)
