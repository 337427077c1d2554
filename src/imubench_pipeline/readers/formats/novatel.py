"""Raw IMU logs of NovAtel receivers, in ASCII."""

import re

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature

_LOG = re.compile(rb"[%#]RAWIMUS?X?A,[^;\r\n]{8,200};")


def _code() -> Code:
    from imubench_pipeline.readers import novatel

    return Code(novatel.NovatelFile, novatel.list_logs)


FORMAT = FileFormat(
    name="novatel",
    title="NovAtel RAWIMU logs in ASCII",
    endings=(".asc", ".txt", ".log"),
    signature=Signature(tells=lambda begin: _LOG.search(begin) is not None),
    streamed=True,
    clock_of="file",
    time_columns=("gnss_time",),
    code=_code,
)
