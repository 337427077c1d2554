"""Logs of PX4."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.flight import messages, ulog

    return Code(ulog.UlogFile, messages.list_kinds)


FORMAT = FileFormat(
    name="ulog",
    title="PX4 ULog",
    endings=(".ulg",),
    signature=Signature(begins=(b"ULog\x01\x12\x35",)),
    streamed=True,
    clock_of="variable",
    time_columns=("timestamp", "timestamp_sample"),
    settings=("variable",),
    code=_code,
)
