"""`imubench compare`: the differences between the results of two runs."""

import argparse
from pathlib import Path

from imubench_pipeline.settings.command_line import CommandError, add_units
from imubench_pipeline.tables.outputs import add_output

_WORST = 3  # differences that are printed without --all
_LONGEST = 400  # characters of one


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
    import pyarrow as pa
    from rich.text import Text

    from imubench_pipeline.model.run_differences import Result, ResultKey
    from imubench_pipeline.report.practical import choose_page_unit
    from imubench_pipeline.report.run_summary import fold_text
    from imubench_pipeline.report.show import show
    from imubench_pipeline.run.run_differences import KINDS, list_differences, load_results
    from imubench_pipeline.settings.sensor import quantity_of
    from imubench_pipeline.tables.files import write_csv
    from imubench_pipeline.words.numbers import Unit
    from imubench_pipeline.words.run_differences import count_text, difference_text

    try:
        a, b = load_results(arguments.run_a), load_results(arguments.run_b)
    except (OSError, ValueError) as error:
        raise CommandError(str(error)) from error
    found = list_differences(a, b)
    if arguments.output:
        columns = {
            "kind": [each.kind for each in found],
            "regression": [each.regression for each in found],
            **{part: [getattr(each.key, part) for each in found] for part in ResultKey._fields},
            **{
                f"{part}_a": [getattr(each.a, part, None) for each in found]
                for part in Result._fields
            },
            **{
                f"{part}_b": [getattr(each.b, part, None) for each in found]
                for part in Result._fields
            },
            "ratio": [each.ratio for each in found],
        }
        with arguments.output.replacing() as temporary, temporary.open("wb") as file:
            write_csv(pa.table(columns), file)
    of_runs = [{key for key in run if key.table == "recordings"} for run in (a, b)]
    lines = [
        f"Recordings: {len(of_runs[0])} in A, {len(of_runs[1])} in B, "
        f"{len(of_runs[0] & of_runs[1])} in both"
    ]
    for kind in KINDS:
        if of_kind := [each for each in found if each.kind == kind]:
            lines.append(count_text(kind, of_kind))
    lines += ["No differences"] * (not found)
    shown = found if arguments.all else found[:_WORST]
    lines += ["", "The worst differences first:"] * bool(shown)
    for each in shown:
        unit = Unit("", 1.0)
        if each.key.table == "parameters":
            quantity, name = quantity_of(each.key.channel or ""), each.key.name or ""
            unit = choose_page_unit(quantity, name, arguments.units)
        lines.append(f"  {fold_text(difference_text(each, unit), _LONGEST)}")
    lines += [f"{len(found) - len(shown)} more: --all"] * (len(found) > len(shown))
    show(lambda width: map(Text, lines))
    return int(arguments.fail_on is not None and any(each.regression for each in found))
