"""What a contribution to an error comes of: quantity and noise parameter, by its name."""

from __future__ import annotations

_PARAMETERS = {
    "N": frozenset({"N"}),
    "Q": frozenset({"Q"}),
    "GM": frozenset({"B", "B_curve", "sigma_min", "tau_min", "T_B"}),
    "flicker": frozenset({"B", "B_curve", "sigma_min", "tau_min"}),
    "K": frozenset({"K"}),
    "R": frozenset({"R"}),
    "line": frozenset({"amplitude", "frequency"}),
}
"""Parameters behind the name of a term (`navigation.error_budget.budget.label`)."""


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
