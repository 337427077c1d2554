"""Number of averaged sensors that equals one better sensor: rows of the table ``fusion``."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.estimators.estimate import Estimate, JointDraws, Parameter
from imubench_pipeline.model.comparisons import FusionRow
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.navigation.fusion.board import divided
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.typing import Array
from imubench_pipeline.words.estimates import STATUS_WORDS

_MIN_RELEVANT_SHARE = 0.1
"""Minimum share of the Allan variance for which an unknown parameter matters."""

_TAIL_PROBABILITY = 0.025
"""Probability beyond each 95 % limit."""


def number_needed(own: ArrayLike, common: ArrayLike, wanted: ArrayLike) -> Array:
    """Return the number of sensors of one kind whose mean has a given Allan variance.

    The mean of n sensors has ``own / n + common``, so n = own / (wanted - common). Without a common
    part, n is the ratio of the Allan variances. It is not rounded, may be below 1, and is infinite
    if no number is enough.

    Parameters
    ----------
    own, common, wanted : array_like
        Allan variance of the independent part of one sensor, of the part common to all, and the
        given one, such as of one better sensor; (rad/s)^2 or (m/s^2)^2, in broadcastable shapes.
    """
    own, common, wanted = np.broadcast_arrays(own, common, wanted)
    room = np.asarray(wanted - common, dtype=np.float64)
    return np.divide(own, room, out=np.full(room.shape, math.inf), where=room > 0.0)


@dataclass(frozen=True)
class TemperaturePart:
    """Temperature effect on a channel, which is common to all specimens on a board."""

    tau: Array  # shape (t,); s
    deviation: Array  # shape (t,); its Allan deviation over the recording, (rad/s) or (m/s²)
    relative_error: float  # standard deviation of the sensitivity over its value

    def variance(self, tau: float) -> float:
        """Return its Allan variance at a tau in s, (rad/s)² or (m/s²)²."""
        log_deviation = np.log(np.maximum(self.deviation, 1e-300))
        return math.exp(2.0 * float(np.interp(math.log(tau), np.log(self.tau), log_deviation)))

    def drawn(self, tau: float, draws: int, rng: np.random.Generator) -> Array:
        """Return Allan variances, shape (draws,), of sensitivities drawn from their interval."""
        factor = 1.0 + self.relative_error * rng.standard_normal(draws)
        return np.asarray(factor**2 * self.variance(tau))


@dataclass(frozen=True)
class FusionChannel:
    """A channel that may represent its sensor."""

    sensor: str
    recording: str
    channel: str
    simulated: bool
    duration: float  # of the recording, s
    # the recommended one, after removal of the temperature effect, if any
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
        groups = [self.estimate.parameters, *self.estimate.further]
        for group in groups:
            for name, parameter in group.items():
                if parameter.value is not None or parameter.status in ("absent", "not_shown"):
                    continue
                part = _bound_variance(name, group, tau)
                if part > _MIN_RELEVANT_SHARE * total:
                    status = STATUS_WORDS[parameter.status]
                    yield f"{name} of {self.sensor}/{self.recording} {self.channel} is {status}"


def _bound_variance(name: str, group: Mapping[str, Parameter], tau: float) -> float:
    """Return the largest Allan variance of a parameter, from its value or upper limit."""
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
    return float(model.allan_variance(tau))


@dataclass(frozen=True)
class Answer:
    """Allan variance of a sensor at one tau."""

    candidate: FusionChannel  # the representative channel
    # own, common: Allan variance of the independent and common part of one specimen, SI
    own: float
    common: float
    # drawn_own, drawn_common: shape (draws,); the same for the drawn models
    drawn_own: Array
    drawn_common: Array
    unknown: str | None  # unknown parameters that matter; the number is then not given


def answer(
    sensor: str,
    candidates: Sequence[FusionChannel],
    tau: float,
    correlation: Mapping[str, float],
    *,
    longest: float,
    draws: int,
    seed: int,
) -> Answer | str:
    """Return the Allan variance of the median channel of a sensor at a tau; or why not.

    Parameters
    ----------
    sensor : str
    candidates : sequence of FusionChannel
        All channels of one quantity of the sensor, at least one. Simulated ones are left out if
        there are measured ones. The median of two is the worse one.
    tau : float
        s.
    correlation : mapping of str to float
        Fraction of the variance of each parameter that specimens share.
    longest : float
        Longest tau, as a fraction of the log.
    draws : int
        Number of models drawn from the estimate.
    seed : int
        Each channel has its own random stream.
    """
    measured = [channel for channel in candidates if not channel.simulated] or list(candidates)
    long = [channel for channel in measured if tau <= longest * channel.duration]
    if not long:
        most = longest * max(channel.duration for channel in measured)
        return f"the logs of {sensor} tell tau up to {most:.3g} s alone"
    noisy = [channel for channel in long if channel.model.terms]
    if not noisy:
        return f"no noise model of {sensor}"
    chosen = sorted(noisy, key=lambda channel: channel.variance(tau))[len(noisy) // 2]
    stream = channel_rng(seed, chosen.sensor, repr(chosen.model), chosen.channel, "fusion")
    own, common = _compute_parts([chosen.model], correlation, tau)
    drawn_own, drawn_common = _compute_parts(chosen.drawn(draws, stream), correlation, tau)
    if chosen.temperature is not None:
        common = common + chosen.of_temperature(tau)
        drawn_common = drawn_common + chosen.temperature.drawn(tau, draws, stream)
    unknown = "; ".join(dict.fromkeys(chosen.unknown(tau))) or None
    return Answer(chosen, float(own[0]), float(common[0]), drawn_own, drawn_common, unknown)


def _compute_parts(
    models: Sequence[NoiseModel], correlation: Mapping[str, float], tau: float
) -> tuple[Array, Array]:
    pairs = [divided(model, correlation) for model in models]
    own, common = (np.array([float(pair[i].allan_variance(tau)) for pair in pairs]) for i in (0, 1))
    return own, common


def equivalence_rows(
    candidates: Iterable[FusionChannel],
    taus: Sequence[float],
    correlation: Mapping[str, float],
    *,
    longest: float,
    draws: int,
    seed: int,
) -> Iterator[FusionRow]:
    """Yield the rows of the table ``fusion``: every ordered pair of sensors at every tau, s.

    The candidates are the channels of all sensors; the other parameters are those of `answer`.
    """
    listed = sorted(candidates, key=lambda channel: channel.sensor)
    for quantity in ("gyro", "accel"):
        by_sensor: dict[str, list[FusionChannel]] = {}
        for channel in listed:
            if channel.channel.startswith(quantity):
                by_sensor.setdefault(channel.sensor, []).append(channel)
        for tau in taus:
            answers = {
                sensor: answer(
                    sensor, own, tau, correlation, longest=longest, draws=draws, seed=seed
                )
                for sensor, own in by_sensor.items()
            }
            for a, b in permutations(answers, 2):
                row = FusionRow(quantity=quantity, tau=tau, sensor=a, other=b)
                yield _compare_pair(row, answers[a], answers[b])


def _compare_pair(row: FusionRow, a: Answer | str, b: Answer | str) -> FusionRow:
    """Return the row of two sensors at a tau with the number needed, or why there is none."""
    answers = [each if isinstance(each, str) else each.unknown for each in (a, b)]
    reasons = [reason for reason in answers if reason]
    plain = not reasons
    if not isinstance(a, str):
        whole = a.own + a.common
        row = replace(
            row,
            recording=a.candidate.recording,
            channel=a.candidate.channel,
            simulated=a.candidate.simulated,
            adev=math.sqrt(whole),
            floor=math.sqrt(a.common),
            common_share=a.common / whole,
            temperature_share=a.candidate.of_temperature(row.tau) / whole,
        )
    if not isinstance(b, str):
        row = replace(
            row,
            other_recording=b.candidate.recording,
            other_channel=b.candidate.channel,
            other_simulated=b.candidate.simulated,
            other_adev=math.sqrt(b.own + b.common),
        )
    if isinstance(a, str) or isinstance(b, str):
        return replace(row, reason="; ".join(reasons))
    number = float(number_needed(a.own, a.common, b.own + b.common))
    drawn = number_needed(a.drawn_own, a.drawn_common, b.drawn_own + b.drawn_common)
    # Infinite numbers cannot be interpolated.
    low, high = np.quantile(
        drawn, [_TAIL_PROBABILITY, 1.0 - _TAIL_PROBABILITY], method="inverted_cdf"
    )
    # Draws of an absent term are above 0: extend the limits to the value.
    low, high = min(float(low), number), max(float(high), number)
    if math.isinf(number):
        reasons.append(f"no number of them reaches it at {row.tau:g} s: the common part is a floor")
    elif math.isinf(high):
        reasons.append("within the limits of the parameters, no number may reach it")
    return replace(
        row,
        n=number if plain and math.isfinite(number) else None,
        lower=low if math.isfinite(low) else None,
        upper=high if math.isfinite(high) else None,
        reachable=math.isfinite(number),
        reason="; ".join(reasons) or None,
    )
