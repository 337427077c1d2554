"""The command `imubench verify`: verify that the outputs of runs are unchanged."""

import argparse
from pathlib import Path

from imubench_pipeline.run.long_work import show_progress
from imubench_pipeline.settings.command_line import CommandError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.description = (
        "Read all outputs of runs, and compare them with their stored digests. Each line states "
        "the fault of a file, and the command that makes it again."
    )
    parser.add_argument("results", type=Path, help="folder of the results of runs")


def run(options: argparse.Namespace) -> int:
    """Print the files of the results that are not as a run left them; return the exit status."""
    # Arrow is loaded for this command only: the others answer at once.
    from imubench_pipeline.report.run_summary import describe_drop_zone
    from imubench_pipeline.run.verification.results import Results
    from imubench_pipeline.tables.seals import FOLDER
    from imubench_pipeline.tables.texts import escape_invisible

    folder: Path = options.results
    made = [name for name in ("recordings", "tables", "report") if (folder / name).is_dir()]
    if not made and not (folder / FOLDER).is_dir():
        raise CommandError(
            f"{folder}: found no results; expected the folder of the results of a run, such as "
            "results"
        )
    if not (folder / FOLDER).is_dir():
        print(
            f"{folder}/{FOLDER}: expected the seals of the steps, found none: the results are of "
            "an older version, or their seals were removed; to correct it: "
            f"{Results(folder).run_again}, which makes everything again"
        )
        return 1
    results = Results(folder)
    number = 0
    with show_progress(results.size, f"of {results.size / 1e9:.2f} GB read") as results.read:
        for fault in results.faults():
            number += 1
            line = f"{folder / fault.path}: {fault.found}; to correct it: {fault.mend}"
            print(escape_invisible(line), flush=True)
    for line in describe_drop_zone(folder):
        print(line)
    if waiting := results.waiting():
        print(f"{len(waiting)} steps are still to be done by the next run: {results.run_again}")
    read = f"{results.files} files, {results.size / 1e6:.1f} MB"
    print(f"{read}: {f'{number} faults' if number else 'all as they were left'}")
    return int(bool(number))
