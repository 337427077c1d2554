"""Experiments that are simulated: what their notes would say, and what is true of them."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from imubench_pipeline.settings.known_rates import Angle, AtRest, OnRateTable
from imubench_pipeline.settings.pointing import Pointing
from imubench_pipeline.settings.two_position import TwoPosition
from imubench_pipeline.settings.validation import Strict, Text, checked
from imubench_pipeline.units import quantity_to_si

_Rate = Annotated[Text, checked("angular_rate")]


class PublishedRate(Strict):
    """What a source prints of the Earth's rate that it found."""

    where: Text = Field(description="such as section 6")
    printed: _Rate = Field(description="with its unit, as printed")
    part: Text = Field("whole", description="of the run: whole, or such as 'last 13 min'")


class SimulatedTurns(TwoPosition):
    """A gyro that is turned between north and south, by the clock."""

    transient: _Rate = Field("0 deg/s", description="largest rate that is sensed of a turn, about")
    assumed: tuple[Text, ...] = Field((), description="figures that no source publishes")
    published: tuple[PublishedRate, ...] = ()

    @model_validator(mode="after")
    def _parts_are_there(self) -> Self:
        parts = {"whole", *(f"last {text}" for text in self.last)}
        for rate in self.published:
            if rate.part not in parts:
                raise ValueError(f"published: part is {rate.part!r}; expected one of {parts}")
        return self

    @property
    def declared(self) -> TwoPosition:
        """What would stand beside such a log."""
        return TwoPosition(**{name: getattr(self, name) for name in TwoPosition.model_fields})


class SimulatedTable(OnRateTable):
    """A gyro on a rate table that keeps to its steps, with ramps between them."""

    scale_factor: float = Field(1.0, gt=0, description="true one: indicated over true rate")
    assumed: tuple[Text, ...] = Field((), description="figures that no source publishes")

    @model_validator(mode="after")
    def _has_steps(self) -> Self:
        if not self.steps:
            raise ValueError("steps is missing; expected the steady rates of the table")
        return self

    @property
    def declared(self) -> OnRateTable:
        """What would stand beside such a log."""
        return OnRateTable(**{name: getattr(self, name) for name in OnRateTable.model_fields})


class SimulatedRest(AtRest):
    """A gyro at rest that senses its part of the Earth's rate."""

    true_heading: Angle = Field("0 deg", description="of the axis, where heading is null")
    assumed: tuple[Text, ...] = Field((), description="figures that no source publishes")

    @property
    def declared(self) -> AtRest:
        """What would stand beside such a log."""
        return AtRest(**{name: getattr(self, name) for name in AtRest.model_fields})

    @property
    def true(self) -> Pointing:
        """Where the axis points, exactly."""
        stated, heading = self.pointing, self.pointing.heading
        if heading is None:
            heading = quantity_to_si(self.true_heading, "angle")
        return Pointing(latitude=stated.latitude, heading=heading, elevation=stated.elevation)
