"""What a recording cannot tell, however long it is and however little noise it has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Quantity = Literal[
    "earth_rate", "bias", "heading", "scale_factor", "asymmetry", "quadratic", "linearity"
]


@dataclass(frozen=True)
class NotObservable:
    """A quantity that the recording does not tell.

    Attributes
    ----------
    quantity : str
    reason : str
        In words.
    half_width : float or None
        What is known of its effect all the same: half of the range of the bias that it leaves
        open, rad/s; None where nothing bounds it.
    """

    quantity: Quantity
    reason: str
    half_width: float | None = None


class NotObservableError(ValueError):
    """What is asked for cannot be told from the data, however little noise there is."""
