"""The modules that each step of the workflow runs."""

from __future__ import annotations

from collections.abc import Mapping

STEPS: Mapping[str, tuple[str, ...]] = {
    "simulate": ("simulated_logs",),
    "ingest": ("ingest", "overview", "results"),
    "allan": ("allan", "recording", "results"),
    "estimate": ("estimation",),
    "reconstruct": ("reconstruction",),
    "datasheet": ("datasheet", "results"),
    "error_budget": ("expected_errors", "backtest.of_recording", "results"),
    "ranking": ("selection", "verdicts.next_steps", "results"),
    "repeatability": ("repeatability.rows", "config", "results"),
    "shortlist": ("shortlist.of_run", "results"),
    "fusion": ("fusion.of_run",),
    "earth_rotation": ("earth_rate.of_run",),
    "calibration": ("calibration.of_run",),
    "outlook": ("alignment.of_sensor",),
    "coverage": ("coverage", "results"),
    "exports": ("export.of_run",),
    "sensor_tables": ("results",),
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
