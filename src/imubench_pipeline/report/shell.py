"""Shell commands on the pages, with quoted names."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence


def make_command(name: str, results: str, options: Mapping[str, str] | None = None) -> str:
    """Return a command of `make_command`, such as ``figures``, for the results of a run.

    ``options`` has the values of options such as ``--sensor``; a word in capitals is a placeholder.
    """
    words = ["imubench", name, f"./{results}" if results.startswith("-") else results]
    for key, value in (options or {}).items():
        words += [f"{key}={value}"] if value.startswith("-") else [key, value]
    return shlex.join(words)


def make_recompute_command(target: str, overrides: Sequence[str] = ()) -> str:
    """Return the command that recomputes a file of a recording from its log.

    ``overrides`` are the settings of the run for ``snakemake --config``.
    """
    stated = ["--config", *overrides] if overrides else []
    # After the two dashes, nothing is read as an option.
    return shlex.join(["snakemake", "-c2", *stated, "--forcerun", "ingest", "--", target])
