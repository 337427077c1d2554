"""What is known of a parameter of one recording, as a mark of a figure."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.typing import Row

Kind = Literal["estimate", "not identified", "limit"]


@dataclass(frozen=True)
class Mark:
    """What the figure shows of one estimate."""

    place: float  # distance from the top, mm
    kind: Kind
    # the estimate; of a limit the limit; of what is not identified what the model has
    value: float | None
    # lower, upper: 95 % limits
    lower: float | None = None
    upper: float | None = None


def marks(view: ChannelView, symbol: str, place: float, spread: float = 0.0) -> Iterator[Mark]:
    """Yield what is known of a parameter, one mark a component of the model.

    ``spread`` is the height for these about the place of the recording, in the same unit.
    """
    if view.recommended not in view.parameters:
        return
    rows = [row for row in view.named(view.recommended, symbol) if _is_shown(row)]
    for number, row in enumerate(rows):
        yield _mark(row, place + spread * ((number + 0.5) / len(rows) - 0.5))


def _is_shown(row: Row) -> bool:
    return row["value"] is not None or bool(row["upper"])


def _mark(row: Row, place: float) -> Mark:
    lower, upper = row["lower"], row["upper"]
    if lower is not None and lower < 0.0:
        # A ramp has a sign, and a logarithmic axis shows its size.
        lower, upper = (-upper, -lower) if upper <= 0.0 else (None, max(-lower, upper))
    if row["value"] is not None:
        return Mark(place, "estimate", abs(row["value"]), lower, upper)
    if not lower:
        return Mark(place, "limit", upper)
    fitted = None if row["fitted"] is None else abs(row["fitted"])
    return Mark(place, "not identified", fitted, lower, upper)
