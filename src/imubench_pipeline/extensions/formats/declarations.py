"""Declarations of the formats of devices and robots."""

import re
from itertools import islice

from imubench_pipeline.extensions.formats.ubx_frames import Frames
from imubench_pipeline.readers.file_format import Code, FileFormat, Signature

_SENTENCE = re.compile(rb"\$VN[A-Z]{3},[-+.,\d]{8}")
"""The checksum is not tested here: the reader counts the wrong ones."""

_RAW_IMU_LOG = re.compile(rb"[%#]RAWIMUS?X?A,[^;\r\n]{8,200};")

_MIN_MESSAGES = 2
"""Least number of messages with a right checksum. Of two million random blocks of 64 kB, one has
one message and none has two."""


def _has_messages(begin: bytes) -> bool:
    # The log may begin in the middle of a message.
    return len(list(islice(Frames(iter([begin])), _MIN_MESSAGES))) == _MIN_MESSAGES


def _load_vectornav() -> Code:
    from imubench_pipeline.extensions.formats import vectornav

    return Code(vectornav.VectorNavFile, vectornav.list_sentences)


def _load_ubx() -> Code:
    from imubench_pipeline.extensions.formats import ubx

    return Code(ubx.UbxFile, ubx.list_messages)


def _load_novatel() -> Code:
    from imubench_pipeline.extensions.formats import novatel

    return Code(novatel.NovatelFile, novatel.list_logs)


def _load_ulog() -> Code:
    from imubench_pipeline.extensions.formats.flight import messages, ulog

    return Code(ulog.UlogFile, messages.list_kinds)


def _load_dataflash() -> Code:
    from imubench_pipeline.extensions.formats.flight import dataflash, messages

    return Code(dataflash.DataFlashFile, messages.list_kinds)


def _load_rosbag() -> Code:
    from imubench_pipeline.extensions.formats.rosbag import file

    return Code(file.RosbagFile, file.list_topics)


VECTORNAV = FileFormat(
    name="vectornav",
    title="VectorNav ASCII sentences",
    endings=(".txt", ".log"),
    signature=Signature(tells=lambda begin: _SENTENCE.search(begin) is not None),
    streamed=True,
    clock_of="file",
    time_columns=("host_time", "counter"),
    code=_load_vectornav,
    vendor="VectorNav",
)
UBX = FileFormat(
    name="ubx",
    title="u-blox UBX messages",
    endings=(".ubx",),
    signature=Signature(tells=_has_messages),
    streamed=True,
    clock_of="variable",
    time_columns=("time_tag", "sTtag"),
    settings=("variable",),
    code=_load_ubx,
    vendor="u-blox",
)
NOVATEL = FileFormat(
    name="novatel",
    title="NovAtel RAWIMU logs in ASCII",
    endings=(".asc", ".txt", ".log"),
    signature=Signature(tells=lambda begin: _RAW_IMU_LOG.search(begin) is not None),
    streamed=True,
    clock_of="file",
    time_columns=("gnss_time",),
    code=_load_novatel,
)
ULOG = FileFormat(
    name="ulog",
    title="PX4 ULog",
    endings=(".ulg",),
    signature=Signature(begins=(b"ULog\x01\x12\x35",)),
    streamed=True,
    clock_of="variable",
    time_columns=("timestamp", "timestamp_sample"),
    settings=("variable",),
    code=_load_ulog,
)
DATAFLASH = FileFormat(
    name="dataflash",
    title="ArduPilot DataFlash log",
    endings=(".bin",),
    signature=Signature(begins=(b"\xa3\x95\x80\x80",)),
    streamed=True,
    clock_of="variable",
    time_columns=("TimeUS", "SampleUS", "TimeMS"),
    settings=("variable",),
    code=_load_dataflash,
)
ROSBAG = FileFormat(
    name="rosbag",
    title="ROS bag",
    endings=(".bag", ".db3", ".mcap"),
    signature=Signature(
        begins=(b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0"), folder_has="metadata.yaml"
    ),
    clock_of="variable",
    time_columns=("header.stamp", "log_time"),
    settings=("variable",),
    code=_load_rosbag,
    extra="ros",
    measured_by_name=True,
)
