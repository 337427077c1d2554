"""Read a recording into Parquet; one that cannot be used is recorded as rejected."""

from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.overview import overview
from imubench_pipeline.tables import write, write_json

if __name__ == "__main__":
    names, outputs = snakemake.wildcards, snakemake.output
    folder = Path(outputs.quality).parent
    quality = ingest_as_planned(
        Path(snakemake.params.source),
        snakemake.params.settings,
        names.sensor,
        names.recording,
        folder,
    )
    seen = overview(folder, names.sensor, names.recording)
    write("envelope", seen.envelope, Path(outputs.envelope))
    write("histogram", seen.histogram, Path(outputs.histogram))
    write_json(asdict(quality), Path(outputs.quality))
