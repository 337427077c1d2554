"""Bias and scale factor of a gyro from known rates: at rest, and on a rate table."""

from imubench_pipeline.registry import Block, Extension

EXTENSION = Extension(
    name="calibration",
    tables="calibration.tables",
    blocks=(
        Block(
            "notes",
            "rate_table",
            "calibration.settings:OnRateTable",
            "a gyro on a rate table, for scale factor and bias; null: not on a rate table",
        ),
        Block(
            "notes",
            "positions",
            "calibration.settings:InPositions",
            "a triad in several positions, to find its attitude; null: in one position",
        ),
        Block(
            "notes",
            "pointing",
            "calibration.settings:AtRest",
            "direction of the axis of a gyro at rest, for its bias without the Earth's rate; null: "
            "not known",
        ),
        Block("simulated", "rate_table", "calibration.settings:SimulatedTable"),
        Block("simulated", "positions", "calibration.settings:SimulatedPositions"),
        Block("simulated", "pointing", "calibration.settings:SimulatedRest"),
    ),
    motions={
        "rate_table": "calibration.simulated:simulate_rate_table",
        "positions": "calibration.simulated:simulate_positions",
        "pointing": "calibration.simulated:simulate_rest",
    },
    rules="rules.smk",
    recording_pages={
        "rate_table": "calibration.pages:RATE_TABLE",
        "positions": "calibration.pages:POSITIONS",
    },
    sections=("calibration.pages:NOT_CALIBRATED",),
    recording_sections=("calibration.pages:make_rest_section",),
    templates="templates",
    static="static",
)
