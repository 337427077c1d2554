"""Tables of Parquet, Feather and Arrow."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.arrays import arrow, file

    return Code(arrow.ArrowFile, file.tables)


FORMAT = FileFormat(
    name="arrow",
    title="Parquet, Feather or Arrow table",
    endings=(".parquet", ".feather", ".arrow"),
    signature=Signature(begins=(b"PAR1", b"ARROW1", b"FEA1")),
    streamed=False,
    clock_of="length",
    time_columns=(),
    settings=(),
    code=_code,
)
