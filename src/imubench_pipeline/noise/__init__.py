"""What each noise is: density, Allan variance and state space of its terms, and of their sum.

Beside it what follows from these alone: the growth of errors, flicker noise as a bank of processes,
low-pass filters, simulated samples.
"""

from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.noise.terms import (
    FLOOR,
    PARAMETERS,
    PEAK_TAU,
    TERMS,
    Deterministic,
    Flicker,
    GaussMarkov,
    Quantization,
    Ramp,
    RandomWalk,
    Role,
    Sinusoid,
    Term,
    TermParameter,
    WhiteNoise,
    bias_instability,
    driving_density,
    gauss_markov_shape,
    sampled_gauss_markov_shape,
)

__all__ = [
    "FLOOR",
    "PARAMETERS",
    "PEAK_TAU",
    "TERMS",
    "Deterministic",
    "Flicker",
    "GaussMarkov",
    "NoiseModel",
    "Quantization",
    "Ramp",
    "RandomWalk",
    "Role",
    "Sinusoid",
    "StateSpace",
    "Term",
    "TermParameter",
    "WhiteNoise",
    "bias_instability",
    "driving_density",
    "gauss_markov_shape",
    "sampled_gauss_markov_shape",
]
