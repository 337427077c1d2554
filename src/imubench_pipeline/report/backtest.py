"""The back-test on the pages: what logs show of their own error budgets."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.estimates import BacktestRow
from imubench_pipeline.report.practical import System, unit_of
from imubench_pipeline.settings.requirements import DIMENSIONS
from imubench_pipeline.words.numbers import duration_text, number_text


def backtest_lines(
    rows: Sequence[BacktestRow], requirements: Mapping[str, Any], system: System
) -> list[dict[str, Any]]:
    """Return the lines of the table of a recording's back-test, of rows of ``backtest``."""
    lines = []
    for row in rows:
        unit = unit_of(DIMENSIONS[row.error], system)
        has_ratio = row.ratio is not None
        lines.append(
            {
                "requirement": requirements.get(row.requirement, {}).get("title")
                or row.requirement,
                "channel": row.channel.replace("_", " "),
                "error": f"{row.error}, {duration_text(row.time)}",
                "window": duration_text(row.window) if row.window is not None else "–",
                "measured": f"{unit.text(row.measured, 3)} {unit.sign}" if has_ratio else "–",
                "predicted": f"{unit.text(row.predicted, 3)} {unit.sign}"
                if row.predicted is not None
                else "–",
                "ratio": number_text(row.ratio, 3) if has_ratio else "–",
                "range": range_text(row.ratio_lower, row.ratio_upper) if has_ratio else "",
                "windows": _windows(row) if has_ratio else "–",
                "verdict": row.verdict,
                "contradicted": row.contradicted,
                "why": "; ".join(_remarks(row)),
            }
        )
    return lines


def _windows(row: BacktestRow) -> str:
    independent = number_text(row.independent, 2)
    return f"{number_text(row.windows, 9)} ({independent} independent)"


def range_text(lower: float | None, upper: float | None) -> str:
    """Return between what limits a ratio is to be expected."""
    return f"{number_text(lower, 2)} to {number_text(upper, 2)}"


def standing_text(row: RankingRow) -> str:
    """Return what the log shows of the error by which a sensor stands, a row of ``ranking``.

    Empty where it shows nothing.
    """
    if row.backtest_ratio is None:
        return ""
    channel = (row.backtest_channel or "all channels").replace("_", " ")
    expected = range_text(row.backtest_ratio_lower, row.backtest_ratio_upper)
    return (
        f"the log drifted {number_text(row.backtest_ratio, 3)} times the prediction at "
        f"{duration_text(row.time)} ({channel}, {row.error}; "
        f"{expected} is to be expected), "
        f"{number_text(row.backtest_windows, 9)} windows"
    )


def _remarks(row: BacktestRow) -> Iterator[str]:
    if row.reason:
        yield row.reason
    elif row.taken_out:
        yield f"in the log, not in the model: {row.taken_out.replace('_', ' ')}"
