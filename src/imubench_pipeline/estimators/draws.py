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
from numpy.typing import NDArray

from imubench_pipeline.estimators.estimate import FAMILY, JointDraws
from imubench_pipeline.estimators.model_choice import LIKE_A_WALK, UNIT_ROOT, Candidate
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Terms

Array = NDArray[np.float64]

NUMBER = 200
"""Draws that are kept of an estimate."""


def drawn_share(candidate: Candidate) -> float:
    """Return the share of a model among the draws: halfway between those by AIC and by BIC.

    By AIC alone, a term that is not there is in half of the draws, can only add, and leaves the
    truth below the limits; by BIC alone, a weak term that is there is in none. On simulated logs of
    N+K, N+GM, N+GM+K and N+F+K the limits of error budgets hold most evenly in between.

    Parameters
    ----------
    candidate : Candidate
    """
    return math.sqrt(candidate.share * candidate.weight)


def joint_draws(
    parts: Sequence[tuple[Terms, Posterior, float]], longest: float, number: int = NUMBER
) -> JointDraws:
    """Return draws from the posteriors of several models, as many of each as its share asks.

    They are picked at even distances of the weight, from one model after the other: nothing is left
    to chance, and neighbours in a chain do not stand for each other. A process as slow as a walk
    counts as in the choice of the model, less than a walk.

    Parameters
    ----------
    parts : sequence of (Terms, Posterior, float)
        Models that the log does not rule out, with their shares of any sum.
    longest : float
        The longest correlation time that the log can show, s.
    number : int
        Draws of all together.

    Returns
    -------
    JointDraws

    Raises
    ------
    ValueError
        If there is no model, or no share above 0.
    """
    if not sum(share for _, _, share in parts) > 0.0:
        raise ValueError("expected models with shares above 0")
    most = max(terms.gauss_markov for terms, _, _ in parts)
    drawn = [_of_model(terms, posterior, most) for terms, posterior, _ in parts]
    first = np.concatenate([one for one, _ in drawn])
    further = np.concatenate([one for _, one in drawn])
    mass = np.concatenate([share * _weights(posterior) for _, posterior, share in parts])
    times = np.column_stack((first[:, FAMILY.index("T_B")], further[:, :, 1]))
    slow = (times > LIKE_A_WALK * longest).any(axis=1)
    mass = np.cumsum(np.where(slow, math.exp(-0.5 * UNIT_ROOT), 1.0) * mass)
    rows = np.searchsorted(mass, (np.arange(number) + 0.5) / number * mass[-1])
    return JointDraws(first[rows], further[rows])


def _weights(posterior: Posterior) -> Array:
    """Return the weights of the draws of a posterior, of the sum 1."""
    drawn = len(posterior.parameters)
    return np.full(drawn, 1.0 / drawn)


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
