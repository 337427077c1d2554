"""Several sensors together: boards, a virtual IMU, how many of one equal another."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="fusion",
    tables="fusion.tables",
    sensor_tables={"published_figures": "fusion.published_figures:published_rows"},
    pages=("fusion.boards:BOARDS",),
    templates="templates",
)
