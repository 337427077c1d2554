"""Read a recording into Parquet; one that cannot be used is recorded as rejected."""

from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.ingest import ingest_as_planned
from imubench_pipeline.tables import write_json

if __name__ == "__main__":
    output = Path(snakemake.output[0])
    quality = ingest_as_planned(
        Path(snakemake.params.source),
        snakemake.params.settings,
        snakemake.wildcards.sensor,
        snakemake.wildcards.recording,
        output.parent,
    )
    write_json(asdict(quality), output)
