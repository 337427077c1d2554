"""What each noise is: density, Allan variance and state space of its terms, and of their sum.

Beside it what follows from these alone: the growth of errors, flicker noise as a bank of processes,
low-pass filters, simulated samples.
"""

from imubench_pipeline.noise.model import (
    FLOOR,
    PEAK_TAU,
    Flicker,
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    StateSpace,
    Term,
    WhiteNoise,
    bias_instability,
    driving_density,
    gauss_markov_shape,
    sampled_gauss_markov_shape,
)

__all__ = [
    "FLOOR",
    "PEAK_TAU",
    "Flicker",
    "GaussMarkov",
    "NoiseModel",
    "Quantization",
    "Ramp",
    "RandomWalk",
    "Sinusoid",
    "StateSpace",
    "Term",
    "WhiteNoise",
    "bias_instability",
    "driving_density",
    "gauss_markov_shape",
    "sampled_gauss_markov_shape",
]
