"""What lies in the folder of the report."""

from __future__ import annotations

from pathlib import Path


def files_of_report(folder: Path) -> list[Path]:
    """Return the files and folders of the report, without its figures, which another step draws."""
    return [
        path
        for path in sorted(folder.iterdir())
        if path.name != "figures" and not path.name.startswith(".")
    ]
