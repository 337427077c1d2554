"""The table of how well the triad of each sensor aligns itself at rest."""

from __future__ import annotations

from imubench_pipeline.tables.columns import Column, count, number, text

ALIGNMENT_TABLES: dict[str, tuple[Column, ...]] = {
    "alignment": (
        text("sensor", "name of the sensor file"),
        text("recording", "static recording that its noise is from"),
        count("positions", "1; or 2, opposite about the vertical", required=True),
        text("method", "coarse or fine"),
        number("time", "s", "of rest, the turn between two positions included", required=True),
        number("roll", "rad", "standard deviation, the triad level and its nose to the north"),
        number("pitch", "rad", "likewise"),
        number("heading", "rad", "likewise; null where reason says why it is not to be had"),
        text("reason", "why there is no heading", required=False),
        number("error_roll", "-", "rms of the errors of simulated triads, over roll"),
        number("error_pitch", "-", "likewise, over pitch"),
        number("error_heading", "-", "likewise, over heading"),
        count("simulated", "triads of that check; null: none"),
        number("latitude", "rad", "as set (earth_rate: latitude)", required=True),
        number("gyro_bias", "rad/s", "standard deviation of the fixed biases", required=True),
        text("gyro_bias_from", "what that is from"),
        number("accelerometer_bias", "m/s^2", "standard deviation of the fixed biases", True),
        text("accelerometer_bias_from", "what that is from"),
        text("gyros", "channels whose noise the axes x, y, z have"),
        text("accelerometers", "likewise"),
    )
}
"""Every number is SI."""
