"""The tables of gyros that were turned between north and south."""

from __future__ import annotations

import pyarrow as pa

from imubench_pipeline.tables.columns import Column, count, figure, number, text

_RATE = "rad/s"
_KEYS = (
    text("sensor", "name of the sensor file"),
    text("recording", "name of the recording"),
    text("channel", "the gyro that was turned"),
)
_PART = text("part", "whole, or the last minutes of the recording")
_METHOD = text("method", "pairs, triples, filter, smoother; known_rate is given the rate")

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
        Column("best", pa.bool_(), "-", "of dwell: the best of these", required=False),
        Column("nearly_best", pa.bool_(), "-", "of dwell: less than 1 % worse", required=False),
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
