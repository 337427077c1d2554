"""Logs of devices and robots: u-blox, VectorNav, NovAtel, PX4, ArduPilot and ROS.

`declarations` has the declaration of each format, which imports its code on demand.
"""

from imubench_pipeline.registry import Extension

_NAMES = ("vectornav", "ubx", "novatel", "ulog", "dataflash", "rosbag")

EXTENSION = Extension(
    name="formats", formats={name: f"formats.declarations:{name.upper()}" for name in _NAMES}
)
