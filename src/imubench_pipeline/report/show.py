"""`imubench show`: the comparison of the sensors in the terminal."""

import argparse
import io
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from imubench_pipeline.settings.command_line import CommandError, add_units, make_number_type

if TYPE_CHECKING:
    import pyarrow as pa
    from rich.console import RenderableType

_NEEDED_TABLES = ("recordings", "findings", "failures", "ranking", "next_steps", "parameters")
_parse_width = make_number_type(40, 10_000, "40 to 10000 columns", int)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.add_argument("results", type=Path, help="folder of the results of a run")
    parser.add_argument(
        "--all",
        action="store_true",
        help="every warning, ranking and parameter, as with the three options below",
    )
    parser.add_argument(
        "--requirement",
        metavar="NAME",
        help="the ranking for only this requirement, with every limit",
    )
    parser.add_argument("--channel", help="parameters of only this channel, such as gyro_x")
    parser.add_argument("--method", help="method of the parameters; default: the recommended one")
    add_units(parser)
    parser.add_argument(
        "--width",
        type=_parse_width,
        metavar="COLUMNS",
        help="default: the width of the terminal, or 80",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the comparison; return the exit status."""
    # Loaded here, so that other commands answer at once.
    from rich.text import Text

    from imubench_pipeline.report.terminal import render_comparison, render_overview
    from imubench_pipeline.tables.files import find_tables_folder

    tables = _load(arguments.results)
    _check(tables["ranking"], "requirement", arguments.requirement)
    _check(tables["parameters"], "channel", arguments.channel)
    _check(tables["parameters"], "method", arguments.method)

    chosen = any((arguments.requirement, arguments.channel, arguments.method))

    def shown(width: int) -> "Iterator[RenderableType]":
        if arguments.all or chosen:
            yield from render_comparison(
                tables,
                requirement=arguments.requirement,
                channel=arguments.channel,
                method=arguments.method,
                system=arguments.units,
                width=width,
            )
        else:
            yield from render_overview(tables)
            yield Text("Every ranking, warning and parameter: --all")
        page = find_tables_folder(arguments.results).parent / "report/index.html"
        no_page = f"No report at {page}; `snakemake -c2` makes it"
        text = f"Report: {page}" if page.is_file() else no_page
        yield Text(text, no_wrap=True, overflow="ignore")

    show(shown, arguments.width)
    return 0


def show(parts: "Callable[[int], Iterable[RenderableType]]", width: int | None = None) -> None:
    """Print what ``parts`` returns for a width in columns, by default of the terminal."""
    from rich.console import Console
    from rich.text import Text

    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a sign that a terminal lacks stops nothing
    console = Console(width=width, highlight=False, markup=False, emoji=False)
    # Another program reads whole lines.
    whole = width is None and not console.is_terminal
    with console.capture() as captured:
        for part in parts(console.width):
            if isinstance(part, Text) and whole:
                console.print(part, soft_wrap=True)
            elif isinstance(part, Text):
                console.print(part, no_wrap=part.no_wrap, overflow=part.overflow)
            else:
                console.print(part)
    # Written at once, so that who calls sees that the reader has gone, as `head` has.
    sys.stdout.writelines(f"{line.rstrip()}\n" for line in captured.get().splitlines())


def _load(results: Path) -> "dict[str, pa.Table]":
    from imubench_pipeline.tables.files import find_tables, read

    try:
        paths = find_tables(results, _NEEDED_TABLES)
        return {name: read(name, [path]) for name, path in paths.items()}
    except (OSError, ValueError) as error:
        raise CommandError(str(error)) from error


def _check(table: "pa.Table", column: str, asked: str | None) -> None:
    existing = table[column].unique().to_pylist()
    if asked is not None and asked not in existing:
        raise CommandError(f"no {column} {asked!r}; there are: {', '.join(existing) or 'none'}")
