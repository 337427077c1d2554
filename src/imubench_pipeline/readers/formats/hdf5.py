"""HDF5 files."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.arrays import file, hdf5

    return Code(hdf5.Hdf5File, file.list_tables)


FORMAT = FileFormat(
    name="hdf5",
    title="HDF5 file",
    endings=(".h5", ".hdf5"),
    signature=Signature(begins=(b"\x89HDF\r\n\x1a\n",)),
    settings=("variable",),
    code=_code,
    extra="hdf5",
)
