"""Arrays of NumPy, one in a file (NPY) or several in an archive (NPZ)."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.arrays import file, npy

    return Code(npy.NumpyFile, file.list_tables)


FORMAT = FileFormat(
    name="numpy",
    title="NumPy arrays",
    endings=(".npy", ".npz"),
    signature=Signature(begins=(b"\x93NUMPY",), archive_has=".npy"),
    settings=("variable",),
    code=_code,
)
