"""The noise terms of an inertial sensor and their properties (IEEE Std 952-2020, 647).

Models, fits, simulation, budgets, exports and pages take everything from here. A new kind of term
is a module here, and an entry of `TERMS`.
"""

from imubench_pipeline.noise.terms.base import register_terms
from imubench_pipeline.noise.terms.flicker import Flicker
from imubench_pipeline.noise.terms.gauss_markov import GaussMarkov
from imubench_pipeline.noise.terms.power_laws import Quantization, Ramp, RandomWalk, WhiteNoise
from imubench_pipeline.noise.terms.sinusoid import Sinusoid

TERMS = register_terms(Quantization, WhiteNoise, Flicker, GaussMarkov, RandomWalk, Ramp, Sinusoid)
"""Every kind of noise term, in the order of a model's name."""

PARAMETERS = {parameter.symbol: parameter for kind in TERMS for parameter in kind.parameters}
"""Every parameter of the terms by its symbol; flicker noise and Gauss-Markov process share B."""
