"""The tables of gyros turned between north and south, on a rate table, and of triads at rest."""

from __future__ import annotations

from imubench_pipeline.tables.columns import (
    RECORDING,
    SENSOR,
    Column,
    count,
    figure,
    flag,
    number,
    text,
)

_RATE = "rad/s"
_KEYS = (SENSOR, RECORDING, text("channel", "the gyro that was turned"))
_PART = text("part", "whole, or the last minutes of the recording")
_METHOD = text(
    "method",
    "pairs, triples, filter, smoother; known_rate is given the rate and starts with 0.1 (deg/s)^2, "
    "known_rate_radians with 0.1 (rad/s)^2",
)

EARTH_RATE_TABLES: dict[str, tuple[Column, ...]] = {
    "earth_rate": (
        *_KEYS,
        _PART,
        _METHOD,
        *figure(
            "earth_rate",
            "ok; ambiguous: the sign may be the other one; given: no estimate; no_turns, no_model, "
            "too_short or not_shown",
        ),
        number("sigma", _RATE, "standard deviation of value, by the noise model"),
        number("sigma_lower", _RATE, "lower 95 % limit of sigma: the noise model is an estimate"),
        number("sigma_upper", _RATE, "upper 95 % limit of sigma"),
        number("white", _RATE, "the least that it can be, N / sqrt(T) / cos(latitude)"),
        number("truth", _RATE, "the Earth's rate", required=True),
        number("off_sigma", "-", "value less truth, in sigma"),
        number("settled", "s", "of known_rate: data until it stays within 10 % of the given"),
        count("dwells", "used"),
        count("turns", "between them"),
        count("samples", "used"),
        count("missing", "samples of the dwells that are not there, or left out as knocks"),
        number("duration", "s", "from the begin of the first dwell to the end of the last"),
        number("latitude", "rad", "as stated with the log", required=True),
        number("block", "s", "length of the blocks that are averaged, at most"),
        text("model", "terms of the noise model", required=False),
        text("model_from", "what that is from", required=False),
    ),
    "earth_rate_series": (
        *_KEYS,
        _PART,
        _METHOD,
        text("quantity", "rate: the estimate of the Earth's; drift: the gyro's slow error"),
        number("time", "s", "from the first sample of the recording", required=True),
        number("value", _RATE, "estimate from the data up to then; smoother: from all", True),
        number("sigma", _RATE, "its standard deviation"),
    ),
    "turning": (
        *_KEYS,
        text("what", "dwell, turn, knock, or a doubt about the whole"),
        count("number", "in order, from 1"),
        number("start", "s", "from the first sample of the recording"),
        number("stop", "s", "its end; of a turn: what is left out for it"),
        number("time", "s", "of a turn: its middle"),
        count("sense", "of a dwell: 1 the axis points north, -1 south"),
        text("found_by", "column, transient, step or schedule", required=False),
        number("peak", _RATE, "of a turn: the largest rate that is sensed of it, or its step"),
        number("mean", _RATE, "of a dwell"),
        text("doubts", "in words", required=False),
    ),
    "earth_rate_prediction": (
        *_KEYS,
        text("of", "goal: what it takes; time: as a run grows; dwell: a run divided in dwells"),
        number("latitude", "rad", "where", required=True),
        number("dwell", "s", "data in each dwell", required=True),
        count("turns", "of the run", required=True),
        number("time", "s", "length of the run", required=True),
        number("sigma", _RATE, "least standard deviation of the Earth's rate"),
        number("relative", "-", "the same over the Earth's rate"),
        number("heading", "rad", "standard deviation of north, the axis lying across it"),
        number("goal", "-", "relative standard deviation that is wanted"),
        flag("best", "of dwell: the best of these", required=False),
        flag("nearly_best", "of dwell: less than 1 % worse", required=False),
    ),
    "earth_rate_published": (
        *_KEYS,
        _PART,
        text("place", "of the source"),
        text("printed", "as printed, with its unit"),
        number("published", _RATE, "the same", required=True),
        number("truth", _RATE, "the Earth's rate", required=True),
        number("duration", "s", "of the run, or of the part", required=True),
        number("white", _RATE, "standard deviation by white noise alone"),
        number("sigma", _RATE, "of the mean over pairs, by the noise that the source prints"),
        number("sigma_filter", _RATE, "of the filter, likewise"),
        number("off_sigma", "-", "published less truth, in sigma"),
        text("verdict", "within the noise or beyond the noise"),
        number("simulated", _RATE, "what the pairs find in the log simulated of this run"),
        number("simulated_filter", _RATE, "what the filter finds in it"),
        text("assumed", "what the source does not print", required=False),
    ),
}
"""Every number is SI."""


_CALIBRATED = (SENSOR, RECORDING, text("channel", "the gyro that was calibrated"))

CALIBRATION_TABLES: dict[str, tuple[Column, ...]] = {
    "calibration": (
        *_CALIBRATED,
        text("run", "rate_table; at_rest with a direction that is stated; positions of a triad"),
        *figure(
            "bias at the first sample used; present_bias: at the end; scale_factor (indicated over "
            "true rate), quadratic, asymmetry (of the scale factors of both senses, over their "
            "mean), linearity (largest deviation from the line over the largest rate); earth_rate, "
            "heading",
            "ok; not_observable: the run cannot tell it; no_model, too_short or not_shown",
        ),
        number("sigma", "as in unit", "standard deviation of value: noise and direction"),
        number("sigma_noise", "as in unit", "the part of it that is by the noise model"),
        number("chance", "-", "of a quadratic, an asymmetry or deviations at least as large"),
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
        *_CALIBRATED,
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


ALIGNMENT = (
    SENSOR,
    text("recording", "static recording that its noise is from"),
    count("positions", "1; or 2, opposite about the vertical", required=True),
    text("method", "coarse or fine"),
    number("time", "s", "of rest, the turn between two positions included", required=True),
    number(
        "roll",
        "rad",
        "standard deviation, level, its nose to the north; null: see reason",
    ),
    number("pitch", "rad", "likewise"),
    number("heading", "rad", "likewise; null where reason says why it is not to be had"),
    text("reason", "why an angle is missing", required=False),
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
"""Every number is SI."""
