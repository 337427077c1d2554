"""The table of what logs show of their own error budgets."""

from __future__ import annotations

import pyarrow as pa

from imubench_pipeline.tables.columns import Column, count, number, text

BACKTEST_TABLES: dict[str, tuple[Column, ...]] = {
    "backtest": (
        text("sensor", "name of the sensor file"),
        text("recording", "name of the recording"),
        text("channel", "axis and quantity, gyro_x to accel_z"),
        text("requirement", "that has the limit"),
        text("error", "attitude, heading, velocity, position: the part of it of this channel"),
        number("time", "s", "of dead reckoning", required=True),
        number("window", "s", "at rest right before, over which the bias is the mean"),
        count("windows", "of the log, overlapping; those with gaps are left out"),
        number("independent", "-", "windows that would scatter as little, if independent"),
        number("measured", "as in unit", "rms of the error over the windows of the log as it is"),
        number("predicted", "as in unit", "standard deviation by the noise model of the channel"),
        number("predicted_lower", "as in unit", "lower 95 % limit, by the models drawn"),
        number("predicted_upper", "as in unit", "upper 95 % limit"),
        number("ratio", "-", "measured over predicted"),
        number("ratio_lower", "-", "lower end of where it lies in 95 % of logs, the model right"),
        number("ratio_upper", "-", "upper end"),
        number("chance", "-", "of such a ratio or a larger one, if the model is right"),
        text("verdict", "as predicted, more or less than predicted", required=False),
        Column(
            "contradicted",
            pa.bool_(),
            "-",
            "1.1 times the prediction or more, sure at 1 % for all rows of the recording",
            required=False,
        ),
        text("unit", "SI unit"),
        text("taken_out", "in the log, not in the model: kinds of deterministic", required=False),
        number("duration_needed", "s", "length of a log that can be tested so"),
        text("reason", "why it cannot be done", required=False),
    )
}

BACKTESTED = (
    text("backtest_channel", "that the error mostly comes of; null: not tested", required=False),
    number("backtest_ratio", "-", "error that its log shows of its part, over the predicted one"),
    number("backtest_ratio_lower", "-", "lower end of where it lies in 95 % of logs"),
    number("backtest_ratio_upper", "-", "upper end"),
    count("backtest_windows", "of the log, overlapping"),
)
"""What the table ``ranking`` says of it."""
