"""Noise terms and their sum: density, Allan variance, state space, growth, simulated samples."""

from imubench_pipeline.noise import terms
from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.noise.terms import *  # noqa: F403 - its names, as in `__all__`

__all__ = ["NoiseModel", "StateSpace"]
__all__ += terms.__all__
