"""MATLAB files of version 5 and 7.3."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.arrays import file, matlab

    return Code(matlab.MatlabFile, file.tables)


FORMAT = FileFormat(
    name="matlab",
    title="MATLAB file",
    endings=(".mat",),
    signature=Signature(begins=(b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file")),
    streamed=False,
    clock_of="length",
    time_columns=(),
    settings=("variable",),
    code=_code,
    extra="hdf5",
)
