"""What every table holds: its columns with type, unit and meaning."""

from __future__ import annotations

import pyarrow as pa

from imubench_pipeline.tables.columns import Column
from imubench_pipeline.tables.columns import count as _count
from imubench_pipeline.tables.columns import curve_limits as _curve_limits
from imubench_pipeline.tables.columns import figure as _figure
from imubench_pipeline.tables.columns import number as _number
from imubench_pipeline.tables.columns import text as _text
from imubench_pipeline.tables.of_alignment import ALIGNMENT_TABLES
from imubench_pipeline.tables.of_backtest import BACKTEST_TABLES
from imubench_pipeline.tables.of_calibration import CALIBRATION_TABLES
from imubench_pipeline.tables.of_deterministic import DETERMINISTIC_TABLES
from imubench_pipeline.tables.of_draws import DRAWN_TABLES
from imubench_pipeline.tables.of_earth_rate import EARTH_RATE_TABLES
from imubench_pipeline.tables.of_failures import FAILURES
from imubench_pipeline.tables.of_fitness import DOUBTS, JUDGED
from imubench_pipeline.tables.of_fusion import FUSION_TABLES
from imubench_pipeline.tables.of_repeatability import REPEATABILITY
from imubench_pipeline.tables.of_shortlist import SHORTLIST
from imubench_pipeline.tables.of_suitability import IN_USE
from imubench_pipeline.tables.of_verdicts import NEXT_STEPS, RANKING

_FITTED = _number("fitted", "as in unit", "what the model has where that is not value; no estimate")
_SENSOR = _text("sensor", "name of the sensor file")
_RECORDING = _text("recording", "name of the recording")
_CHANNEL = _text("channel", "axis and quantity, gyro_x to accel_z")
_DOUBTED = _text("doubts", "of the recording; empty: none", required=False)
_METHOD = _text("method", "estimation method")
_SI = "rad/s or m/s^2"
_DENSITY = "(rad/s)^2/Hz or (m/s^2)^2/Hz"
_KEYS = (_SENSOR, _RECORDING, _CHANNEL)
_LIMITS = _curve_limits(_SI)

