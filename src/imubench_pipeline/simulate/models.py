"""Sensor models from settings, their provenance, and the true values of their parameters."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from imubench_pipeline.estimators.estimate import SI_UNITS
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.registry import Hook
from imubench_pipeline.settings.sensor import Channel, quantity_of
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.settings.simulated_sensor import AxisSettings, ImuSettings, ModelSettings
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.settings.yaml_files import read_settings
from imubench_pipeline.simulate.imu import ImuModel
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift, in_the_log
from imubench_pipeline.simulate.profiles import Profile
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_difference, parse_quantity

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
    """Return the model in a file; raises ConfigError without the file, or for an invalid figure."""
    settings = read_settings(ModelSettings, path)
    source = f"the model file {path.name}" + (f" ({settings.source})" if settings.source else "")
    as_given = Remark("noise", f"as stated in {path.name}")
    figures = {str(name): [as_given] for name in settings.axes}
    try:
        model = make_imu_model(settings.axes, settings)
    except ValueError as error:
        raise ConfigError(f"{path}: axes.{error}") from error
    return Origin(model, source, figures, [], settings.sensor)


def select_channels(origin: Origin, channels: Sequence[str]) -> Origin:
    """Return a model with the given channels only; ConfigError if it has no such channel."""
    if missing := [name for name in channels if name not in origin.imu.axes]:
        channels_there = ", ".join(origin.imu.axes) or "none"
        raise ConfigError(f"no figures of {missing[0]}; there are figures of {channels_there}")
    axes = {name: axis for name, axis in origin.imu.axes.items() if name in channels}
    figures = {name: lines for name, lines in origin.figures.items() if name in channels}
    return replace(origin, imu=replace(origin.imu, axes=axes), figures=figures)


_NOISE_PARAMETERS = ("N", "B", "T_B", "K", "R", "Q")


@dataclass(frozen=True)
class Simulation:
    """How an extension simulates recordings of several sensors or of an experiment."""

    # yields the blocks of its channels, with its motion and its temperature
    blocks: Callable[
        [SimulatedRecording, Mapping[str, Profile], Profile | None], Iterator[dict[str, Array]]
    ]
    # returns factors of N, B and K of a channel, relative to a single sensor
    factors: Callable[[SimulatedRecording, str], Mapping[str, float]]


SIMULATIONS: Hook[Simulation] = Hook("simulations")
"""Simulations by extensions, by their block of settings."""


def make_axis_model(settings: AxisSettings, channel: str) -> SensorModel:
    """Return the model of an axis in SI; raises UnitError, or ValueError for a figure's range."""
    quantity, figures = quantity_of(channel), settings.si(channel)
    drift, low_pass = settings.drift, settings.low_pass
    return SensorModel(
        noise=NoiseModel(
            **{name: figures[name] for name in _NOISE_PARAMETERS if name in figures},
            further=[GaussMarkov(**term.si(quantity)) for term in settings.further],
            sinusoids=[Sinusoid(**term.si(quantity)) for term in settings.sinusoids],
        ),
        bias=figures.get("bias", 0.0),
        drift=None if drift is None else TemperatureDrift(**drift.si(quantity)),
        low_pass=LowPass(parse_quantity(low_pass.cutoff, "frequency"), low_pass.order)
        if low_pass
        else None,
        scale_error=settings.scale_error,
        resolution=figures.get("resolution", 0.0),
        full_scale=figures.get("full_scale"),
    )


def make_imu_model(axes: Mapping[Channel, AxisSettings], settings: ImuSettings) -> ImuModel:
    """Return the model of a sensor in SI; raises ValueError with the name of the channel."""
    models = {}
    for channel, axis in axes.items():
        try:
            models[str(channel)] = make_axis_model(axis, channel)
        except ValueError as error:
            raise ValueError(f"{channel}: {error}") from error
    step = settings.temperature_step
    return ImuModel(
        axes=models,
        misalignment={name: np.array(rows) for name, rows in settings.misalignment.items()},
        temperature_step=0.0 if step is None else parse_difference(step, "temperature"),
    )


@dataclass(frozen=True)
class TrueFigure:
    """True value of one parameter."""

    name: str  # of the parameter in the tables
    value: float  # SI; degC for a temperature
    unit: str
    setting: str  # its key in `AxisSettings`
    component: int = 1  # number of a repeated term, from 1


def list_true_figures(settings: AxisSettings, channel: str, rate: float) -> Iterator[TrueFigure]:
    """Yield the true values of the parameters of an axis, in a log of a rate in Hz.

    N is the density at low frequencies of the log; N_sensor is the density before the low-pass, if
    there is one.
    """
    quantity = quantity_of(channel)
    units, plain = SI_UNITS[quantity], SI_UNITS[quantity]["B"]
    model = make_axis_model(settings, channel)
    figures = settings.si(channel)
    for name, value in figures.items():
        if name == "N":
            yield TrueFigure(name, in_the_log(model, rate), units[name], name)
            if model.low_pass is not None:
                yield TrueFigure("N_sensor", model.noise.N, units[name], name)
        elif name in ("Q", "K", "R"):
            yield TrueFigure(name, value, units[name], name)
        elif name == "bias":
            yield TrueFigure(name, value, plain, name)
    # The order of estimates: flicker noise, then by T_B.
    processes = [(process.si(quantity), "further") for process in settings.further]
    if "B" in figures:
        processes.append(({name: figures[name] for name in ("B", "T_B") if name in figures}, "B"))
    processes.sort(key=lambda process: process[0].get("T_B", 0.0))
    for number, (values, setting) in enumerate(processes, start=1):
        for name, value in values.items():
            yield TrueFigure(name, value, units[name], setting, number)
    lines = sorted((line.si(quantity) for line in settings.sinusoids), key=lambda f: f["frequency"])
    for number, line in enumerate(lines, start=1):
        for name, value in line.items():
            yield TrueFigure(name, value, units[name], "sinusoids", number)
    if settings.drift is not None:
        of_drift = {"sensitivity": f"{plain}/K", "quadratic": f"{plain}/K^2", "lag": "s"}
        for name, value in settings.drift.si(quantity).items():
            yield TrueFigure(name, value, of_drift.get(name, "degC"), "drift")
    if model.low_pass is not None:
        yield TrueFigure("cutoff", model.low_pass.cutoff, "Hz", "low_pass")
