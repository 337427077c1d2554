"""Samples of a log compared with logs simulated from its models, on the page of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from imubench_pipeline.model.estimates import ModelSampleRow
from imubench_pipeline.report.payload import Arrays, numbers
from imubench_pipeline.words.numbers import duration_text, number_text

NAMES = {
    "log": "log",
    "before": "model before the fit",
    "after": "model after the fit",
}


def words(rows: Sequence[ModelSampleRow], channel: str) -> str:
    """Return the standard deviations of the simulated samples relative to the log, as a sentence.

    ``rows`` are those of ``samples_of_models`` of a recording; empty without such rows.
    """
    own = [row for row in rows if row.channel == channel and row.what == "deviation"]
    widths = {row.of: row.mean for row in own}
    of_log = widths.get("log")
    if not of_log:
        return ""
    ratios = [
        f"{number_text(width / of_log, 4)} {of} the fit"
        for of in ("before", "after")
        if (width := widths.get(of)) is not None
    ]
    if not ratios:
        return ""
    length = next(row.end for row in own if row.of == "log")
    return (
        f"Standard deviation relative to that of the log ({duration_text(length)}): "
        f"{', '.join(ratios)}."
    )


def payload(rows: Sequence[ModelSampleRow], arrays: Arrays) -> dict[str, Any]:
    """Return the data of the figures, by channel."""
    drawn: dict[str, Any] = {}
    for channel in dict.fromkeys(row.channel for row in rows):
        drawn[channel] = {}
        for of in NAMES:
            own = [row for row in rows if (row.channel, row.of) == (channel, of)]
            envelope = [row for row in own if row.what == "envelope"]
            stretch = [row for row in own if row.what == "stretch"]
            if not envelope:
                continue
            drawn[channel][of] = {
                "name": NAMES[of],
                "end": envelope[-1].end,
                "low": arrays.even(numbers(row.low for row in envelope)),
                "high": arrays.even(numbers(row.high for row in envelope)),
                "mean": arrays.even(numbers(row.mean for row in envelope)),
                "stretch": arrays.even(numbers(row.mean for row in stretch)),
                "stretch_end": stretch[-1].end,
            }
    return drawn
