"""Say what vendors publish of the sensors of the catalogue."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.datasheets.coverage import by_vendor, coverage
from imubench_pipeline.settings.sensor import sensors_of
from imubench_pipeline.tables import build, write_arrow


def write_coverage(catalogue: str, outputs: list[Path]) -> None:
    """Write the tables ``coverage`` and ``coverage_by_vendor``, as Parquet and CSV."""
    rows = coverage(sensors_of(catalogue))
    tables = {
        "coverage": build("coverage", map(asdict, rows)),
        "coverage_by_vendor": build("coverage_by_vendor", map(asdict, by_vendor(rows))),
    }
    for output in outputs:
        write_arrow(tables[output.stem], output)
