"""List the figures that vendors publish for the sensors of the catalogue."""

from pathlib import Path

from imubench_pipeline.datasheets.catalogue import list_catalogue
from imubench_pipeline.datasheets.coverage import by_vendor, coverage
from imubench_pipeline.settings.sensor import sensors_of
from imubench_pipeline.tables.files import write_each


def write_coverage(catalogue: str, outputs: list[Path]) -> None:
    """Write the tables ``catalogue``, ``coverage`` and ``coverage_by_vendor``."""
    sensors = sensors_of(catalogue)
    rows = coverage(sensors)
    catalogue_rows = list_catalogue(sensors)
    tables = {"catalogue": catalogue_rows, "coverage": rows, "coverage_by_vendor": by_vendor(rows)}
    write_each(tables, outputs)
