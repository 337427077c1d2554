"""What a contribution to an error comes of: quantity and noise parameter, by its name."""

from __future__ import annotations

from imubench_pipeline.estimators.estimate import CURVE
from imubench_pipeline.noise import TERMS, Term


def _behind(kind: type[Term]) -> frozenset[str]:
    symbols = frozenset(parameter.symbol for parameter in kind.parameters)
    return symbols | frozenset(CURVE) if "B" in symbols else symbols


_PARAMETERS = {kind.word: _behind(kind) for kind in TERMS}
"""Parameters behind the first word of a term's name (`Term.source`); the lowest part of the curve
is what its bias instability makes of it."""


def quantity_behind(source: str) -> str | None:
    """Return gyro or accel where a source is noise of one that the log tells; else None.

    Parameters
    ----------
    source : str
        As in the table ``error_budget``: ``gyro N``, ``initial tilt by accel GM 89.5 s``. A
        turn-on bias is stated, and not of the log.
    """
    words = source.removeprefix("initial tilt by ").split()
    noise = len(words) > 1 and words[0] in ("gyro", "accel") and words[1] in _PARAMETERS
    return words[0] if noise else None


def parameters_behind(source: str) -> frozenset[str]:
    """Return the noise parameters that a source comes of; none where it is no noise of the log.

    Parameters
    ----------
    source : str
        As in `quantity_behind`.
    """
    if quantity_behind(source) is None:
        return frozenset()
    return _PARAMETERS[source.removeprefix("initial tilt by ").split()[1]]
