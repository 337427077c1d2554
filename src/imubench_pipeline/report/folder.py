"""What lies in the folder of the report."""

from __future__ import annotations

import json
from pathlib import Path

KEYS = "pages.json"
"""What each page of a report shows."""


def is_report(folder: Path) -> bool:
    """Return whether a folder is a report that was written before."""
    return all((folder / name).is_file() for name in (KEYS, "index.html", "assets/report.js"))


def files_of_report(folder: Path) -> list[Path]:
    """Return the files and folders of the report, without its figures, which another step draws."""
    return [
        path
        for path in sorted(folder.iterdir())
        if path.name != "figures" and not path.name.startswith(".")
    ]


def drop_zone_of(results: Path) -> Path | None:
    """Return the drop zone of the last run, as its report says; None where that is not known.

    Parameters
    ----------
    results : Path
        Folder of the results of runs. Paths that were given from the folder of the run are taken
        from there, as far as the results have the name that they had.
    """
    try:
        settings = json.loads((results / "report/settings.json").read_text("utf-8"))
        given, logs = Path(settings["results"]), Path(settings["logs"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    if given.is_absolute() or given.resolve() == results.resolve():
        return logs
    own = results.absolute()
    if own.parts[-len(given.parts) :] != given.parts:
        return None
    return own.parents[len(given.parts) - 1] / logs
