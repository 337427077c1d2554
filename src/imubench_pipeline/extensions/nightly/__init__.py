"""`imubench nightly`: what a timer calls, while loggers write."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="nightly",
    commands={"nightly": "nightly.command:COMMAND"},
)
