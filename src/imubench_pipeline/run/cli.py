"""The command `imubench`."""

import argparse
import io
import json
import os
import sys
from collections.abc import Sequence
from difflib import get_close_matches
from functools import partial
from importlib.metadata import version
from pathlib import Path

import shtab
from pydantic import BaseModel

from imubench_pipeline.registry import Hook
from imubench_pipeline.report import command as report
from imubench_pipeline.report import show
from imubench_pipeline.run import convert_command as conversion
from imubench_pipeline.run import demo_command as demo
from imubench_pipeline.run import formats_command as formats
from imubench_pipeline.run import project
from imubench_pipeline.run import sensors_command as sensors
from imubench_pipeline.run import simulate_command as simulation
from imubench_pipeline.run.analysis import command as analysis
from imubench_pipeline.run.project import find_protected_places
from imubench_pipeline.run.verification import command as verification
from imubench_pipeline.settings import command_line
from imubench_pipeline.settings.config import Run, read_config
from imubench_pipeline.settings.extras import ExtraError
from imubench_pipeline.settings.sensor import RecordingNotes, Sensor
from imubench_pipeline.settings.simulated_recordings import Board, Simulated
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables import outputs
from imubench_pipeline.tables.texts import escape_invisible
from imubench_pipeline.units import UnitError

SCHEMAS: dict[str, type[BaseModel]] = {
    "run": Run,
    "sensor": Sensor,
    "recording": RecordingNotes,
    "simulated": Simulated,
    "board": Board,
}
"""The configuration files: config.yaml, a sensor's, the notes beside a log, simulated.yaml, a
board's."""

_CLOSED_PIPE = 141  # exit status that shells give a command whose reader has gone


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the commands and their options."""
    parser = argparse.ArgumentParser(prog="imubench", description="Inertial sensor benchmark.")
    parser.add_argument(
        "--version", action="version", version=f"imubench {version('imubench_pipeline')}"
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        of_it = commands.add_parser(name, help=command.help)
        command.add_arguments(of_it)
        for action in of_it._actions:
            if action.type is Path:
                action.type = command_line.parse_path
        said = (f"{status} {meaning}" for status, meaning in enumerate(command.statuses) if meaning)
        of_it.epilog = f"Exit status: {'; '.join(said)}."
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = make_parser()
    own = list(sys.argv[1:] if arguments is None else arguments)
    first = next(iter(own), "-")
    flags = []
    if first in COMMANDS and COMMANDS[first].passes_on and "--" in own:
        end = own.index("--")
        own, flags = own[:end], own[end + 1 :]
    if first not in COMMANDS and not first.startswith("-"):
        close = get_close_matches(first, COMMANDS, n=1)
        meant = f", did you mean {close[0]}?" if close else "."
        parser.error(f"no command {first!r}{meant} There are: {', '.join(COMMANDS)}")
    options = parser.parse_args(own, argparse.Namespace(flags=flags))
    results = getattr(options, "results", None)
    try:
        outputs.check_outputs(options, lambda path: find_protected_places(path, results))
        status = COMMANDS[options.command].run(options)
        sys.stdout.flush()
        return status
    except (command_line.CommandError, ConfigError, UnitError) as error:
        print(error, file=sys.stderr)
        return 2
    except (ExtraError, outputs.OutputError) as error:
        print(f"imubench {options.command}: {error}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        # The reader of the pipe closed it, as `head` does.
        _close_terminal()
        return _CLOSED_PIPE
    except OSError as error:
        file = (
            "" if error.filename is None else f"{escape_invisible(os.fsdecode(error.filename))}: "
        )
        print(f"imubench {options.command}: {file}{outputs.explain(error)}", file=sys.stderr)
        _close_terminal()
        return 2


def _close_terminal() -> None:
    """Discard unwritten output, about which Python would complain at exit."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _add_schema(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", choices=sorted(SCHEMAS), help="which configuration file")
    outputs.add_output(parser, "--output", help="where to write it; default: the terminal")


