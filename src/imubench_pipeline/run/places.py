"""The places of a project in which no other command writes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.report.folder import drop_zone_of
from imubench_pipeline.settings.config import Run
from imubench_pipeline.settings.shipped import CATALOGUE, project
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.settings.yaml_files import read_settings
from imubench_pipeline.tables.outputs import Place

_CONFIG = Path("config/config.yaml")
_OF_RUNS = (
    "exports",
    "faults",
    "logs",
    "nightly",
    "recordings",
    "report",
    "seals",
    "sensors",
    "simulated",
    "tables",
)
"""Folders in the results that runs fill."""

_OF_WORKFLOW = ("Snakefile", "workflow", "profiles", "src", "tests", "pyproject.toml")


def places_about(path: Path, results: Path | None = None) -> Iterator[Place]:
    """Yield the places that a path may be in, or hold.

    A project is a folder with ``config/config.yaml``: the working folder, any folder at or above
    the path, and any above the results that a command is given. Its places are ``config/`` and the
    folders of logs, results, sensors and requirements that the file names, and the workflow of a
    checkout. Results are also those
    that a command is given, and any folder at or above the path, and any folder ``results`` beside
    one of these, with ``seals/`` or ``tables/recordings.parquet``; the logs that their report names
    are a place, too. In results, the folders that runs fill are places; the folder
    itself is none. The configuration that comes with the package is a place.

    Parameters
    ----------
    path : Path
        Absolute, without links.
    results : Path, optional
        The results that the command is given.
    """
    above = [path, *path.parents]
    given = [] if results is None else [results.absolute(), Path(os.path.realpath(results))]
    found = [folder for folder in above if has_results(folder)] + given
    yield Place(project() / "config", "config", "the configuration of the package")
    projects = [Path.cwd(), *above, *(folder for one in given for folder in one.parents)]
    for folder in dict.fromkeys(projects):
        if not (folder / _CONFIG).is_file():
            continue
        run = _settings(folder / _CONFIG)
        stated = [folders for folders in (run.sensors, run.requirements) if folders is not None]
        named = [one for of in stated for one in ([of] if isinstance(of, Path) else of)]
        for one in (Path("config"), *named):
            if one != CATALOGUE:
                yield Place(folder / one, "config", "the configuration")
        yield Place(folder / run.logs, "logs", "the logs")
        for name in _OF_WORKFLOW:
            yield Place(folder / name, "workflow", "the workflow")
        found.append(folder / run.results)
    found += [folder / "results" for folder in projects if has_results(folder / "results")]
    for folder in dict.fromkeys(found):
        if (logs := drop_zone_of(folder)) is not None:
            yield Place(logs.absolute(), "logs", "the logs")
        yield from (Place(folder / name, "results", "the results of runs") for name in _OF_RUNS)


def has_results(folder: Path) -> bool:
    """Return whether runs left their results in a folder."""
    return (folder / "seals").is_dir() or (folder / "tables/recordings.parquet").is_file()


def _settings(file: Path) -> Run:
    """Return the settings of a run; the defaults where they cannot be read."""
    try:
        return read_settings(Run, file)
    except (ConfigError, OSError):
        return Run()
