"""Counterparts of the numbered equations of Maia et al., for the MTi-7 gyro of Table 2."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from imubench_pipeline.extensions.papers.evidence import Evidence, Result
from imubench_pipeline.extensions.papers.maia_draws import DURATION, MTI_GYRO
from imubench_pipeline.noise import (
    GaussMarkov,
    NoiseModel,
    RandomWalk,
    WhiteNoise,
    driving_density,
)
from imubench_pipeline.noise.variance_covariance import variance_covariance

_MODEL = MTI_GYRO.table_2
_RATE = MTI_GYRO.rate
assert _MODEL.T_B is not None
_PROCESS = GaussMarkov(_MODEL.B, _MODEL.T_B)
_DEFAULT_TAU = 100.0  # s

WEIGHED_AT = (10.0, 100.0, 1000.0)
"""Cluster times, s, for the comparison of the weight of equation 25 with the spread."""


def integrate_density(model: NoiseModel, tau: float) -> float:
    """Return the Allan variance at a tau, s, by integration of the density, as a reference.

    4 ∫ S(f) sin⁴(π f τ) / (π f τ)² df from 0, with x = π f τ.
    """
    # The random walk is steep at 0. White noise converges slowly: its tail has the mean 3/8 of
    # sin⁴.
    ends = np.concatenate(([1e-9, 1e-3, 1e-2, 0.1], np.pi * np.arange(0.5, 400.5, 0.5)))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = np.diff(ends)[:, None] / 2.0
    x = ends[:-1, None] + half * (1.0 + nodes)
    last = float(ends[-1])
    density = model.psd(x / (math.pi * tau))
    total = float((half * (density * np.sin(x) ** 4 / x**2) @ weights[:, None]).sum())
    rest = float(model.psd(last / (math.pi * tau))) * 0.375 / last
    return 4.0 / (math.pi * tau) * (total + rest)


def evaluate_as_printed(model: NoiseModel, tau: float) -> float:
    """Return equation 26 as it is printed, with e^(+τ/T_B)."""
    assert model.T_B is not None
    T_B, x = model.T_B, tau / model.T_B
    bracket = 1.0 - (3.0 - 4.0 * math.exp(x) + math.exp(-2.0 * x)) / (2.0 * x)
    driven = driving_density(model.B, T_B) * T_B**2 / tau * bracket
    return model.N**2 / tau + driven + model.K**2 * tau / 3.0


def compute_weight_ratios(tau: float) -> tuple[float, float]:
    """Return the standard deviation of an Allan variance over the one that a weight assumes.

    First for the intended weight, 2 √(n/2L) σ̂²; then for the printed one, 2 √(n/2L) σ̂. Its
    dimension is wrong, so that the ratio depends on the unit. For the MTi-7 gyro at a tau, s.
    """
    samples, n = round(DURATION * _RATE), round(tau * _RATE)
    variance = float(_MODEL.allan_variance(tau, _RATE))
    spread = math.sqrt(variance_covariance(_MODEL, _RATE, samples, np.array([n]))[0, 0])
    meant = 2.0 * math.sqrt(n / (2.0 * samples)) * variance
    return spread / meant, spread / (meant / math.sqrt(variance))


def equation(_: Evidence, number: str) -> Result:
    """Return the result of an equation, with the printed one where it follows from Table 2."""
    return _evaluate_equations()[number]


@cache
def _evaluate_equations() -> dict[str, Result]:
    N, B, K, T_B, T = _MODEL.N, _MODEL.B, _MODEL.K, _PROCESS.T_B, 1.0 / _RATE
    f, omega = np.array(1e-3), 2.0 * math.pi * 1e-3
    space, driven = _MODEL.state_space(_RATE), driving_density(B, T_B)
    parts = [NoiseModel(N=N), NoiseModel(B=B, T_B=T_B), NoiseModel(K=K)]
    of_parts = sum(part.allan_variance(_DEFAULT_TAU) for part in parts)
    decay = _PROCESS.state_space(T_B).transition[0, 0]
    S_B = 2.0 * B**2 * math.log(2.0) / (math.pi * 0.4365**2 * T_B)
    return {
        "2": Result(value=float(_MODEL.allan_variance(_DEFAULT_TAU) / of_parts)),
        "4": Result(value=float(decay), printed=math.exp(-1.0)),
        "5": Result(value=float(RandomWalk(1.0).state_space(1.0).process_noise[0, 0])),
        "7": Result(value=float(WhiteNoise(2.0).psd(f) / 4.0)),
        "8": Result(value=driven, printed=S_B),
        "9": Result(value=float(RandomWalk(1.0).psd(f) * omega**2)),
        # Differences of adjacent clusters of two, begun at every one of ten samples.
        "10": Result(value=float(sum(start + 2 * 2 <= 10 for start in range(10)))),
        "11": Result(value=math.sqrt(float(NoiseModel(N=1.0).allan_variance(1.0)))),
        "12": Result(value=math.sqrt(float(NoiseModel(K=1.0).allan_variance(3.0)))),
        "20": Result(value=float(space.transition[0, 0]), printed=math.exp(-T / T_B)),
        "21": Result(fields={"matrix": space.output.astype(int).tolist()}),
        "22": Result(value=float(space.process_noise[0, 0]) / (driven / _RATE)),
        "23": Result(value=float(space.measurement_noise), printed=N**2 / T),
    }


def spread_over_weight(_: Evidence) -> Result:
    """Return the spread of the Allan variance over the one that the intended weight assumes."""
    return Result(fields={f"at_{tau:.0f}": compute_weight_ratios(tau)[0] for tau in WEIGHED_AT})


def sign_of_exponent(_: Evidence) -> Result:
    """Return the error of equation 26 as meant, and the ratio as printed, against the density."""
    truth = integrate_density(_MODEL, _DEFAULT_TAU)
    ours = abs(float(_MODEL.allan_variance(_DEFAULT_TAU)) / truth - 1.0)
    return Result(
        fields={"ours": ours, "printed_ratio": evaluate_as_printed(_MODEL, _DEFAULT_TAU) / truth}
    )
