"""Sensor models from settings."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.settings.sensor import Channel, quantity_of
from imubench_pipeline.settings.simulated_sensor import AxisSettings, ImuSettings
from imubench_pipeline.simulate.imu import ImuModel
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift
from imubench_pipeline.units import difference_to_si, quantity_to_si

_OF_NOISE = ("N", "B", "T_B", "K", "R", "Q")


def axis_model(settings: AxisSettings, channel: str) -> SensorModel:
    """Return the model of an axis, in SI.

    Parameters
    ----------
    settings : AxisSettings
    channel : str
        ``gyro_x`` to ``accel_z``.

    Raises
    ------
    UnitError
        If a unit has another dimension than its figure.
    ValueError
        If a figure is out of its range.
    """
    quantity, figures = quantity_of(channel), settings.si(channel)
    drift, low_pass = settings.drift, settings.low_pass
    return SensorModel(
        noise=NoiseModel(
            **{name: figures[name] for name in _OF_NOISE if name in figures},
            further=[GaussMarkov(**one.si(quantity)) for one in settings.further],
            sinusoids=[Sinusoid(**one.si(quantity)) for one in settings.sinusoids],
        ),
        bias=figures.get("bias", 0.0),
        drift=None if drift is None else TemperatureDrift(**drift.si(quantity)),
        low_pass=None
        if low_pass is None
        else LowPass(quantity_to_si(low_pass.cutoff, "frequency"), low_pass.order),
        scale_error=settings.scale_error,
        resolution=figures.get("resolution", 0.0),
        full_scale=figures.get("full_scale"),
    )


def imu_model(axes: Mapping[Channel, AxisSettings], settings: ImuSettings) -> ImuModel:
    """Return the model of a sensor, in SI.

    Parameters
    ----------
    axes : mapping of str to AxisSettings
        By channel.
    settings : ImuSettings
        What the axes have together.

    Raises
    ------
    ValueError
        As `axis_model`, with the name of the channel.
    """
    models = {}
    for channel, axis in axes.items():
        try:
            models[str(channel)] = axis_model(axis, channel)
        except ValueError as error:
            raise ValueError(f"{channel}: {error}") from error
    step = settings.temperature_step
    return ImuModel(
        axes=models,
        misalignment={name: np.array(rows) for name, rows in settings.misalignment.items()},
        temperature_step=0.0 if step is None else difference_to_si(step, "temperature"),
    )
