"""Write the input files of filters and simulators, for every sensor."""

from pathlib import Path

from imubench_pipeline.extensions.exports.exports import write_exports

if __name__ == "__main__":
    write_exports(
        Path(snakemake.input.recordings).parent,
        snakemake.params.settings,
        Path(snakemake.output.folder),
    )
