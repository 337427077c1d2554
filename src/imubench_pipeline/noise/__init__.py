"""Noise terms and their sum: density, Allan variance, state space, growth, simulated samples."""

from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.noise.terms import PARAMETERS, TERMS
from imubench_pipeline.noise.terms.base import Deterministic, Role, Term, TermParameter
from imubench_pipeline.noise.terms.flicker import Flicker
from imubench_pipeline.noise.terms.gauss_markov import (
    FLOOR,
    PEAK_TAU,
    GaussMarkov,
    compute_bias_instability,
    compute_driving_density,
    evaluate_gauss_markov_shape,
    evaluate_sampled_shape,
)
from imubench_pipeline.noise.terms.power_laws import Quantization, Ramp, RandomWalk, WhiteNoise
from imubench_pipeline.noise.terms.sinusoid import Sinusoid

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
