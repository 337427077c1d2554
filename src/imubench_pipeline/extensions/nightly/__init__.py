"""`imubench nightly`: run the workflow on complete logs, from a timer."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(name="nightly", commands={"nightly": "nightly.command:COMMAND"})
