"""Binary logs of ArduPilot."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.flight import dataflash, messages

    return Code(dataflash.DataFlashFile, messages.list_kinds)


FORMAT = FileFormat(
    name="dataflash",
    title="ArduPilot DataFlash log",
    endings=(".bin",),
    signature=Signature(begins=(b"\xa3\x95\x80\x80",)),
    streamed=True,
    clock_of="variable",
    time_columns=("TimeUS", "SampleUS", "TimeMS"),
    settings=("variable",),
    code=_code,
)
