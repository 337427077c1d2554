"""What the page says of datasheets: who publishes what."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_TITLES = {"gyro": "Gyroscope: published figures", "accel": "Accelerometer: published figures"}
_SIGNS = {"yes": "yes", "no": "no", "other convention": "other", "not looked up": "?"}


def coverage_tables(rows: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield a table a quantity: a line a sensor, a column a figure.

    Parameters
    ----------
    rows : sequence of mapping
        The table ``coverage``.
    """
    for quantity, title in _TITLES.items():
        own = [row for row in rows if row["quantity"] == quantity]
        figures = list(dict.fromkeys(row["figure"] for row in own))
        lines: dict[str, dict[str, Any]] = {}
        for row in own:
            name = f"{row['vendor']} {row['model']}"
            line = lines.setdefault(
                row["sensor"], {"name": name, "document": row["document"] or "–", "cells": {}}
            )
            line["cells"][row["figure"]] = {
                "text": _SIGNS[row["published"]],
                "note": row["as_printed"] or "",
                "class": "" if row["published"] == "yes" else "none",
            }
        if not lines:
            continue
        counts = [
            sum(line["cells"][figure]["text"] == "yes" for line in lines.values())
            for figure in figures
        ]
        yield {
            "title": title,
            "figures": [
                figure.replace("_", " ") if len(figure) > 3 else figure for figure in figures
            ],
            "lines": [
                line | {"cells": [line["cells"][figure] for figure in figures]}
                for line in sorted(lines.values(), key=lambda line: str(line["name"]))
            ],
            "counts": [f"{count} of {len(lines)}" for count in counts],
        }
