"""The bias instability of the curve: one quantity of every model, whatever its terms.

B of flicker noise, of a Gauss-Markov process and of the first of two are different quantities, and
the selection between them is poorly determined by a log. Their sum is better determined:

- ``B_curve``: the largest Allan deviation of all flicker and Gauss-Markov terms together, over
  0.664; of a single one it is its B;
- ``sigma_min``, ``tau_min``: the lowest point of the Allan deviation of the whole noise, which is
  what datasheets print, and its averaging time.

Both are evaluated up to a ninth of the log; at longer tau the curve is too uncertain.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.estimate import BROADBAND_TIME, CURVE, Estimate, Parameter
from imubench_pipeline.estimators.intervals import as_good, mixture_limits
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Terms
from imubench_pipeline.noise import FLOOR, PEAK_TAU, GaussMarkov, NoiseModel
from imubench_pipeline.noise.terms import gauss_markov_shape
from imubench_pipeline.typing import Array

MAX_TAU_FRACTION = 1 / 9
"""Maximum tau over the duration of the log."""

_POINTS_PER_DECADE = 16
"""Averaging times per decade for the search of the lowest point, before interpolation."""

_POINTS_BETWEEN_PEAKS = 49
"""Averaging times between the peaks of several processes."""

_MAX_DRAWS = 16_000
"""Maximum number of draws of a model if each is evaluated at many averaging times."""

_PEAK_SHAPE = float(gauss_markov_shape(np.array([PEAK_TAU]), 1.0)[0])


@dataclass(frozen=True)
class Models:
    """Parameters of many models that have the same terms."""

    terms: Terms
    parameters: Array  # (d, p): the linear parameters in their order, then B of each process; SI
    times: Array  # (d, g): T_B of each process, s
    weight: float = 1.0  # of all of them together, among those of other terms

    def parameter(self, letter: str) -> Array:
        """Return Q, N, B of flicker noise (F) or K, shape (d,); zeros where there is none."""
        if letter not in self.terms.linear:
            return np.zeros(len(self.parameters))
        return self.parameters[:, self.terms.linear.index(letter)]

    @property
    def biases(self) -> Array:
        """B of each Gauss-Markov process, shape (d, g)."""
        return self.parameters[:, len(self.terms.linear) :]

    def fewer(self) -> Models:
        """Return every n-th of them, some `_MAX_DRAWS`."""
        every = max(1, len(self.parameters) // _MAX_DRAWS)
        return replace(self, parameters=self.parameters[::every], times=self.times[::every])

    @property
    def has_bias(self) -> bool:
        """Whether there is flicker noise or a Gauss-Markov process."""
        return any(self.terms.biases)


def models_of(model: NoiseModel) -> Models:
    """Return a noise model alone, without its ramp and lines, as `Models` of one."""
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


def bias_of_curve(models: Models, longest: float) -> tuple[Array, Array]:
    """Return the bias instability of the curve of models up to a tau in s, and where it is.

    That is the largest Allan deviation of the flicker and Gauss-Markov terms over 0.664, rad/s or
    m/s², and its tau, s, both of shape (d,); flicker noise alone has it everywhere, and the longest
    is given.
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
        shape = gauss_markov_shape(tau / T_B[:, None], 1.0)
        squared += B[:, None] ** 2 * shape / _PEAK_SHAPE
    highest = squared.argmax(axis=1)
    rows = np.arange(len(tau))
    return np.sqrt(squared[rows, highest]), tau[rows, highest]


def allan_variance(models: Models, tau: Array) -> Array:
    """Return the Allan variance of models at averaging times of shape (m,), shape (d, m)."""
    variance = (
        3.0 * models.parameter("Q")[:, None] ** 2 / tau**2
        + models.parameter("N")[:, None] ** 2 / tau
        + (FLOOR * models.parameter("F")[:, None]) ** 2
        + models.parameter("K")[:, None] ** 2 * tau / 3.0
    )
    for B, T_B in zip(models.biases.T, models.times.T, strict=True):
        shape = gauss_markov_shape(tau / T_B[:, None], 1.0)
        variance = variance + (FLOOR * B[:, None]) ** 2 * shape / _PEAK_SHAPE
    return np.asarray(variance)


