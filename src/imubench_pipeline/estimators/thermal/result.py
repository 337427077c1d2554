"""What temperature does to a channel: as it is told, and as it is put into a log or taken out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.missing import block_means, fill_missing, slow_part
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


def shift_by_effect(
    blocks: Iterable[Array], path: TemperaturePath, effect: Array, sign: float
) -> Iterator[Array]:
    """Yield the blocks of a log with what temperature adds to it, put in (1) or taken out (-1).

    ``effect``, shape (k,), is what temperature adds at the knots of the path, SI as the log.
    """
    reached = 0
    for values in blocks:
        points = np.arange(reached, reached + len(values))
        yield values + sign * path.at(points, effect)
        reached += len(values)


def complete_log(
    blocks: Callable[[], Iterable[Array]],
    spans: Sequence[Span],
    model: NoiseModel,
    path: TemperaturePath,
    effect: Array,
    rate: float,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Return the blocks of a log with its missing samples drawn: temperature's effect, and noise.

    The blocks come in order, SI, NaN where a sample is missing; ``spans`` are the parts whose holes
    can be filled (`imubench_pipeline.estimators.missing.divide_at_holes`), the model is that of
    what temperature leaves, and ``effect``, shape (k,), as of `shift_by_effect`.
    """
    means = block_means(shift_by_effect(blocks(), path, effect, -1.0), spans)
    slow = slow_part(means, spans, model, rate, rng)
    without = shift_by_effect(blocks(), path, effect, -1.0)
    return shift_by_effect(fill_missing(without, slow, model, rate, rng), path, effect, 1.0)


@dataclass(frozen=True)
class ThermalFit:
    """What temperature does to a channel.

    Attributes
    ----------
    reference : float
        T_0, the mean temperature, °C.
    sensitivity, quadratic : Parameter
        s and q, SI per K and per K²; q has status ``absent`` where it is not in the model.
    lag : Parameter
        L, s.
    bias : Parameter
        Mean of the log, at T_0, SI.
    compensated : bool
        Temperature is taken out of the noise: the interval of s (or q) excludes 0, and BIC
        favours it.
    reason : str
        Why it is, or is not.
    plain, without_temperature : Likelihood
        The noise of the log as it is, and of what temperature leaves of it; the same where
        nothing is taken out.
    effect : ndarray, shape (k,)
        What temperature adds to the log at the knots of the path, SI; zeros where nothing is
        taken out.
    path : TemperaturePath
        Temperature of the log.
    """

    reference: float
    sensitivity: Parameter
    quadratic: Parameter
    lag: Parameter
    bias: Parameter
    compensated: bool
    reason: str
    plain: Likelihood
    without_temperature: Likelihood
    effect: Array
    path: TemperaturePath

    def compensate(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Return the blocks of the log, in order, SI, less what temperature adds to it."""
        return shift_by_effect(blocks, self.path, self.effect, -1.0)
