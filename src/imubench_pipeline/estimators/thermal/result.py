"""Result of a thermal fit, and the temperature effect added to or removed from a log."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.missing import average_blocks, draw_slow_part, fill_missing
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


def add_temperature_effect(
    blocks: Iterable[Array], path: TemperaturePath, effect: Array
) -> Iterator[Array]:
    """Yield the blocks of a log plus the effect of temperature at the knots, shape (k,), SI."""
    reached = 0
    for values in blocks:
        points = np.arange(reached, reached + len(values))
        yield values + path.at(points, effect)
        reached += len(values)


def remove_temperature_effect(
    blocks: Iterable[Array], path: TemperaturePath, effect: Array
) -> Iterator[Array]:
    """Yield the blocks of a log less the effect of temperature (see `add_temperature_effect`)."""
    return add_temperature_effect(blocks, path, -effect)


def complete_log(
    blocks: Callable[[], Iterable[Array]],
    spans: Sequence[Span],
    model: NoiseModel,
    path: TemperaturePath,
    effect: Array,
    rate: float,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Return the blocks of a log with missing samples drawn: temperature effect plus noise.

    ``spans`` are the parts with gaps that can be filled, the model is the noise of the residual,
    and ``effect``, shape (k,), as in `add_temperature_effect`.
    """
    means = average_blocks(remove_temperature_effect(blocks(), path, effect), spans)
    slow = draw_slow_part(means, spans, model, rate, rng)
    without = remove_temperature_effect(blocks(), path, effect)
    return add_temperature_effect(fill_missing(without, slow, model, rate, rng), path, effect)


@dataclass(frozen=True)
class ThermalFit:
    """Temperature dependence of a channel."""

    reference: float  # T_0, the mean temperature, °C
    sensitivity: Parameter  # s, SI per K
    quadratic: Parameter  # q, SI per K²; ``absent`` where it is not in the model
    lag: Parameter  # L, s
    bias: Parameter  # mean of the log, at T_0, SI
    compensated: bool
    """Temperature is removed from the noise: the interval of s (or q) excludes 0, and BIC favours
    it."""
    reason: str  # for ``compensated``
    plain: Likelihood
    without_temperature: Likelihood
    """The noise of the log before and after compensation; the same without compensation."""
    effect: Array  # (k,): of temperature at the knots of the path, SI; 0 without compensation
    path: TemperaturePath

    def compensate(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Return the blocks of the log, in order, SI, less the effect of temperature."""
        return remove_temperature_effect(blocks, self.path, self.effect)
