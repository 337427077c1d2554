"""Logs of devices and robots: u-blox, VectorNav, NovAtel, PX4, ArduPilot and ROS.

`declarations` has the declaration of each format, which imports its code on demand.
"""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="formats",
    formats={
        "vectornav": "formats.declarations:VECTORNAV",
        "ubx": "formats.declarations:UBX",
        "novatel": "formats.declarations:NOVATEL",
        "ulog": "formats.declarations:ULOG",
        "dataflash": "formats.declarations:DATAFLASH",
        "rosbag": "formats.declarations:ROSBAG",
    },
)
