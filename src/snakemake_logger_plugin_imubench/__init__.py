"""What Snakemake looks for by this name where a profile says ``logger: imubench``."""

from imubench_pipeline.run.progress import LogHandler

__all__ = ["LogHandler"]
