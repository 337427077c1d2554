"""Files of the package: the workflow, and the catalogue of sensors and requirements.

A checkout has them at its root, a wheel in the package.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

CATALOGUE = Path("catalogue")
"""Placeholder in a configuration for the folder of such files in the package."""

Folders = Path | Sequence[Path]


def find_project() -> Path:
    """Return the folder with the Snakefile, workflow/, config/ and profiles/."""
    inside = Path(__file__).parents[1] / "project"
    return inside if inside.is_dir() else Path(__file__).parents[3]


def list_folders(stated: Folders, kind: Literal["sensors", "requirements"]) -> list[Path]:
    """Return the folders of sensor or requirement files, each once; later ones have precedence."""
    found: dict[Path, Path] = {}
    for folder in [stated] if isinstance(stated, Path) else stated:
        place = find_project() / "config" / kind if folder == CATALOGUE else folder
        found.pop(place.resolve(), None)
        found[place.resolve()] = place
    places = list(found.values())
    needed = [place for place in places if place != Path("config", kind) or place.is_dir()]
    return needed or places


def find_own_folder(stated: Folders) -> Path:
    """Return the folder for a new file: the last one outside the package."""
    named = [stated] if isinstance(stated, Path) else stated
    return next((folder for folder in reversed(named) if folder != CATALOGUE), named[-1])