def lowest_point(models: Models, tau: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the lowest point of the Allan deviation of models.

    ``tau``, shape (m,), rises evenly in the logarithm, s; between them a parabola is taken.
    Returned are, each of shape (d,), the deviation, rad/s or m/s², its averaging time, s, and
    whether it is a minimum, and not an end of ``tau``.
    """
    level = np.log(allan_variance(models, tau))
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


def averaging_times(rate: float, duration: float) -> Array:
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
    """Return an estimate by likelihood with the figures of its curve.

    Values follow from the model of the estimate, intervals from the draws of all models that the
    log does not rule out, by their weights (BIC). (By AIC, two processes of which the
    slower stands for the random walk count as much as the walk: limits are twice as wide as they
    need be.)

    Parameters
    ----------
    alike : sequence of Candidate
        The models that the log does not rule out, the chosen one first.
    wider : sequence of Candidate
        Models with one bias instability beside the terms of the chosen one: what is absent is
        below their limits.
    tau : ndarray, shape (m,)
        As `averaging_times` gives them.
    """
    chosen = alike[0]
    model = models_of(estimate.model)
    drawn = [_select_draws(candidate, draws) for candidate in alike]
    if not any(chosen.terms.biases):
        having = [c for c in alike if as_good(c, chosen) and any(c.terms.biases)]
        every = [c for c in wider if any(c.terms.biases)] + having
        bias = _describe_weak_bias(
            [_select_draws(c, draws) for c in every], bool(having), float(tau[-1])
        )
    else:
        bias = _estimate_bias(model, drawn, float(tau[-1]))
        bias = unless_at_bound(bias, estimate)
    return replace(estimate, curve={"B_curve": bias} | lowest_parameters(model, drawn, tau))


def _estimate_bias(model: Models, drawn: Sequence[Models], longest: float) -> Parameter:
    parts = [(bias_of_curve(each, longest)[0], each.weight) for each in drawn if each.has_bias]
    value, at = (float(of_one[0]) for of_one in bias_of_curve(model, longest))
    lower, upper = _compute_limits(parts, value)
    if value == 0.0:
        return Parameter(None, "absent", "the data do not ask for it", 0.0, upper)
    reason = None
    if model.terms.gauss_markov and at >= longest * (1.0 - 1e-9):
        reason = f"its processes still rise at {longest:.4g} s, a ninth of the log"
    elif model.terms.gauss_markov and at < PEAK_TAU * BROADBAND_TIME:
        reason = (
            f"its highest point, at {at:.2g} s, is a process with a correlation time below "
            f"{BROADBAND_TIME:g} s: broadband noise, and no bias instability"
        )
    if reason:
        reason += "; only its interval is given"
        return Parameter(None, "not_identified", reason, lower, upper, fitted=value)
    return Parameter(value, "ok", None, lower, upper)


def unless_at_bound(bias: Parameter, estimate: Estimate) -> Parameter:
    """Return the bias instability of the curve, which is not identified where a T_B is at a bound.

    The end of the search decides the amplitude of a process whose correlation time ran into it.
    """
    groups = [estimate.parameters, *estimate.further]
    times = [group["T_B"] for group in groups if group.get("T_B")]
    bounds = [time.reason for time in times if time.status == "at_bound"]
    if bias.status != "ok" or not bounds:
        return bias
    reason = f"a correlation time is at the bound of its search: {bounds[0]}"
    return replace(bias, value=None, status="not_identified", reason=reason, fitted=bias.in_model)


def _describe_weak_bias(drawn: Sequence[Models], as_good: bool, longest: float) -> Parameter:
    """Return what is said where the chosen model has no bias instability."""
    if not drawn:
        return Parameter(None, "absent", "the data do not ask for it")
    upper = max(float(np.quantile(bias_of_curve(models, longest)[0], 0.975)) for models in drawn)
    if as_good:
        reason = "models with a bias instability are about as good; only its interval is given"
        return Parameter(None, "not_identified", reason, 0.0, upper)
    reason = "the data do not ask for it; with 95 % it is below the upper limit"
    return Parameter(None, "absent", reason, 0.0, upper)


def of_model(model: NoiseModel, tau: Array) -> dict[str, Parameter]:
    """Return the figures of the curve of a model as it is, at `averaging_times`, without limits."""
    models = models_of(model)
    if not models.terms.parameters:
        nothing = Parameter(None, "not_shown", "there is no noise")
        return dict.fromkeys(CURVE, nothing)
    bias = Parameter(None, "absent", "no flicker noise and no Gauss-Markov process")
    if models.has_bias:
        bias = Parameter(float(bias_of_curve(models, float(tau[-1]))[0][0]))
    return {"B_curve": bias} | lowest_parameters(models, [], tau)


def lowest_parameters(model: Models, drawn: Sequence[Models], tau: Array) -> dict[str, Parameter]:
    """Return ``sigma_min`` and ``tau_min``, at `averaging_times`.

    ``model`` is the one that is fitted; ``drawn`` has draws of the sets of terms that the log does
    not rule out, none where the fit gives no limits.
    """
    (sigma,), (time,), (inside,) = lowest_point(model, tau)
    drawn_points = [lowest_point(models.fewer(), tau) for models in drawn]
    limits: list[tuple[float | None, float | None]] = [(None, None), (None, None)]
    if drawn:
        sizes = [models.weight for models in drawn]
        lows = list(zip([point[0] for point in drawn_points], sizes, strict=True))
        times = list(zip([point[1] for point in drawn_points], sizes, strict=True))
        limits = [_compute_limits(lows, float(sigma)), _compute_limits(times, float(time))]
    if not inside:
        falls = time > tau[0]
        reason = (
            f"no minimum is shown: the curve of the noise {'still falls' if falls else 'rises'} "
            f"{f'at {tau[-1]:.4g} s, a ninth of the log' if falls else 'from its beginning'}"
        )
        upper = limits[0][1] if falls else None
        return {
            "sigma_min": Parameter(None, "not_shown", reason, 0.0 if upper else None, upper),
            "tau_min": Parameter(None, "not_shown", reason, float(time) if falls else None),
        }
    return {
        "sigma_min": Parameter(float(sigma), "ok", None, *limits[0]),
        "tau_min": _estimate_lowest_time(float(time), limits[1], drawn_points, drawn),
    }


def _estimate_lowest_time(
    value: float,
    limits: tuple[float | None, float | None],
    points: Sequence[tuple[Array, Array, NDArray[np.bool_]]],
    drawn: Sequence[Models],
) -> Parameter:
    weight = sum(models.weight for models in drawn)
    outside = sum(
        models.weight * float(np.mean(~point[2]))
        for models, point in zip(drawn, points, strict=True)
    )
    if outside > 0.025 * weight:
        reason = "models that the log does not rule out have no minimum within a ninth of it"
        return Parameter(None, "not_identified", reason, limits[0], None, fitted=value)
    return Parameter(value, "ok", None, *limits)


def _compute_limits(parts: Sequence[tuple[Array, float]], value: float) -> tuple[float, float]:
    """Return the 95 % limits of draws of several models; those of the first lie inside."""
    lower, upper = mixture_limits(parts, [(parts[0][0], 1.0)])
    return min(lower, value), max(upper, value)


def _select_draws(candidate: Candidate, draws: Mapping[Terms, Posterior]) -> Models:
    posterior, terms = draws[candidate.terms], candidate.terms
    models = Models(terms, posterior.parameters, posterior.times, candidate.weight)
    # Of several processes the highest point is looked for at many tau.
    return models.fewer() if terms.gauss_markov > 1 else models
