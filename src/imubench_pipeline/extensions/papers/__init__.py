"""Claims of the papers behind this project, with the results of this project."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="papers",
    needs=("earth_rate", "fusion"),
    tables="papers.tables",
    rules="rules.smk",
)
