"""The units that a text log states: in the names of its columns, or in a line beside them."""

from __future__ import annotations

from collections.abc import Mapping

from imubench_pipeline.readers.stated_units import StatedUnit, stated
from imubench_pipeline.readers.text.header import completed, says_units
from imubench_pipeline.readers.text.layout import TextLayout


def line_of_units(layout: TextLayout) -> tuple[dict[int, str], bytes]:
    """Return the units that a line beside the names says, by the positions of columns; and it."""
    for raw in layout.preamble:
        if raw == layout.header:
            continue
        text = raw.decode("utf-8", "replace")
        sign = next((sign for sign in layout.comments if text.startswith(sign)), "")
        cells = layout.split.names(text.lstrip(sign) if sign else text, len(layout.names))
        if completed(cells, layout.names) and says_units(cells):
            return {place: cell.strip("()[]{}<> ") for place, cell in enumerate(cells)}, raw
    return {}, b""


def text_units(layout: TextLayout, columns: Mapping[str, int]) -> dict[str, StatedUnit]:
    """Return the units that a log states of its channels.

    Parameters
    ----------
    columns : mapping of str to int
        Position of the column of each channel, and of what is beside them.
    """
    beside, _ = line_of_units(layout)
    found = {}
    for channel, place in columns.items():
        label = layout.names[place] if layout.header else ""
        line = f"the line of units, column {place + 1}"
        unit = stated(channel, ((beside.get(place), line),), label)
        if unit is not None:
            found[channel] = unit
    return found
