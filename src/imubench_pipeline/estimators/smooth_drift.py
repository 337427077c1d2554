"""Whether what looks like a random walk is a smooth drift.

A drift with temperature or time that is a smooth curve over the log, and does not end where it
began, has a cosine transform that falls with the square of its number: its spectrum falls as f^-4,
that of a random walk as f^-2. The two are compared as noise models with as many parameters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.whittle import Whittle

_AS_GOOD = 0.5
"""AIC up to which a drift is as good as a walk beside the same terms: so it is for a tenth of the
walks that are known to a fourth, and for hardly any that is known better."""

_BETTER_BESIDE_OTHERS = 4.0
"""The same beside terms of which the best are looked for."""

_TRIED = 15.0
"""BIC over the best up to which the terms of a model are tried."""


def instead_of_walk(whittle: Whittle, candidates: Sequence[Candidate]) -> str | None:
    """Say so where a smooth drift explains a spectrum as well as its random walk does, or better.

    Parameters
    ----------
    whittle : Whittle
        The likelihood to which the candidates were fitted.
    candidates : sequence of Candidate
        The best first.

    Returns
    -------
    str or None
        None where the best model has no random walk, or only that explains as much.
    """
    chosen = candidates[0]
    if "K" not in chosen.found.terms.linear or chosen.found.parameter("K") == 0.0:
        return None
    frequency = whittle.spectrum.frequency
    drift = whittle.with_column("K", whittle.column("K") * (frequency[0] / frequency) ** 2)
    best, beside = -math.inf, ""
    for one in candidates:
        terms = one.found.terms
        if "K" not in terms.linear or one.bic > chosen.bic + _TRIED:
            continue
        cost = drift.maximum(terms).cost
        better = chosen.aic - (one.aic + 2.0 * (cost - one.found.cost))
        wanted = -_AS_GOOD if one is chosen else _BETTER_BESIDE_OTHERS
        if better > max(wanted, best):
            best, beside = better, terms.name.replace("+K", "")
    if not beside:
        return None
    how = f"better by {best:.1f} in AIC" if best > _AS_GOOD else "as good"
    return (
        f"a smooth drift, whose spectrum falls as f^-4, and {beside} are {how}: a drift with "
        "temperature or time passes for a random walk"
    )
