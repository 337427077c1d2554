"""Joint draws of the parameters of an estimate, over the noise models that the log allows.

Intervals of single parameters ignore correlations: N and K, or B and T_B, may be correlated, and
the log may allow models with and without a random walk. The error of a result of all parameters (an
error budget, a density, a prediction) then differs from that for independent parameters.
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

KEPT_DRAWS = 200
"""Number of draws that are kept for an estimate."""


def compute_draw_weight(candidate: Candidate, bins: int) -> float:
    """Return the weight of a model among the draws, not normalised: by AIC, but for T_B by BIC.

    Amplitudes start at 0, and AIC keeps a weak term in some draws; by BIC it would be in none, and
    the true value would lie above the limits. A correlation time is searched over decades, of which
    a fit covers a small part: BIC, with the number of fitted bins, has the right penalty. The
    penalty for a process as slow as a walk is applied in `draw_jointly`; applied here as well, it
    would remove such a process from the draws even if it fits nearly as well as a walk.
    """
    terms = candidate.terms
    of_times = terms.gauss_markov * (0.5 * math.log(bins) - 1.0)
    of_rare_terms = 0.5 * BIC_PENALTY_RARE_TERM * (terms.ramp + ("Q" in terms.linear))
    return candidate.akaike_weight * math.exp(-of_times - of_rare_terms)


def draw_jointly(
    parts: Sequence[tuple[Terms, Posterior, float]], longest: float, number: int = KEPT_DRAWS
) -> JointDraws:
    """Return draws from the posteriors of several models, in proportion to their weights.

    They are selected at equal distances of the cumulative weight, over one model after the other
    (systematic resampling without a random start). A process as slow as a walk has the same penalty
    as in the model choice.

    ``parts`` are the models that the log does not exclude, with unnormalised weights; ``longest``
    is the longest correlation time that the log can determine, s.

    Raises
    ------
    ValueError
        If there is no model, or no weight above 0.
    """
    if not sum(share for _, _, share in parts) > 0.0:
        raise ValueError("expected models with shares above 0")
    most = max(terms.gauss_markov for terms, _, _ in parts)
    drawn = [_convert_draws(terms, posterior, most) for terms, posterior, _ in parts]
    first = np.concatenate([first_components for first_components, _ in drawn])
    further = np.concatenate([processes for _, processes in drawn])
    counts = [len(posterior.parameters) for _, posterior, _ in parts]
    mass = np.repeat([share / n for (_, _, share), n in zip(parts, counts, strict=True)], counts)
    times = np.column_stack((first[:, FAMILY.index("T_B")], further[:, :, 1]))
    slow = (times > WALK_LIKE_TIME_FRACTION * longest).any(axis=1)
    mass = np.cumsum(np.where(slow, math.exp(-0.5 * BIC_PENALTY_UNIT_ROOT), 1.0) * mass)
    rows = np.searchsorted(mass, (np.arange(number) + 0.5) / number * mass[-1])
    return JointDraws(first[rows], further[rows])


def _convert_draws(terms: Terms, posterior: Posterior, most: int) -> tuple[Array, Array]:
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
        # By convention the first component is flicker noise, or else the fastest process.
        first[:, FAMILY.index("B")], first[:, FAMILY.index("T_B")] = pairs[:, 0].T
        pairs = pairs[:, 1:]
    further = np.tile([0.0, np.nan], (count, most, 1))
    further[:, : pairs.shape[1]] = pairs
    return first, further
