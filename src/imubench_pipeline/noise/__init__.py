"""Noise terms and their sum: density, Allan variance, state space, growth, simulated samples."""

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
    compute_bias_instability,
    compute_driving_density,
    evaluate_gauss_markov_shape,
    evaluate_sampled_shape,
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
    "compute_bias_instability",
    "compute_driving_density",
    "evaluate_gauss_markov_shape",
    "evaluate_sampled_shape",
]
