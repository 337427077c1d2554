"""The bias instability of the curve: one quantity of every model, whatever its terms.

- ``B_curve``: the largest Allan deviation of all flicker and Gauss-Markov terms together, over
  0.664; of a single one it is its B. A log determines it better than the B of each term.
- ``sigma_min``, ``tau_min``: the lowest point of the Allan deviation of the whole noise, which
  datasheets print, and its averaging time.

Both are evaluated up to a ninth of the log; at longer tau the curve is too uncertain.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.estimate import CURVE, Estimate, Parameter
from imubench_pipeline.estimators.intervals import compute_mixture_limits, is_as_good
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Terms
from imubench_pipeline.noise import (
    FLOOR,
    PEAK_TAU,
    GaussMarkov,
    NoiseModel,
    evaluate_gauss_markov_shape,
)
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import curves, estimates

MAX_TAU_FRACTION = 1 / 9  # Maximum tau over the duration of the log
_POINTS_PER_DECADE = 16  # Averaging times for the search of the lowest point
_POINTS_BETWEEN_PEAKS = 49  # Averaging times between the peaks of several processes
_PEAK_SHAPE = float(evaluate_gauss_markov_shape(np.array([PEAK_TAU]), 1.0)[0])


@dataclass(frozen=True)
class Models:
    """Parameters of many models that have the same terms."""

    terms: Terms
    parameters: Array  # (d, p): the linear parameters in their order, then B of each process; SI
    times: Array  # (d, g): T_B of each process, s
    weight: float = 1.0  # of all these models together, see `Candidate.weight`

    def parameter(self, letter: str) -> Array:
        """Return Q, N, B of flicker noise (letter F) or K of each model, (d,); 0 if absent."""
        if letter not in self.terms.linear:
            return np.zeros(len(self.parameters))
        return self.parameters[:, self.terms.linear.index(letter)]

    @property
    def biases(self) -> Array:
        """B of each Gauss-Markov process, shape (d, g)."""
        return self.parameters[:, len(self.terms.linear) :]


def convert_noise_model(model: NoiseModel) -> Models:
    """Return one noise model, without its ramp and lines, as `Models` with d = 1."""
    processes = model.further_processes
    letters = {"Q": model.Q, "N": model.N, "F": 0.0, "K": model.K}
    if model.T_B is None:
        letters["F"] = model.B
    elif model.B > 0.0:
        processes.append(GaussMarkov(model.B, model.T_B))
    linear = "".join(letter for letter, value in letters.items() if value > 0.0)
    values = [letters[letter] for letter in linear] + [process.B for process in processes]
    times = [process.T_B for process in processes]
    return Models(
        Terms(linear, len(processes)),
        np.array([values], dtype=np.float64),
        np.array([times], dtype=np.float64).reshape(1, len(times)),
    )


def compute_curve_bias(models: Models, longest: float) -> tuple[Array, Array]:
    """Return the bias instability of models from their Allan curves, and its tau.

    This is the largest Allan deviation of the flicker and Gauss-Markov terms up to ``longest``, s,
    divided by 0.664 (rad/s or m/s²), and the tau of the maximum, s; both have shape (d,). Without
    Gauss-Markov terms the curve is flat, and tau is ``longest``.
    """
    flicker, count = models.parameter("F"), models.terms.gauss_markov
    if count == 0:
        return flicker, np.full(len(flicker), longest)
    peaks = np.minimum(PEAK_TAU * models.times, longest)
    if count == 1:
        tau = peaks
    else:
        ends = np.log(peaks.min(axis=1)), np.log(peaks.max(axis=1))
        tau = np.exp(np.linspace(*ends, _POINTS_BETWEEN_PEAKS, axis=1))
    squared = flicker[:, None] ** 2 + np.zeros_like(tau)
    for B, T_B in zip(models.biases.T, models.times.T, strict=True):
        shape = evaluate_gauss_markov_shape(tau / T_B[:, None], 1.0)
        squared += B[:, None] ** 2 * shape / _PEAK_SHAPE
    highest = squared.argmax(axis=1)
    rows = np.arange(len(tau))
    return np.sqrt(squared[rows, highest]), tau[rows, highest]


def find_lowest_point(models: Models, tau: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the lowest point of the Allan deviation of each model (see `locate_minimum`)."""
    variance = (
        3.0 * models.parameter("Q")[:, None] ** 2 / tau**2
        + models.parameter("N")[:, None] ** 2 / tau
        + (FLOOR * models.parameter("F")[:, None]) ** 2
        + models.parameter("K")[:, None] ** 2 * tau / 3.0
    )
    for B, T_B in zip(models.biases.T, models.times.T, strict=True):
        shape = evaluate_gauss_markov_shape(tau / T_B[:, None], 1.0)
        variance = variance + (FLOOR * B[:, None]) ** 2 * shape / _PEAK_SHAPE
    return locate_minimum(np.log(variance), tau)


