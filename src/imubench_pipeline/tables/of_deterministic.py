"""The table of what is no noise in a log."""

from __future__ import annotations

from imubench_pipeline.tables.columns import Column, number, text

DETERMINISTIC_TABLES: dict[str, tuple[Column, ...]] = {
    "deterministic": (
        text("sensor", "name of the sensor file"),
        text("recording", "name of the recording"),
        text("channel", "axis and quantity, gyro_x to accel_z"),
        text("kind", "bias_step, warm_up_drift or periodic_drift: taken out of the noise"),
        number("start", "s", "of the part that has it, from the first sample", required=True),
        number("end", "s", "its end; of a step both are its place", required=True),
        number("size", "as in unit", "of a step; of a warm-up at its start; amplitude", True),
        number("size_lower", "as in unit", "lower 95 % limit"),
        number("size_upper", "as in unit", "upper 95 % limit"),
        text("unit", "SI unit of the sizes"),
        number("time", "s", "time constant of a warm-up, period of periodic drift"),
        number("time_lower", "s", "lower 95 % limit"),
        number("time_upper", "s", "upper 95 % limit"),
        number("place_error", "s", "half width of the 95 % interval of a step's place"),
        number("gain", "-", "twice the log likelihood that is lost without it"),
    ),
}
"""What `imubench_pipeline.estimators.deterministic` finds; its sizes are SI."""
