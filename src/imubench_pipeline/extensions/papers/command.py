"""`imubench papers`: printed values of the papers and the results, in the terminal."""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from imubench_pipeline.settings.command_line import NO_RESULTS, Command

if TYPE_CHECKING:
    from rich.console import RenderableType

    from imubench_pipeline.extensions.papers.tables import PublishedRow

_RATIO_LEGEND = (
    "Ratio: result / printed, ± the tolerance. A printed value inside the interval of the result "
    "agrees, too. Derived: not printed, but follows from printed values."
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.add_argument(
        "results",
        type=Path,
        nargs="?",
        help="folder of the results of a run; default: only lines that need no log",
    )
    parser.add_argument(
        "--paper", choices=("maia", "silva", "engers"), help="only this paper; default: all"
    )
    parser.add_argument("--place", help='such as "Table 3"; default: all')


def run(arguments: argparse.Namespace) -> int:
    """Show the values that the papers print beside the results; return the exit status."""
    # Imported here, so that the other commands start fast.
    from imubench_pipeline.extensions.papers.printed import read_papers
    from imubench_pipeline.extensions.papers.tables import PublishedRow
    from imubench_pipeline.report.show import show

    if arguments.results is None:
        from imubench_pipeline.extensions.papers.papers import make_rows_without_run

        rows = list(make_rows_without_run())
        expected = "without the results of a run: only lines that need no log"
    else:
        from imubench_pipeline.tables.files import find_tables, read

        try:
            path = find_tables(arguments.results, ["published"])["published"]
            rows = PublishedRow.rows_of(read("published", [path]))
        except (OSError, ValueError) as error:
            print(error, file=sys.stderr)
            return 2
        expected = f"{path}: the run simulates the logs of no paper"
    wanted = [paper for paper in read_papers() if arguments.paper in (None, paper.key)]
    names = {paper.name for paper in wanted}
    places = list(dict.fromkeys(row.place for row in rows if row.paper in names))
    if arguments.place is not None and arguments.place not in places:
        shown = ", ".join(places) or expected
        print(f"no place {arguments.place!r}; there are: {shown}", file=sys.stderr)
        return 2

    shown_rows = [row for row in rows if arguments.place in (None, row.place)]

    def shown_parts(width: int) -> "Iterator[RenderableType]":
        for paper in wanted:
            own = [row for row in shown_rows if row.paper == paper.name]
            if own:
                yield from _make_parts(f"{paper.name}: {paper.title}", own, width)

    if not rows:
        print(expected)
    show(shown_parts)
    return 0


def _make_parts(
    title: str, rows: "Sequence[PublishedRow]", width: int
) -> "Iterator[RenderableType]":
    from rich.text import Text

    from imubench_pipeline.extensions.papers.page import format_cells
    from imubench_pipeline.extensions.papers.printed import read_terms
    from imubench_pipeline.report.terminal import fit_table

    reasons = list(dict.fromkeys(row.reason for row in rows if row.reason))
    lines: list[list[str | Text]] = []
    for row in rows:
        shown = format_cells(row)
        note = f" [{reasons.index(row.reason) + 1}]" if row.reason else ""
        ratio = f"{shown['ratio_text']} {shown['tolerance_text']}".strip()
        texts = [row.place, row.quantity, row.printed_as, shown["found_text"], ratio]
        lines.append([*texts, row.verdict + note])
    heads = ["Place", "Quantity", "Printed", "Result", "Ratio", "Verdict"]
    yield fit_table(title, heads, lines, width, names=1)
    yield Text()
    yield Text(_RATIO_LEGEND)
    for number, reason in enumerate(reasons, start=1):
        yield Text(f"  [{number}] {reason}")
    meanings = {str(verdict): words.meaning for verdict, words in read_terms().verdicts.items()}
    for verdict in dict.fromkeys(row.verdict for row in rows):
        yield Text(f"  {verdict}: {meanings[verdict]}")
    yield Text()


COMMAND = Command(
    "print the values of the papers, line by line, with the computed ones",
    add_arguments,
    run,
    ("printed", "", NO_RESULTS),
)
