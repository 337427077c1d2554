"""Bias and scale factor of a gyro from rates that are known: at rest, and on a rate table."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="calibration",
    tables="calibration.tables",
)
