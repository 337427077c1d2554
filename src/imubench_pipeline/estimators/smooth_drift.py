"""Whether what looks like a random walk is a drift with temperature or time.

A drift that turns a few times over a log has its power in the lowest cosines of the transform,
where a weak random walk has most of its own; beyond them, it falls as f^-4 and a walk as f^-2. So a
walk is believed that is still needed without the lowest cosines, and whose spectrum is not steeper.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.whittle import Maximum, Whittle

_OF_DRIFT = 5
"""Lowest cosines of a log, half a period to two and a half, that a drift is granted."""

_NEEDED = 3.0
"""Gain, twice the log likelihood, from which a walk is needed beyond them: so it is for 97 % of the
walks that are known to 14 to 20 %, and for one in seven of the smooth drifts that pass for one."""

_STEEPER = 8.0
"""The same by which a spectrum of f^-4 must be the better: so it is for 1 % of the walks, and for
some of the drifts with sharp bends."""

_WITHOUT = (0, 4)
"""Lowest cosines without which the slope is looked at: chance in a few of them hides it."""


def instead_of_walk(whittle: Whittle, chosen: Maximum) -> str | None:
    """Say so where a drift explains a spectrum about as well as its random walk does.

    Parameters
    ----------
    whittle : Whittle
    chosen : Maximum
        The model that the data favour, fitted to it.

    Returns
    -------
    str or None
        None where the model has no random walk, or only that explains as much.
    """
    terms = chosen.terms
    if "K" not in terms.linear or chosen.parameter("K") == 0.0:
        return None
    beyond = _beyond(whittle, _OF_DRIFT)
    bare = replace(terms, linear=terms.linear.replace("K", ""))
    if len(beyond.spectrum.density) <= terms.parameters:
        return f"the log has too few frequencies beyond the {_OF_DRIFT} lowest, which drift has too"
    if 2.0 * (beyond.maximum(bare).cost - beyond.maximum(terms).cost) < _NEEDED:
        return (
            f"beyond the {_OF_DRIFT} lowest frequencies {bare.name} explains the log as well, and "
            "in these a drift with temperature or time passes for a random walk"
        )
    first = float(whittle.spectrum.frequency[0])
    for number in _WITHOUT:
        rest = _beyond(whittle, number)
        steep = (first / rest.spectrum.frequency) ** 2
        drift = rest.with_column("K", rest.column("K") * steep)
        better = 2.0 * (rest.maximum(terms).cost - drift.maximum(terms).cost)
        if better > _STEEPER:
            return (
                f"a smooth drift, whose spectrum falls as f^-4, and {bare.name} are better by "
                f"{better:.1f} in AIC: a drift with temperature or time passes for a random walk"
            )
    return None


def _beyond(whittle: Whittle, number: int) -> Whittle:
    """Return the likelihood without the lowest cosines of each part of the log."""
    spectrum = whittle.spectrum
    place = 2.0 * spectrum.frequency * spectrum.length
    beyond = place > number + 0.5
    return whittle if bool(np.all(beyond)) else whittle.select(spectrum, beyond)
