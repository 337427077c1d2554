"""Protected folders of a project: other commands must not write there."""

import os
from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.report.folder import find_drop_zone
from imubench_pipeline.settings.config import Run
from imubench_pipeline.settings.shipped import CATALOGUE, find_project
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.settings.yaml_files import read_settings
from imubench_pipeline.tables.outputs import Place

_CONFIG_FILE = Path("config/config.yaml")
_RESULT_FOLDERS = ("exports", "faults", "logs", "nightly", "recordings", "report", "seals",
                   "sensors", "simulated", "tables")  # fmt: skip
"""Folders in the results that runs write."""

_WORKFLOW_PARTS = ("Snakefile", "workflow", "profiles", "src", "tests", "pyproject.toml")


def find_protected_places(path: Path, results: Path | None = None) -> Iterator[Place]:
    """Yield the protected places that may contain an absolute path without links, or be inside it.

    These are the configuration of the package, and the ``config/``, logs, results, sensors,
    requirements and workflow of each project: a folder with ``config/config.yaml`` that is the
    working folder, or lies at or above the path or `results`. In folders of results, only the
    folders that runs write and the logs that the report names are protected.
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
        yield from (
            Place(folder / name, "results", "the results of runs") for name in _RESULT_FOLDERS
        )


def has_results(folder: Path) -> bool:
    """Return whether a folder contains results of runs."""
    return (folder / "seals").is_dir() or (folder / "tables/recordings.parquet").is_file()
