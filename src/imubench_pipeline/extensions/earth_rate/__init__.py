"""The Earth's rotation from a gyro turned between north and south (Silva et al., section 6, 7)."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="earth_rate",
    needs=("calibration",),
    tables="earth_rate.tables",
)
