"""The modules that each step of the workflow runs."""

from __future__ import annotations

from collections.abc import Mapping

STEPS: Mapping[str, tuple[str, ...]] = {
    "simulate": ("simulated_logs",),
    "ingest": ("ingest", "overview", "tables"),
    "allan": ("allan", "recording", "rows"),
    "estimate": ("estimation",),
    "reconstruct": ("reconstruction",),
    "datasheet": ("datasheet", "kept_curves", "rows"),
    "error_budget": ("expected_errors", "backtest.of_recording", "rows"),
    "ranking": ("selection", "verdicts.next_steps", "tables"),
    "repeatability": ("repeatability.rows", "config", "tables"),
    "shortlist": ("shortlist.of_run", "tables"),
    "fusion": ("fusion.of_run",),
    "earth_rotation": ("earth_rate.of_run",),
    "calibration": ("calibration.of_run",),
    "outlook": ("alignment.of_sensor",),
    "coverage": ("coverage", "tables"),
    "exports": ("export.of_run",),
    "sensor_tables": ("joined",),
    "tables": ("failures",),
    "figures": ("report.static_figures.of_run",),
    "report": ("report.publish",),
}
"""The modules that each step runs: their edit runs the step again."""

OF_SENSOR = ("outlook", "sensor_tables")
"""Steps of one sensor."""

OF_ALONE = (
    "ingest",
    "allan",
    "estimate",
    "reconstruct",
    "datasheet",
    "error_budget",
    "earth_rotation",
    "calibration",
    *OF_SENSOR,
)
"""Steps of one recording or one sensor, which is left out where they fail."""
