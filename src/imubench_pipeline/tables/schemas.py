"""The columns of every table, with type, unit and meaning, and groups of tables."""

from types import ModuleType

from imubench_pipeline.model import comparisons, estimates, recordings
from imubench_pipeline.model.table import OfRecordingRow, TableRow, TypedColumn, columns_of, rows_in
from imubench_pipeline.registry import Hook

_MODULES: Hook[ModuleType] = Hook("tables")

ROWS: dict[str, type[TableRow]] = {
    row.table: row
    for module in (recordings, estimates, comparisons, *_MODULES.objects())
    for row in rows_in(module)
}
"""The class of the rows of every table a run leaves, by its name."""

TABLES: dict[str, tuple[TypedColumn, ...]] = {name: columns_of(row) for name, row in ROWS.items()}
"""The columns of every table; all numbers are SI (temperatures in degC)."""

PARTS_OF = {"curve": "allan", "estimate_findings": "findings"}  # tables with rows of other ones
SAMPLES = ("envelope", "histogram")  # tables of the samples, for pages of recordings
OF_ONE_RECORDING = (*SAMPLES, "samples_of_models", "draws", "error_growth", "drawn_deviations")
"""The tables that are kept with each recording and not joined."""

_OF_RECORDING = {name for name, row in ROWS.items() if issubclass(row, OfRecordingRow)}
BY_RECORDING = ("recordings", *sorted(_OF_RECORDING - {*OF_ONE_RECORDING}))
"""The joined tables in which a recording has rows of its own."""
