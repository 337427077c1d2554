"""Simulate several axes with common motion and temperature, in parallel."""

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.sensor import CHANNELS, TEMPERATURE, quantity_of
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.profiles import Profile
from imubench_pipeline.simulate.simulation import SAMPLES_PER_CHUNK, Signal, simulate_blocks
from imubench_pipeline.typing import Array

SAMPLES_PER_BLOCK = 8 * SAMPLES_PER_CHUNK
"""Samples per block of `simulate_imu`."""


@dataclass(frozen=True, kw_only=True)
class ImuModel:
    """The model of a sensor; raises ValueError for an unknown channel or an invalid figure."""

    axes: Mapping[str, SensorModel]  # by channel, ``gyro_x`` to ``accel_z``
    misalignment: Mapping[str, Array] = field(default_factory=dict)
    """By quantity, shape (3, 3): response of the axes x, y, z (rows) to a unit rate or specific
    force along the true x, y, z, without scale errors. By default the identity."""
    temperature_step: float = 0.0  # of the register of temperature, K; 0: not rounded

    def __post_init__(self) -> None:
        if unknown := [name for name in self.axes if name not in CHANNELS]:
            raise ValueError(f"no channel {unknown[0]!r}; expected {', '.join(CHANNELS)}")
        for quantity, matrix in self.misalignment.items():
            if np.shape(matrix) != (3, 3) or not np.isfinite(matrix).all():
                raise ValueError(f"misalignment of {quantity}: expected 3 by 3 finite numbers")
        if not self.temperature_step >= 0:
            raise ValueError(f"temperature_step is {self.temperature_step}, expected 0 or more")

    def sensed(self, channel: str) -> dict[str, float]:
        """Return the sensitivity of an axis, such as ``gyro_x``, to each channel that it senses."""
        quantity, row = quantity_of(channel), "xyz".index(channel[-1])
        matrix = np.asarray(self.misalignment.get(quantity, np.eye(3)))
        parts = {f"{quantity}_{axis}": float(matrix[row, i]) for i, axis in enumerate("xyz")}
        return {name: part for name, part in parts.items() if part != 0.0}


def simulate_imu(
    imu: ImuModel,
    rate: float,
    samples: int,
    seed: int,
    names: tuple[str, ...] = (),
    *,
    motion: Mapping[str, Profile] | None = None,
    temperature: Profile | None = None,
    threads: int = 1,
) -> Iterator[dict[str, Array]]:
    """Yield the log of a sensor in blocks of `SAMPLES_PER_BLOCK` samples, with constant memory.

    The channels are in SI, the rate is in Hz. ``temperature``, if given, is in °C and rounded to
    its register; without one there is no drift. ``motion`` is the true rate, rad/s, and specific
    force, m/s², by channel; 0 where there is none. ``seed`` and ``names``, such as sensor and
    recording, determine all samples. An axis does not depend on the other simulated axes or on the
    number of ``threads``, in which axes are simulated in parallel.
    """
    profiles = dict(motion or {})
    if temperature is not None:
        profiles[TEMPERATURE] = temperature
    start = 0
    present: dict[str, Array] = {}  # the profiles in the block that begins at `start`

    def signal(sensed: Mapping[str, float]) -> Signal | None:
        """Return the sum of the profiles that an axis senses; None without any."""
        parts = {name: part for name, part in sensed.items() if name in profiles}

        def at(first: int, last: int) -> Array:
            total = np.zeros(last - first)
            for name, part in parts.items():
                total += part * present[name][first - start : last - start]
            return total

        return at if parts else None

    streams = {
        channel: simulate_blocks(
            model,
            rate,
            samples,
            channel_rng(seed, *names, channel),
            true=signal(imu.sensed(channel)),
            temperature=signal({TEMPERATURE: 1.0}),
            block=SAMPLES_PER_BLOCK,
        )
        for channel, model in imu.axes.items()
    }
    with ThreadPoolExecutor(max(1, threads)) as pool:
        for start in range(0, samples, SAMPLES_PER_BLOCK):
            times = np.arange(start, min(start + SAMPLES_PER_BLOCK, samples)) / rate
            present = {name: profile(times) for name, profile in profiles.items()}
            blocks = dict(zip(streams, pool.map(next, streams.values()), strict=True))
            if temperature is not None:
                block, step = present[TEMPERATURE], imu.temperature_step
                blocks[TEMPERATURE] = np.rint(block / step) * step if step else block
            yield blocks
