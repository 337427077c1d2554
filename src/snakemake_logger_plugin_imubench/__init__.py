"""Logger plug-in of Snakemake, for a profile with ``logger: imubench``."""

from imubench_pipeline.run.progress import LogHandler

__all__ = ["LogHandler"]
