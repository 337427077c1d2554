"""Components of verdicts on sensors, besides their codes (`imubench_pipeline.model.states`)."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from imubench_pipeline.model import states

_NOISE_SOURCES = get_args(states.NoiseSource)

Property = Literal[
    "price_class",
    "quantity",
    "axis",
    "full_scale",
    "bandwidth",
    "rate",
    "temperature",
    "mass",
    "power",
]
"""Properties of a sensor that a requirement can demand."""


@dataclass(frozen=True, slots=True)
class Condition:
    """An unknown figure, or property, on which a verdict depends.

    ``subject`` is the quantity (gyro, accel), or the axis of a property. ``largest`` is the largest
    figure with which every limit is met, 1 sigma, SI; None for a property. In the catalogue,
    ``printing`` sensors print this figure; for ``within`` of them it is at most ``largest``.
    """

    figure: states.Cause | None
    property: Property | None
    subject: str
    largest: float | None = None
    within: int | None = None
    printing: int | None = None


@dataclass(frozen=True, slots=True)
class Shortfall:
    """A required property that a sensor does not have.

    ``subject`` is the quantity or axis, or the price class of the sensor; ``asked`` is as in the
    requirement; ``has``: values of the sensor, SI (empty if there are none).
    """

    property: Property
    subject: str
    asked: str
    has: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class ErrorSource:
    """Source of an error; ``T_B`` (s) and ``frequency`` (Hz) distinguish terms of one kind."""

    source: states.SourceCode
    quantity: states.Measured | None = None
    through: states.SourcePath | None = None
    T_B: float | None = None
    frequency: float | None = None

    @property
    def is_noise(self) -> bool:
        """Whether it is a term of the noise model."""
        return self.source in _NOISE_SOURCES


@dataclass(frozen=True, slots=True)
class Share(ErrorSource):
    """A source of an error, with its share of the variance, 0 to 1."""

    share: float = field(kw_only=True)
    origin: states.Origin | None = None


@dataclass(frozen=True, slots=True)
class UnitFactor:
    """Factor that corrects the data of a quantity whose unit is in doubt."""

    quantity: str
    factor: float


@dataclass(frozen=True, slots=True)
class DoubtMark:
    """A doubt about a recording: its code in the table ``doubts``, and its channels."""

    recording: str
    code: str
    channels: tuple[str, ...] = ()
