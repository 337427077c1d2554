"""Run the workflow on complete logs, from a timer; compare the results of two runs."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="nightly",
    commands={"nightly": "nightly.command:COMMAND", "compare": "nightly.compare:COMMAND"},
)
