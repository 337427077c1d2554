"""Ratio of the noise of two logs with its confidence interval, and channels to be compared.

Two logs are independent, so the limits of a ratio of two parameters follow from the limits of each:
on the logarithm, they are the limits of a difference (MOVER). The Allan deviation of a model at a
tau depends on all its parameters, which are not independent: ratios of Allan deviations are
computed over the joint draws of both.

References
----------
G. Zou and A. Donner, "Construction of confidence limits about effect measures: a general approach",
Statistics in Medicine 27, 2008 (eq. 2, and 3 for a ratio by logarithms).
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.estimators.estimate import Estimate, JointDraws, Parameter
from imubench_pipeline.model.estimates import DrawnDeviationRow
from imubench_pipeline.model.states import RatioVerdict
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.model import stack_models, sum_over_stacked_terms
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import pools as texts

_MIN_RELEVANT_SHARE = 0.1
"""Minimum share of the Allan variance for which an unknown parameter matters."""


def compute_number_needed(own: ArrayLike, common: ArrayLike, wanted: ArrayLike) -> Array:
    """Return the number of sensors of one kind whose mean has a given Allan variance.

    The mean of n sensors has the Allan variance ``own / n + common``, which is to be ``wanted``.
    n is not rounded, may be below 1, and is infinite if no number is enough. The arguments are
    scalars or arrays of one shape, in (rad/s)^2 or (m/s^2)^2.
    """
    own, common, wanted = np.broadcast_arrays(own, common, wanted)
    room = np.asarray(wanted - common, dtype=np.float64)
    return np.divide(own, room, out=np.full(room.shape, math.inf), where=room > 0.0)


@dataclass(frozen=True)
class TemperaturePart:
    """Temperature effect on a channel, which is common to all specimens on a board."""

    tau: Array  # shape (t,); s
    deviation: Array  # shape (t,); its Allan deviation over the recording, (rad/s) or (m/s²)
    relative_error: float  # standard deviation of the sensitivity divided by its value

    def variance(self, tau: float) -> float:
        """Return its Allan variance at a tau in s, (rad/s)² or (m/s²)²."""
        log_deviation = np.log(np.maximum(self.deviation, 1e-300))
        return math.exp(2.0 * float(np.interp(math.log(tau), np.log(self.tau), log_deviation)))

    def drawn(self, tau: float, draws: int, rng: np.random.Generator) -> Array:
        """Return Allan variances, shape (draws,), of sensitivities drawn from their interval."""
        factor = 1.0 + self.relative_error * rng.standard_normal(draws)
        return np.asarray(factor**2 * self.variance(tau))


@dataclass(frozen=True)
class ComparedChannel:
    """A channel with its estimate, for comparisons with channels of other logs."""

    sensor: str
    recording: str
    channel: str
    simulated: bool
    duration: float  # of the recording, s
    # the recommended estimate, after removal of the temperature effect, if any
    estimate: Estimate
    temperature: TemperaturePart | None = None  # removed temperature effect
    # loads the joint draws, if the estimate does not contain them: in a run, they are read only for
    # the representative channels
    joint: Callable[[], JointDraws | None] | None = None

    def drawn(self, draws: int, rng: np.random.Generator) -> list[NoiseModel]:
        """Return noise models drawn from the estimate (`draw_models`)."""
        estimate = self.estimate
        if estimate.draws is None and self.joint is not None:
            estimate = replace(estimate, draws=self.joint())
        return draw_models(estimate, draws, rng)

    @cached_property
    def model(self) -> NoiseModel:
        """The noise model of the estimate."""
        return self.estimate.model

    def variance(self, tau: float) -> float:
        """Return the Allan variance, (rad/s)² or (m/s²)², at a tau in s."""
        return float(self.model.allan_variance(tau)) + self.of_temperature(tau)

    def of_temperature(self, tau: float) -> float:
        """Return the Allan variance from temperature, (rad/s)² or (m/s²)², at a tau in s."""
        return 0.0 if self.temperature is None else self.temperature.variance(tau)

    def unknown(self, tau: float) -> Iterator[str]:
        """Yield the parameters that are not determined and may matter at a tau in s."""
        total = self.variance(tau)
        for group in [self.estimate.parameters, *self.estimate.further]:
            for name, parameter in group.items():
                if parameter.value is not None or parameter.status in ("absent", "not_shown"):
                    continue
                # The largest Allan variance of a parameter, from its value or upper limit
                size = {
                    key: parameter.in_model if parameter.upper is None else parameter.upper
                    for key, parameter in group.items()
                }
                if name in ("B", "T_B"):
                    time = group["T_B"].in_model if "T_B" in group else None
                    model = NoiseModel(B=size["B"] or 0.0, T_B=time or None)
                else:
                    of = {key: (size[name] or 0.0) * (key == name) for key in ("Q", "N", "K", "R")}
                    model = NoiseModel(Q=of["Q"], N=of["N"], K=of["K"], R=of["R"])
                part = float(model.allan_variance(tau))
                if part > _MIN_RELEVANT_SHARE * total:
                    recording = f"{self.sensor}/{self.recording}"
                    yield texts.undetermined(name, recording, self.channel, parameter.status)


_TAIL_PROBABILITY = 0.025  # probability beyond each 95 % limit
_TAUS_PER_DECADE = 2  # number of tau per decade in the table ``drawn_deviations``


@dataclass(frozen=True)
class Ratio:
    """Ratio of a value of the first log to the value of the second log."""

    value: float | None  # None: one of them has no value
    # 95 % limits; None: unbounded above, or not known
    lower: float | None
    upper: float | None
    reasons: tuple[str, ...] = ()

    @property
    def verdict(self) -> RatioVerdict:
        """Whether the interval shows that the first value is lower or higher than the second."""
        if self.upper is not None and self.upper < 1.0:
            return "lower"
        if self.lower is not None and self.lower > 1.0:
            return "higher"
        limited = self.lower is not None and (self.upper is not None or self.lower > 0.0)
        return "not significant" if limited else "not determined"


def compare_parameters(first: Parameter, second: Parameter) -> Ratio:
    """Return the ratio of one noise parameter of two logs (Zou and Donner 2008, eq. 2 and 3).

    If a parameter has limits but no value, the interval contains all quotients within the limits.
    """
    reasons = tuple(
        texts.operand_status(which, parameter.status)
        for which, parameter in (("first", first), ("second", second))
        if parameter.status != "ok"
    )
    a, b = first.value, second.value
    if not a or not b:
        low = _divide(first.lower or 0.0, second.upper)
        high = _divide(first.upper, second.lower)
        if high is None and low in (None, 0.0):
            low = None
        return Ratio(None, low, high, reasons)
    middle = math.log(a / b)
    below = _add_in_quadrature(
        _compute_log_ratio(first.lower, a), _compute_log_ratio(b, second.upper)
    )
    above = _add_in_quadrature(
        _compute_log_ratio(a, first.upper), _compute_log_ratio(second.lower, b)
    )
    return Ratio(
        a / b,
        None if below is None else math.exp(middle - below),
        None if above is None or math.isinf(above) else math.exp(middle + above),
        reasons,
    )


def _divide(numerator: float | None, denominator: float | None) -> float | None:
    if numerator is None or not denominator:
        return None
    return numerator / denominator


def _compute_log_ratio(low: float | None, high: float | None) -> float | None:
    """Return ln(high / low); infinite if low is 0, None if a limit is not known."""
    if low is None or high is None:
        return None
    return math.log(high / low) if low > 0.0 else math.inf


def _add_in_quadrature(*sides: float | None) -> float | None:
    return None if None in sides else math.hypot(*(side for side in sides if side is not None))


def compare_deviations(
    first: ComparedChannel,
    second: ComparedChannel,
    tau: float,
    *,
    longest: float,
    draws: int,
    seed: int,
) -> Ratio:
    """Return the ratio of the Allan deviations of two models at a tau, s.

    ``longest`` is the longest tau as a fraction of the log. ``draws`` noise models are drawn from
    the estimate of each log, and all pairs are used. Each channel has its own random stream of the
    seed.
    """
    longest_tau = longest * min(first.duration, second.duration)
    if tau > longest_tau:
        return Ratio(None, None, None, (texts.tau_beyond(longest_tau),))
    if not first.model.terms or not second.model.terms:
        return Ratio(None, None, None, (texts.NO_MODEL,))
    value = math.sqrt(float(compute_number_needed(first.variance(tau), 0.0, second.variance(tau))))
    own, other = (_draw_variances(channel, draws, seed, [tau])[0] for channel in (first, second))
    ratios = np.sqrt(compute_number_needed(own[:, None], 0.0, other[None, :]))
    lower, upper = np.quantile(
        ratios, [_TAIL_PROBABILITY, 1.0 - _TAIL_PROBABILITY], method="inverted_cdf"
    )
    unknown = tuple(dict.fromkeys([*first.unknown(tau), *second.unknown(tau)]))
    # Draws of an absent term are above 0: extend the limits to the value.
    limits = min(float(lower), value), max(float(upper), value)
    return Ratio(None if unknown else value, *limits, unknown)


def _draw_variances(channel: ComparedChannel, draws: int, seed: int, tau: Sequence[float]) -> Array:
    """Return the Allan variances of drawn noise models of a channel, shape (tau, draws)."""
    stream = channel_rng(seed, repr(channel.model), channel.channel, "ratio")
    times = np.asarray(tau, dtype=np.float64)[:, np.newaxis]
    models = channel.drawn(draws, stream)
    return sum_over_stacked_terms(
        len(models), stack_models(models), lambda term: term.allan_variance(times), len(tau)
    )


def list_deviation_rows(
    channel: ComparedChannel, rate: float, *, longest: float, draws: int, seed: int
) -> Iterator[DrawnDeviationRow]:
    """Yield the rows of the table ``drawn_deviations`` of a channel.

    They are the input of `compare_deviations`, at two tau a decade from the sampling interval on,
    so that any two channels can be compared without their logs. ``rate`` is in Hz; the other
    arguments are as in `compare_deviations`.
    """
    if not channel.model.terms:
        return
    first, last = (
        _TAUS_PER_DECADE * math.log10(end) for end in (1.0 / rate, longest * channel.duration)
    )
    taus = [
        10.0 ** (step / _TAUS_PER_DECADE)
        for step in range(math.ceil(first - 1e-9), math.floor(last + 1e-9) + 1)
    ]
    drawn = np.sqrt(_draw_variances(channel, draws, seed, taus))
    row = partial(
        DrawnDeviationRow,
        sensor=channel.sensor,
        recording=channel.recording,
        channel=channel.channel,
    )
    for tau, deviations in zip(taus, drawn, strict=True):
        unknown = tuple(dict.fromkeys(channel.unknown(tau)))
        yield row(tau=tau, adev=math.sqrt(channel.variance(tau)), unknown=unknown)
        for number, deviation in enumerate(np.sort(deviations).tolist()):
            yield row(tau=tau, draw=number, adev=deviation)
