"""What every table holds: its columns with type, unit and meaning."""

from __future__ import annotations

from imubench_pipeline.model import comparisons, estimates, experiments, published, recordings
from imubench_pipeline.model.table import TableRow, TypedColumn, columns_of, rows_in

ROWS: dict[str, type[TableRow]] = {
    row.table: row
    for module in (recordings, estimates, comparisons, experiments, published)
    for row in rows_in(module)
}
"""The class of the rows of every table a run leaves, by its name."""

TABLES: dict[str, tuple[TypedColumn, ...]] = {name: columns_of(row) for name, row in ROWS.items()}
"""The columns of every table; all numbers are SI (temperatures in degC)."""

PARTS_OF = {"curve": "allan", "estimate_findings": "findings"}
"""Files of a recording that hold rows of another table, and that table."""

SAMPLES = ("envelope", "histogram")
"""The tables of the samples themselves, for the pages of the recordings."""

OF_ONE_RECORDING = (*SAMPLES, "samples_of_models", "draws", "error_growth", "drawn_deviations")
"""The tables that are kept with each recording and not joined."""

TURNED = (
    "earth_rate",
    "earth_rate_series",
    "turning",
    "earth_rate_prediction",
    "earth_rate_published",
)
"""The tables of gyros that were turned: only such recordings have rows."""

CALIBRATED = ("calibration", "calibration_points")
"""The tables of gyros on a rate table, or at rest where it is known how they point."""

OUTLOOK = ("alignment", "earth_rate_prediction")
"""The tables of what each sensor at rest could find; the second has rows of turned gyros, too."""

BY_RECORDING = (
    "recordings",
    "findings",
    "doubts",
    "allan",
    "parameters",
    "reconstruction",
    "scores",
    "models",
    "lines",
    "datasheet",
    "datasheet_curve",
    "spectrum",
    "fixed_bias",
    "temperature",
    "allan_compensated",
    "low_pass",
    "deterministic",
    "simulated_truth",
    "published_figures",
    "error_budget",
    "backtest",
    *TURNED,
    *CALIBRATED,
    "alignment",
)
"""The joined tables in which a recording has rows of its own."""

COMPARED = ("recordings", "allan", "parameters", "simulated_truth")
"""The joined tables from which the figures of all sensors are drawn."""
