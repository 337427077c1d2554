"""Write a simulated recording, in the layout of its sensor's logs."""

from pathlib import Path

from imubench_pipeline.steps.simulate import write_recording

if __name__ == "__main__":
    write_recording(snakemake.params.settings, Path(snakemake.output.log))
