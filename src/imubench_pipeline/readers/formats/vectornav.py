"""Asynchronous sentences of VectorNav's sensors."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers import vectornav

    return Code(vectornav.VectorNavFile, vectornav.tables)


FORMAT = FileFormat(
    name="vectornav",
    title="VectorNav ASCII sentences",
    endings=(".txt", ".log"),
    signature=Signature(within=(b"$VN",)),
    streamed=True,
    clock_of="file",
    time_columns=("host_time", "counter"),
    settings=(),
    code=_code,
    vendor="VectorNav",
)
