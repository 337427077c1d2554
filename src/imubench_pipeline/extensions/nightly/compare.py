"""`imubench compare`: the differences between the results of two runs."""

import argparse
from pathlib import Path

from imubench_pipeline.settings.command_line import NO_RESULTS, Command, CommandError, add_units
from imubench_pipeline.tables.outputs import add_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.description = (
        "Compare the results of two runs of the same logs, such as before and after an upgrade. A "
        "regression is a recording that is now rejected, failed or not used, a parameter that has "
        "lost its value, or a worse verdict."
    )
    parser.add_argument("run_a", type=Path, metavar="RUN_A", help="folder of the results of a run")
    parser.add_argument("run_b", type=Path, metavar="RUN_B", help="results that may differ")
    parser.add_argument(
        "--fail-on", choices=("regression",), help="exit status 1 if run B is worse than run A"
    )
    parser.add_argument("--all", action="store_true", help="print every difference")
    add_units(parser)
    add_output(parser, "--output", help="write every difference, in SI, into this CSV file")


def run(arguments: argparse.Namespace) -> int:
    """Print the differences between two runs; return the exit status."""
    # Loaded here, so that other commands answer at once.
    from rich.text import Text

    from imubench_pipeline.extensions.nightly import run_differences as differences
    from imubench_pipeline.report.show import show
    from imubench_pipeline.tables.files import write_csv

    try:
        runs = [differences.load_results(run) for run in (arguments.run_a, arguments.run_b)]
    except (OSError, ValueError) as error:
        raise CommandError(str(error)) from error
    found = differences.list_differences(*runs)
    if arguments.output:
        with arguments.output.replacing() as temporary, temporary.open("wb") as file:
            write_csv(differences.make_table(found), file)
    lines = differences.describe_runs(arguments.run_a, arguments.run_b, *runs)
    lines += differences.describe_differences(found, arguments.units, every=arguments.all)
    show(lambda width: map(Text, lines))
    return int(arguments.fail_on is not None and any(each.regression for each in found))


COMMAND = Command(
    "compare the results of two runs",
    add_arguments,
    run,
    ("compared", "run B is worse than run A (--fail-on)", NO_RESULTS),
)
