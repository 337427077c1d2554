"""The table of the noise models that are drawn jointly from the posterior of an estimate."""

from __future__ import annotations

from imubench_pipeline.tables.columns import Column, count, drawn, text

_SI = "rad/s or m/s^2"

DRAWN_TABLES: dict[str, tuple[Column, ...]] = {
    "draws": (
        text("sensor", "name of the sensor file"),
        text("recording", "name of the recording"),
        text("channel", "axis and quantity, gyro_x to accel_z"),
        text("method", "estimation method: likelihood, likelihood_gm or compensated"),
        count("draw", "number of the draw, from 0: a noise model that the log allows", True),
        count("component", "number of a repeated term, from 1", required=True),
        drawn("Q", "rad or m/s", "quantization noise; null: the model has none"),
        drawn("N", "rad/s/sqrt(Hz) or m/s^2/sqrt(Hz)", "white noise; null: it has none"),
        drawn("B", _SI, "bias instability; null: it has none"),
        drawn("T_B", "s", "correlation time; null where B is flicker noise"),
        drawn("K", "rad/s/sqrt(s) or m/s^2/sqrt(s)", "random walk; null: it has none"),
        drawn("R", "rad/s^2 or m/s^3", "ramp; null: it has none"),
    ),
}
"""The table ``draws``, by name; all numbers are SI."""
