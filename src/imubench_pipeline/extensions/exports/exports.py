"""The exports of a run: a folder per sensor with a file per program."""

from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.extensions.exports.imu import ExportError
from imubench_pipeline.extensions.exports.request import (
    Request,
    Tables,
    load,
    make_content,
    recordings_of,
)
from imubench_pipeline.extensions.exports.settings import ExportSettings
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.tables.files import make_folder, write_content
from imubench_pipeline.tables.texts import escape_invisible
from imubench_pipeline.units import parse_quantity

NOT_MADE = "not_made.txt"  # names the programs for which there is no file, with the reason


def make_exports(
    tables: Tables, settings: ExportSettings, recordings: Path | None = None
) -> Iterator[tuple[Path, str | bytes]]:
    """Yield path and content of each exported file of a run; paths are below the exports folder.

    A path is ``<sensor>/<target>/<file of the program>``; ``<sensor>/not_made.txt`` has the
    reasons of missing files. `tables` and `recordings`: as in `request.make_content`.
    """
    for sensor in dict.fromkeys(tables["parameters"]["sensor"].to_pylist()):
        refused = []
        horizon = parse_quantity(settings.horizon, "time")
        options = settings.model_dump(exclude={"targets", "horizon"})
        for target in settings.targets:
            request = Request(sensor=sensor, target=target, horizon=horizon, **options)
            try:
                content = make_content(tables, request, recordings)
            except ExportError as error:
                refused.append(escape_invisible(f"{target}: {error}"))
                continue
            yield Path(sensor, target, TARGETS[target].file_name), content
        if refused:
            yield Path(sensor, NOT_MADE), "\n".join(refused) + "\n"


def write_exports(tables: Path, settings: str, folder: Path) -> None:
    """Write a folder per sensor with a file per program; all appear together."""
    how = ExportSettings.model_validate_json(settings)
    with make_folder(folder) as made:
        for place, content in make_exports(load(tables), how, recordings_of(tables)):
            write_content(content, made / place)
