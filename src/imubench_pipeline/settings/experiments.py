"""Settings of extensions, and statements of notes about a moved sensor."""

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeVar

from pydantic import BaseModel, Field, create_model

from imubench_pipeline.registry import Place, blocks, load
from imubench_pipeline.settings.validation import Strict

if TYPE_CHECKING:
    from imubench_pipeline.settings.simulated_sensor import AxisSettings

Kind = str
"""Experiment with a sensor during a recording: ``static``, or the key of its block of notes."""

AT_REST: Kind = "static"  # nothing: it was at rest all the time

Gyro = Literal["gyro_x", "gyro_y", "gyro_z"]
_Block = TypeVar("_Block", bound=BaseModel)
_Model = TypeVar("_Model", bound="WithBlocks")


class WithBlocks(Strict):
    """Settings to which extensions may add blocks."""

    def block(self, model: type[_Block]) -> _Block | None:
        """Return the block of a class; None if it is not stated."""
        return next((value for _, value in self if isinstance(value, model)), None)


def with_blocks(place: Place) -> Callable[[type[_Model]], type[_Model]]:
    """Return a decorator that adds the blocks of extensions: with defaults in a run, else None."""

    def extend(model: type[_Model]) -> type[_Model]:
        fields: dict[str, Any] = {}
        for key, block in blocks(place).items():
            of = load(block.model)
            stated = Field(None, description=block.description or None)
            fields[key] = (of, of()) if place == "run" else (of | None, stated)
        return create_model(
            model.__name__,
            __base__=model,
            __module__=model.__module__,
            __doc__=model.__doc__,
            **fields,
        )

    return extend


class Experiment(Strict):
    """Experiment, or attitude, of a sensor during a recording, as stated in its notes."""

    is_static: ClassVar[bool] = False  # whether the sensor was at rest all the time

    @abstractmethod
    def moved_gyro(self, channels: Sequence[str], *, column: bool) -> str | None:
        """Return the gyro of the experiment, or None for all channels.

        ``channels``: of the log. ``column``: whether the log has a column with the rate of the
        table. Raises ValueError, with the key, if the gyro or the rates are missing.
        """


class SimulatedSensors(Strict):
    """Settings of a simulated recording that is made from several units of a sensor."""

    @abstractmethod
    def check(self, channels: "Mapping[Any, AxisSettings]") -> None:
        """Raise ValueError if the simulation does not support the settings of a channel."""


def stated_experiments(settings: WithBlocks) -> dict[str, Experiment]:
    """Return the experiments that are stated, by their keys."""
    return {key: value for key, value in settings if isinstance(value, Experiment)}


def kind_of(notes: object) -> Kind:
    """Return the kind of a recording from its notes, even if the rest of them is invalid."""
    if isinstance(notes, Mapping):
        for key, block in blocks("notes").items():
            if notes.get(key) is not None and not load(block.model).is_static:
                return key
    return AT_REST
