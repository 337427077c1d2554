"""Noise models as input files of public filters and simulators.

A program has a pure function of an `imu.Imu`, which describes the convention of the program and
cites its documentation. `targets` lists the programs, `request` makes a file from the tables of a
run, and `of_models` one from noise models.
"""

from imubench_pipeline.registry import Block, Extension

EXTENSION = Extension(
    name="exports",
    blocks=(Block("run", "exports", "exports.settings:ExportSettings"),),
    rules="rules.smk",
    library={
        "export": "exports.of_models:export",
        "export_estimates": "exports.of_estimates:export_estimates",
    },
    sensor_commands=("exports.targets:list_commands",),
    listings=("exports.targets:list_targets",),
    commands={"calibrate": "exports.calibrate:COMMAND", "export": "exports.command:COMMAND"},
)