def locate_minimum(level: Array, tau: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the lowest point of each Allan deviation.

    ``level``, shape (d, m), are logarithms of Allan variances at ``tau``, s, shape (m,), which is
    evenly spaced in the logarithm; a parabola interpolates. Returned are the deviation, rad/s or
    m/s², its tau, s, and whether it is a minimum and not an end of ``tau``; all have shape (d,).
    """
    rows = np.arange(len(level))
    lowest = level.argmin(axis=1)
    inside = (lowest > 0) & (lowest < len(tau) - 1)
    middle = np.clip(lowest, 1, max(len(tau) - 2, 1))
    before, here, after = (level[rows, middle + i] for i in (-1, 0, 1))
    bend = np.maximum(before - 2.0 * here + after, 1e-300)
    shift = np.where(inside, np.clip(0.5 * (before - after) / bend, -0.5, 0.5), 0.0)
    refined = here - 0.25 * (before - after) * shift
    step = math.log(tau[-1] / tau[0]) / (len(tau) - 1)
    deviation = np.exp(0.5 * np.where(inside, refined, level[rows, lowest]))
    return deviation, tau[lowest] * np.exp(shift * step), inside


def make_averaging_times(rate: float, duration: float) -> Array:
    """Return averaging times, s, for the search of the lowest point, up to `MAX_TAU_FRACTION`."""
    first, last = 1.0 / rate, max(duration * MAX_TAU_FRACTION, 4.0 / rate)
    return np.geomspace(first, last, 2 + math.ceil(math.log10(last / first) * _POINTS_PER_DECADE))


def add_curve_figures(
    estimate: Estimate,
    alike: Sequence[Candidate],
    wider: Sequence[Candidate],
    draws: Mapping[Terms, Posterior],
    tau: Array,
) -> Estimate:
    """Return an estimate by likelihood, with the figures of its curve (`CURVE`) added.

    Values follow from the model of the estimate, intervals from the draws of all models that the
    log does not rule out, weighted by BIC. (By AIC, a model with a slow process instead of the walk
    has the same weight: limits would be twice as wide as needed.) ``alike`` are the models that
    the log does not rule out, the chosen one first; ``wider`` are models with one more bias
    instability, for the upper limit of an absent one; ``tau`` is from `make_averaging_times`.
    """

    def select(candidate: Candidate) -> Models:
        posterior, terms = draws[candidate.terms], candidate.terms
        return Models(terms, posterior.parameters, posterior.times, candidate.weight)

    model, longest = convert_noise_model(estimate.model), float(tau[-1])
    drawn = [select(candidate) for candidate in alike]
    bias = Parameter(None, "absent", estimates.ABSENT)
    if any(alike[0].terms.biases):
        biased = [models for models in drawn if any(models.terms.biases)]
        parts = [(compute_curve_bias(models, longest)[0], models.weight) for models in biased]
        value = float(compute_curve_bias(model, longest)[0][0])
        lower, upper = _compute_limits(parts, value)
        bias = Parameter(value, "ok", None, lower, upper)
        if value == 0.0:
            bias = Parameter(None, "absent", estimates.ABSENT_BELOW, 0.0, upper)
    else:
        having = [c for c in alike if is_as_good(c, alike[0]) and any(c.terms.biases)]
        every = [select(c) for c in wider if any(c.terms.biases)] + [select(c) for c in having]
        values = [compute_curve_bias(models, longest)[0] for models in every]
        upper = max((float(np.quantile(value, 0.975)) for value in values), default=0.0)
        if having:
            bias = Parameter(None, "not_identified", estimates.BIAS_MODELS_ALIKE, 0.0, upper)
        elif every:
            bias = Parameter(None, "absent", estimates.ABSENT_BELOW, 0.0, upper)
    return replace(estimate, curve={"B_curve": bias} | estimate_lowest_point(model, drawn, tau))


def compute_curve_figures(model: NoiseModel, tau: Array) -> dict[str, Parameter]:
    """Return the figures of a model's curve (`CURVE`), without limits, at averaging times, s."""
    models = convert_noise_model(model)
    if not models.terms.parameters:
        return dict.fromkeys(CURVE, Parameter(None, "not_shown", curves.NO_NOISE))
    bias = Parameter(None, "absent", curves.NO_BIAS_TERMS)
    if any(models.terms.biases):
        bias = Parameter(float(compute_curve_bias(models, float(tau[-1]))[0][0]))
    return {"B_curve": bias} | estimate_lowest_point(models, [], tau)


def estimate_lowest_point(
    model: Models, drawn: Sequence[Models], tau: Array
) -> dict[str, Parameter]:
    """Return ``sigma_min`` and ``tau_min`` of a model, with limits if draws of models are given."""
    (sigma,), (time,), (inside,) = (part.tolist() for part in find_lowest_point(model, tau))
    points = [find_lowest_point(models, tau) for models in drawn]
    weights = [models.weight for models in drawn]
    limits: list[tuple[float | None, float | None]] = [(None, None), (None, None)]
    if drawn:
        columns = zip(*(point[:2] for point in points), strict=True)
        limits = [
            _compute_limits(list(zip(column, weights, strict=True)), value)
            for column, value in zip(columns, (sigma, time), strict=True)
        ]
    if not inside:
        falls = time > tau[0]
        reason = curves.no_model_minimum(float(tau[-1]) if falls else None)
        upper = limits[0][1] if falls else None
        return {
            "sigma_min": Parameter(None, "not_shown", reason, 0.0 if upper else None, upper),
            "tau_min": Parameter(None, "not_shown", reason, time if falls else None),
        }
    lowest_time = Parameter(time, "ok", None, *limits[1])
    outside = sum(
        weight * float(np.mean(~minimum))
        for weight, (_, _, minimum) in zip(weights, points, strict=True)
    )
    if outside > 0.025 * sum(weights):
        reason = curves.MINIMUM_BEYOND
        lowest_time = Parameter(None, "not_identified", reason, limits[1][0], None, fitted=time)
    return {"sigma_min": Parameter(sigma, "ok", None, *limits[0]), "tau_min": lowest_time}


def _compute_limits(parts: Sequence[tuple[Array, float]], value: float) -> tuple[float, float]:
    """Return the 95 % limits of draws of several models; they include the limits of the first."""
    lower, upper = compute_mixture_limits(parts, parts[0][0])
    return min(lower, value), max(upper, value)
