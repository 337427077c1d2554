"""What the table ``backtest`` says: in words, as findings, and beside a ranking."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Row


def words(row: Row) -> str:
    """Return a row of the table ``backtest`` in words."""
    if row["ratio"] is None:
        return str(row["reason"])
    return (
        f"this log drifted {row['ratio']:.2f} times the prediction at {row['time']:g} s "
        f"({row['ratio_lower']:.2f} to {row['ratio_upper']:.2f} are to be expected), "
        f"{row['windows']} windows, as good as {row['independent']:.3g} independent ones"
    )


def findings(rows: Iterable[Row]) -> Iterator[Row]:
    """Yield the rows of the table ``findings`` of logs that contradict their own budgets.

    One a channel, of the error whose ratio is least likely.

    Parameters
    ----------
    rows : iterable of mapping
        Of the table ``backtest``.
    """
    worst: dict[tuple[str, str, str], Row] = {}
    for row in rows:
        place = row["sensor"], row["recording"], row["channel"]
        if row["contradicted"] and row["chance"] < worst.get(place, {"chance": 2.0})["chance"]:
            worst[place] = row
    for (sensor, recording, channel), row in worst.items():
        taken_out = row["taken_out"]
        why = (
            f"what is taken out of the noise ({taken_out.replace('_', ' ')}) is in the log"
            if taken_out
            else "its slow terms miss something, such as drift with temperature"
        )
        detail = (
            f"{channel}: {row['error']} after {row['time']:g} s with the bias from "
            f"{row['window']:g} s at rest: {words(row)}. Budgets of this channel are too small: "
            f"{why}"
        )
        finding = Finding("backtest_contradicts", "warning", detail, row["ratio"], channel)
        yield finding.row(sensor, recording)
