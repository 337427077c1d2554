"""A folder of logs, which needs no checkout: `imubench init` makes it, `imubench run` runs it."""

import argparse
import os
import sys
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from pathlib import Path

from imubench_pipeline.report.folder import find_drop_zone
from imubench_pipeline.settings.config import Run
from imubench_pipeline.settings.extras import require_extra
from imubench_pipeline.settings.shipped import CATALOGUE, find_project
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.settings.yaml_files import read_settings
from imubench_pipeline.tables.outputs import OutputFolder, Place, add_output

_CONFIG_FILE = Path("config/config.yaml")
WRITTEN_FOLDERS = ("exports", "faults", "nightly", "recordings", "report", "seals", "sensors",
                   "simulated", "tables")  # fmt: skip
"""Folders in the results that runs write, besides ``logs`` of Snakemake."""

_WORKFLOW_PARTS = ("Snakefile", "workflow", "profiles", "src", "tests", "pyproject.toml")


def find_protected_places(path: Path, results: Path | None = None) -> Iterator[Place]:
    """Yield the protected places that can contain a path, or lie inside it.

    The path is absolute, with links resolved. Protected are the configuration of the package, and
    ``config/``, logs, results, sensors, requirements and workflow of each project. A project is a
    folder with ``config/config.yaml``: the working folder, the path, or a folder above the path or
    `results`. Of results, only folders that runs write, and logs that reports name, are protected.
    """
    above = [path, *path.parents]
    given = [] if results is None else [results.absolute(), Path(os.path.realpath(results))]
    found = [folder for folder in above if has_results(folder)] + given
    yield Place(find_project() / "config", "config", "the configuration of the package")
    projects = [Path.cwd(), *above, *(folder for one in given for folder in one.parents)]
    for folder in dict.fromkeys(projects):
        if not (folder / _CONFIG_FILE).is_file():
            continue
        try:
            run = read_settings(Run, folder / _CONFIG_FILE)
        except (ConfigError, OSError):  # not readable
            run = Run()
        stated = [folders for folders in (run.sensors, run.requirements) if folders is not None]
        named = [one for of in stated for one in ([of] if isinstance(of, Path) else of)]
        for one in (Path("config"), *named):
            if one != CATALOGUE:
                yield Place(folder / one, "config", "the configuration")
        yield Place(folder / run.logs, "logs", "the logs")
        for name in _WORKFLOW_PARTS:
            yield Place(folder / name, "workflow", "the workflow")
        found.append(folder / run.results)
    found += [folder / "results" for folder in projects if has_results(folder / "results")]
    for folder in dict.fromkeys(found):
        if (logs := find_drop_zone(folder)) is not None:
            yield Place(logs.absolute(), "logs", "the logs")
        for name in (*WRITTEN_FOLDERS, "logs"):
            yield Place(folder / name, "results", "the results of runs")


def has_results(folder: Path) -> bool:
    """Return whether a folder contains results of runs."""
    return (folder / "seals").is_dir() or (folder / "tables/recordings.parquet").is_file()


def find_own_snakefile(folder: Path) -> Path | None:
    """Return the Snakefile that `snakemake` finds in a folder; None if there is none."""
    places = (folder / "Snakefile", folder / "workflow/Snakefile")
    return next((place for place in places if place.is_file()), None)


def find_snakefile(folder: Path) -> Path:
    """Return a checkout's Snakefile, or the package's for a folder of logs; else ConfigError."""
    if own := find_own_snakefile(folder):
        return own.absolute()
    shipped = find_project() / "Snakefile"
    if not (folder / "config/config.yaml").is_file():
        raise ConfigError(
            f"{folder}: found no config/config.yaml and no Snakefile; expected a checkout of "
            f"imubench, or a folder of logs: make a folder of logs with imubench init {folder}"
        )
    if not shipped.is_file():
        raise ConfigError(
            f"{shipped}: no such file; expected the workflow in the installed package: install the "
            "package again, from a wheel or a checkout"
        )
    return shipped


_DEMONSTRATION = ("config/simulated.yaml", "config/boards")


def add_init_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `imubench init` to its parser."""
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


def init(options: argparse.Namespace) -> int:
    """Make a folder of logs, with settings, an example and a README; return the exit status."""
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
        raise ConfigError(
            f"{folder / there[0]} exists already; choose a folder without this file, or rename "
            "the file"
        )
    absolute = folder.resolve()
    if results := next((one for one in [absolute, *absolute.parents] if has_results(one)), None):
        raise ConfigError(
            f"{folder} is inside the results of runs ({results}); choose a folder outside"
        )
    for made in ("logs", "config/sensors"):
        (folder / made).mkdir(parents=True, exist_ok=True)
    # The configuration last: it makes the folder a project.
    for name, source in reversed(files.items()):
        output.file(name).write(source.read_text("utf-8"))
    print(f"{folder}: logs go to {folder / 'logs'}/<sensor>/; {folder / 'README.md'} says how")
    return 0


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of `imubench run` to its parser."""
    parser.usage = "%(prog)s [-h] [-c N] [folder] [-- FLAG ...]"
    parser.description = (
        "Run the workflow in a folder that imubench init has made, or in a checkout. Arguments "
        "after -- go to snakemake: targets, and flags such as -n or --config allan='{...}'; "
        "paths in them are taken from the folder."
    )
    parser.add_argument(
        "folder", type=Path, nargs="?", default=Path(), help="of logs; default: this one"
    )
    parser.add_argument(
        "-c", "--cores", default="all", metavar="N", help="cores for snakemake; default: all"
    )


def run(options: argparse.Namespace) -> int:
    """Run the workflow: this process becomes Snakemake, and ends with its exit status."""
    with require_extra("workflow", "run the workflow"):
        import_module("snakemake")
    folder: Path = options.folder
    try:
        snakefile = find_snakefile(folder)
        os.chdir(folder)
    except (ConfigError, OSError) as error:
        raise ConfigError(f"imubench run: {error}") from None
    command = [sys.executable, "-P", "-m", "snakemake", "--snakefile", str(snakefile)]
    command += ["--cores", options.cores, *options.flags]
    sys.stdout.flush()
    os.execv(sys.executable, command)
