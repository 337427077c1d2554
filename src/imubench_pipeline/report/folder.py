"""What lies in the folder of the report."""

from __future__ import annotations

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
