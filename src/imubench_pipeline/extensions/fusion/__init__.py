"""Several sensors as one: boards, a virtual IMU, and how many sensors equal one better sensor."""

from imubench_pipeline.registry import Block, Extension

EXTENSION = Extension(
    name="fusion",
    tables="fusion.tables",
    blocks=(
        Block(
            "simulated",
            "specimens",
            "fusion.settings:Specimens",
            "number of sensors fused to this log; omitted: one sensor",
        ),
    ),
    simulations={"specimens": "fusion.specimens:SPECIMENS"},
    sensor_tables={"published_figures": "fusion.published_figures:yield_published_figures"},
    pages=("fusion.page:FUSION", "fusion.page:BOARDS"),
    templates="templates",
    rules="rules.smk",
)
