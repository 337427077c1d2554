"""`imubench shortlist`: which sensors are worth logging for a requirement."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
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
        help="folder of the requirements; default: those of the package and config/requirements",
    )
    parser.add_argument(
        "--results",
        type=Path,
        help="of a run: what is measured, and what stands for figures that nobody publishes",
    )


def run(options: argparse.Namespace) -> int:
    """Print the shortlist; return the exit status."""
    # Only this command draws and computes: the others answer at once.
    from rich.console import Console

    from imubench_pipeline.report.shortlist import format_shortlist_row, list_assumptions
    from imubench_pipeline.report.terminal_table import fit_table
    from imubench_pipeline.settings.config import Run
    from imubench_pipeline.settings.requirements import Requirement, read_requirements
    from imubench_pipeline.settings.sensor import read_sensors
    from imubench_pipeline.settings.shipped import list_folders
    from imubench_pipeline.settings.validation import ConfigError
    from imubench_pipeline.settings.yaml_files import read_settings
    from imubench_pipeline.steps.shortlist import NEEDED, list_shortlist
    from imubench_pipeline.tables import find_tables

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
    except (ConfigError, OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    console = Console(highlight=False, markup=False, emoji=False)
    margins = [f"Margin\n{which}" for which in ("at best", "at worst", "measured")]
    heads = ["Sensor", "Verdict", *margins, "Limit"]
    lines = [format_shortlist_row(row) for row in rows]
    console.print(fit_table(asked.title, heads, lines, console.width, names=0))
    for note in list_assumptions(rows):
        console.print(note, soft_wrap=True)
    return 0
