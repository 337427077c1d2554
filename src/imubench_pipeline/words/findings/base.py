"""Base class of findings: their data, the parameters that they affect, and their sentence.

A finding is a class of its data, which the base class makes a dataclass:

    class Stuck(FindingData, affects=ALL, unfit=True):
        value: float
        def text(self, channel: str) -> str:
            return f"{channel} stays at {self.value:.4g} ..."

The check that finds it passes the data to `imubench_pipeline.tables.findings.find`.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Literal, dataclass_transform

from imubench_pipeline.units import convert_from_si
from imubench_pipeline.words.numbers import Unit, join_names, number_text

SLOW = frozenset({"B", "B_curve", "sigma_min", "tau_min", "T_B", "K", "R"})
"""Parameters of slow noise."""

WHITE = frozenset({"N", "Q"})
"""Parameters of fast noise."""

ALL = SLOW | WHITE | {"S", "bias"}
NONE: frozenset[str] = frozenset()

POWERS_OF_UNIT: Mapping[str, float] = dict.fromkeys(
    ("N", "Q", "B", "B_curve", "sigma_min", "K", "R", "bias"), 1.0
)
"""Power with which each parameter scales with the samples."""

POWERS_OF_TIME: Mapping[str, float] = {
    "N": 0.5,
    "Q": 1.0,
    "T_B": 1.0,
    "tau_min": 1.0,
    "K": -0.5,
    "R": -1.0,
}
"""Power with which each parameter scales with time: N² = σ²(τ) τ."""

FINDINGS: "dict[str, type[FindingData]]" = {}
"""The class of each finding, by its code."""


@dataclass_transform(frozen_default=True)
@dataclass(frozen=True)
class FindingData:
    """Data of a finding about a recording or a channel; each subclass is a frozen dataclass."""

    code: ClassVar[str]
    """By default the name of the class, ``StuckForAWhile`` as ``stuck_for_a_while``."""
    affects: ClassVar[frozenset[str]]
    """Parameters whose estimates it puts in doubt; `NONE`: it is no doubt."""
    unfit: ClassVar[bool]
    """Whether the log is not used: it may be of several sensors, of motion, or in another unit."""
    scales: ClassVar[Mapping[str, float]]
    """If a factor corrects samples or times: its power in each parameter; else empty."""
    doubt: ClassVar[str]
    """The doubt in a few words; ``{channels}`` becomes the channels, ``{are}`` is or are."""

    def __init_subclass__(
        cls,
        *,
        affects: frozenset[str],
        code: str = "",
        unfit: bool = False,
        scales: Mapping[str, float] | None = None,
        doubt: str = "",
    ) -> None:
        """Make a finding a dataclass, and register it by its code."""
        dataclass(frozen=True)(cls)
        code = code or re.sub(r"(?<!^)(?=[A-Z])", "_", cls.__name__).lower()
        cls.code, cls.affects, cls.unfit, cls.scales = code, affects, unfit, scales or {}
        cls.doubt = doubt or code.replace("_", " ") + " ({channels})"
        FINDINGS[code] = cls

    def text(self, channel: str) -> str:
        """Return the finding in sentences, with what to do; ``channel`` may be empty."""
        raise NotImplementedError


def channel_name(channel: str) -> str:
    """Return a channel in words: ``gyro x``."""
    return channel.replace("_", " ")


def channels_text(channels: Sequence[str]) -> str:
    """Return channels in words, by quantity: ``gyro x and accel x, y and z``."""
    axes: dict[str, list[str]] = {}
    for channel in sorted(set(channels), key=lambda name: (name[:1] != "g", name)):
        quantity, _, axis = channel.partition("_")
        axes.setdefault(quantity, []).append(axis)
    return join_names([f"{name} {join_names(own)}".strip() for name, own in axes.items()])


Kind = Literal["signal", "level", "density"]
"""What a unit is for: samples and their mean, the level of slow noise and bias, white noise."""

System = Literal["practical", "si"]
_system: ContextVar[System] = ContextVar("system", default="practical")

_UNITS: Mapping[tuple[str, Kind], tuple[str, str, str]] = {
    ("gyro", "signal"): ("°/s", "rad/s", "angular_rate"),
    ("gyro", "level"): ("°/h", "rad/s", "angular_rate"),
    ("gyro", "density"): ("°/s/√Hz", "rad/s/√Hz", "gyro_density"),
    ("accel", "signal"): ("mg", "m/s²", "acceleration"),
    ("accel", "level"): ("µg", "m/s²", "acceleration"),
    ("accel", "density"): ("µg/√Hz", "m/s²/√Hz", "accel_density"),
}


@contextmanager
def units_of(system: System) -> Iterator[None]:
    """Make the sentences of this thread use practical or SI units."""
    token = _system.set(system)
    try:
        yield
    finally:
        _system.reset(token)


def unit_of(channel: str, kind: Kind) -> Unit:
    """Return the unit in which values of a channel, or of ``gyro`` or ``accel``, are shown."""
    return _unit_of(channel.partition("_")[0], kind, _system.get())


@cache
def _unit_of(quantity: str, kind: Kind, system: System) -> Unit:
    sign, si_sign, dimension = _UNITS[quantity, kind]
    per_si = 1.0 if system == "si" else convert_from_si(1.0, sign, dimension)
    return Unit(si_sign if system == "si" else sign, per_si)


def value_text(value: float, channel: str, kind: Kind = "signal") -> str:
    """Return a value of a channel, SI, with its unit: ``0.24 °/s/√Hz``."""
    unit = unit_of(channel, kind)
    return f"{unit.text(value, 3)} {unit.sign}"


def at_text(seconds: float) -> str:
    """Return a position in a recording with its unit, s, as in the notes (``use:``)."""
    return f"{number_text(seconds, 5)} s"


def estimate_text(value: float, lower: float, upper: float, unit: Unit) -> str:
    """Return an estimate with its 95 % interval: ``30 °/h (95 %: 28 to 32 °/h)``."""
    text, limits = unit.estimate_texts(value, lower, upper)
    return f"{text} {unit.sign} (95 %: {limits} {unit.sign})"
