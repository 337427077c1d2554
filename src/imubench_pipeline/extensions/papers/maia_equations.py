"""The numbered equations of Maia et al., each compared with an independent result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from imubench_pipeline.extensions.papers.claims import Claim, Result
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.extensions.papers.maia_printed import DURATION, MTI_GYRO
from imubench_pipeline.noise import (
    FLOOR,
    PEAK_TAU,
    GaussMarkov,
    NoiseModel,
    RandomWalk,
    WhiteNoise,
    driving_density,
)
from imubench_pipeline.noise.variance_covariance import variance_covariance

_MODEL = MTI_GYRO.table_2
_RATE = MTI_GYRO.rate
_TEST = "tests/papers/test_maia.py"
_DEFAULT_TAU = 100.0

WEIGHED_AT = (10.0, 100.0, 1000.0)
"""Cluster times, s, for the comparison of the weight of equation 25 with the spread."""


def _get_process() -> GaussMarkov:
    assert _MODEL.T_B is not None
    return GaussMarkov(_MODEL.B, _MODEL.T_B)


def by_integral(model: NoiseModel, tau: float) -> float:
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


def as_printed(model: NoiseModel, tau: float) -> float:
    """Return equation 26 as it is printed, with e^(+τ/T_B)."""
    assert model.T_B is not None
    T_B, x = model.T_B, tau / model.T_B
    bracket = 1.0 - (3.0 - 4.0 * math.exp(x) + math.exp(-2.0 * x)) / (2.0 * x)
    driven = driving_density(model.B, T_B) * T_B**2 / tau * bracket
    return model.N**2 / tau + driven + model.K**2 * tau / 3.0


def spread_over_weight(tau: float = _DEFAULT_TAU) -> tuple[float, float]:
    """Return the standard deviation of an Allan variance over the one that a weight assumes.

    First for the intended weight, 2 √(n/2L) σ̂²; then for the printed one, 2 √(n/2L) σ̂. Its
    dimension is wrong, so that the ratio depends on the unit. For the MTi-7 gyro at a tau, s.
    """
    samples, n = round(DURATION * _RATE), round(tau * _RATE)
    variance = float(_MODEL.allan_variance(tau, _RATE))
    spread = math.sqrt(variance_covariance(_MODEL, _RATE, samples, np.array([n]))[0, 0])
    meant = 2.0 * math.sqrt(n / (2.0 * samples)) * variance
    return spread / meant, spread / (meant / math.sqrt(variance))


def _verbal_result(words: str) -> Callable[[Evidence], Result]:
    return lambda _: Result(words=words, verdict="agrees")


def _numeric_result(value: Callable[[], float], words: str = "") -> Callable[[Evidence], Result]:
    return lambda _: Result(value=value(), words=words)


def _evaluate_sign(_: Evidence) -> Result:
    truth = by_integral(_MODEL, _DEFAULT_TAU)
    ours = float(_MODEL.allan_variance(_DEFAULT_TAU)) / truth - 1.0
    printed = as_printed(_MODEL, _DEFAULT_TAU) / truth
    return Result(
        words=f"e^(−τ/T_B): {abs(ours):.0e} from the integral of the density at 100 s; as printed "
        f"it is {printed:.2g} times that",
        verdict="misprint",
    )


def _evaluate_weight(_: Evidence) -> Result:
    at = ", ".join(f"{spread_over_weight(tau)[0]:.2f} at {tau:,.0f} s" for tau in WEIGHED_AT)
    return Result(
        words=f"w = 1/(2 √(n/2L) σ̂²)²; the spread of σ̂², over 2 √(n/2L) σ̂²: {at}",
        verdict="misprint",
    )


def _compute_step_noise() -> float:
    """Return what Q_zd has for the process of equation 4, exactly, over S_B T."""
    space = _MODEL.state_space(_RATE)
    return float(space.process_noise[0, 0]) / (
        driving_density(_MODEL.B, _get_process().T_B) / _RATE
    )


def _count_differences(samples: int, n: int) -> int:
    """Return how many differences of adjacent clusters there are, each begun at every sample."""
    return sum(1 for start in range(samples) if start + 2 * n <= samples)


def equations() -> Iterator[Claim]:
    """Yield the 27 equations in their order."""

    def equation(
        number: int,
        quantity: str,
        printed: str,
        evaluate: Callable[[Evidence], Result],
        **more: object,
    ) -> Claim:
        about = {"basis": "checked", "page": "theory.html#terms", "check": _TEST} | more
        return Claim(
            place=f"Equation {number}",
            quantity=quantity,
            printed=printed,
            evaluate=evaluate,
            **about,  # type: ignore[arg-type]  # fields of a claim, of several types
        )

    process, T = _get_process(), 1.0 / _RATE
    simulated = {"page": "theory.html#simulated", "check": "tests/sensor_model/test_simulation.py"}
    curve = {"page": "theory.html#reading", "check": f"{_TEST}::test_lines_and_floor"}
    spaces = {"check": f"{_TEST}::test_the_discrete_model"}
    yield equation(
        1, "measurement of a sensor", "ũ = u + d(u) + z", **simulated,
        evaluate=_verbal_result(
            "the simulated sensor has bias, temperature, scale, misalignment and noise"),
    )  # fmt: skip
    parts = [NoiseModel(N=_MODEL.N), NoiseModel(B=_MODEL.B, T_B=_MODEL.T_B), NoiseModel(K=_MODEL.K)]
    yield equation(
        2, "AV of z over those of z_N, z_B and z_K together", "z = z_N + z_B + z_K", value=1.0,
        evaluate=_numeric_result(lambda: float(_MODEL.allan_variance(_DEFAULT_TAU)
                                    / sum(part.allan_variance(_DEFAULT_TAU) for part in parts))),
        tolerance=1e-9,
    )  # fmt: skip
    yield equation(3, "white noise", "z_N = ω_N", _verbal_result("new in every sample"))
    yield equation(
        4, "decay of z_G over a correlation time", "ż_G = −μ_B z_G + ω_B", value=math.exp(-1.0),
        evaluate=_numeric_result(lambda: float(process.state_space(process.T_B).transition[0, 0])),
        tolerance=1e-9, **spaces,
    )  # fmt: skip
    yield equation(
        5, "variance of z_K after 1 s over K²", "ż_K = ω_K", value=1.0, unit="s",
        evaluate=_numeric_result(
            lambda: float(RandomWalk(1.0).state_space(1.0).process_noise[0, 0])
        ),
        tolerance=1e-9, **spaces,
    )  # fmt: skip
    yield equation(
        6, "decay rate", "μ_B = 1/T_B", _verbal_result("e^(−T/T_B) in equation 20"), **spaces
    )
    f = 1e-3
    density = {"check": f"{_TEST}::test_densities"}
    yield equation(
        7, "density of white noise over N²", "S_N = N²", value=1.0, **density,
        evaluate=_numeric_result(lambda: float(WhiteNoise(2.0).psd(np.array(f)) / 4.0)),
        tolerance=1e-9,
    )  # fmt: skip
    yield equation(
        8, "S_B of the MTi-7 gyro", "S_B = 2 B² ln 2 / (π 0.4365² T_B)", **density,
        value=2.0 * _MODEL.B**2 * math.log(2.0) / (math.pi * 0.4365**2 * process.T_B),
        unit="(rad/s)^2/s", tolerance=1e-3, page="theory.html#bias-instability",
        evaluate=_numeric_result(lambda: driving_density(_MODEL.B, process.T_B)),
    )  # fmt: skip
    yield equation(
        9, "density of a random walk times (2πf)², over K²", "S_K = K²", value=1.0, **density,
        evaluate=_numeric_result(
            lambda: float(RandomWalk(1.0).psd(np.array(f)) * (2.0 * math.pi * f) ** 2)
        ),
        tolerance=1e-9,
    )  # fmt: skip
    yield equation(
        10, "differences in the sum, of ten samples with n = 2", "L − 2n", value=6.0, tolerance=0.0,
        evaluate=_numeric_result(lambda: float(_count_differences(10, 2)), "L − 2n + 1"),
        reason="clusters begin at L − 2n + 1 samples; the paper leaves out the last, which it may",
        page="theory.html#allan", check="tests/test_allan.py",
    )  # fmt: skip
    yield equation(
        11, "Allan deviation of white noise at 1 s over N", "σ = N/√τ", value=1.0, **curve,
        evaluate=_numeric_result(lambda: math.sqrt(float(NoiseModel(N=1.0).allan_variance(1.0)))),
        tolerance=1e-9,
    )  # fmt: skip
    yield equation(
        12, "Allan deviation of a random walk at 3 s over K", "σ = K √(τ/3)", value=1.0, **curve,
        evaluate=_numeric_result(lambda: math.sqrt(float(NoiseModel(K=1.0).allan_variance(3.0)))),
        tolerance=1e-9,
    )  # fmt: skip
    floor = {"page": "theory.html#bias-instability", "check": f"{_TEST}::test_lines_and_floor"}
    yield equation(
        13, "floor of flicker noise over B", "0,664 B (“log” is the natural one)", value=0.664,
        evaluate=_numeric_result(lambda: FLOOR), tolerance=1e-3, **floor,
    )  # fmt: skip
    yield equation(
        13, "place of the peak of a Gauss-Markov process over T_B", "1,89", value=1.89,
        evaluate=_numeric_result(lambda: PEAK_TAU, "of the process alone: N and K move it"),
        tolerance=2e-3, **floor,
    )  # fmt: skip
    words = "the states of the terms, held against their density"
    for number, quantity, printed in (
        (14, "states in continuous time", "ẋ = A x + B ω"),
        (15, "error in continuous time", "z = C x + η"),
        (16, "matrices in continuous time", "A = diag(−μ_B, 0), C = [1 1]"),
        (17, "density of what drives the states", "S = diag(S_B, S_K)"),
        (18, "states in discrete time", "x(k+1) = Φ x(k) + ω"),
        (19, "error in discrete time", "z = H x + η"),
    ):
        yield equation(number, quantity, printed, _verbal_result(words), **spaces)
    space = _MODEL.state_space(_RATE)
    yield equation(
        20, "decay of z_G over a sample", "e^(−μ_B T)", value=math.exp(-T / process.T_B),
        evaluate=_numeric_result(lambda: float(space.transition[0, 0])), tolerance=1e-12, **spaces,
    )  # fmt: skip
    yield equation(
        21, "output", "H = [1 1]", _verbal_result(f"{space.output.astype(int).tolist()}"),
        **spaces,
    )  # fmt: skip
    yield equation(
        22, "variance of a step of z_G over S_B T", "Q ≈ diag(S_B T, S_K T)", value=1.0,
        evaluate=_numeric_result(_compute_step_noise, "exact: S_B T_B/2 (1 − e^(−2T/T_B))"),
        **spaces,
    )  # fmt: skip
    yield equation(
        23, "variance of white noise in a sample", "S_N/T", value=_MODEL.N**2 / T,
        unit="(rad/s)^2", evaluate=_numeric_result(lambda: float(space.measurement_noise)),
        **spaces,
    )  # fmt: skip
    fit = {"page": "theory.html#methods", "check": "tests/estimators/test_least_squares.py"}
    yield equation(
        24, "cost of the optimisation", "Σ w (σ̂² − σ²)²",
        _verbal_result("the same, with S_N, S_B and S_K from 0 on, and τ up to a ninth of the log"),
        **fit,
    )  # fmt: skip
    yield equation(
        25, "weight of a cluster time", "1/(2 √(n/2L) σ̂)²", _evaluate_weight,
        reason="σ̂² has the standard deviation 2 √(n/2L) σ̂², and with σ̂ the weight has not the "
        "dimension of the cost; how little that hurts, the panel above says",
        page="theory.html#methods", check=f"{_TEST}::test_the_weight_of_equation_25",
    )  # fmt: skip
    sign = {"page": "theory.html#bias-instability",
            "check": f"{_TEST}::test_the_sign_of_equation_26",
            "reason": "with e^(+τ/T_B) the bracket grows without bound"}  # fmt: skip
    yield equation(26, "parametric AV", "… − 4 e^(+τ/T_B) + e^(−2τ/T_B) …", _evaluate_sign, **sign)
    yield equation(27, "the same, of θ", "… − 4 e^(+τ/θ₄) + e^(−2τ/θ₄) …", _evaluate_sign, **sign)
