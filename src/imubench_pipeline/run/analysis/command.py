"""`imubench analyse`: estimate the noise parameters of logs directly."""

import argparse
import gc
import json
import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from imubench_pipeline.settings import command_line
from imubench_pipeline.settings.extras import require_extra
from imubench_pipeline.tables.outputs import OutputFolder, add_output

if TYPE_CHECKING:
    import pyarrow as pa

    from imubench_pipeline.run.analysis.compilation import Compilation
    from imubench_pipeline.run.analysis.project import Stated
    from imubench_pipeline.run.plan import Plan

_TABLES = ("recordings", "findings", "doubts", "parameters", "allan", "models", "temperature")
_MAX_DRAWING_TIME, _MAX_DRAWING_MEMORY = 600.0, 4 << 30  # of a process, s and bytes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.description = (
        "Read static logs, report their faults, and estimate the noise parameters of each axis, "
        "like a run of the workflow."
    )
    add_log_arguments(parser)
    add_output(
        parser,
        "--output",
        OutputFolder,
        metavar="FOLDER",
        help="write report.html, figures (SVG, PDF) and tables (CSV, and for `imubench export`) "
        "into it",
    )
    command_line.add_units(parser)
    parser.add_argument(
        "-v", "--verbose", action="store_true", help="print all findings and parameters"
    )


