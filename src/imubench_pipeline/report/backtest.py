"""The back-test on the pages: observed errors compared with the error budgets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.estimates import BacktestRow
from imubench_pipeline.report.practical import System, choose_unit
from imubench_pipeline.settings.requirements import DIMENSIONS
from imubench_pipeline.words.numbers import duration_text, number_text


def format_backtest(
    rows: Sequence[BacktestRow], requirements: Mapping[str, Any], system: System
) -> list[Mapping[str, object]]:
    """Return the lines of a recording's back-test, from rows of ``backtest``."""
    lines: list[Mapping[str, object]] = []
    for row in rows:
        unit = choose_unit(DIMENSIONS[row.error], system)
        line: dict[str, object] = {
            "requirement": requirements.get(row.requirement, {}).get("title") or row.requirement,
            "channel": row.channel.replace("_", " "),
            "error": f"{row.error}, {duration_text(row.time)}",
            "window": duration_text(row.window) if row.window is not None else "–",
            "measured": "–",
            "predicted": "–",
            "ratio": "–",
            "range": "",
            "windows": "–",
            "verdict": row.verdict,
            "contradicted": row.contradicted,
            "why": row.reason or "",
        }
        if row.predicted is not None:
            line["predicted"] = f"{unit.text(row.predicted, 3)} {unit.sign}"
        if row.ratio is not None:
            line["measured"] = f"{unit.text(row.measured, 3)} {unit.sign}"
            line["ratio"] = number_text(row.ratio, 3)
            line["range"] = format_range(row.ratio_lower, row.ratio_upper)
            independent = f"({number_text(row.independent, 2)} independent)"
            line["windows"] = f"{number_text(row.windows, 9)} {independent}"
        if row.taken_out and not row.reason:
            line["why"] = f"in the log, not in the model: {row.taken_out.replace('_', ' ')}"
        lines.append(line)
    return lines


def format_range(lower: float | None, upper: float | None) -> str:
    """Return the expected range of a ratio."""
    return f"{number_text(lower, 2)} to {number_text(upper, 2)}"


def describe_backtest(row: RankingRow) -> str:
    """Return the back-test of the deciding error, from a row of ``ranking``; empty without one."""
    if row.backtest_ratio is None:
        return ""
    channel = (row.backtest_channel or "all channels").replace("_", " ")
    lower, upper = row.backtest_ratio_lower, row.backtest_ratio_upper
    place = ""
    if lower is not None and upper is not None:
        place = ": inside" if lower <= row.backtest_ratio <= upper else ": outside"
    return (
        f"observed / predicted {row.error} of {channel} after {duration_text(row.time)}: "
        f"{number_text(row.backtest_ratio, 3)} (expected {format_range(lower, upper)}){place}"
    )
