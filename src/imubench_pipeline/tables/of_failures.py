"""The columns of the table of steps that failed."""

from __future__ import annotations

from imubench_pipeline.tables.columns import text

FAILURES = (
    text("sensor", "name of the sensor file"),
    text("recording", "that is left out; null: a step of the whole sensor", required=False),
    text("step", "of the workflow, which failed"),
    text("cause", "error, killed, or time: it ran past its time"),
    text("reason", "in one line; the log of the step has the rest"),
)
"""Columns of the table ``failures``."""
