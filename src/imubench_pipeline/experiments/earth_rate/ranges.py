"""How sure the standard deviations of the Earth's rate are: their range over noise models.

The noise model is an estimate with limits. Each standard deviation is computed again for models
drawn from these; 95 % of the values lie between its limits. What weights that come of another
model than the true one add to it is of the second order, and left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.linalg import LinAlgError

from imubench_pipeline.experiments.earth_rate.bound import bound
from imubench_pipeline.experiments.earth_rate.experiment import Blocks
from imubench_pipeline.experiments.earth_rate.pairs import by_pairs, by_triples
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.sigma_range import sigma_range

Range = dict[str, float]


def sigma_ranges(
    blocks: Blocks, model: NoiseModel, drawn: Sequence[NoiseModel], turn_on_bias: float | None
) -> dict[str, Range]:
    """Return the limits of the standard deviation of each method at the end of a run.

    Parameters
    ----------
    blocks : Blocks
    model : NoiseModel
        As estimated.
    drawn : sequence of NoiseModel
        From the limits of its parameters.
    turn_on_bias : float or None
        Standard deviation of the fixed bias, rad/s; None: not known.

    Returns
    -------
    dict
        By method, ``sigma_lower`` and ``sigma_upper``, rad/s; none where nothing is drawn, or the
        method has no estimate.
    """
    if not drawn:
        return {}
    nothing = np.zeros((1, len(blocks)))
    bias = math.inf if turn_on_bias is None else turn_on_bias

    def filtered(one: NoiseModel) -> float:
        return bound(blocks, one, bias)

    methods: dict[str, Callable[[NoiseModel], float]] = {
        "pairs": lambda one: float(by_pairs(nothing, blocks, one).sigma[-1]),
        "triples": lambda one: float(by_triples(nothing, blocks, one).sigma[-1]),
        "filter": filtered,
    }
    found: dict[str, Range] = {}
    for method, sigma in methods.items():
        try:
            limits = sigma_range(sigma, model, drawn)
        except (ValueError, LinAlgError):
            continue  # no pair or triple in these dwells, which the estimate says
        found[method] = {"sigma_lower": float(limits.lower), "sigma_upper": float(limits.upper)}
    if "filter" in found:
        found["smoother"] = found["filter"]  # at the end of the run they are one
    return found