TABLES: dict[str, tuple[Column, ...]] = {
    "recordings": (
        _SENSOR,
        _text("device", "specimen of the sensor; by default the recording's name"),
        _RECORDING,
        _text("kind", "static, two_position or rate_table"),
        _text("started", "date and time of the first sample, where known", required=False),
        Column("power_cycled", pa.bool_(), "-", "without power before it; null: not known", False),
        Column("simulated", pa.bool_(), "-", "made from known parameters, not measured"),
        _text("status", "ok, rejected, or failed: a step of its analysis did"),
        _text("reason", "why a recording is rejected or failed", required=False),
        _number("rate", "Hz", "sampling rate used"),
        _text("rate_from", "where it is from: stamps, or stated", required=False),
        _number("rate_error", "Hz", "its standard deviation, as the stamps' scatter tells"),
        _count("samples", "samples present in the longest channel"),
        _number("duration", "s", "from the first to the last sample"),
        _number("temperature_min", "degC", "lowest temperature"),
        _number("temperature_max", "degC", "highest temperature"),
        *JUDGED,
    ),
    "doubts": DOUBTS,
    "findings": (
        _SENSOR,
        _RECORDING,
        _text("channel", "the channel concerned; null: the whole recording", required=False),
        _text("finding", "what was found"),
        _text("severity", "note, warning or fatal"),
        _text("detail", "in words, with what to do"),
        _number("value", "as the finding says", "its size"),
        _number("start", "s", "begin of the part concerned, from the first sample"),
        _number("end", "s", "its end"),
    ),
    "failures": FAILURES,
    "allan": (
        *_KEYS,
        _number("tau", "s", "cluster length, cluster_size / rate", required=True),
        _count("cluster_size", "samples in a cluster", required=True),
        _number("adev", _SI, "Allan deviation", required=True),
        *_LIMITS,
        _number(
            "averaged",
            "-",
            "samples that a cluster really averages: fewer than its size where samples are missing",
        ),
        _count("exponent", "noise type: 0 white, -1 flicker, -2 random walk, 1 and 2 phase noise"),
        _number("share", "-", "part of the differences that missing samples leave"),
    ),
    "parameters": (
        *_KEYS,
        _METHOD,
        Column("recommended", pa.bool_(), "-", "the method to use for this channel"),
        _text("model", "the terms of the model, such as N+GM+K"),
        _count("component", "number of a repeated term, from 1", required=True),
        *_figure(
            "Q, N, B, T_B, K, R; amplitude and frequency of a line; of the curve of the model: "
            "B_curve (bias instability of the curve: highest Allan deviation of all F and GM "
            "terms over 0.664), sigma_min and tau_min (lowest point, up to a ninth of the log)"
        ),
        _number("duration_needed", "s", "length of a log that gives the value to 10 %"),
        _FITTED,
    ),
    "models": (
        *_KEYS,
        _text("model", "the terms: Q, N, F (flicker), GM, K, R"),
        Column("chosen", pa.bool_(), "-", "the model of method likelihood: the lowest BIC"),
        _count("free", "free parameters", required=True),
        _number("log_likelihood", "-", "up to a constant of the channel", required=True),
        _number("bic", "-", "-2 log likelihood + free log(bins); + 4: GM for K, + 6: Q, R", True),
        _number("aic", "-", "-2 log likelihood + 2 free", required=True),
        _number("weight", "-", "of the model among the candidates, by BIC", required=True),
        _number("deviance", "-", "mean of a bin; about 1 where the model is right"),
        _number("chance", "-", "of so poor a fit, if the model is right"),
        _text("verdict", "explained or not explained"),
        _text("note", "where it is furthest from the spectrum; what AIC says", required=False),
        _count("bins", "bins of the spectrum used", required=True),
        _number("band", "Hz", "highest frequency used"),
        _text("band_source", "how it was found", required=False),
    ),
    "lines": (
        *_KEYS,
        _text("kind", "sinusoid; band of noise; alias of a faster line in block means"),
        _number("frequency", "Hz", "of the line", required=True),
        _number("frequency_lower", "Hz", "lower 95 % limit"),
        _number("frequency_upper", "Hz", "upper 95 % limit"),
        _number("amplitude", _SI, "of the sinusoid", required=True),
        _number("amplitude_lower", _SI, "lower 95 % limit"),
        _number("amplitude_upper", _SI, "upper 95 % limit"),
        _number("ratio", "-", "highest density over that of the noise"),
        _number("false_alarm", "-", "chance of one like it in a channel without lines"),
        _number("width", "Hz", "how wide it is"),
    ),
    "envelope": (
        *_KEYS,
        _number("start", "s", "begin of a part of the log, from the first sample", required=True),
        _number("end", "s", "its end", required=True),
        _number("low", "SI", "least sample; degC for temperature"),
        _number("high", "SI", "largest sample"),
        _number("mean", "SI", "mean of the samples"),
        _count("samples", "samples present", required=True),
    ),
    "histogram": (
        *_KEYS,
        _number("lower", "SI", "lower edge of the bin", required=True),
        _number("upper", "SI", "upper edge of the bin", required=True),
        _count("count", "samples in it", required=True),
    ),
    "spectrum": (
        *_KEYS,
        _number("frequency", "Hz", "mean of the bin", required=True),
        _number("lower", "Hz", "lower end of the bin", required=True),
        _number("upper", "Hz", "upper end of the bin", required=True),
        _number("ordinates", "-", "degrees of freedom of the bin", required=True),
        _number("density", _DENSITY, "measured, two-sided", required=True),
        _number("fitted", _DENSITY, "of the chosen model"),
        Column("used", pa.bool_(), "-", "inside the band, and clear of lines"),
    ),
    "fixed_bias": (
        *_KEYS,
        _number("value", "as in unit", "mean of the samples", required=True),
        _text("unit", "SI unit of value"),
    ),
    "temperature": (
        *_KEYS,
        Column("compensated", pa.bool_(), "-", "taken out of the noise: method compensated"),
        *_figure("T_0 (mean temperature), sensitivity, quadratic, lag, bias (at T_0)"),
        _FITTED,
    ),
    "allan_compensated": (
        *_KEYS,
        _number("tau", "s", "cluster length", required=True),
        _number("adev", _SI, "Allan deviation of the log less what temperature adds", True),
        *_LIMITS,
        _number("temperature", _SI, "Allan deviation of what temperature adds", True),
    ),
    "low_pass": (
        *_KEYS,
        _text("kind", "analogue, bilinear or boxcar; null: none shows", required=False),
        _count("order", "of the filter: 1, or that of Butterworth; null: none shows"),
        *_figure("cutoff (-3 dB), N (before the filter), floor (white, behind the filter)"),
        _FITTED,
    ),
    "drift": (
        _SENSOR,
        _text("device", "of which the recordings are compared"),
        _CHANNEL,
        _text("parameter", "N, B_curve, sigma_min, K, B, T_B, Q, R, or bias: the fixed bias"),
        _RECORDING,
        _count("position", "place in the order of the device's recordings, from 1", required=True),
        _text("started", "date and time of the first sample, where known", required=False),
        _number("value", "as in unit", "estimate of this recording"),
        _number("lower", "as in unit", "lower 95 % limit"),
        _number("upper", "as in unit", "upper 95 % limit"),
        _text("unit", "SI unit"),
        _number("expected", "as in unit", "what the earlier recordings let one expect"),
        _number("expected_lower", "as in unit", "lower 95 % limit of the estimate expected"),
        _number("expected_upper", "as in unit", "upper 95 % limit of the estimate expected"),
        _number("change", "-", "value / expected - 1; null for a bias"),
        _number("p_value", "-", "chance of such a difference, if the device has not changed"),
        _text("verdict", "changed or as before; null: cannot be judged", required=False),
        _text("reason", "in words", required=False),
    ),
    "pooled": (
        _SENSOR,
        _text("device", "null: all recordings of the sensor", required=False),
        _CHANNEL,
        _text("parameter", "N, B_curve, sigma_min, K, B, T_B, Q, R, or bias: the fixed bias"),
        _count("recordings", "recordings pooled", required=True),
        _count("left_out", "recordings that have no value to pool", required=True),
        _number("value", "as in unit", "pooled estimate"),
        _number("lower", "as in unit", "lower 95 % limit, the spread between recordings included"),
        _number("upper", "as in unit", "upper 95 % limit"),
        _text("unit", "SI unit"),
        _number("spread", "as in unit", "standard deviation between recordings"),
        _number("spread_lower", "as in unit", "lower 95 % limit of the spread"),
        _number("spread_upper", "as in unit", "upper 95 % limit of the spread"),
        _number("p_value", "-", "chance of such differences, if the recordings agree"),
        _text("verdict", "agree or differ, at 1 %", required=False),
        _text("reason", "in words", required=False),
        _text("doubts", "of the recordings pooled; empty: none", required=False),
    ),
    "reconstruction": (
        *_KEYS,
        _METHOD,
        _number("tau", "s", "cluster length", required=True),
        _number("adev", _SI, "median of the ensemble of simulated logs", required=True),
        _number("lower", _SI, "lower 95 % limit of the ensemble", required=True),
        _number("upper", _SI, "upper 95 % limit of the ensemble", required=True),
        _number("reconstructed", _SI, "Allan deviation of the full-length simulated log", True),
    ),
    "scores": (
        *_KEYS,
        _METHOD,
        _number("rms", _SI, "RMS over tau of reconstructed minus measured Allan deviation"),
        _number("rms_log10", "decades", "RMS over tau of the difference of log10"),
        _number("inside_band", "-", "share of the measured curve inside the 95 % band"),
        _text("reason", "why there is no score", required=False),
    ),
    "datasheet": (
        *_KEYS,
        _text("method", "of the estimate; mean: of the log; temperature: the thermal fit"),
        _text("quantity", "N, bias_instability, K, T_B, allan_deviation, offset, ..."),
        _text(
            "statistic",
            "what is compared: N, adev_minimum, plateau (0.664 B), K, T_B, mean, sensitivity",
        ),
        _number("printed", "as in unit", "figure as printed; null: the verdict says why"),
        _text("unit", "unit as printed", required=False),
        _text("kind", "typ, max, min, range, 1sigma or derived", required=False),
        _text("condition", "as printed", required=False),
        _text("sidedness", "of a noise density, as assumed in this row", required=False),
        _number("comparable", "SI", "the printed figure in the convention of measured"),
        _number("comparable_lower", "SI", "least figure that is printed of it, such as typ"),
        _number("comparable_upper", "SI", "largest figure that is printed of it, such as max"),
        _number("measured", "SI", "estimate of the same quantity"),
        _number("lower", "SI", "lower 95 % limit of measured"),
        _number("upper", "SI", "upper 95 % limit of measured"),
        _number("delta", "-", "measured / comparable - 1"),
        _number("delta_lower", "-", "least that both intervals allow"),
        _number("delta_upper", "-", "largest that both intervals allow"),
        _text("verdict", "better than typ, as printed, worse than typ, not sure, ..."),
        _text("reason", "in words", required=False),
        _DOUBTED,
    ),
    "repeatability": REPEATABILITY,
    "datasheet_curve": (
        *_KEYS,
        _text("sidedness", "of the noise density, as assumed in this row", required=False),
        _number("N", _SI + " times sqrt(s)", "line N / sqrt(tau) of the datasheet"),
        _number("floor", _SI, "bias instability of the datasheet"),
        _number("rms", _SI, "RMS over tau of measured Allan deviation minus the lines'"),
        _number("rms_log10", "decades", "RMS over tau of the difference of log10"),
    ),
    "coverage": (
        _SENSOR,
        _text("vendor", "of the sensor"),
        _text("model", "of the sensor"),
        _text("quantity", "gyro or accel"),
        _text("figure", "N, B, K, T_B, temperature_coefficient or offset"),
        _text("published", "yes, no, other convention, not looked up"),
        _text("as_printed", "every figure of it", required=False),
        _text("document", "with its revision", required=False),
        _text("source", "primary or secondary", required=False),
    ),
    "coverage_by_vendor": (
        _text("vendor", "of the sensors"),
        _text("quantity", "gyro or accel"),
        _text("figure", "N, B, K, T_B, temperature_coefficient or offset"),
        _count("sensors", "of the vendor in the catalogue", required=True),
        _count("yes", "that have it published", required=True),
        _count("other_convention", "that have something akin", required=True),
        _count("no", "that do not", required=True),
        _count("not_looked_up", "that nobody looked it up for", required=True),
    ),
    "error_budget": (
        _SENSOR,
        _RECORDING,
        _text("requirement", "that asks; null: the times of the settings", required=False),
        _text("axis", "worst or median axis of the sensor"),
        _text("gyro", "channel that answers", required=False),
        _text("accel", "channel that answers", required=False),
        _text("error", "attitude, heading, velocity, position; north: heading found at rest"),
        _number("time", "s", "of dead reckoning; of rest for north", required=True),
        _text("source", "total, or what the error comes of"),
        _number("sigma", "as in unit", "standard deviation; null where reason says why"),
        _number("lower", "as in unit", "lower 95 % limit of a total"),
        _number("upper", "as in unit", "upper 95 % limit of a total"),
        _text("drawn", "parameters behind the limits: jointly, or one by one", required=False),
        _number("within", "-", "chance that the total is within limit"),
        _number("limit", "as in unit", "largest standard deviation that is allowed"),
        _text("unit", "SI unit"),
        _number("reached_after", "s", "time after which the limit is reached; null: never"),
        *IN_USE,
        _text("reason", "what is not known", required=False),
        _DOUBTED,
    ),
    "ranking": RANKING,
    "next_steps": NEXT_STEPS,
    "shortlist": SHORTLIST,
    "published": (
        *_KEYS,
        _text("place", "table of the source"),
        _text("figure", "its name there"),
        _text("printed", "as printed, with its unit"),
        _text("of", "log or datasheet: what it says something of"),
        _text("parameter", "N, B, bias or sensitivity"),
        _number("means", "as in unit", "what it stands for as that parameter", required=True),
        _text("unit", "SI unit of the numbers"),
        _number("truth", "as in unit", "of the simulation"),
        _number("curve", "as in unit", "read from the curve of the simulated log; mean of the log"),
        _number("value", "as in unit", "as the recommended method estimates it of that log"),
        _number("lower", "as in unit", "lower 95 % limit"),
        _number("upper", "as in unit", "upper 95 % limit"),
        _number("datasheet", "as in unit", "of the sensor file, in the convention of N and B"),
        _number("datasheet_upper", "as in unit", "the largest of several, or of two readings"),
        _text("reason", "why the printed figure differs", required=False),
    ),
    "simulated_truth": (
        *_KEYS,
        _text("parameter", "as in parameters, temperature and low_pass; bias"),
        _count("component", "number of a repeated term, from 1", required=True),
        _number("value", "as in unit", "true value of the simulation", required=True),
        _text("unit", "SI unit of value"),
        Column("assumed", pa.bool_(), "-", "not published by the source: chosen"),
        _text("source", "where the parameters are published"),
    ),
    **BACKTEST_TABLES,
    **DETERMINISTIC_TABLES,
    **DRAWN_TABLES,
    **FUSION_TABLES,
    **EARTH_RATE_TABLES,
    **CALIBRATION_TABLES,
    **ALIGNMENT_TABLES,
}
"""Every table a run leaves, by name; all numbers are SI (temperatures in degC)."""

