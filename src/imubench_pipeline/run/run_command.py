"""`imubench run`: the workflow in a folder of logs."""

from __future__ import annotations

import argparse
import os
import sys
from importlib import import_module
from pathlib import Path

from imubench_pipeline.run.project import find_snakefile
from imubench_pipeline.settings.extras import require_extra
from imubench_pipeline.settings.validation import ConfigError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command is given."""
    parser.usage = "%(prog)s [-h] [-c N] [folder] [-- FLAG ...]"
    parser.description = (
        "Run the workflow in a folder that imubench init has made, or in a checkout. What stands "
        "after -- goes to snakemake: targets, and flags such as -n or --config allan='{...}'; "
        "paths in them are taken from the folder."
    )
    parser.add_argument(
        "folder", type=Path, nargs="?", default=Path(), help="of logs; default: this one"
    )
    parser.add_argument(
        "-c", "--cores", default="all", metavar="N", help="cores for snakemake; default: all"
    )


def run(options: argparse.Namespace) -> int:
    """Become Snakemake, whose exit status is that of the command."""
    with require_extra("workflow", "run the workflow"):
        import_module("snakemake")
    folder: Path = options.folder
    try:
        snakefile = find_snakefile(folder)
        os.chdir(folder)
    except (ConfigError, OSError) as error:
        print(f"imubench run: {error}", file=sys.stderr)
        return 2
    command = [sys.executable, "-P", "-m", "snakemake", "--snakefile", str(snakefile)]
    command += ["--cores", options.cores, *options.flags]
    sys.stdout.flush()
    os.execv(sys.executable, command)
