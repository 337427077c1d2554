"""The modules that each step of the workflow runs."""

from __future__ import annotations

from collections.abc import Mapping

STEPS: Mapping[str, tuple[str, ...]] = {
    "simulate": ("steps.simulate",),
    "ingest": ("recordings.ingest", "recordings.overview", "tables.files"),
    "allan": ("allan.variance", "recordings.recording", "estimators.rows"),
    "estimate": ("steps.estimate",),
    "reconstruct": ("steps.reconstruct",),
    "datasheet": ("datasheets.deltas", "steps.kept_curves", "estimators.rows"),
    "error_budget": (
        "navigation.expected_errors",
        "navigation.backtest.of_recording",
        "estimators.rows",
    ),
    "ranking": ("navigation.selection", "navigation.verdicts.next_steps", "tables.files"),
    "repeatability": ("navigation.repeatability", "settings.config", "tables.files"),
    "shortlist": ("steps.shortlist", "tables.files"),
    "fusion": ("steps.fusion",),
    "earth_rotation": ("steps.earth_rotation",),
    "calibration": ("steps.calibration",),
    "outlook": ("steps.outlook",),
    "coverage": ("datasheets.coverage", "tables.files"),
    "exports": ("steps.exports",),
    "sensor_tables": ("steps.sensor_tables",),
    "tables": ("tables.failures",),
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
