"""Bags of ROS 1, and of ROS 2: SQLite, MCAP, or a folder of them."""

from imubench_pipeline.readers.file_format import Code, FileFormat, Signature


def _code() -> Code:
    from imubench_pipeline.readers.rosbag import file

    return Code(file.RosbagFile, file.list_topics)


FORMAT = FileFormat(
    name="rosbag",
    title="ROS bag",
    endings=(".bag", ".db3", ".mcap"),
    signature=Signature(
        begins=(b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0"), folder_has="metadata.yaml"
    ),
    clock_of="variable",
    time_columns=("header.stamp", "log_time"),
    settings=("variable",),
    code=_code,
    extra="ros",
    measured_by_name=True,
)
