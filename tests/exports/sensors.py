"""The sensors of these tests, and the recursions of the programs that load their noise."""

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.extensions.exports.imu import AxisNoise, Imu
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel

GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
ACCEL = NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2.0e-5)
RATE = 50.0

Array = NDArray[np.float64]


def imu(gyro: NoiseModel = GYRO, accel: NoiseModel = ACCEL, **more: object) -> Imu:
    return Imu(
        sensor="mti_7",
        rate=float(more.pop("rate", RATE)),  # type: ignore[arg-type]  # callers give what the field takes
        estimated={
            "gyro": AxisNoise(gyro, "gyro_z of recording a"),
            "accel": AxisNoise(accel, "accel_x of recording a"),
        },
        **more,  # type: ignore[arg-type]  # callers give what the field takes
    )


def write_text(name: str, sensor: Imu) -> str:
    """Return the file of a program that is a text."""
    content = TARGETS[name].write(sensor)
    assert isinstance(content, str)
    return content


def white_and_walk(per_sample: float, per_step: float, samples: int, seed: int) -> Array:
    """Return white noise of a deviation a sample on a walk of a deviation a step."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(per_step * rng.standard_normal(samples))
    return per_sample * rng.standard_normal(samples) + walk


def midpoint(per_sample: float, per_step: float, samples: int, seed: int) -> Array:
    """Return what a midpoint rule integrates that takes the two ends of each step for new."""
    rng = np.random.default_rng(seed)
    ends = per_sample * rng.standard_normal((2, samples))
    walk = np.cumsum(per_step * rng.standard_normal(samples))
    return ends.mean(axis=0) + walk


EACH = {
    quantity: {
        letter: NoiseModel(N=scale * n, B=0.7 * scale, T_B=90.0)
        for letter, n in zip("xyz", factors, strict=True)
        if n
    }
    for quantity, scale, factors in (("gyro", 1e-5, (3, 0, 5)), ("accel", 1e-3, (1, 2, 4)))
}
"""Models of the axes of `imu_of_each`; gyro y has none."""


def imu_of_each(**more: object) -> Imu:
    """Return a sensor with a model of each axis; z represents both quantities."""
    chosen = {}
    for quantity, models in EACH.items():
        each = {name: AxisNoise(one, f"{quantity} {name} of a") for name, one in models.items()}
        chosen[quantity] = AxisNoise(models["z"], f"{quantity} z of a", each=each)
    return Imu(sensor="mti_7", rate=100.0, estimated=chosen, **more)  # type: ignore[arg-type]  # as above