def add_log_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that name the logs, and state how to read and analyse the logs."""
    parser.add_argument(
        "logs", type=Path, nargs="+", metavar="LOG", help="log file, or folder of a recording"
    )
    parser.add_argument(
        "--sensor",
        type=Path,
        metavar="FILE",
        help="sensor file, or a name in config/sensors or the catalogue; default: as stated in the "
        "log",
    )
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        help="of a bag with several IMUs; again for an accelerometer of its own",
    )
    parser.add_argument("--rate", metavar="FREQUENCY", help="of a log without stamps, as '100 Hz'")
    parser.add_argument("--gyro-unit", metavar="UNIT", help="unit, if the log does not state it")
    parser.add_argument("--accel-unit", metavar="UNIT", help="unit, if the log does not state it")
    parser.add_argument(
        "--at-rest",
        action="store_true",
        help="analyse the longest part of each log in which the sensor was not moved",
    )
    parser.add_argument(
        "--config",
        type=Path,
        default=Path("config/config.yaml"),
        metavar="FILE",
        help="settings of the estimates; default: config/config.yaml, if it is there",
    )
    parser.add_argument(
        "-c",
        "--cores",
        type=command_line.make_number_type(1, command_line.MOST_WHOLE, "at least 1", int),
        default=os.cpu_count() or 1,
        metavar="N",
        help="default: all",
    )


def run(arguments: argparse.Namespace) -> int:
    """Analyse logs, print the parameters, write the requested outputs; return the exit status."""
    from imubench_pipeline.run.analysis.compilation import Compilation

    # Compiling and importing create many permanent objects: the default frequency of garbage
    # collection takes a tenth of the time at the first use.
    gc.set_threshold(100_000, 50, 50)
    with Compilation(say) as compiling:  # while this process imports all else
        if arguments.output is not None:
            with require_extra("workflow", "write pages and figures (--output)"):
                import_module("imubench_pipeline.report.publish")
        return _run(arguments, compiling)


def _run(arguments: argparse.Namespace, compiling: "Compilation") -> int:
    from imubench_pipeline.model.recordings import FailureRow
    from imubench_pipeline.report.log_screen import render_log_screen
    from imubench_pipeline.report.run_summary import list_failures
    from imubench_pipeline.report.show import show
    from imubench_pipeline.report.terminal import render_logs
    from imubench_pipeline.run.analysis.chain import Analysis

    with tempfile.TemporaryDirectory(prefix="imubench.") as folder:
        plan = plan_logs(arguments, Path(folder))
        analysis = Analysis(plan, compiling, arguments.cores, say)
        tables = analysis.estimates()
        render = render_logs if arguments.verbose else render_log_screen
        show(lambda width: render(tables, arguments.units, width))
        if arguments.output is not None:
            say("making the page and the figures: some seconds")
            printed = FailureRow.rows_of(tables["failures"])
            tables = analysis.for_pages()
            later = [row for row in FailureRow.rows_of(tables["failures"]) if row not in printed]
            for line in list_failures(later):
                say(f"left out of the page: {line}")
            _write(plan, tables, arguments)
    statuses = set(tables["recordings"]["status"].to_pylist())
    return 0 if statuses == {"ok"} else 1


def plan_logs(arguments: argparse.Namespace, folder: Path, device: str | None = None) -> "Plan":
    """Make a temporary project of the logs of a command in a folder; return its plan.

    ``device``: name of the one sensor of all logs; None: a sensor for each log. Raises CommandError
    if a log or a setting cannot be used.
    """
    from imubench_pipeline.run.analysis.project import lay_out
    from imubench_pipeline.run.plan import Plan
    from imubench_pipeline.settings.config import Run, read_config
    from imubench_pipeline.settings.shipped import list_folders
    from imubench_pipeline.settings.validation import ConfigError

    try:
        stated = read_stated(arguments)
        catalogue = list_folders(Run().sensors, "sensors")
        paths = lay_out(arguments.logs, arguments.sensor, stated, catalogue, folder, device)
        config = {**read_config(arguments.config), **paths}
        quality = config.get("quality")
        if arguments.at_rest:
            own = quality if isinstance(quality, dict) else {}
            config["quality"] = {**own, "at_rest": True}
        return Plan(config)
    except ConfigError as error:
        raise command_line.CommandError(f"imubench {arguments.command}: {error}") from None


def read_stated(arguments: argparse.Namespace) -> "Stated":
    """Return the properties of logs that the arguments state: rate, units and topics."""
    from imubench_pipeline.run.analysis.project import Stated

    units = arguments.gyro_unit, arguments.accel_unit
    return Stated(arguments.rate, *units, tuple(arguments.topic))


def say(text: str) -> None:
    """Print a line of progress."""
    print(text, file=sys.stderr, flush=True)


def _write(plan: "Plan", tables: "Mapping[str, pa.Table]", arguments: argparse.Namespace) -> None:
    from imubench_pipeline.report.command import list_drawings
    from imubench_pipeline.report.publish import make_site, render_one_file
    from imubench_pipeline.tables.files import write_arrow, write_content

    output: OutputFolder = arguments.output
    # For a single log there are no intervals to compare.
    kinds = ("comparison", "forest") if len(arguments.logs) > 1 else ("comparison",)
    # The results are temporary: this command, with its options, makes them again.
    options = {
        "--sensor": arguments.sensor,
        "--rate": arguments.rate,
        "--gyro-unit": arguments.gyro_unit,
        "--accel-unit": arguments.accel_unit,
        "--output": arguments.output and arguments.output.path,
    }
    words = [f"{name}={value}" for name, value in options.items() if value is not None]
    settings_of_report = json.loads(plan.report_settings()) | {
        "at_once": shlex.join(["imubench", "analyse", *words, "--", *map(str, arguments.logs)])
    }
    with output.filling() as folder:
        figures = list_drawings(tables, arguments.units, folder / "figures", kinds=kinds)
        with _draw_in_parallel(figures, arguments.cores):
            site = make_site(tables, json.dumps(settings_of_report), plan.run.results)
            write_content(render_one_file(site), folder / "report.html")
            for name in _TABLES:
                write_arrow(tables[name], folder / f"{name}.csv")
                write_arrow(tables[name], folder / "tables" / f"{name}.parquet")
            for drawn in plan.run.results.glob("recordings/*/*/draws.parquet"):
                copy = folder / drawn.relative_to(plan.run.results)
                copy.parent.mkdir(parents=True)
                shutil.copy(drawn, copy)
    print(f"{output.path / 'report.html'}: open it in a browser")


@contextmanager
def _draw_in_parallel(figures: Sequence[Callable[[], None]], cores: int) -> Iterator[None]:
    from imubench_pipeline.readers.bounded import Bounded

    shares = [figures[first::cores] for first in range(min(cores, len(figures)))]
    with ExitStack() as beside:
        drawing = [Bounded(_MAX_DRAWING_MEMORY, _draw, share) for share in shares]
        for process in drawing:
            beside.callback(process.end)
        yield
        for process in drawing:
            process.result(_MAX_DRAWING_TIME)


def _draw(figures: Sequence[Callable[[], None]]) -> None:
    for draw in figures:
        draw()