PARTS_OF = {"curve": "allan", "estimate_findings": "findings"}
"""Files of a recording that hold rows of another table, and that table."""

SAMPLES = ("envelope", "histogram")
"""The tables of the samples themselves, for the pages of the recordings."""

OF_ONE_RECORDING = (*SAMPLES, "draws")
"""The tables that are kept with each recording and not joined."""

TURNED = tuple(EARTH_RATE_TABLES)
"""The tables of gyros that were turned: only such recordings have rows."""

CALIBRATED = tuple(CALIBRATION_TABLES)
"""The tables of gyros on a rate table, or at rest where it is known how they point."""

OUTLOOK = ("alignment", "earth_rate_prediction")
"""The tables of what each sensor at rest could find; the second has rows of turned gyros, too."""

BY_RECORDING = (
    "recordings",
    "findings",
    "doubts",
    "allan",
    "parameters",
    "reconstruction",
    "scores",
    "models",
    "lines",
    "datasheet",
    "datasheet_curve",
    "spectrum",
    "fixed_bias",
    "temperature",
    "allan_compensated",
    "low_pass",
    "deterministic",
    "simulated_truth",
    "published",
    "error_budget",
    "backtest",
    *TURNED,
    *CALIBRATED,
    "alignment",
)
"""The joined tables in which a recording has rows of its own."""

COMPARED = ("recordings", "allan", "parameters", "simulated_truth")
"""The joined tables from which the figures of all sensors are drawn."""
