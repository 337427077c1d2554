"""Samples of a log beside those of the models that were found of it, on the page of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from imubench_pipeline.report.payload import Arrays, numbers
from imubench_pipeline.report.practical import duration_text, number_text
from imubench_pipeline.typing import Row

NAMES = {
    "log": "the log",
    "before": "model before the fit",
    "after": "model after the fit",
}


def words(rows: Sequence[Row], channel: str) -> str:
    """Return how widely the samples of the models lie beside the log's, in a sentence, if any.

    Of rows of ``samples_of_models`` of a recording.
    """
    own = [row for row in rows if row["channel"] == channel and row["what"] == "deviation"]
    by = {row["of"]: row for row in own}
    if "log" not in by or not by["log"]["mean"]:
        return ""
    ratios = [
        f"{number_text(by[of]['mean'] / by['log']['mean'], 4)} times as widely {of} the fit"
        for of in ("before", "after")
        if of in by
    ]
    if not ratios:
        return ""
    return (
        f"Samples of the models lie {' and '.join(ratios)} as those of the log, of "
        f"{duration_text(by['log']['end'])}."
    )


def payload(rows: Sequence[Row], arrays: Arrays) -> dict[str, Any]:
    """Return what the figures are drawn from, by channel."""
    drawn: dict[str, Any] = {}
    for channel in dict.fromkeys(row["channel"] for row in rows):
        drawn[channel] = {}
        for of in NAMES:
            own = [row for row in rows if (row["channel"], row["of"]) == (channel, of)]
            envelope = [row for row in own if row["what"] == "envelope"]
            stretch = [row for row in own if row["what"] == "stretch"]
            if not envelope:
                continue
            drawn[channel][of] = {
                "name": NAMES[of],
                "end": envelope[-1]["end"],
                **{
                    name: arrays.even(numbers(row[name] for row in envelope))
                    for name in ("low", "high", "mean")
                },
                "stretch": arrays.even(numbers(row["mean"] for row in stretch)),
                "stretch_end": stretch[-1]["end"],
            }
    return drawn
