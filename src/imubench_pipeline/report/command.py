"""`imubench report`: write the report of a finished run again, elsewhere or in one file."""

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from imubench_pipeline.registry import Hook
from imubench_pipeline.report.folder import is_report, list_report_files
from imubench_pipeline.settings.command_line import CommandError
from imubench_pipeline.settings.extras import require_extra
from imubench_pipeline.tables.outputs import OutputFolder, add_output

if TYPE_CHECKING:
    import pyarrow as pa

    from imubench_pipeline.report.practical import System
    from imubench_pipeline.report.site import Site

_DRAWINGS: Hook[Callable[..., Sequence[Callable[[], None]]]] = Hook("drawings")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.add_argument("results", type=Path, help="folder of the results of a run")
    add_output(
        parser,
        "--one-file",
        metavar="FILE",
        help="write all pages into one HTML file, to send by mail",
    )
    add_output(
        parser,
        "--output",
        partial(OutputFolder, is_earlier=is_report),
        metavar="FOLDER",
        help="folder of the pages: a new one, or an earlier report; default: RESULTS/report",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the report; return 1 if a page failed, else 0. Raises CommandError without results."""
    # Imported here, because templates and figures take half a second to load.
    with require_extra("workflow", "write the report"):
        from imubench_pipeline.report.publish import load_site
    from imubench_pipeline.tables.findings import RecordingError
    from imubench_pipeline.tables.seals import list_missing_inputs

    try:
        site = load_site(arguments.results)
    except FileNotFoundError as error:
        raise CommandError(
            f"{arguments.results}: found no {Path(error.filename).name}; expected the results of a "
            "finished run; run snakemake -c2 first"
        ) from None
    except ValueError as error:
        raise CommandError(str(error)) from None
    if lost := list_missing_inputs(arguments.results, "report"):
        raise CommandError(
            f"{arguments.results / lost[0]}: missing, and the report needs it; run snakemake -c2 "
            "again, with the same options as for these results, to make it again"
        )
    try:
        _write(site, arguments)
    except RecordingError as error:
        raise CommandError(str(error)) from None
    for path, reason in site.failed.items():
        print(f"{path}: could not be made: {reason}", file=sys.stderr)
    return int(bool(site.failed))


def list_drawings(
    tables: "Mapping[str, pa.Table]", system: "System", folder: Path, **kinds: Sequence[str]
) -> Sequence[Callable[[], None]]:
    """Return functions that each write a figure for print; none without the extension figures."""
    return [one for made in _DRAWINGS.objects() for one in made(tables, system, folder, **kinds)]


def _write(site: "Site", arguments: argparse.Namespace) -> None:
    from imubench_pipeline.report.publish import publish, remove_old_pages, render_one_file
    from imubench_pipeline.tables.seals import seal_again

    if arguments.one_file is not None:
        page = render_one_file(site).encode()
        arguments.one_file.write(page)
        print(f"{arguments.one_file}: {len(page) / 1e6:.1f} MB")
        return
    say = partial(print, file=sys.stderr) if sys.stderr.isatty() else lambda _: None
    output: OutputFolder | None = arguments.output
    if output is None:
        folder = arguments.results / "report"
        written = publish(site, folder, say, os.cpu_count() or 1)
        seal_again(arguments.results, "report", list_report_files(folder))
    else:
        folder = output.path
        with output.filling() as made:
            written = publish(site, made, say, os.cpu_count() or 1)
            for draw in list_drawings(site.tables, site.system, made / "figures"):
                draw()
            remove_old_pages(folder, made)
    print(f"{folder / 'index.html'}: {len(written)} files written")
