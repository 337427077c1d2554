"""Logs of u-blox receivers: their inertial sensors."""

from itertools import islice

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature
from imubench_pipeline.readers.ubx_frames import Frames

_MESSAGES = 2
"""With a right checksum. Of two million files of 64 kB of chance, one has one; none has two."""


def _has_messages(begin: bytes) -> bool:
    # The receiver may be in the middle of something else when the log begins.
    return len(list(islice(Frames(iter([begin])), _MESSAGES))) == _MESSAGES


def _code() -> Code:
    from imubench_pipeline.readers import ubx

    return Code(ubx.UbxFile, ubx.tables)


FORMAT = FileFormat(
    name="ubx",
    title="u-blox UBX messages",
    endings=(".ubx",),
    signature=Signature(tells=_has_messages),
    streamed=True,
    clock_of="variable",
    time_columns=("time_tag", "sTtag"),
    settings=("variable",),
    code=_code,
    vendor="u-blox",
)
