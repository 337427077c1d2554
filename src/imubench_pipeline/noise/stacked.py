"""Many noise models at once: their terms, each kind as one whose parameters are arrays."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.noise.terms import Term
from imubench_pipeline.typing import Array


def stacked(models: Sequence[NoiseModel]) -> Iterator[tuple[NDArray[np.intp], Term]]:
    """Yield terms whose parameters are arrays, each with the numbers of the models that have it.

    What a closed form says of such a term, as `Term.growth` or `Term.allan_variance`, it says of
    all these models. A model with several terms of a kind has a part in as many.
    """
    groups: dict[tuple[type[Term], int], list[tuple[int, Term]]] = {}
    for number, model in enumerate(models):
        before: Counter[type[Term]] = Counter()
        for term in model.terms:
            kind = type(term)
            groups.setdefault((kind, before[kind]), []).append((number, term))
            before[kind] += 1
    for (kind, _), members in groups.items():
        names = [field.name for field in fields(kind)]
        values = [np.array([getattr(term, name) for _, term in members]) for name in names]
        yield np.array([number for number, _ in members]), kind(*values)


def summed(
    models: Sequence[NoiseModel], figure: Callable[[Term], Array], places: int | None = None
) -> Array:
    """Return a figure of each model that is the sum over its terms, such as a variance.

    Parameters
    ----------
    models : sequence of NoiseModel
    figure : callable
        Given a term whose parameters are arrays of shape (k,), returns an array of shape (k,), or
        (places, k).
    places : int, optional
        As many figures are returned of each model.

    Returns
    -------
    ndarray, shape (models,) or (places, models)
    """
    total = np.zeros((len(models),) if places is None else (places, len(models)))
    for numbers, term in stacked(models):
        total[..., numbers] += figure(term)
    return total
