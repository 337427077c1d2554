"""The table of sensors that are worth logging."""

from __future__ import annotations

from imubench_pipeline.tables.columns import number, text

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
