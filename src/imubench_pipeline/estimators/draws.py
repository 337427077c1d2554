"""Draws of an estimate: noise models that its log allows, all parameters of each together.

The interval of a parameter says nothing of the others: where N and K trade off, or B and T_B, or
where the log allows a model with a random walk as well as one without, what is computed from all of
them (an error budget, a density, a prediction) is surer, or less sure, than independent parameters
would make it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from imubench_pipeline.estimators.estimate import FAMILY, JointDraws
from imubench_pipeline.estimators.model_choice import (
    BIC_PENALTY_RARE_TERM,
    BIC_PENALTY_UNIT_ROOT,
    WALK_LIKE_TIME_FRACTION,
    Candidate,
)
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Terms
from imubench_pipeline.typing import Array

NUMBER = 200
"""Draws that are kept of an estimate."""


def drawn_share(candidate: Candidate, bins: int) -> float:
    """Return the share of a model among the draws, of any sum: by AIC, but for T_B by BIC.

    An amplitude may be anything from 0, and AIC gives a weak one that is there its part; by BIC it
    is in no draw, and the truth lies above the limits. A correlation time must be looked for over
    decades, of which a fit takes a small part: that costs what BIC asks, of the bins that were
    fitted. That a process as slow as a walk counts less than the walk is left to `joint_draws`:
    counted here as well, a log that shows such a process nearly as well as a walk has none among
    its draws.
    """
    terms = candidate.terms
    of_times = terms.gauss_markov * (0.5 * math.log(bins) - 1.0)
    of_unlikely = 0.5 * BIC_PENALTY_RARE_TERM * (terms.ramp + ("Q" in terms.linear))
    return candidate.akaike_weight * math.exp(-of_times - of_unlikely)


def joint_draws(
    parts: Sequence[tuple[Terms, Posterior, float]], longest: float, number: int = NUMBER
) -> JointDraws:
    """Return draws from the posteriors of several models, as many of each as its share asks.

    They are picked at even distances of the weight, from one model after the other: nothing is left
    to chance, and neighbours in a chain do not stand for each other. A process as slow as a walk
    counts as in the choice of the model, less than a walk.

    ``parts`` are the models that the log does not rule out, with shares of any sum; ``longest`` is
    the longest correlation time that the log can show, s.

    Raises
    ------
    ValueError
        If there is no model, or no share above 0.
    """
    if not sum(share for _, _, share in parts) > 0.0:
        raise ValueError("expected models with shares above 0")
    most = max(terms.gauss_markov for terms, _, _ in parts)
    drawn = [_of_model(terms, posterior, most) for terms, posterior, _ in parts]
    first = np.concatenate([first_components for first_components, _ in drawn])
    further = np.concatenate([processes for _, processes in drawn])
    counts = [len(posterior.parameters) for _, posterior, _ in parts]
    mass = np.repeat([share / n for (_, _, share), n in zip(parts, counts, strict=True)], counts)
    times = np.column_stack((first[:, FAMILY.index("T_B")], further[:, :, 1]))
    slow = (times > WALK_LIKE_TIME_FRACTION * longest).any(axis=1)
    mass = np.cumsum(np.where(slow, math.exp(-0.5 * BIC_PENALTY_UNIT_ROOT), 1.0) * mass)
    rows = np.searchsorted(mass, (np.arange(number) + 0.5) / number * mass[-1])
    return JointDraws(first[rows], further[rows])


def _of_model(terms: Terms, posterior: Posterior, most: int) -> tuple[Array, Array]:
    """Return the first components and the further processes of the draws of one model."""
    linear, count = len(terms.linear), len(posterior.parameters)
    first = np.zeros((count, len(FAMILY)))
    first[:, FAMILY.index("T_B")] = np.nan
    first[:, FAMILY.index("R")] = posterior.ramps
    for place, letter in enumerate(terms.linear):
        column = FAMILY.index("B" if letter == "F" else letter)
        first[:, column] = posterior.parameters[:, place]
    pairs = np.stack([posterior.parameters[:, linear:], posterior.times], axis=2)
    if terms.gauss_markov and "F" not in terms.linear:
        # As everywhere: the first component is flicker noise, or else the fastest process.
        first[:, FAMILY.index("B")], first[:, FAMILY.index("T_B")] = pairs[:, 0].T
        pairs = pairs[:, 1:]
    further = np.tile([0.0, np.nan], (count, most, 1))
    further[:, : pairs.shape[1]] = pairs
    return first, further
