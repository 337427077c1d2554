"""Read ROS bags: sensor_msgs/Imu of ROS 1 (.bag) and ROS 2 (SQLite, MCAP, or a folder of them).

Columns are ``angular_velocity.x`` ``.y`` ``.z`` in rad/s and ``linear_acceleration.x`` ``.y``
``.z`` in m/s^2, of a topic of sensor_msgs/Imu; ``temperature`` in degC, of a topic of
sensor_msgs/Temperature. ``variable`` is the topic; it is needed if the bag has several topics with
the column. Time columns, with ``unit: ns``: ``header.stamp``, the stamp of the driver, and
``log_time``, the time at which the message was recorded.
"""

from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from imubench_pipeline.extensions.formats.rosbag.version_1 import Bag
from imubench_pipeline.extensions.formats.rosbag.version_2 import Bag2, check_database, check_folder
from imubench_pipeline.readers import file_format as formats
from imubench_pipeline.readers.batch import Batch, LogFile
from imubench_pipeline.readers.bounds import MAX_MESSAGE_BATCH
from imubench_pipeline.readers.stamps import Clock, format_date
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.words.findings import files

# ---------------------------------------------------------------------------------- messages
#
# All are a header (stamp, name of a frame) and float64 numbers, so many can be read at once.

_ENCAPSULATION_BYTES = 4
_CDR_BYTE_ORDERS = {b"\0\1": "<", b"\0\0": ">"}
_NANOSECONDS_PER_SECOND = 10**9


def _make_axis_columns(name: str, first: int) -> dict[str, int]:
    return {f"{name}.{axis}": first + place for place, axis in enumerate("xyz")}


@dataclass(frozen=True)
class Layout:
    """Layout of the numbers of a kind of message, after its header."""

    figures: int  # how many float64 numbers a message has
    columns: dict[str, int]  # index of each number that can be a column
    units: dict[str, str]  # unit of each column, which ROS fixes
    covariances: dict[str, int]  # index of the first one of each quantity; -1 there: not measured


LAYOUTS: dict[str, Layout] = {  # the messages that are read, by type
    # Orientation 0 and covariance 4, angular velocity 13 and 16, acceleration 25 and 28.
    "sensor_msgs/msg/Imu": Layout(
        37,
        _make_axis_columns("angular_velocity", 13) | _make_axis_columns("linear_acceleration", 25),
        dict.fromkeys(_make_axis_columns("angular_velocity", 0), "rad/s")
        | dict.fromkeys(_make_axis_columns("linear_acceleration", 0), "m/s^2"),
        {"angular_velocity": 16, "linear_acceleration": 28},
    ),
    "sensor_msgs/msg/Temperature": Layout(2, {"temperature": 0}, {"temperature": "degC"}, {}),
}


