"""The command `imubench nightly`, for timers."""

import argparse
import sys
from importlib import import_module
from pathlib import Path

from imubench_pipeline.settings.command_line import (
    LONGEST,
    Command,
    make_number_type,
    parse_seconds,
)
from imubench_pipeline.settings.extras import require_extra

_TIME_TYPE = make_number_type(0.0, LONGEST, "a time, such as 10 s", parse_seconds)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.usage = "%(prog)s [options] [folder] [-- FLAG ...]"
    parser.description = "Arguments after -- go to snakemake, such as --workflow-profile DIR."
    parser.add_argument(
        "folder",
        type=Path,
        nargs="?",
        help="folder of logs, or a checkout; default: this one",
    )
    parser.add_argument("--project", type=Path, metavar="DIR", help="the folder, as an option")
    parser.add_argument(
        "-c", "--cores", default="all", metavar="N", help="cores for Snakemake; default: all"
    )
    parser.add_argument(
        "--config", nargs="+", default=[], metavar="KEY=VALUE", help="settings, as for snakemake"
    )
    parser.add_argument(
        "--settle",
        type=_TIME_TYPE,
        default="10 s",
        metavar="TIME",
        help="a log is complete if unchanged for this time; default: 10 s",
    )
    parser.add_argument(
        "--wait",
        type=_TIME_TYPE,
        default="0 s",
        metavar="TIME",
        help="time to wait for another run; default: no waiting",
    )
    parser.add_argument(
        "--quiet", action="store_true", help="print the summary only if the exit status is not 0"
    )


def run(options: argparse.Namespace) -> int:
    """Run the workflow on the logs that are complete; return the exit status."""
    with require_extra("workflow", "run the workflow"):
        import_module("snakemake")
    from imubench_pipeline.extensions.nightly.night import Night
    from imubench_pipeline.extensions.nightly.summary import STATUS, format_summary
    from imubench_pipeline.run.lock import TakenError
    from imubench_pipeline.settings.validation import ConfigError

    try:
        if options.folder and options.project:
            raise ConfigError("found a folder and --project; expected one of the two")
        night = Night(options.folder or options.project or Path(), options.config, options.flags)
        summary = night.run(options.cores, options.settle, options.wait)
    except KeyboardInterrupt:
        print("stopped by a signal before Snakemake began", file=sys.stderr)
        return 2
    except (ConfigError, TakenError, OSError) as error:
        print(f"imubench nightly: {error}", file=sys.stderr)
        return 2
    status = STATUS[summary.outcome]
    if status or not options.quiet:
        print(format_summary(summary), end="", file=sys.stderr if status == 2 else sys.stdout)
    return status


COMMAND = Command(
    "analyse the complete logs, and report changes (for timers)",
    add_arguments,
    run,
    (
        "fine",
        "a log was rejected, a warning is new or a device has changed since the last run",
        "failed for at least one recording, or another run is active",
    ),
    passes_on=True,
)
