"""The tables of gyros on a rate table, and at rest with a direction that is known."""

from __future__ import annotations

from imubench_pipeline.tables.columns import Column, count, figure, number, text

_RATE = "rad/s"
_KEYS = (
    text("sensor", "name of the sensor file"),
    text("recording", "name of the recording"),
    text("channel", "the gyro that was calibrated"),
)

CALIBRATION_TABLES: dict[str, tuple[Column, ...]] = {
    "calibration": (
        *_KEYS,
        text("run", "rate_table, or at_rest with a direction that is stated"),
        *figure(
            "bias at the first sample used; present_bias: at the end; scale_factor (indicated over "
            "true rate), quadratic, asymmetry (of the scale factors of both senses, over their "
            "mean), linearity (largest deviation from the line over the largest rate); earth_rate, "
            "heading",
            "ok; not_observable: the run cannot tell it; no_model, too_short or not_shown",
        ),
        number("sigma", "as in unit", "standard deviation of value: noise and direction"),
        number("sigma_noise", "as in unit", "the part of it that is by the noise model"),
        number(
            "chance",
            "-",
            "of a quadratic, an asymmetry or deviations at least as large",
        ),
        number("half_width", _RATE, "half of the range of the bias that is left open"),
        number("earth_rate", _RATE, "along the axis, which was taken off; null: it was not"),
        number("earth_rate_sigma", _RATE, "its standard deviation, by the direction's"),
        number("truth", "as in unit", "of a simulation"),
        number("scatter", "-", "chance of a scatter of the means at least as large, by the noise"),
        number("latitude", "rad", "as stated"),
        number("heading", "rad", "of the axis, from north towards east; null: not known"),
        number("elevation", "rad", "of the axis above the horizon"),
        number("duration", "s", "from the first to the last sample used"),
        count("samples", "used"),
        count("rates", "of the table that are steady"),
        text("model", "terms of the noise model", required=False),
        text("model_from", "what that is from", required=False),
    ),
    "calibration_points": (
        *_KEYS,
        count("number", "of the steady rate, in order, from 1", required=True),
        number("start", "s", "from the first sample of the recording, settling left out", True),
        number("stop", "s", "its end", required=True),
        number("table_rate", _RATE, "of the table", required=True),
        number("earth_rate", _RATE, "along the axis, beside it; 0 where it is not known", True),
        number("mean", _RATE, "mean reading", required=True),
        number("line", _RATE, "bias and scale factor at that rate", required=True),
        number("residual", _RATE, "mean less line", required=True),
        number("sigma", _RATE, "standard deviation of the residual, by the noise model", True),
    ),
}
"""Every number is SI."""
