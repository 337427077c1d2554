"""Types of command-line options. All commands import this module, so it imports nothing slow."""

import argparse
import math
import reprlib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

T = TypeVar("T", int, float)


def parse_path(text: str) -> Path:
    """Return the path in an argument; argparse reports an empty one."""
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a path")
    return Path(text)


def add_units(parser: argparse.ArgumentParser) -> None:
    """Add the option that chooses between practical and SI units."""
    parser.add_argument(
        "--units",
        choices=("practical", "si"),
        default="practical",
        help="practical: deg/h, ug and their like; si: rad/s, m/s^2; default: practical",
    )


def parse_seconds(text: str) -> float:
    """Return a time, s, from a text such as ``90`` or ``2 min``."""
    from imubench_pipeline.units import UnitError, parse_quantity

    try:
        return float(text)
    except ValueError:
        try:
            return parse_quantity(text, "time")
        except UnitError as error:
            raise argparse.ArgumentTypeError(str(error)) from None


def make_number_type(
    least: float, most: float, words: str, read: Callable[[str], T]
) -> Callable[[str], T]:
    """Return an argument type for finite numbers in a range; ``words``: the range, for errors."""

    def value(text: str) -> T:
        try:
            found: T | None = read(text)
        except ValueError:
            found = None
        if found is None or abs(found) == math.inf or not least <= found <= most:
            raise argparse.ArgumentTypeError(f"found {reprlib.repr(text)}; expected {words}")
        return found

    return value


MOST_WHOLE = 2**63 - 1
LONGEST = 1e10  # s, three centuries

NO_RESULTS = "the requested data are missing, or cannot be used"
"""Meaning of the exit status 2 of commands that show results."""


class CommandError(Exception):
    """Ends a command with its text and the exit status 2."""


class Command(NamedTuple):
    """A command of ``imubench``.

    ``statuses``: meanings of its exit statuses, from 0; an empty text marks an unused status.
    ``passes_on``: whether arguments after ``--`` are passed on to Snakemake.
    """

    help: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], int]
    statuses: tuple[str, ...]
    passes_on: bool = False
