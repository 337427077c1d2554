"""Aided navigation: an error-state filter on simulated drives, with outages of GNSS.

A trajectory gives true motion and what ideal sensors measure of it (`trajectories`), a sensor model
their errors (`signals`), a noise model the states of the filter (`axis_states`), which runs on both
(`error_state`). `runs` repeats it, for several tunings on the same signals, and `measures` says how
large the errors are at the end of an outage, and whether they are as large as the filter says.
"""

from imubench_pipeline.registry import Block, Extension

EXTENSION = Extension(
    name="aided",
    tables="aided.tables",
    blocks=(Block("run", "navigate", "aided.settings:NavigateSettings"),),
    limits={"navigation": "aided.limits:yield_outage_rows"},
    rules="rules.smk",
    pages=("aided.page:NAVIGATION",),
    templates="templates",
)
