"""The tables of what noise means in use: budgets, verdicts, fusion, repeatability, shortlist."""

from __future__ import annotations

from imubench_pipeline.tables.columns import (
    CHANNEL,
    KEYS,
    RECORDING,
    SENSOR,
    count,
    flag,
    number,
    text,
)

IN_USE = (
    text("cause", "of a source: noise, start, turn_on_bias, temperature, ...", required=False),
    text("origin", "of a source: measured, datasheet, requirement or not known", required=False),
    text("kind", "of a printed figure: typ, max, 1sigma, ...", required=False),
    text("convention", "how a figure became a standard deviation", required=False),
    number("largest", "as in largest_unit", "1 sigma with which the limit is kept"),
    text("largest_unit", "SI unit of the figure", required=False),
)
"""Where a source of the table ``error_budget`` is from."""

CONDITIONS = (
    text("conditions", "on which the verdict holds; why a sensor is excluded", required=False),
    text("parts", "every source of 1 % of the variance or more", required=False),
)
"""What the table ``ranking`` says beside its verdict."""


ERROR_GROWTH = (
    SENSOR,
    RECORDING,
    text("axis", "worst: of all axes; or x, y or z alone, where there are several"),
    text("gyro", "channel that answers"),
    text("accel", "channel that answers", required=False),
    number("window", "s", "at rest right before, from which biases and tilt are taken", True),
    text("error", "attitude, heading, velocity or position"),
    number("time", "s", "of dead reckoning", required=True),
    text("source", "total, or what the error comes of"),
    number("sigma", "as in unit", "standard deviation", required=True),
    number("lower", "as in unit", "lower 95 % limit of a total"),
    number("upper", "as in unit", "upper 95 % limit of a total"),
    text("unit", "SI unit"),
)

DRAWN_DEVIATIONS = (
    *KEYS,
    number("tau", "s", "averaging time", required=True),
    count("draw", "place of a noise model drawn, the lowest first; null: the estimate itself"),
    number("adev", "rad/s or m/s^2", "Allan deviation of the noise model", required=True),
    text("unknown", "parameters that matter and that the log does not tell", required=False),
)

BACKTEST = (
    *KEYS,
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
    flag(
        "contradicted",
        "1.1 times the prediction or more, sure at 1 % for all rows of the recording",
        required=False,
    ),
    text("unit", "SI unit"),
    text("taken_out", "in the log, not in the model: kinds of deterministic", required=False),
    number("duration_needed", "s", "length of a log that can be tested so"),
    text("reason", "why it cannot be done", required=False),
)

BACKTESTED = (
    text("backtest_channel", "that the error mostly comes of; null: not tested", required=False),
    number("backtest_ratio", "-", "error that its log shows of its part, over the predicted one"),
    number("backtest_ratio_lower", "-", "lower end of where it lies in 95 % of logs"),
    number("backtest_ratio_upper", "-", "upper end"),
    count("backtest_windows", "of the log, overlapping"),
)
"""What the table ``ranking`` says of it."""


_OF_SPECIMENS = (
    count("specimens", "devices that the figures stand on"),
    count("recordings", "recordings that they stand on"),
    number("longest_log", "s", "duration of the longest of them"),
    number("spread", "-", "standard deviation of ln sigma between specimens; null: unknown"),
    text(
        "spread_of",
        "specimens; recordings (of one specimen); other sensors (of one specimen)",
        required=False,
    ),
)
"""Of the table ``ranking``: on what its figures stand."""

_OF_EVIDENCE = (
    text("evidence", "of this limit: strong or weak; null: nothing is known", required=False),
    text(
        "evidence_reasons",
        "one_specimen, short_log, wide_interval, few_axes, or codes of the table doubts",
        required=False,
    ),
)
"""Of the table ``ranking``: how far the logs carry."""

_UNLESS = (
    text("unless", "what the verdict would be, if what is doubted were mended", required=False),
    text("unless_verdict", "of the sensor, with the unit that is in doubt mended", required=False),
    number("unless_margin", "-", "its margin"),
    text("logged_verdict", "of what was left out, as it was logged", required=False),
    number("logged_margin", "-", "its margin"),
)
"""Of the table ``ranking``: verdicts that a doubt could turn."""

