"""The command `imubench figures`: figures of a run as SVG and PDF."""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.settings.command_line import NO_RESULTS, Command, CommandError, add_units
from imubench_pipeline.settings.extras import require_extra
from imubench_pipeline.tables.files import find_tables, find_tables_folder, read
from imubench_pipeline.tables.outputs import OutputFolder, add_output
from imubench_pipeline.tables.schemas import TABLES

if TYPE_CHECKING:
    from imubench_pipeline.extensions.figures.figures import Make

NEEDED = ("recordings", "allan", "parameters")
"""The tables that every figure needs; the others are optional."""

KINDS = ("comparison", "forest", "allan", "methods", "terms", "datasheet", "spectrum", "theory")
_KIND_NEEDS = {
    "methods": "an estimate with a model",
    "terms": "an estimate with a model",
    "datasheet": "a printed figure of the channel that is comparable",
    "spectrum": "the spectrum of the channel",
}
"""Requirements of each kind besides the curve of a channel."""

_FILE_FORMATS = ("svg", "pdf")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    parser.description = "Write figures for print."
    parser.add_argument("results", type=Path, help="folder of the results of a run")
    parser.add_argument("--sensor", help="only this sensor; default: all")
    parser.add_argument("--recording", help="only this recording; default: all")
    parser.add_argument("--channel", help="only this channel, such as gyro_x; default: all")
    parser.add_argument(
        "--kind",
        type=_make_list_reader(KINDS),
        default=KINDS,
        metavar="KIND,...",
        help=f"some of {', '.join(KINDS)}; default: all",
    )
    parser.add_argument(
        "--format",
        type=_make_list_reader(_FILE_FORMATS),
        default=_FILE_FORMATS,
        metavar="FORMAT,...",
        help="svg, pdf; default: both",
    )
    add_units(parser)
    add_output(parser, "--output", OutputFolder, metavar="FOLDER", help="default: RESULTS/figures")


def _make_list_reader(choices: Sequence[str]) -> Callable[[str], tuple[str, ...]]:
    """Return a parser for names separated by commas; ``all`` selects every name."""
    expected = f"expected all, or some of {', '.join(choices)}"

    def names(text: str) -> tuple[str, ...]:
        asked = [name.strip() for name in text.split(",")]
        for name in asked:
            if name not in choices and name != "all":
                raise argparse.ArgumentTypeError(f"found {name!r}, {expected}")
        return tuple(choices) if "all" in asked else tuple(dict.fromkeys(asked))

    return names


def run(arguments: argparse.Namespace) -> int:
    """Write the selected figures; return the exit status."""
    # The folder may be the folder of the tables itself.
    paths = {name: find_tables_folder(arguments.results) / f"{name}.parquet" for name in TABLES}
    try:
        find_tables(arguments.results, NEEDED)
        tables = {name: read(name, [p] if p.exists() else []) for name, p in paths.items()}
    except (OSError, ValueError) as error:
        raise CommandError(str(error)) from error
    chosen = select(tables, arguments.sensor, arguments.recording, arguments.channel)
    # Matplotlib is loaded only if there is something to draw.
    with require_extra("workflow", "draw figures"):
        from imubench_pipeline.extensions.figures.figures import save

    # The figures that were drawn beside the tables before are drawn again.
    own = OutputFolder(arguments.results / "figures", is_earlier=lambda _: True)
    output: OutputFolder = arguments.output or own
    # The order of the pages of the report, so that a sensor looks the same in both.
    sensors = sorted(set(tables["recordings"]["sensor"].to_pylist()))
    written = []
    with output.filling() as folder:
        for name, make in _list_figures(chosen, sensors, arguments):
            figure = make()
            if figure is None:
                continue
            for ending in arguments.format:
                save(figure, folder / f"{name}.{ending}")
                written.append(output.path / f"{name}.{ending}")
    for path in written:
        print(path)
    if not written:
        needs = [
            f"{kind} needs {_KIND_NEEDS[kind]}" for kind in arguments.kind if kind in _KIND_NEEDS
        ]
        raise CommandError(f"found nothing to draw: {'; '.join(needs)}")
    return 0


def select(
    tables: Mapping[str, pa.Table], sensor: str | None, recording: str | None, channel: str | None
) -> dict[str, pa.Table]:
    """Return the tables, with only the given sensor, recording and channel; None: all of them."""
    chosen = dict(tables)
    for column, asked in (("sensor", sensor), ("recording", recording), ("channel", channel)):
        if asked is None:
            continue
        existing = chosen["allan"][column].unique().to_pylist()
        if asked not in existing:
            # A recording, or all recordings of a sensor, may have no curve for a reason.
            reasons = [
                f" with a curve; status {row.status} ({row.reason})"
                for row in RecordingRow.rows_of(_select_rows(chosen["recordings"], column, asked))
                if row.status != "ok" and column != "channel"
            ]
            raise CommandError(
                f"found no {column} {asked!r}{''.join(reasons[:1])}; there are: "
                f"{', '.join(sorted(existing))}"
            )
        chosen = {name: _select_rows(table, column, asked) for name, table in chosen.items()}
    if not chosen["allan"].num_rows:
        raise CommandError("found no curve, as no recording is usable; see imubench show")
    return chosen


def _select_rows(table: pa.Table, column: str, asked: str) -> pa.Table:
    if column not in table.schema.names:
        return table
    mask = pc.equal(table[column], asked)
    # A finding without a channel is about all of them.
    return table.filter(pc.fill_null(mask, True) if column == "channel" else mask)


def _list_figures(
    chosen: Mapping[str, pa.Table], sensors: Sequence[str], arguments: argparse.Namespace
) -> "Iterator[tuple[str, Make]]":
    from imubench_pipeline.extensions.figures import figures as files
    from imubench_pipeline.extensions.figures.curves import draw_theory_figure
    from imubench_pipeline.report.view import gather_recordings

    cross = [kind for kind in arguments.kind if kind in files.CROSS_KINDS]
    of_channel = [kind for kind in arguments.kind if kind in files.CHANNEL_KINDS]
    if "theory" in arguments.kind:
        yield "theory", partial(draw_theory_figure, arguments.units)
    views = []
    if cross or of_channel:
        views = [view for recording in gather_recordings(chosen) for view in recording.channels()]
    # A figure of some sensors must not replace the figure of all sensors.
    part = "".join(f"{name}/" for name in (arguments.sensor, arguments.recording) if name)
    for name, make in files.list_cross_figures(
        views, arguments.units, sensors=sensors, kinds=cross
    ):
        yield part + name, make
    for number, view in enumerate(views if of_channel else [], start=1):
        print(f"channel {number} of {len(views)}: {view.label} {view.channel}", file=sys.stderr)
        yield from files.list_channel_figures(view, arguments.units, kinds=of_channel)


COMMAND = Command(
    "draw the figures of channels for print", add_arguments, run, ("drawn", "", NO_RESULTS)
)
