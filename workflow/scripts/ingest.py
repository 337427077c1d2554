"""Convert a recording to Parquet; an unusable one is recorded as rejected."""

from pathlib import Path

from imubench_pipeline.steps.ingest import write_recording

if __name__ == "__main__":
    names = snakemake.wildcards
    samples = snakemake.output.get("samples")
    write_recording(
        Path(snakemake.params.source),
        snakemake.params.settings,
        names.sensor,
        names.recording,
        Path(snakemake.output.quality).parent,
        Path(samples) if samples else None,
    )
