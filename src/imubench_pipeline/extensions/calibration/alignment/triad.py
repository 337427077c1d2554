"""A triad of gyros and accelerometers at rest: noise, site and positions."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.earth import EARTH_RATE, STANDARD_GRAVITY
from imubench_pipeline.extensions.calibration.alignment.attitude import rotation
from imubench_pipeline.extensions.calibration.experiment import Blocks, Dwell, Experiment
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_NEAREST_POLE = 1e-6  # least cosine of the latitude; nearer to a pole there is no north


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place on Earth; ValueError at a pole, or if a value is out of range."""

    latitude: float  # rad, north positive
    gravity: float = STANDARD_GRAVITY  # m/s^2

    def __post_init__(self) -> None:
        if not (abs(self.latitude) < math.pi and math.cos(self.latitude) > _NEAREST_POLE):
            raise ValueError(
                f"latitude is {self.latitude}, expected an angle between the poles, in rad"
            )
        if not (math.isfinite(self.gravity) and self.gravity > 0):
            raise ValueError(f"gravity is {self.gravity}, expected a number above 0")

    @property
    def earth_rate(self) -> Array:
        """Rate of the Earth, north, east and down, rad/s."""
        return EARTH_RATE * np.array([math.cos(self.latitude), 0.0, -math.sin(self.latitude)])

    @property
    def specific_force(self) -> Array:
        """Specific force of a triad at rest, north, east and down, m/s^2."""
        return np.array([0.0, 0.0, -self.gravity])


@dataclass(frozen=True, kw_only=True)
class Triad:
    """Noise of three gyros and three accelerometers, x, y, z; ValueError if out of range."""

    gyros: Sequence[NoiseModel]  # three, SI
    accelerometers: Sequence[NoiseModel]  # three, SI
    gyro_bias: float  # standard deviation of the fixed bias of each axis, rad/s
    accelerometer_bias: float  # the same, m/s^2

    def __post_init__(self) -> None:
        for name in ("gyros", "accelerometers"):
            if len(getattr(self, name)) != 3:
                raise ValueError(f"found {len(getattr(self, name))} {name}, expected three")
        for name in ("gyro_bias", "accelerometer_bias"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value}, expected a finite number, 0 or more")

    @property
    def axes(self) -> list[tuple[NoiseModel, float]]:
        """Noise and sigma of the fixed bias of gyros x, y, z and accelerometers x, y, z."""
        return [(model, self.gyro_bias) for model in self.gyros] + [
            (model, self.accelerometer_bias) for model in self.accelerometers
        ]


@dataclass(frozen=True)
class Positions:
    """Blocks of a run at rest, in one position or in several with known turns from the first."""

    blocks: Blocks  # neither their sense nor their latitude is used
    turned: Array  # shape (dwells, 3, 3); from the body frame of each dwell to the first

    def __post_init__(self) -> None:
        dwells = int(self.blocks.dwell[-1]) + 1
        if self.turned.shape != (dwells, 3, 3):
            raise ValueError(f"turned has the shape {self.turned.shape}, expected ({dwells}, 3, 3)")
        square = self.turned @ np.swapaxes(self.turned, 1, 2)
        if not (
            np.allclose(square, np.eye(3), atol=1e-6) and np.all(np.linalg.det(self.turned) > 0)
        ):
            raise ValueError("turned has a matrix that is not a rotation, expected C C^T = I")

    @classmethod
    def at_rest(cls, duration: float, block: float, rate: float) -> "Positions":
        """Return one position, in blocks of at most ``block`` s; the sampling rate is in Hz."""
        samples = max(round(duration * rate), 1)
        run = Experiment((Dwell(0, samples, 1),), rate, 0.0)
        return cls(run.blocks(max(round(block * rate), 1)), np.eye(3)[None])

    @classmethod
    def turned_about_z(
        cls, headings: Sequence[float], *, dwell: float, turning: float, block: float, rate: float
    ) -> "Positions":
        """Return positions at headings, rad; dwell, turning and block in s, the rate in Hz."""
        run = Experiment.regular(
            dwell=dwell, turning=turning, dwells=len(headings), rate=rate, latitude=0.0
        )
        angles = np.zeros((len(headings), 3))
        angles[:, 2] = np.asarray(headings) - headings[0]
        return cls(run.blocks(max(round(block * rate), 1)), rotation(angles))

    @property
    def of_blocks(self) -> Array:
        """Rotation from the body frame of each block to the first, shape (b, 3, 3)."""
        return np.asarray(self.turned[self.blocks.dwell])
