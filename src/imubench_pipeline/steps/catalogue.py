"""List the figures that vendors publish for the sensors of the catalogue."""

from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.datasheets.catalogue import list_catalogue
from imubench_pipeline.datasheets.coverage import by_vendor, coverage
from imubench_pipeline.settings.sensor import sensors_of
from imubench_pipeline.tables.files import write_each


def write_coverage(catalogue: str, outputs: list[Path]) -> None:
    """Write the tables ``catalogue``, ``coverage`` and ``coverage_by_vendor``."""
    sensors = sensors_of(catalogue)
    rows = coverage(sensors)
    write_each(
        {
            "catalogue": list_catalogue(sensors),
            "coverage": map(asdict, rows),
            "coverage_by_vendor": map(asdict, by_vendor(rows)),
        },
        outputs,
    )