RANKING = (
    text("requirement", "file under config/requirements, without .yaml"),
    SENSOR,
    count("rank", "1 is the best; null: not ranked"),
    text("tied_with", "sensors whose intervals overlap", required=False),
    text("verdict", "passes, probably passes, probably fails, surely fails, ..."),
    flag("decides", "the limit with the least margin"),
    text("recording", "that answers: of several, nearest to sigma", required=False),
    text("error", "as in error_budget"),
    number("time", "s", "as in error_budget; of an outage with trajectory", required=True),
    text("trajectory", "of an outage of GNSS; null: an error budget", required=False),
    number("at_most", "as in unit", "the limit as it was asked for"),
    number("confidence", "-", "chance of an error within it that was asked for"),
    number("limit", "as in unit", "the same as a standard deviation: the largest allowed"),
    number("sigma", "as in unit", "standard deviation of the error, of the next specimen"),
    number("lower", "as in unit", "lower 95 % limit"),
    number("upper", "as in unit", "upper 95 % limit"),
    text("unit", "SI unit"),
    number("margin", "-", "limit over sigma"),
    number("chance", "-", "that sigma is within limit, as far as logs and specimens tell"),
    text("limit_verdict", "of this limit alone"),
    text("source", "the largest contribution", required=False),
    number("share", "-", "its part of the variance"),
    number("reached_after", "s", "time after which the limit is reached"),
    *CONDITIONS,
    text("reason", "what is not known", required=False),
    text("doubts", "of the recording; empty: none", required=False),
    text("left_out", "recordings that do not decide, and why", required=False),
    *_OF_SPECIMENS,
    *_OF_EVIDENCE,
    *_UNLESS,
    *BACKTESTED,
)
"""The table ``ranking``."""

_SIZES = (
    ("position", "m", "in the plane"),
    ("velocity", "m/s", "in the plane"),
    ("heading", "rad", "about the vertical"),
)

NAVIGATION = (
    SENSOR,
    text("recording", "whose estimates tune the filter"),
    text("trajectory", "field, car, drone or rest", required=False),
    number("outage", "s", "length of the outages of GNSS; null: epochs with GNSS"),
    text(
        "tuning",
        "method of the estimate, datasheet, datasheet_misread, times_ten, table_1, overbound, "
        "or true: the model of the simulated sensor",
    ),
    flag("recommended", "the recommended estimate", required=False),
    text("model", "terms of gyros and of accelerometers in the filter", required=False),
    count("states", "of the filter, position, velocity and attitude included"),
    text(
        "signals",
        "errors of the sensor: simulated by the truth of its recording, by its estimate, or "
        "pieces of its log",
        required=False,
    ),
    text("assumed", "of another sensor, as the recording does not have it", required=False),
    count("runs", "that a row is of"),
    count("outages", "of this length in all runs"),
    *(
        column
        for name, unit, where in _SIZES
        for column in (
            number(name, unit, f"rms of the error {where}, at the end of outages or at all fixes"),
            number(f"{name}_lower", unit, "lower 95 % limit, by the scatter of the runs"),
            number(f"{name}_upper", unit, "upper 95 % limit"),
            number(f"{name}_predicted", unit, "rms that the filter expects"),
            number(f"{name}_ratio", "-", "rms over that of the true model on the same signals"),
            number(f"{name}_ratio_lower", "-", "lower 95 % limit"),
            number(f"{name}_ratio_upper", "-", "upper 95 % limit"),
        )
    ),
    number("nees_inside", "-", "share of epochs with NEES within its 95 % bounds"),
    number("nees_error", "-", "standard error of that share"),
    number("nees_position", "-", "likewise of the position alone"),
    number("nees_velocity", "-", "of the velocity"),
    number("nees_attitude", "-", "of the attitude"),
    number(
        "nees_gyro",
        "-",
        "of the biases of the gyros; null: not known, or flicker",
    ),
    number("nees_accel", "-", "of the biases of the accelerometers"),
    flag(
        "consistent",
        "that share, with twice its error, is 0.9 to 1; null: the runs do not tell",
        required=False,
    ),
    flag("smallest", "of the consistent tunings that with the fewest states", required=False),
    text("reason", "why there is no such tuning", required=False),
)
"""The table ``navigation``."""

