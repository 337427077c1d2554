"""Compare the estimates of a recording, and its fixed bias, with its sensor's datasheet."""

from pathlib import Path

from imubench_pipeline.steps.datasheet import curve_rows, rows
from imubench_pipeline.tables import write

if __name__ == "__main__":
    names = snakemake.wildcards
    given = (
        Path(snakemake.input.parameters).parent,
        names.sensor,
        names.recording,
        snakemake.params.settings,
    )
    write("datasheet", rows(*given), Path(snakemake.output.datasheet))
    write("datasheet_curve", curve_rows(*given), Path(snakemake.output.datasheet_curve))
