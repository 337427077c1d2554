"""Logs of u-blox receivers: their inertial sensors."""

from itertools import islice

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature
from imubench_pipeline.readers.ubx_frames import Frames

_MIN_MESSAGES = 2
"""Least number of messages with a right checksum. Of two million random blocks of 64 kB, one has
one message and none has two."""


def _has_messages(begin: bytes) -> bool:
    # The log may begin in the middle of a message.
    return len(list(islice(Frames(iter([begin])), _MIN_MESSAGES))) == _MIN_MESSAGES


def _code() -> Code:
    from imubench_pipeline.readers import ubx

    return Code(ubx.UbxFile, ubx.list_messages)


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