def decode_messages(
    messages: Sequence[bytes], layout: Layout, ros_1: bool
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return header stamps, ns, numbers, and whether they are valid, of ROS 1 or CDR messages.

    Shapes (m,), (m, layout.figures) and (m,); NaN where a message has another layout.
    """
    stamps = np.zeros(len(messages), np.int64)
    figures = np.full((len(messages), layout.figures), np.nan)
    sound = np.zeros(len(messages), bool)
    alike: dict[tuple[int, bytes], list[int]] = {}
    for place, message in enumerate(messages):
        alike.setdefault((len(message), b"" if ros_1 else message[:2]), []).append(place)
    for (size, encapsulation), places in alike.items():
        order = "<" if ros_1 else _CDR_BYTE_ORDERS.get(encapsulation)
        before = size - 8 * layout.figures
        if not ros_1:
            # CDR aligns float64 to 8 bytes after its own 4 bytes; padding may follow.
            before -= (before - _ENCAPSULATION_BYTES) % 8
        if order is None or before < 16:
            continue
        table = np.frombuffer(b"".join(messages[place] for place in places), np.uint8)
        table = table.reshape(len(places), size)
        header = np.ascontiguousarray(table[:, 4:16]).view(f"{order}u4").astype(np.uint32)
        seconds, nanoseconds, name_size = header.T
        if not ros_1:
            seconds = seconds.astype(np.uint32).view(np.int32)
        begins = 16 + name_size.astype(np.int64)
        if not ros_1:
            begins += -(begins - _ENCAPSULATION_BYTES) % 8
        good = (begins == before) & (nanoseconds < _NANOSECONDS_PER_SECOND)
        written = np.ascontiguousarray(table[good, before : before + 8 * layout.figures])
        chosen = np.array(places)[good]
        figures[chosen] = written.view(f"{order}f8")
        whole = seconds[good].astype(np.int64)
        stamps[chosen] = whole * _NANOSECONDS_PER_SECOND + nanoseconds[good]
        sound[chosen] = True
    return stamps, figures, sound


_BATCH_MESSAGES = 1 << 14
_join_names = partial(formats.join_first, most=10)
_SQLITE_MAGIC = b"SQLite format 3"
HEADER_STAMP, LOG_TIME = "header.stamp", "log_time"  # the columns of time


Source = Bag | Bag2


class RosbagFile(LogFile):
    """One topic of a ROS bag."""

    fixed_units: ClassVar = {"gyro": "rad/s", "accel": "m/s^2"}
    fixed_by: ClassVar = "the type sensor_msgs/Imu of its topic"

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the bag (see `LogFile.batches`)."""
        time = self.log.time
        if time is not None and time.column not in (HEADER_STAMP, LOG_TIME):
            raise RecordingError(
                f"{self.path.name}: no time column {time.column!r}; a ROS bag has {HEADER_STAMP!r} "
                f"and {LOG_TIME!r}; correct 'column' of 'time' in the sensor file"
            )
        if time is not None and time.unit != "ns":
            raise RecordingError(
                f"{self.path.name}: {time.column} is {time.unit or time.format} in the sensor "
                "file, but a ROS bag has ns; expected 'unit: ns' of 'time'"
            )
        with closing(open_bag(self.path)) as source:
            topic, kind = self._topic(source)
            yield from self._read(source, topic, LAYOUTS[kind])

    def _read(self, source: Source, topic: str, layout: Layout) -> Iterator[Batch]:
        sound = damaged = 0
        absent = dict.fromkeys(layout.covariances, 0)
        wraps = None if self.log.time is None else self.log.time.wraps
        clock = Clock(self, wraps, lambda first: format_date(int(first)))
        for times, messages in self._blocks(source, topic):
            stamps, figures, good = decode_messages(messages, layout, source.ros_1)
            sound += int(good.sum())
            damaged += int(np.count_nonzero(~good))
            self._blank(figures, layout, absent)
            time = None
            if self.log.time is not None:
                chosen = stamps if self.log.time.column == HEADER_STAMP else times
                figures, chosen = figures[good], chosen[good]
                if not len(chosen):
                    continue
                time = clock.seconds(chosen, np.ones(len(chosen), bool))
            columns = {}
            for name, wanted in self.sources.items():
                raw = figures[:, layout.columns[str(wanted.column)]]
                columns[name] = self.to_si(name, np.ascontiguousarray(raw))
            yield Batch(time, columns)
        if not sound:
            raise RecordingError(
                f"{self.path.name}: no message of {topic} can be read, {damaged} do not match "
                "their type; expected messages as ROS writes them (in ROS 2 CDR, uncompressed "
                "unless metadata.yaml states it); record the bag again or convert it"
            )
        self._report(topic, source.unclosed, damaged, absent)

    def _blank(self, figures: NDArray[np.float64], layout: Layout, absent: dict[str, int]) -> None:
        """Set quantities to NaN that a message marks as not measured; count them."""
        for quantity, place in layout.covariances.items():
            columns = [
                layout.columns[str(source.column)]
                for source in self.sources.values()
                if str(source.column).startswith(quantity)
            ]
            without = figures[:, place] == -1
            if columns and without.any():
                figures[np.ix_(without, columns)] = np.nan
                absent[quantity] += int(without.sum())

    def _blocks(
        self, source: Source, topic: str
    ) -> Iterator[tuple[NDArray[np.int64], list[bytes]]]:
        """Yield the messages of a topic in blocks, with their times of recording."""
        incoming = source.messages(topic)
        while True:
            times: list[int] = []
            messages: list[bytes] = []
            size = 0
            with explain_errors(self.path):
                for time, message in incoming:
                    times.append(time)
                    messages.append(message)
                    size += len(message)
                    if len(times) == _BATCH_MESSAGES or size > MAX_MESSAGE_BATCH:
                        break
                written = np.array(times, np.int64)
            if not times:
                return
            yield written, messages

    def _topic(self, source: Source) -> tuple[str, str]:
        with explain_errors(self.path):
            topics = source.topics()
        stated = {source.variable for source in self.sources.values() if source.variable}
        if len(stated) > 1:
            raise RecordingError(
                f"{self.path.name}: columns of the topics {_join_names(sorted(stated))} cannot be "
                "read together, because each topic has its own clock; state one topic only"
            )
        able = {
            topic: kind
            for topic, kind in topics.items()
            if kind in LAYOUTS
            and all(source.column in LAYOUTS[kind].columns for source in self.sources.values())
        }
        wanted = ", ".join(str(source.column) for source in self.sources.values())
        present = _join_names(f"{topic} ({kind})" for topic, kind in sorted(topics.items()))
        if stated:
            (name,) = stated
            chosen = [topic for topic in able if topic.strip("/") == name.strip("/")]
        else:
            name, chosen = "", sorted(able)
        if len(chosen) == 1:
            return chosen[0], able[chosen[0]]
        if chosen:
            raise RecordingError(
                f"{self.path.name}: several topics have {wanted}: {_join_names(chosen)}; name one "
                "with 'variable:' at each column in the sensor file"
            )
        cut = " (the bag is cut short, or was not closed)" if source.unclosed else ""
        expected = "; ".join(f"{kind}: {', '.join(LAYOUTS[kind].columns)}" for kind in LAYOUTS)
        raise RecordingError(
            f"{self.path.name}: no topic {name + ' ' if name else ''}with {wanted}; found "
            f"{present or 'none'}{cut}; expected a topic of {expected}; correct 'variable' or "
            "'column' in the sensor file"
        )

    def _report(self, topic: str, unclosed: bool, damaged: int, absent: dict[str, int]) -> None:
        name = self.path.name
        if damaged:
            timed = self.log.time is not None
            self.note(files.DamagedMessage(name, damaged, topic, timed), damaged)
        for quantity, count in absent.items():
            if count:
                self.note(files.NotMeasured(name, count, topic, quantity), count)
        if unclosed:
            self.note(files.TruncatedFile(name, "bag"), 1)
        # The journals of SQLite have the latest records.
        beside = [self.path.with_name(f"{self.path.name}-wal")]
        for journal in self.path.glob("*-wal") if self.path.is_dir() else beside:
            if journal.is_file() and journal.stat().st_size:
                self.note(files.TruncatedFile(name, "journal", journal.name), 1)


@contextmanager
def explain_errors(path: Path) -> Iterator[None]:
    """Convert all exceptions of the libraries about a bag to `RecordingError`."""
    try:
        yield
    except RecordingError:
        raise
    # The libraries raise any exception of their parsers: struct.error, KeyError, ...
    except Exception as error:
        reason = " ".join(str(error).replace(f"{path.parent}/", "").split())[:300]
        if isinstance(error, MemoryError):
            reason = "a record promises more bytes than memory can hold"
        raise RecordingError(
            f"{path.name}: corrupt, or cut short ({reason or type(error).__name__}); "
            "expected a ROS bag; copy it again, or repair it ('ros2 bag reindex', 'mcap recover', "
            "'.recover' of sqlite3)"
        ) from None


def open_bag(path: Path) -> Source:
    """Open a bag (a file, or a folder of ROS 2) by its content, or raise RecordingError."""
    with explain_errors(path):
        try:
            if path.is_dir():
                for database in sorted(path.glob("*.db3")):
                    check_database(database)
                check_folder(path)
                return Bag2(Reader(path))
            with path.open("rb") as file:
                begin = file.read(16)
            if begin.startswith(b"\x89MCAP"):
                return Bag2(McapReader(path))
            if begin.startswith(_SQLITE_MAGIC):
                check_database(path)
                return Bag2(Sqlite3Reader(path))
            return Bag(path)
        except OSError as error:
            raise RecordingError(
                f"{path.name}: cannot be opened ({error.strerror or error})"
            ) from None


_MAX_SLOW_MESSAGES = 20  # largest number of messages of a slow topic that are examined


def list_topics(path: Path, file_format: formats.FileFormat) -> list[formats.LogTable]:
    """Return a table for each topic; raise `RecordingError` if there is none."""
    with closing(open_bag(path)) as source, explain_errors(path):
        topics, counts = source.topics(), source.counts()
        if not topics:
            raise RecordingError(
                f"{path.name}: the bag has no topic that can be read; expected "
                "sensor_msgs/Imu; 'rosbag reindex' may repair a damaged bag"
            )
        return [
            _describe_topic(file_format, source, topic, kind, counts.get(topic))
            for topic, kind in sorted(topics.items())
        ]


def _describe_topic(
    file_format: formats.FileFormat, source: Source, topic: str, kind: str, rows: int | None
) -> formats.LogTable:
    if kind not in LAYOUTS:
        kinds = " or ".join(name.replace("/msg/", "/") for name in LAYOUTS)
        return formats.LogTable(
            file_format, topic, rows=rows, about=kind, fault=f"is {kind}; only {kinds} are read"
        )
    layout = LAYOUTS[kind]
    count = formats.MAX_EXAMINED_RECORDS if layout.covariances else _MAX_SLOW_MESSAGES
    messages = [] if rows == 0 else list(islice(source.messages(topic), count))
    stamps, figures, sound = decode_messages([data for _, data in messages], layout, source.ros_1)
    columns = []
    for name, place in layout.columns.items():
        values = figures[sound, place]
        covariance = layout.covariances.get(name.partition(".")[0])
        if covariance is None or (figures[sound, covariance] != -1).any():  # it is measured
            columns.append(formats.LogColumn.of_numbers(name, name, values, layout.units[name]))
    logged = np.array([time for time, _ in messages], np.int64)
    for name, times in ((HEADER_STAMP, stamps[sound]), (LOG_TIME, logged[sound])):
        columns.append(formats.LogColumn.of_numbers(name, name, times, "ns"))
    fault = None if sound.any() else "has no message that can be read"
    described = tuple(columns) if sound.any() else ()
    return formats.LogTable(
        file_format, topic, described, topic, rows=rows, about=kind, fault=fault
    )
