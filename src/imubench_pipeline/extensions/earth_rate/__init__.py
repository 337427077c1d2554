"""The Earth's rotation from a gyro turned between north and south (Silva et al., section 6, 7)."""

from imubench_pipeline.registry import Block, Extension

EXTENSION = Extension(
    name="earth_rate",
    needs=("calibration",),
    tables="earth_rate.tables",
    blocks=(
        Block("run", "earth_rate", "earth_rate.settings:EarthRateSettings"),
        Block(
            "notes",
            "two_position",
            "earth_rate.settings:TwoPosition",
            "a gyro turned between north and south to find the Earth's rate; null: the sensor was "
            "at rest",
        ),
        Block("simulated", "two_position", "earth_rate.settings:SimulatedTurns"),
    ),
    motions={"two_position": "earth_rate.simulation:simulate_turned_gyro"},
    rules="rules.smk",
    pages=("earth_rate.page:EARTH_RATE_PAGE",),
    recording_pages={"two_position": "earth_rate.page:TURNED_PAGE"},
    sections=("earth_rate.page:NOT_FOUND",),
    templates="templates",
    static="static",
)
