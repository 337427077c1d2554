"""Which gyro of a log an experiment is about, as its notes say or as there is only one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

Gyro = Literal["gyro_x", "gyro_y", "gyro_z"]


def stated_gyro(stated: Gyro | None, channels: Sequence[str], what: str) -> str:
    """Return the gyro that is meant.

    Parameters
    ----------
    stated : str or None
        As the notes say; None: the only one of the log.
    channels : sequence of str
        Those that the log has.
    what : str
        Completes "the gyro whose axis ..." of the error.

    Raises
    ------
    ValueError
        If it is not among them, or is not stated and the log has another number of gyros than
        one; the text begins with the key.
    """
    gyros = [name for name in channels if name.startswith("gyro_")]
    if stated in gyros:
        return stated
    in_log = ", ".join(gyros) or "no gyro"
    if stated is not None:
        raise ValueError(f"channel: found {stated!r}; the log has {in_log}")
    if len(gyros) != 1:
        raise ValueError(
            f"channel: missing; expected the gyro whose axis {what}, the log has {in_log}"
        )
    return gyros[0]
