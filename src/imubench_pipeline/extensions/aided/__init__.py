"""Aided navigation: an error-state filter on simulated drives, with outages of GNSS.

A trajectory gives true motion and sensor readings (`trajectories`), a noise model the states of the
filter (`axis_states`) that runs on them (`error_state`), for several tunings (`runs`).
"""

from imubench_pipeline.registry import Block, Extension

EXTENSION = Extension(
    name="aided",
    needs=("calibration", "exports"),
    tables="aided.tables",
    blocks=(Block("run", "navigate", "aided.settings:NavigateSettings"),),
    limits={"navigation": "aided.limits:yield_outage_rows"},
    rules="rules.smk",
    pages=("aided.page:NAVIGATION",),
    templates="templates",
)
