"""The files in the folder of the report."""

import json
from collections.abc import Mapping
from pathlib import Path

from imubench_pipeline.tables.files import write_content

KEYS = "pages.json"

_FAILED_PAGES_FILE = "failed_pages.json"


def read_failed_pages(folder: Path) -> dict[str, str]:
    """Return the reason for each page of a report that could not be made, by path."""
    return _read_failed(folder)[1]


def count_attempt(folder: Path) -> int:
    """Return the number of the next attempt at failed pages; 0 if no page failed."""
    attempt, failed = _read_failed(folder)
    return attempt + bool(failed)


def write_failed_pages(failed: Mapping[str, str], folder: Path) -> None:
    """Write the paths and reasons of failed pages into the folder; without any, remove the file."""
    if failed:
        content = {"attempt": count_attempt(folder), "pages": dict(failed)}
        write_content(json.dumps(content, indent=1) + "\n", folder / _FAILED_PAGES_FILE)
    else:
        (folder / _FAILED_PAGES_FILE).unlink(missing_ok=True)


def _read_failed(folder: Path) -> tuple[int, dict[str, str]]:
    try:
        content = json.loads((folder / _FAILED_PAGES_FILE).read_text("utf-8"))
        return int(content["attempt"]), {str(k): str(v) for k, v in content["pages"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return 0, {}


def is_report(folder: Path) -> bool:
    """Return whether a folder is an earlier report."""
    return all((folder / name).is_file() for name in (KEYS, "index.html", "assets/report.js"))


def list_report_files(folder: Path) -> list[Path]:
    """Return the files and folders of the report, without its figures, which another step draws."""
    names = sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))
    return [folder / name for name in names if name != "figures"]


def find_drop_zone(results: Path) -> Path | None:
    """Return the folder of logs of the last run, from the settings in its report; None if unknown.

    A relative path is below the folder of the run, which is unknown if ``results`` was renamed.
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
