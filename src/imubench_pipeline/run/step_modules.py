"""The modules that each step of the workflow runs."""

from __future__ import annotations

from collections.abc import Mapping

STEPS: Mapping[str, tuple[str, ...]] = {
    "simulate": ("steps.simulate",),
    "ingest": ("steps.ingest",),
    "allan": ("steps.allan",),
    "estimate": ("steps.estimate",),
    "reconstruct": ("steps.reconstruct",),
    "datasheet": ("steps.datasheet",),
    "error_budget": ("steps.error_budget",),
    "ranking": ("steps.ranking",),
    "repeatability": ("steps.repeatability",),
    "shortlist": ("steps.shortlist",),
    "fusion": ("steps.fusion",),
    "earth_rotation": ("steps.earth_rotation",),
    "calibration": ("steps.calibration",),
    "outlook": ("steps.outlook",),
    "coverage": ("steps.coverage",),
    "exports": ("steps.exports",),
    "sensor_tables": ("steps.sensor_tables",),
    "tables": ("steps.tables",),
    "figures": ("steps.figures",),
    "report": ("steps.report",),
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
