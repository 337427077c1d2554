"""The tables of what is no noise in a log, and of the noise models that a log allows."""

from __future__ import annotations

from imubench_pipeline.tables.columns import KEYS, count, drawn, number, text

DETERMINISTIC = (
    *KEYS,
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
)
"""What `imubench_pipeline.estimators.deterministic` finds; its sizes are SI."""


_SI = "rad/s or m/s^2"

DRAWS = (
    *KEYS,
    text("method", "estimation method: likelihood, likelihood_gm or compensated"),
    count("draw", "number of the draw, from 0: a noise model that the log allows", True),
    count("component", "number of a repeated term, from 1", required=True),
    drawn("Q", "rad or m/s", "quantization noise; null: the model has none"),
    drawn("N", "rad/s/sqrt(Hz) or m/s^2/sqrt(Hz)", "white noise; null: it has none"),
    drawn("B", _SI, "bias instability; null: it has none"),
    drawn("T_B", "s", "correlation time; null where B is flicker noise"),
    drawn("K", "rad/s/sqrt(s) or m/s^2/sqrt(s)", "random walk; null: it has none"),
    drawn("R", "rad/s^2 or m/s^3", "ramp; null: it has none"),
)
"""The table ``draws``: noise models drawn jointly from the posterior of an estimate."""
