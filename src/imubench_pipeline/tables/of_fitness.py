"""The columns that say what is doubted of a recording."""

from __future__ import annotations

from imubench_pipeline.tables.columns import RECORDING, SENSOR, flag, number, text

JUDGED = (
    text("fitness", "fit, fit with doubts or unfit; null: not analysed", required=False),
    flag("decides", "enters rankings, pools and exports", required=False),
    text("doubts", "what puts its figures in doubt; empty: nothing", required=False),
)
"""What the table ``recordings`` says of it."""

DOUBTS = (
    SENSOR,
    RECORDING,
    text("channel", "the channel concerned; null: the whole recording", required=False),
    text("code", "a finding; not_explained: the spectrum; doubtful: a parameter's status"),
    text("fitness", "unfit: the figures may be of something else; else fit with doubts"),
    text("parameters", "on which it bears; null: on all", required=False),
    number("factor", "-", "by which it may change a value, where that is known"),
    number("start", "s", "begin of the part concerned, from the first sample"),
    number("end", "s", "its end"),
    text("reason", "in words"),
)
"""The table ``doubts``."""
