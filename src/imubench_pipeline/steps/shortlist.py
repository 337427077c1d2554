"""The shortlist of a run or, without a run, of the catalogue."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path

from imubench_pipeline.model.comparisons import RankingRow, ShortlistRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import R
from imubench_pipeline.navigation.shortlist import list_shortlist_rows
from imubench_pipeline.settings.requirements import Requirement, validate_requirements
from imubench_pipeline.settings.sensor import Sensor, sensors_of
from imubench_pipeline.tables.files import read, write_each

NEEDED = ("recordings", "ranking")  # the tables of a run that the step reads


def list_shortlist(
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Sensor],
    tables: Mapping[str, Path],
) -> Iterator[ShortlistRow]:
    """Yield the rows of the table ``shortlist``; OSError or ValueError if a table cannot be read.

    `sensors`: the catalogue; `tables`: files of the tables `NEEDED`, empty if nothing is measured;
    `requirements`: of applications, by name.
    """
    sensors = {name: sensor for name, sensor in sensors.items() if sensor.sold}

    def rows_of(of: type[R]) -> list[R]:
        return of.rows_of(read(of.table, [tables[of.table]])) if of.table in tables else []

    yield from list_shortlist_rows(
        requirements, sensors, rows_of(RankingRow), rows_of(RecordingRow)
    )


def write_shortlist(
    tables: dict[str, Path], settings: str, catalogue: str, outputs: list[Path]
) -> None:
    """Write the table ``shortlist``, as Parquet and CSV."""
    requirements = validate_requirements(json.loads(settings)["requirements"])
    write_each({"shortlist": list_shortlist(requirements, sensors_of(catalogue), tables)}, outputs)
