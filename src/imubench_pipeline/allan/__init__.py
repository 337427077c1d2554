"""The Allan variance of a log: kernels, the grid of cluster sizes, confidence limits."""

from imubench_pipeline.allan.variance import (
    FITTED,
    POWER_LAW,
    AllanCurve,
    allan_variance,
    cluster_sizes,
    of_blocks,
    of_phase,
)

__all__ = [
    "FITTED",
    "POWER_LAW",
    "AllanCurve",
    "allan_variance",
    "cluster_sizes",
    "of_blocks",
    "of_phase",
]
