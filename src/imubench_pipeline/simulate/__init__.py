"""A whole sensor, simulated: noise, drift, low-pass, register and motion of all axes.

`imubench_pipeline.noise.simulate` has the samples of a noise model alone, which `simulate` draws.
"""

from imubench_pipeline.noise.simulate import simulate

__all__ = ["simulate"]
