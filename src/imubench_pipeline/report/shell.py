"""Commands that the pages print for a shell, whatever names stand in them."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence


def imubench(name: str, results: str, options: Mapping[str, str] | None = None) -> str:
    """Return a command of `imubench`, such as ``figures``, for the results of a run.

    By option, such as ``--sensor``, what is asked; a word in capitals stands for what the reader
    puts there.
    """
    asked = [word for key, value in (options or {}).items() for word in _option(key, value)]
    return shlex.join(["imubench", name, _place(results), *asked])


def made_again(target: str, overrides: Sequence[str] = ()) -> str:
    """Return the command that makes a file of a recording again, from its log.

    The overrides are what the run has beside its configuration, as ``snakemake --config`` takes it.
    """
    stated = ["--config", *overrides] if overrides else []
    # What follows the two dashes is no option, whatever it begins with.
    return shlex.join(["snakemake", "-c2", *stated, "--forcerun", "ingest", "--", target])


def _option(key: str, value: str) -> list[str]:
    """Return an option as words; one that begins with a dash would be taken for another option."""
    return [f"{key}={value}"] if value.startswith("-") else [key, value]


def _place(path: str) -> str:
    return f"./{path}" if path.startswith("-") else path
