"""Claims of the papers behind this project, with the results of this project."""

from imubench_pipeline.registry import Extension

EXTENSION = Extension(
    name="papers",
    needs=("calibration", "earth_rate", "fusion"),
    tables="papers.tables",
    rules="rules.smk",
    pages=("papers.page:PAPERS_PAGE",),
    sections=("papers.page:READING",),
    search=("papers.page:find_lines",),
    commands={"papers": "papers.command:COMMAND"},
    templates="templates",
)
