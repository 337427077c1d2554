"""Settings of several simulated sensors on a board."""

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from imubench_pipeline.settings.experiments import SimulatedSensors
from imubench_pipeline.settings.simulated_sensor import AxisSettings


class Specimens(SimulatedSensors):
    """Several units of one sensor on a board, fused to one log."""

    number: int = Field(ge=2, le=1000)
    spread: float = Field(
        0.0,
        ge=0,
        le=1,
        description="standard deviation of the logarithm of N, B and K between units",
    )

    def check(self, channels: Mapping[Any, AxisSettings]) -> None:
        """Raise ValueError if a channel has other terms than N, B and K."""
        for name, axis in channels.items():
            other = [key for key in ("R", "Q", "further", "sinusoids") if getattr(axis, key)]
            if axis.N is None or other:
                found = f"{other[0]} in it" if other else "no N in it"
                raise ValueError(
                    f"channels.{name} has {found}; expected N, optionally B and K, and no other "
                    "term"
                )
