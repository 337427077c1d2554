"""Types of options: values that the commands of the terminal take.

Every command imports this: it loads nothing that takes long.
"""

from __future__ import annotations

import argparse
import math
import reprlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple


def named_path(text: str) -> Path:
    """Return a path, which has a name."""
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a path")
    return Path(text)


def seconds(text: str) -> float:
    """Return a time in s, which is given with its unit or without."""
    from imubench_pipeline.units import UnitError, quantity_to_si

    try:
        return float(text)
    except ValueError:
        try:
            return quantity_to_si(text, "time")
        except UnitError as error:
            raise argparse.ArgumentTypeError(str(error)) from None


def number(
    least: float, most: float, words: str, read: Callable[[str], float] = float
) -> Callable[[str], float]:
    """Return the type of a number that is finite, and in a range.

    Parameters
    ----------
    least, most : float
        The range, its ends included.
    words : str
        What is expected, as the error says it.
    read : callable
        Returns the number of a text.
    """

    def value(text: str) -> float:
        try:
            found = read(text)
        except ValueError:
            found = math.nan
        if not (math.isfinite(found) and least <= found <= most):
            raise argparse.ArgumentTypeError(f"found {reprlib.repr(text)}; expected {words}")
        return found

    return value


def whole_number(least: int, most: int, words: str) -> Callable[[str], int]:
    """Return the type of a whole number in a range, its ends included; see `number`."""

    def value(text: str) -> int:
        try:
            found = int(text)
        except ValueError:
            found = least - 1
        if not least <= found <= most:
            raise argparse.ArgumentTypeError(f"found {reprlib.repr(text)}; expected {words}")
        return found

    return value


MOST_WHOLE = 2**63 - 1
LONGEST = 1e10
"""s, three centuries."""


NO_RESULTS = "what was asked for is not there, or cannot be used"
"""What the exit status 2 of a command means that shows results."""


class Command(NamedTuple):
    """A command.

    ``statuses``: what its exit statuses mean, from 0; an empty text is one that it never has.
    ``passes_on``: all that stands after ``--`` is for Snakemake.
    """

    help: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]
    statuses: tuple[str, ...]
    passes_on: bool = False
