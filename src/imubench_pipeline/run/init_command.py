"""`imubench init`: a folder of logs, which needs no checkout."""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path

from imubench_pipeline.run.places import has_results
from imubench_pipeline.settings.shipped import find_project
from imubench_pipeline.tables.outputs import OutputFolder, add_output

_DEMONSTRATION = ("config/simulated.yaml", "config/boards")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what the command is given."""
    parser.description = (
        "Make a folder of logs: config/config.yaml with all settings, an example of a sensor file, "
        "and a README that says how to go on. Nothing that is there is written over."
    )
    add_output(
        parser,
        "folder",
        partial(OutputFolder, shared=True),
        help="where to make it; made if it is not there",
    )
    parser.add_argument(
        "--demonstration",
        action="store_true",
        help="with the simulated recordings that a checkout begins with, to try it without a log",
    )


def run(options: argparse.Namespace) -> int:
    """Make the folder; return the exit status."""
    output: OutputFolder = options.folder
    folder = output.path
    shipped, own = find_project(), Path(__file__).with_name("lab")
    files = {
        "config/config.yaml": shipped / "config/config.yaml",
        "config/example_sensor.yaml": own / "example_sensor.yaml",
        "README.md": own / "README.md",
    }
    for name in _DEMONSTRATION if options.demonstration else ():
        source = shipped / name
        for path in [source] if source.is_file() else source.glob("*.yaml"):
            files[path.relative_to(shipped).as_posix()] = path
    if there := [name for name in files if (folder / name).exists()]:
        print(
            f"{folder / there[0]}: exists already; expected a folder without it: choose "
            "another one, or rename that file",
            file=sys.stderr,
        )
        return 2
    absolute = folder.resolve()
    if results := next((one for one in [absolute, *absolute.parents] if has_results(one)), None):
        print(
            f"{folder}: lies in the results of runs ({results}); expected a folder outside of them",
            file=sys.stderr,
        )
        return 2
    for made in ("logs", "config/sensors"):
        (folder / made).mkdir(parents=True, exist_ok=True)
    # The configuration last: it makes the folder a project.
    for name, source in reversed(files.items()):
        output.file(name).write(source.read_text("utf-8"))
    print(f"{folder}: logs go to {folder / 'logs'}/<sensor>/; {folder / 'README.md'} says how")
    return 0
