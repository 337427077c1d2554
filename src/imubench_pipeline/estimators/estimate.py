"""What every estimator gives: parameters with their status, and the model they make."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from imubench_pipeline.noise import NoiseModel

Status = Literal["ok", "not_shown", "at_bound", "not_identified", "absent"]

PARAMETERS = ("N", "B", "T_B", "K")
"""The parameters of the papers' model."""

SI_UNITS: dict[str, dict[str, str]] = {
    "gyro": {"N": "rad/s/sqrt(Hz)", "B": "rad/s", "T_B": "s", "K": "rad/s/sqrt(s)"},
    "accel": {"N": "m/s^2/sqrt(Hz)", "B": "m/s^2", "T_B": "s", "K": "m/s^2/sqrt(s)"},
}
"""SI unit of each parameter, by quantity."""


@dataclass(frozen=True)
class Parameter:
    """One estimated parameter.

    Attributes
    ----------
    value : float or None
        SI; None where the status says why there is none.
    status : str
        ``ok``; ``not_shown``: the curve does not show it; ``at_bound``: the fit ran into the
        end of its search; ``not_identified``: the log cannot tell it; ``absent``: the model
        has no such term.
    reason : str or None
    lower, upper : float or None
        95 % limits, where the method gives them.
    """

    value: float | None
    status: Status = "ok"
    reason: str | None = None
    lower: float | None = None
    upper: float | None = None


@dataclass(frozen=True)
class Estimate:
    """The parameters of one channel by one method."""

    method: str
    parameters: Mapping[str, Parameter]

    @property
    def model(self) -> NoiseModel:
        """The noise model of the parameters that have a value."""
        values = {name: parameter.value for name, parameter in self.parameters.items()}
        with_bias = values.get("B") is not None and values.get("T_B") is not None
        return NoiseModel(
            N=values.get("N") or 0.0,
            B=(values["B"] or 0.0) if with_bias else 0.0,
            T_B=values["T_B"] if with_bias else None,
            K=values.get("K") or 0.0,
        )
