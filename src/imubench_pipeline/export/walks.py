"""White noise and random walk, N and K: the noise model of most navigation filters."""

from __future__ import annotations

from imubench_pipeline.export.comments import format_exponential, format_setting
from imubench_pipeline.export.imu import ExportError, Imu
from imubench_pipeline.export.mapping import Mapped, as_walk

CONVENTION = (
    "N as *_noise_density and K as *_random_walk: continuous in time, two-sided (sigma^2(tau) = "
    "N^2 / tau and K^2 tau / 3), SI; not multiplied by the root of the rate."
)

TOPIC = "/imu0"
"""ROS topic of the samples."""


def map_to_walks(imu: Imu) -> dict[str, Mapped]:
    """Return gyro and accelerometer as white noise and random walk; ExportError without both."""
    imu.require_both()
    return {
        name: as_walk(axis.model, imu.horizon, imu.rate, axis.least_walk)
        for name, axis in imu.axes.items()
    }


def map_to_positive_walks(imu: Imu, program: str) -> dict[str, Mapped]:
    """Return `map_to_walks` for a program that takes no 0; ExportError if a density is 0."""
    mapped = map_to_walks(imu)
    for name, axis in mapped.items():
        for letter in ("N", "K"):
            if not getattr(axis.model, letter) > 0.0:
                raise ExportError(
                    f"{name}: {letter} is 0, and {program} takes values above 0 only; a longer "
                    "log, or an overbound, gives one"
                )
    return mapped


def format_densities(mapped: dict[str, Mapped], indent: str = "") -> str:
    """Return the four lines with the densities."""
    text = ""
    for name, word, unit, slower in (
        ("accel", "accelerometer", "m/s^2", "m/s^3"),
        ("gyro", "gyroscope", "rad/s", "rad/s^2"),
    ):
        model = mapped[name].model
        text += format_setting(
            f"{word}_noise_density", format_exponential(model.N), f"N, {unit}/sqrt(Hz)", indent
        )
        text += format_setting(
            f"{word}_random_walk", format_exponential(model.K), f"K, {slower}/sqrt(Hz)", indent
        )
    return text
