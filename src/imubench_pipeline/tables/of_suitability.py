"""Columns of what comes in use: of the tables ``error_budget`` and ``ranking``."""

from __future__ import annotations

from imubench_pipeline.tables.columns import number, text

IN_USE = (
    text("cause", "of a source: noise, start, turn_on_bias, temperature, ...", required=False),
    text("origin", "of a source: measured, datasheet, requirement or not known", required=False),
    text("kind", "of a printed figure: typ, max, 1sigma, ...", required=False),
    text("convention", "how a figure became a standard deviation", required=False),
    number(
        "largest",
        "as in largest_unit",
        "1 sigma with which the limit is kept",
    ),
    text("largest_unit", "SI unit of the figure", required=False),
)
"""Where a source of the table ``error_budget`` is from."""

CONDITIONS = (
    text("conditions", "on which the verdict holds; why a sensor is excluded", required=False),
    text("parts", "every source of 1 % of the variance or more", required=False),
)
"""What the table ``ranking`` says beside its verdict."""
