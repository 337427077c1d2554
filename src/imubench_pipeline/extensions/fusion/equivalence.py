"""Number of averaged sensors that equals one better sensor: rows of the table ``fusion``."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from imubench_pipeline.extensions.fusion.board import divided
from imubench_pipeline.extensions.fusion.tables import FusionRow
from imubench_pipeline.navigation.ratios import ComparedChannel, compute_number_needed
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.typing import Array

_TAIL_PROBABILITY = 0.025  # beyond each 95 % limit


@dataclass(frozen=True)
class Answer:
    """Allan variance of a sensor at one tau."""

    candidate: ComparedChannel  # the representative channel
    own: float  # Allan variance of the independent part of one specimen, SI
    common: float  # of its common part
    drawn_own: Array  # shape (draws,); the same for the drawn models
    drawn_common: Array
    unknown: tuple[str, ...]  # unknown parameters that matter; the number is then not given


def answer(
    sensor: str,
    candidates: Sequence[ComparedChannel],
    tau: float,
    correlation: Mapping[str, float],
    *,
    longest: float,
    draws: int,
    seed: int,
) -> Answer | str:
    """Return the Allan variance of a sensor's median channel at a tau, s; or why there is none.

    The candidates are all channels of one quantity; if any is measured, simulated ones are left
    out. ``correlation``: shared fraction of the variance of each parameter; ``longest``: largest
    tau as a fraction of the log; ``draws``: number of models drawn from the estimate.
    """
    measured = [channel for channel in candidates if not channel.simulated] or candidates
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
    unknown = tuple(dict.fromkeys(chosen.unknown(tau)))
    return Answer(chosen, float(own[0]), float(common[0]), drawn_own, drawn_common, unknown)


def _compute_parts(
    models: Sequence[NoiseModel], correlation: Mapping[str, float], tau: float
) -> tuple[Array, Array]:
    pairs = [divided(model, correlation) for model in models]
    own, common = (np.array([float(pair[i].allan_variance(tau)) for pair in pairs]) for i in (0, 1))
    return own, common


def equivalence_rows(
    candidates: Iterable[ComparedChannel],
    taus: Sequence[float],
    correlation: Mapping[str, float],
    *,
    longest: float,
    draws: int,
    seed: int,
) -> Iterator[FusionRow]:
    """Yield rows of ``fusion``: every ordered pair of sensors at every tau, s (see `answer`)."""
    listed = sorted(candidates, key=lambda channel: channel.sensor)
    for quantity in ("gyro", "accel"):
        own = [channel for channel in listed if channel.channel.startswith(quantity)]
        by_sensor = group_rows(own, lambda channel: channel.sensor)
        for tau in taus:
            answers = {
                name: answer(name, of, tau, correlation, longest=longest, draws=draws, seed=seed)
                for name, of in by_sensor.items()
            }
            for a, b in permutations(answers, 2):
                row = FusionRow(quantity=quantity, tau=tau, sensor=a, other=b)
                yield _compare_pair(row, answers[a], answers[b])


def _compare_pair(row: FusionRow, a: Answer | str, b: Answer | str) -> FusionRow:
    """Return the row of two sensors at a tau with the number needed, or why there is none."""
    answers = [(each,) if isinstance(each, str) else each.unknown for each in (a, b)]
    reasons = [reason for each in answers for reason in each]
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
        return replace(row, reasons=tuple(reasons))
    number = float(compute_number_needed(a.own, a.common, b.own + b.common))
    drawn = compute_number_needed(a.drawn_own, a.drawn_common, b.drawn_own + b.drawn_common)
    # Infinite numbers cannot be interpolated.
    tails = [_TAIL_PROBABILITY, 1.0 - _TAIL_PROBABILITY]
    low, high = np.quantile(drawn, tails, method="inverted_cdf")
    # Draws of an absent term are above 0: extend the limits to the value.
    low, high = min(float(low), number), max(float(high), number)
    if math.isinf(number):
        reasons.append(
            f"no number of them reaches it at {row.tau:g} s, because the common part remains"
        )
    elif math.isinf(high):
        reasons.append("within the limits of the parameters, no number may reach it")
    return replace(
        row,
        n=number if plain and math.isfinite(number) else None,
        lower=low if math.isfinite(low) else None,
        upper=high if math.isfinite(high) else None,
        reachable=math.isfinite(number),
        reasons=tuple(reasons),
    )
