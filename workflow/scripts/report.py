"""Write the pages of the report whose data changed."""

from pathlib import Path

from imubench_pipeline.steps.report import write_report

if __name__ == "__main__":
    write_report(
        [Path(path) for path in snakemake.input.tables],
        snakemake.params.settings,
        Path(snakemake.output.page),
        snakemake.threads,
        one_file=snakemake.params.get("one_file", False),
    )
