"""Find the workflow of a folder."""

from __future__ import annotations

from pathlib import Path

from imubench_pipeline.settings.shipped import find_project
from imubench_pipeline.settings.validation import ConfigError

_SNAKEFILE_PATHS = ("Snakefile", "workflow/Snakefile")


def has_snakefile(folder: Path) -> bool:
    """Return whether a folder has a workflow of its own, which `snakemake` finds there."""
    return any((folder / own).is_file() for own in _SNAKEFILE_PATHS)


def find_snakefile(folder: Path) -> Path:
    """Return the Snakefile of a folder; for a folder of logs, the Snakefile of this package.

    A ConfigError is raised if the folder is neither.
    """
    for own in _SNAKEFILE_PATHS:
        if (folder / own).is_file():
            return (folder / own).absolute()
    shipped = find_project() / "Snakefile"
    if not (folder / "config/config.yaml").is_file():
        raise ConfigError(
            f"{folder}: found no config/config.yaml and no Snakefile; expected a folder of logs, "
            f"which imubench init {folder} makes, or a checkout"
        )
    if not shipped.is_file():
        raise ConfigError(
            f"{shipped}: no such file; expected the workflow in the installed package: install it "
            "again, from a wheel or a checkout"
        )
    return shipped
