"""The table of how many of one sensor, averaged, are as good as one of another."""

from __future__ import annotations

import pyarrow as pa

from imubench_pipeline.tables.columns import Column, number, text

_SI = "rad/s or m/s^2"

FUSION_TABLES: dict[str, tuple[Column, ...]] = {
    "fusion": (
        text("quantity", "gyro or accel"),
        number("tau", "s", "averaging time at which they are compared", required=True),
        text("sensor", "of which several are averaged"),
        text("recording", "that answers for it: of its median channel", required=False),
        text("channel", "that answers", required=False),
        Column("simulated", pa.bool_(), "-", "that recording is simulated", required=False),
        number("adev", _SI, "Allan deviation of one of them, by its noise model"),
        number("floor", _SI, "part of it that all have in common: any number keeps it"),
        number("common_share", "-", "the same as a part of the variance"),
        number("temperature_share", "-", "part of the variance that temperature adds: common"),
        text("other", "sensor of which one is to be equalled"),
        text("other_recording", "that answers for it", required=False),
        text("other_channel", "that answers", required=False),
        Column("other_simulated", pa.bool_(), "-", "that one is simulated", required=False),
        number("other_adev", _SI, "its Allan deviation"),
        number("n", "-", "how many equal it, not rounded; below 1: one is better"),
        number("lower", "-", "lower 95 % limit of n; null: no number is enough"),
        number("upper", "-", "upper 95 % limit of n; null: no number may be enough"),
        Column("reachable", pa.bool_(), "-", "some number is enough", required=False),
        text("reason", "why there is no n or no limit", required=False),
        text("doubts", "of both recordings; empty: none", required=False),
    ),
}
"""The table ``fusion``, by name; all numbers are SI."""
