"""Evaluate many noise models at once, with one term of array parameters for each kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.noise.terms import Term
from imubench_pipeline.typing import Array


def stack_models(models: Sequence[NoiseModel]) -> Iterator[tuple[NDArray[np.intp], Term]]:
    """Yield terms with array parameters, each with the indices of the models that have the term.

    Closed forms such as `Term.growth` or `Term.allan_variance` of such a term hold for all these
    models. A model with several terms of a kind occurs in as many stacked terms.
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


def sum_over_terms(
    models: Sequence[NoiseModel], figure: Callable[[Term], Array], places: int | None = None
) -> Array:
    """Return a quantity of each model that is the sum over its terms, such as a variance.

    ``figure`` returns an array of shape (k,), or (places, k), for a term with array parameters of
    shape (k,). The result has the shape (models,), or (places, models).
    """
    total = np.zeros((len(models),) if places is None else (places, len(models)))
    for numbers, term in stack_models(models):
        total[..., numbers] += figure(term)
    return total
