"""The messages of ROS that hold inertial figures, from their bytes.

Both are a header (stamp, name of a frame) and float64 figures, so many can be read at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_ENCAPSULATION = 4
_CDR = {b"\0\1": "<", b"\0\0": ">"}
_SECOND = 10**9


def _xyz(name: str, first: int) -> dict[str, int]:
    return {f"{name}.{axis}": first + place for place, axis in enumerate("xyz")}


@dataclass(frozen=True)
class Layout:
    """Where the figures of a kind of message stand, counted behind its header."""

    figures: int
    """How many there are."""
    columns: dict[str, int]
    """Place of each that can be a column."""
    units: dict[str, str]
    """Unit of each, which ROS fixes."""
    covariances: dict[str, int]
    """Place of the first covariance of a quantity; it is -1 where the quantity is not there."""


LAYOUTS: dict[str, Layout] = {
    # Orientation 0 and covariance 4, angular velocity 13 and 16, acceleration 25 and 28.
    "sensor_msgs/msg/Imu": Layout(
        37,
        _xyz("angular_velocity", 13) | _xyz("linear_acceleration", 25),
        dict.fromkeys(_xyz("angular_velocity", 0), "rad/s")
        | dict.fromkeys(_xyz("linear_acceleration", 0), "m/s^2"),
        {"angular_velocity": 16, "linear_acceleration": 28},
    ),
    "sensor_msgs/msg/Temperature": Layout(2, {"temperature": 0}, {"temperature": "degC"}, {}),
}
"""The messages that are read, by type."""


def figures_of(
    messages: Sequence[bytes], layout: Layout, ros_1: bool
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Read some messages.

    Parameters
    ----------
    messages : sequence of bytes
        As recorded.
    ros_1 : bool
        They are written as ROS 1 does; else as CDR.

    Returns
    -------
    stamps : ndarray of int64
        Stamp of the header, ns.
    figures : ndarray of float64, shape (messages, layout.figures)
        NaN where the message is damaged.
    sound : ndarray of bool
        The message is as its type says.
    """
    stamps = np.zeros(len(messages), np.int64)
    figures = np.full((len(messages), layout.figures), np.nan)
    sound = np.zeros(len(messages), bool)
    alike: dict[tuple[int, bytes], list[int]] = {}
    for place, message in enumerate(messages):
        alike.setdefault((len(message), b"" if ros_1 else message[:2]), []).append(place)
    for (size, encapsulation), places in alike.items():
        order = "<" if ros_1 else _CDR.get(encapsulation)
        before = size - 8 * layout.figures
        if not ros_1:
            # CDR aligns float64 to 8 bytes behind its own 4; some bytes may follow.
            before -= (before - _ENCAPSULATION) % 8
        if order is None or before < 16:
            continue
        table = np.frombuffer(b"".join(messages[place] for place in places), np.uint8)
        table = table.reshape(len(places), size)
        seconds, nanoseconds, name_size = _whole_numbers(table[:, 4:16], f"{order}u4").T
        if not ros_1:
            seconds = seconds.astype(np.uint32).view(np.int32)
        ends = 16 + name_size.astype(np.int64)
        begins = ends if ros_1 else _ENCAPSULATION + -(-(ends - _ENCAPSULATION) // 8) * 8
        good = (begins == before) & (nanoseconds < _SECOND)
        written = np.ascontiguousarray(table[good, before : before + 8 * layout.figures])
        chosen = np.array(places)[good]
        figures[chosen] = written.view(f"{order}f8")
        stamps[chosen] = seconds[good].astype(np.int64) * _SECOND + nanoseconds[good]
        sound[chosen] = True
    return stamps, figures, sound


def _whole_numbers(table: NDArray[np.uint8], kind: str) -> NDArray[np.uint32]:
    return np.ascontiguousarray(table).view(kind).astype(np.uint32)