def _add_check(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("logs", type=Path, help="folder that contains <sensor>/<recording>")
    parser.add_argument("--sensors", type=Path, help="folder of the sensor files")
    parser.add_argument(
        "--config", type=Path, default=Path("config/config.yaml"), help="settings of the findings"
    )


def _add_inspect(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", type=Path, help="log file, or folder or archive of a recording")
    parser.add_argument(
        "--block", action="store_true", help="print only the sensor file, without a listing"
    )
    outputs.add_output(
        parser,
        "--output",
        partial(outputs.OutputFile, adds_to={"config"}),
        help="where to write the sensor file; default: the terminal",
    )


def _schema(options: argparse.Namespace) -> int:
    schema = SCHEMAS[options.file].model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    text = json.dumps(schema, indent=1) + "\n"
    if options.output is not None:
        options.output.write(text)
    else:
        sys.stdout.write(text)
    return 0


def _check(options: argparse.Namespace) -> int:
    # Numerics are loaded for this command only: the others answer at once.
    from imubench_pipeline.run.checking import check
    from imubench_pipeline.run.plan import Plan

    over: dict[str, object] = {"logs": str(options.logs), "simulated": None}
    if options.sensors:
        over["sensors"] = str(options.sensors)
    plan = Plan({**read_config(options.config), **over})
    if not plan.recordings:
        raise ConfigError(f"{options.logs}: no log found; expected <sensor>/<recording> in it")
    for reason in plan.unusable.values():
        print(reason, file=sys.stderr)
    worst = int(bool(plan.unusable))
    for sensor, recording, quality in check(plan):
        serious = any(finding.severity != "note" for finding in quality.findings)
        worst = max(worst, int(serious))
        status = quality.recording.status
        shown = "warnings" if status == "ok" and serious else status
        simulated = ", simulated" * quality.recording.simulated
        print(f"{sensor}/{recording}: {shown}{simulated}")
        for finding in quality.findings:
            print(f"  {finding.severity:8} {finding.finding}: {escape_invisible(finding.detail)}")
        sys.stdout.flush()
    return worst


def _inspect(options: argparse.Namespace) -> int:
    from imubench_pipeline.run.analysis.project import inspect_log

    if isinstance(sys.stdout, io.TextIOWrapper):
        # Names in a log may be in any script, and sensor files are UTF-8.
        sys.stdout.reconfigure(encoding="utf-8", errors="backslashreplace")
    output: outputs.OutputFile | None = options.output
    inspected = inspect_log(options.log, model=output.path.stem if output is not None else None)
    if output is not None:
        output.write(inspected.block)
    if not options.block:
        print(inspected.listing)
    if output is None:
        sys.stdout.write(inspected.block)
    print(inspected.proof.said, file=sys.stderr if options.block else sys.stdout)
    return 0 if inspected.complete else 1


def _add_shortlist(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "requirement", help="name of a file under --requirements, or such a file: robot.yaml"
    )
    parser.add_argument(
        "--sensors",
        type=Path,
        help="folder of the sensor files; default: the catalogue of the package and config/sensors",
    )
    parser.add_argument(
        "--requirements",
        type=Path,
        help="folder of the requirements; default: the package's and config/requirements",
    )
    parser.add_argument(
        "--results", type=Path, help="of a run: sensors with usable logs are judged by these"
    )


def _shortlist(options: argparse.Namespace) -> int:
    # Only this command draws and computes: the others answer at once.
    from rich.console import Console

    from imubench_pipeline.report.shortlist import format_shortlist_row, list_remarks
    from imubench_pipeline.report.terminal import fit_table
    from imubench_pipeline.settings.requirements import Requirement, read_requirements
    from imubench_pipeline.settings.sensor import read_sensors
    from imubench_pipeline.settings.shipped import list_folders
    from imubench_pipeline.settings.yaml_files import read_settings
    from imubench_pipeline.steps.shortlist import NEEDED, list_shortlist
    from imubench_pipeline.tables.files import find_tables

    try:
        path = Path(options.requirement)
        if path.suffix in (".yaml", ".yml"):
            name, asked = path.stem, read_settings(Requirement, path)
        else:
            requirements = read_requirements(
                list_folders(options.requirements or Run().requirements or (), "requirements")
            )
            if options.requirement not in requirements:
                names = ", ".join(requirements) or "none"
                raise ConfigError(f"no requirement {options.requirement!r}; there are: {names}")
            name, asked = options.requirement, requirements[options.requirement]
        sensors = read_sensors(list_folders(options.sensors or Run().sensors, "sensors"))
        tables = {}
        if options.results is not None:
            tables = find_tables(options.results, NEEDED)
        rows = [*list_shortlist({name: asked}, sensors, tables)]
    except (OSError, ValueError) as error:
        raise command_line.CommandError(str(error)) from None
    console = Console(highlight=False, markup=False, emoji=False)
    margins = [f"Margin\n{which}" for which in ("in use", "noise", "likely")]
    heads = ["", "Sensor", "Verdict", *margins, "Limit"]
    lines = [format_shortlist_row(row) for row in rows]
    console.print(fit_table(asked.title, heads, lines, console.width, names=1))
    if any(row.basis != "printed" for row in rows):
        console.print("*: noise by logs; else as printed")
    for note in list_remarks(rows):
        console.print(note, soft_wrap=True)
    return 0


def _add_completion(parser: argparse.ArgumentParser) -> None:
    parser.description = (
        'Print a script for the shell. Now: eval "$(imubench completion bash)"; always: put that '
        "line into ~/.bashrc, for zsh the script as _imubench into a folder of $fpath."
    )
    parser.add_argument("shell", choices=shtab.SUPPORTED_SHELLS, help="which shell")


def _completion(options: argparse.Namespace) -> int:
    parser = make_parser()
    of_commands = next(
        action for action in parser._actions if isinstance(action, argparse._SubParsersAction)
    )
    for command in of_commands.choices.values():
        for action in command._actions:
            if action.type is command_line.parse_path:
                action.complete = shtab.FILE
    print(shtab.complete(parser, options.shell))
    return 0


_ADDED: Hook[command_line.Command] = Hook("commands")

COMMANDS = {
    "analyse": command_line.Command(
        "estimate the noise parameters of logs, at once",
        analysis.add_arguments,
        analysis.run,
        (
            "analysed",
            "a log was rejected, or a step failed",
            "a log or the sensor file is missing, or incomplete",
        ),
    ),
    "demo": command_line.Command(
        "compare simulated sensors, or analyse a published log of a real one",
        demo.add_arguments,
        demo.run,
        (
            "done (exit status of snakemake), or printed",
            "a step failed, or the log was rejected",
            "the folder or the file is not as expected",
        ),
    ),
    "init": command_line.Command(
        "make a folder of logs",
        project.add_init_arguments,
        project.init,
        ("made", "", "it has one of the files already, or cannot be written"),
    ),
    "run": command_line.Command(
        "analyse the logs of a folder, as snakemake does in a checkout",
        project.add_run_arguments,
        project.run,
        (
            "done (exit status of snakemake)",
            "a step failed, a recording was omitted, or a setting is wrong",
            "the folder has no logs, or snakemake does not know a flag",
        ),
        passes_on=True,
    ),
    **_ADDED.by_key(),
    "schema": command_line.Command(
        "write the JSON Schema of a configuration file, for editors",
        _add_schema,
        _schema,
        ("written", "", "cannot be written"),
    ),
    "check": command_line.Command(
        "check logs without analysing them",
        _add_check,
        _check,
        ("all good", "warnings, or rejected logs", "a setting is wrong, or there are no logs"),
    ),
    "inspect": command_line.Command(
        "show the contents of a log, and draft a sensor file for it",
        _add_inspect,
        _inspect,
        (
            "the sensor file is complete",
            "something is left to fill in",
            "the log cannot be read, or the sensor file cannot be written",
        ),
    ),
    "formats": command_line.Command(
        "list the log formats, and the programs of the exports",
        lambda _: None,
        formats.run,
        ("listed",),
    ),
    "show": command_line.Command(
        "show the comparison of the sensors in the terminal",
        show.add_arguments,
        show.run,
        ("shown", "", command_line.NO_RESULTS),
    ),
    "shortlist": command_line.Command(
        "judge all sensors of the catalogue for a requirement",
        _add_shortlist,
        _shortlist,
        ("said", "", command_line.NO_RESULTS),
    ),
    "sensors": command_line.Command(
        "list the catalogue of sensors, or show the figures of one",
        sensors.add_arguments,
        sensors.run,
        ("shown", "", "no such sensor"),
    ),
    "convert": command_line.Command(
        "convert a figure to another unit or quantity",
        conversion.add_arguments,
        conversion.run,
        ("printed", "", "the units do not belong together"),
    ),
    "report": command_line.Command(
        "write the report again, elsewhere or in one file",
        report.add_arguments,
        report.run,
        ("written", "", command_line.NO_RESULTS),
    ),
    "simulate": command_line.Command(
        "write a simulated log of a sensor, to test filters on",
        simulation.add_arguments,
        simulation.run,
        ("written", "", command_line.NO_RESULTS),
    ),
    "verify": command_line.Command(
        "verify that all results are unchanged",
        verification.add_arguments,
        verification.run,
        ("all results are unchanged", "something is not", "there are no results"),
    ),
    "completion": command_line.Command(
        "print a completion script for the shell", _add_completion, _completion, ("printed",)
    ),
}