NEXT_STEPS = (
    SENSOR,
    text("recording", "name of the recording; null: a new one", required=False),
    text("requirements", "whose verdicts it is about"),
    text(
        "action",
        "check_unit, find_figures, add_channels, record_again, log_longer or add_specimens",
    ),
    count("verdicts_turned", "verdicts that it may change, or settle", required=True),
    count("verdicts_strengthened", "verdicts whose evidence it makes stronger", required=True),
    number("duration", "s", "length of the log that it takes"),
    count("specimens", "how many more specimens it takes"),
    text("text", "in words"),
)
"""The table ``next_steps``: what to do, what weighs most first."""


_SI = "rad/s or m/s^2"

GRADES = (
    text("quantity", "gyro or accel"),
    text("sensor", "of which several are averaged"),
    text("recording", "that answers for it: of its middle channel"),
    text("channel", "that answers"),
    flag("simulated", "that recording is simulated"),
    text("grade", "sensor of the class that is to be reached, by its datasheet"),
    text("grade_name", "its vendor and model"),
    text("option", "of that one", required=False),
    text("statistic", "N, or sigma_min: the lowest point of the curve"),
    number("value", "SI", "of one of them"),
    number("lower", "SI", "lower 95 % limit"),
    number("upper", "SI", "upper 95 % limit"),
    number("printed", "SI", "of the grade, in the same convention"),
    number("n", "-", "how many equal it, not rounded, if they have nothing in common"),
    number("n_lower", "-", "by the lower limit"),
    number("n_upper", "-", "by the upper limit"),
    text("reason", "why there is no n", required=False),
)

FUSION = (
    text("quantity", "gyro or accel"),
    number("tau", "s", "averaging time at which they are compared", required=True),
    text("sensor", "of which several are averaged"),
    text("recording", "that answers for it: of its median channel", required=False),
    text("channel", "that answers", required=False),
    flag("simulated", "that recording is simulated", required=False),
    number("adev", _SI, "Allan deviation of one of them, by its noise model"),
    number("floor", _SI, "part of it that all have in common: any number keeps it"),
    number("common_share", "-", "the same as a part of the variance"),
    number("temperature_share", "-", "part of the variance that temperature adds: common"),
    text("other", "sensor of which one is to be equalled"),
    text("other_recording", "that answers for it", required=False),
    text("other_channel", "that answers", required=False),
    flag("other_simulated", "that one is simulated", required=False),
    number("other_adev", _SI, "its Allan deviation"),
    number("n", "-", "how many equal it, not rounded; below 1: one is better"),
    number("lower", "-", "lower 95 % limit of n; null: no number is enough"),
    number("upper", "-", "upper 95 % limit of n; null: no number may be enough"),
    flag("reachable", "some number is enough", required=False),
    text("reason", "why there is no n or no limit", required=False),
    text("doubts", "of both recordings; empty: none", required=False),
)
"""The table ``fusion``."""


REPEATABILITY = (
    SENSOR,
    text("device", "whose recordings are compared"),
    CHANNEL,
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


SHORTLIST = (
    text("requirement", "file under config/requirements, without .yaml"),
    text("sensor", "of the catalogue"),
    text("price_class", "as stated", required=False),
    number("best_margin", "-", "limit over error, of the best that the datasheet allows"),
    number("worst_margin", "-", "of the worst that it allows; null: not known"),
    text("decides", "the limit with the least margin at the best", required=False),
    text("verdict", "cannot pass, worth logging, passes at its worst, or not judged"),
    text("measured_margin_of", "logs or simulated logs; null: not measured", required=False),
    number("measured_margin", "-", "limit over error by its logs: see the table ranking"),
    text("measured_verdict", "as of the table ranking", required=False),
    text("assumed", "what is not printed, and what stands for it", required=False),
    text("reason", "what it lacks, or why it is not judged", required=False),
)
"""The table ``shortlist``."""
