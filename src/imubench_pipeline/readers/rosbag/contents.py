"""What a ROS bag holds, told from its index and its first messages."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np

from imubench_pipeline.readers.file_format import ROWS, FileFormat, LogColumn, LogTable, shown
from imubench_pipeline.readers.rosbag.file import LOG_TIME, STAMP, Source, explained, opened
from imubench_pipeline.readers.rosbag.messages import LAYOUTS, Layout, figures_of
from imubench_pipeline.tables.findings import RecordingError

_RARE = 20
"""Messages of a slow topic that are looked at."""


def tables(path: Path, file_format: FileFormat) -> list[LogTable]:
    """Return a table for each topic.

    Parameters
    ----------
    path : Path
        A file, or the folder of a ROS 2 bag.

    Raises
    ------
    RecordingError
        If it is no bag, or has no topic.
    """
    source = opened(path)
    try:
        with explained(path):
            topics, counts = source.topics(), source.counts()
            if not topics:
                raise RecordingError(f"{path.name}: the bag has no topic; expected sensor_msgs/Imu")
            return [
                _table(file_format, source, topic, kind, counts.get(topic))
                for topic, kind in sorted(topics.items())
            ]
    finally:
        source.close()


def _table(
    file_format: FileFormat, source: Source, topic: str, kind: str, rows: int | None
) -> LogTable:
    if kind not in LAYOUTS:
        known = " or ".join(name.replace("/msg/", "/") for name in LAYOUTS)
        return LogTable(
            file_format, topic, rows=rows, about=kind, fault=f"is {kind}; only {known} are read"
        )
    layout = LAYOUTS[kind]
    count = ROWS if layout.covariances else _RARE
    columns = () if rows == 0 else _columns(source, topic, layout, count)
    fault = None if columns else "has no message that can be read"
    return LogTable(file_format, topic, columns, topic, rows=rows, about=kind, fault=fault)


def _columns(source: Source, topic: str, layout: Layout, count: int) -> tuple[LogColumn, ...]:
    messages = list(islice(source.messages(topic), count))
    if not messages:
        return ()
    stamps, figures, sound = figures_of([data for _, data in messages], layout, source.ros_1)
    if not sound.any():
        return ()
    columns = []
    for name, place in layout.columns.items():
        values = figures[sound, place]
        covariance = layout.covariances.get(name.partition(".")[0])
        if covariance is not None and (figures[sound, covariance] == -1).all():
            continue  # the messages say that it is not measured
        columns.append(LogColumn(name, name, "number", shown(values), values, layout.units[name]))
    logged = np.array([time for time, _ in messages], np.int64)
    for name, times in ((STAMP, stamps[sound]), (LOG_TIME, logged[sound])):
        columns.append(
            LogColumn(name, name, "number", shown(times), times.astype(np.float64), "ns")
        )
    return tuple(columns)
