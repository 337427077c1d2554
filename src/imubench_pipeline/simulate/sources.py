"""A simulated model with its provenance: the source of each figure, and assumptions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from imubench_pipeline.settings.simulated_sensor import ModelSettings
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.settings.yaml_files import read_settings
from imubench_pipeline.simulate.imu import ImuModel
from imubench_pipeline.simulate.models import make_imu_model
from imubench_pipeline.words.reasons import simulations as texts

Topic = Literal["noise", "bias", "drift", "low-pass", "register", "log"]
"""Part of a model; ``log``: remarks on the written log."""


@dataclass(frozen=True)
class Remark:
    """A sentence about a part of a model."""

    topic: Topic
    text: str


@dataclass
class Origin:
    """A model and its provenance."""

    imu: ImuModel
    source: str  # source of the figures, in words
    # remarks on the figures of each channel, with their source
    figures: dict[str, list[Remark]] = field(default_factory=dict)
    assumed: list[Remark] = field(default_factory=list)  # figures without a source
    sensor: str | None = None  # name of the sensor file of its logs

    def assume(self, topic: Topic, text: str) -> None:
        """Add an assumption, unless it is already listed."""
        remark = Remark(topic, text)
        if remark not in self.assumed:
            self.assumed.append(remark)


def read_model_file(path: Path) -> Origin:
    """Read a file of models (see `settings`).

    Raises ConfigError if the file does not exist, or a figure cannot be used.
    """
    settings = read_settings(ModelSettings, path)
    source = texts.of_model_file(path.name, settings.source)
    as_given = Remark("noise", texts.stated_in(path.name))
    figures = {str(name): [as_given] for name in settings.axes}
    try:
        model = make_imu_model(settings.axes, settings)
    except ValueError as error:
        raise ConfigError(f"{path}: axes.{error}") from error
    return Origin(model, source, figures, [], settings.sensor)


def select_channels(origin: Origin, channels: Sequence[str]) -> Origin:
    """Return a model with the given channels only.

    Raises ConfigError if it has no such channel.
    """
    if missing := [name for name in channels if name not in origin.imu.axes]:
        channels_there = ", ".join(origin.imu.axes) or "none"
        raise ConfigError(f"no figures of {missing[0]}; there are those of {channels_there}")
    axes = {name: axis for name, axis in origin.imu.axes.items() if name in channels}
    figures = {name: lines for name, lines in origin.figures.items() if name in channels}
    return replace(origin, imu=replace(origin.imu, axes=axes), figures=figures)
