"""The table of turn-on biases against the printed repeatability."""

from __future__ import annotations

from imubench_pipeline.tables.columns import count, number, text

REPEATABILITY = (
    text("sensor", "name of the sensor file"),
    text("device", "whose recordings are compared"),
    text("channel", "axis and quantity, gyro_x to accel_z"),
    count("recordings", "turn-ons that count", required=True),
    text("power_cycled", "between all of them: yes or unknown"),
    number("printed", "as in unit", "bias repeatability as printed"),
    text("unit", "unit as printed", required=False),
    text("kind", "typ, max, min, range, 1sigma or derived", required=False),
    text("condition", "as printed", required=False),
    number("comparable", "SI", "the printed figure"),
    number("measured", "SI", "standard deviation of the fixed bias between recordings"),
    number("lower", "SI", "lower 95 % limit of measured"),
    number("upper", "SI", "upper 95 % limit of measured"),
    number("delta", "-", "measured / comparable - 1"),
    text("verdict", "as of the table datasheet"),
    text("reason", "in words, with the conditions", required=False),
)
"""The table ``repeatability``."""
