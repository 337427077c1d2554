"""The columns of the tables of verdicts."""

from __future__ import annotations

import pyarrow as pa

from imubench_pipeline.tables.columns import Column, count, number, text
from imubench_pipeline.tables.of_backtest import BACKTESTED
from imubench_pipeline.tables.of_suitability import CONDITIONS

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
    text("sensor", "name of the sensor file"),
    count("rank", "1 is the best; null: not ranked"),
    text("tied_with", "sensors whose intervals overlap", required=False),
    text("verdict", "passes, probably passes, probably fails, surely fails, ..."),
    Column("decides", pa.bool_(), "-", "the limit with the least margin", required=True),
    text("recording", "that answers: of several, nearest to sigma", required=False),
    text("error", "as in error_budget"),
    number("time", "s", "as in error_budget", required=True),
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

NEXT_STEPS = (
    text("sensor", "name of the sensor file"),
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
