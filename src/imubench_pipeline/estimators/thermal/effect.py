"""What temperature adds to a log: taken from it, and put into what is drawn for its holes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from imubench_pipeline.estimators.missing import block_means, filled, slow_part
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.estimators.thermal.register import Span
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


def shifted(
    blocks: Iterable[Array], path: TemperaturePath, effect: Array, sign: float
) -> Iterator[Array]:
    """Yield the blocks of a log with what temperature adds to it, put in or taken out.

    Parameters
    ----------
    blocks : iterable of ndarray
        The log in order, SI.
    path : TemperaturePath
    effect : ndarray, shape (k,)
        What temperature adds at the knots of the path, SI.
    sign : float
        1 puts it in, -1 takes it out.

    Yields
    ------
    ndarray
        SI, in the shape of each block.
    """
    reached = 0
    for values in blocks:
        points = np.arange(reached, reached + len(values))
        yield values + sign * path.at(points, effect)
        reached += len(values)


def complete(
    blocks: Callable[[], Iterable[Array]],
    spans: Sequence[Span],
    model: NoiseModel,
    path: TemperaturePath,
    effect: Array,
    rate: float,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Return a log with its missing samples drawn: temperature's effect, and noise.

    Parameters
    ----------
    blocks : callable
        Gives the log in order, SI, as often as it is called; NaN where a sample is missing.
    spans : sequence of (int, int)
        First and one-past-last sample of each part whose holes can be filled
        (`imubench_pipeline.estimators.missing.divided`).
    model : NoiseModel
        Of what temperature leaves.
    path : TemperaturePath
    effect : ndarray, shape (k,)
        What temperature adds at the knots of the path, SI.
    rate : float
        Hz.
    rng : numpy.random.Generator

    Returns
    -------
    iterator of ndarray
        The blocks, SI.
    """
    means = block_means(shifted(blocks(), path, effect, -1.0), spans)
    slow = slow_part(means, spans, model, rate, rng)
    without = shifted(blocks(), path, effect, -1.0)
    return shifted(filled(without, slow, model, rate, rng), path, effect, 1.0)
