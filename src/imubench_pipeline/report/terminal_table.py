"""Tables that fit into the width of a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich import box
from rich.cells import cell_len
from rich.table import Table
from rich.text import Text

_NAME_FOLDS_AT = 16
_GAP = 2


def fit_table(
    title: str,
    heads: Sequence[str],
    lines: Sequence[Sequence[str | Text]],
    width: int,
    *,
    names: int,
) -> Table:
    """Return a table that breaks no word or number, except for names.

    Columns that do not fit into the width are omitted from the right. The head of a
    column of numbers has their unit on a second line; ``names`` is the column that may be broken
    anywhere.
    """
    cells = [["-", *map(str, column)] for column in zip(heads, *lines, strict=True)]
    widths = [max(cell_len(word) for cell in column for word in cell.split()) for column in cells]
    wanted = [
        max(cell_len(text) for cell in column for text in cell.split("\n")) for column in cells
    ]
    widths[names] = min(widths[names], _NAME_FOLDS_AT)
    shown = len(heads)
    while shown > names + 1 and sum(widths[:shown]) + _GAP * (shown - 1) > width:
        shown -= 1
    spare = width - sum(widths[:shown]) - _GAP * (shown - 1)
    while spare > 0:
        lacking = [i for i in range(shown) if widths[i] < wanted[i]]
        # Names can be broken, so they get the rest.
        lacking = [i for i in lacking if i != names] or lacking
        if not lacking:
            break
        for i in lacking[:spare]:
            widths[i] += 1
        spare -= len(lacking)
    left_out = ", ".join(" in ".join(head.split("\n")) for head in heads[shown:])
    table = Table(
        title=title,
        caption=f"no room for: {left_out}" if left_out else None,
        title_justify="left",
        caption_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, _GAP - 1, 0, 0),
        pad_edge=False,
    )
    for head, own in zip(heads[:shown], widths, strict=False):
        justify: Any = "right" if "\n" in head else "left"
        table.add_column(head, justify=justify, width=own, overflow="fold")
    for line in lines:
        table.add_row(*line[:shown])
    return table
