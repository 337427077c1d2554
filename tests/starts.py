"""Starts of dead reckoning."""

from imubench_pipeline.navigation.error_budget.budget import Start
from imubench_pipeline.noise.growth import Uncalibrated


def uncalibrated(
    *,
    gyro_bias: float | None,
    accel_bias: float | None,
    on_time: float,
    tilt: float = 0.0,
    heading: float = 0.0,
) -> Start:
    """Return a start with turn-on biases of a given sigma, rad/s and m/s^2, and no window."""
    return Start(
        gyro=Uncalibrated(bias=gyro_bias, on_time=on_time),
        accel=Uncalibrated(bias=accel_bias, on_time=on_time),
        tilt=tilt,
        heading=heading,
    )
