"""`imubench run`: the workflow in a folder of logs."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from imubench_pipeline.run.project import snakefile_of
from imubench_pipeline.settings.validation import ConfigError

_DRY = {"-n", "--dry-run", "--dryrun"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command is given."""
    parser.usage = "%(prog)s [-h] [-c N] [folder] [-- FLAG ...]"
    parser.description = (
        "Run the workflow in a folder that imubench init has made, or in a checkout. What stands "
        "after -- goes to snakemake: targets, and flags such as -n or --config allan='{...}'; "
        "paths in them are taken from the folder."
    )
    parser.epilog = (
        "Exit status: that of snakemake, 0 fine, 1 something failed or was left out; 2 the folder "
        "is none of logs."
    )
    parser.add_argument(
        "folder", type=Path, nargs="?", default=Path(), help="of logs; default: this one"
    )
    parser.add_argument("-c", "--cores", default="all", metavar="N", help="default: all")


def run(options: argparse.Namespace) -> int:
    """Become Snakemake, whose exit status is that of the command."""
    folder: Path = options.folder
    try:
        snakefile = snakefile_of(folder)
        os.chdir(folder)
    except (ConfigError, OSError) as error:
        print(f"imubench run: {error}", file=sys.stderr)
        return 2
    quiet = _unsaid(options.flags, terminal=sys.stderr.isatty())
    command = [sys.executable, "-P", "-m", "snakemake", "--snakefile", str(snakefile)]
    command += ["--quiet", *quiet, "--cores", options.cores, *options.flags]
    sys.stdout.flush()
    os.execv(sys.executable, command)


def _unsaid(flags: Sequence[str], *, terminal: bool) -> list[str]:
    """Return what Snakemake need not say: a terminal has one line, others read the summary."""
    if _DRY.intersection(flags):
        return ["host", "rules"]
    return ["host"] if terminal else ["host", "rules", "progress"]
