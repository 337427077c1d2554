"""Findings on changes over a log: steps and drifts of the bias, noise that is not stationary."""

import math
from collections.abc import Mapping

from imubench_pipeline.words.estimates import symbol_text
from imubench_pipeline.words.findings.base import (
    NONE,
    SLOW,
    FindingData,
    channel_name,
    estimate_text,
    unit_of,
)
from imubench_pipeline.words.numbers import Unit, join_names, number_text, percent_text

_SECONDS = Unit("s", 1.0)
_SHOWN = ("N", "B_curve", "K", "sigma_min")  # parameters whose change is stated
_MAX_SHOWN = 2
_MIN_SHOWN_CHANGE = 0.05
_MAX_PRINTED_FACTOR = 100.0
_MIN_CYCLES = 1.5  # in a log, of a drift that is called periodic


def removal_text(factors: Mapping[str, float] | None) -> str:
    """Return how much larger parameters would be, by ``factors``, if a signal were not removed."""
    if factors is None:
        return ""
    clear = {name: factor for name, factor in factors.items() if name in _SHOWN}
    largest = sorted(clear, key=lambda name: -abs(math.log(max(clear[name], 1e-9))))
    parts = [
        f"{symbol_text(name)} would be {_times_text(clear[name])}"
        for name in largest[:_MAX_SHOWN]
        if abs(clear[name] - 1.0) >= _MIN_SHOWN_CHANGE
    ]
    if not parts:
        return ", with little effect on any parameter"
    return f"; otherwise {join_names(parts)} as large"


def _times_text(factor: float) -> str:
    if factor > _MAX_PRINTED_FACTOR:
        return f"over {number_text(_MAX_PRINTED_FACTOR)} times"
    return f"{number_text(factor, 2)} times"


class BiasStep(FindingData, affects=SLOW | {"bias"}, doubt="the bias of {channels} steps"):
    """The bias changes at once, and stays there."""

    size: float
    size_lower: float
    size_upper: float  # with 95 % limits, SI
    time: float  # s from the first sample
    time_error: float  # half width of the 95 % interval of the time, s
    factors: dict[str, float] | None = None
    """Factor of each parameter if no signal is removed; None: not known."""

    def text(self, channel: str) -> str:
        size = estimate_text(self.size, self.size_lower, self.size_upper, unit_of(channel, "level"))
        return (
            f"The bias of {channel_name(channel)} steps by {size} at {number_text(self.time, 6)} s "
            f"(± {number_text(self.time_error, 2)} s). This step is removed from the noise"
            f"{removal_text(self.factors)}. "
            "Look for a motion, a new range or a sudden change of temperature"
        )


class WarmUpDrift(
    FindingData, affects=SLOW | {"bias"}, doubt="the bias of {channels} drifts during warm-up"
):
    """The bias settles exponentially from the start of the log."""

    size: float
    size_lower: float
    size_upper: float  # initial value, with 95 % limits, SI
    time: float
    time_lower: float
    time_upper: float  # time constant, with 95 % limits, s
    factors: dict[str, float] | None = None
    """Factor of each parameter if no signal is removed; None: not known."""

    def text(self, channel: str) -> str:
        size = estimate_text(self.size, self.size_lower, self.size_upper, unit_of(channel, "level"))
        time = estimate_text(self.time, self.time_lower, self.time_upper, _SECONDS)
        return (
            f"The bias of {channel_name(channel)} starts {size} from its final value. It settles "
            f"with a time constant of {time}. It is removed from the "
            f"noise{removal_text(self.factors)}. Let the sensor warm up before recording"
        )


class PeriodicDrift(FindingData, affects=SLOW, doubt="the bias of {channels} oscillates slowly"):
    """The bias varies with a slow period."""

    size: float
    size_lower: float
    size_upper: float  # amplitude, with 95 % limits, SI
    time: float
    time_lower: float
    time_upper: float  # period, with 95 % limits, s
    factors: dict[str, float] | None = None
    """Factor of each parameter if no signal is removed; None: not known."""
    cycles: float | None = None  # in the log
    has_temperature: bool = False  # whether the log has readings of the temperature

    def text(self, channel: str) -> str:
        size = estimate_text(self.size, self.size_lower, self.size_upper, unit_of(channel, "level"))
        time = estimate_text(self.time, self.time_lower, self.time_upper, _SECONDS)
        if self.cycles is not None and self.cycles < _MIN_CYCLES:
            motion = f"drifts slowly, like a part of a wave with an amplitude of {size}"
        else:
            motion = f"oscillates with an amplitude of {size}. Its period is {time}"
        advice = "Record at a steady temperature, or with readings of it"
        if self.has_temperature:
            advice = "Compare with the temperature, and with the method compensated"
        return (
            f"The bias of {channel_name(channel)} {motion}. This motion is removed from the noise"
            f"{removal_text(self.factors)}. {advice}"
        )


class TelegraphNoise(
    FindingData, affects=SLOW | {"bias"}, doubt="the bias of {channels} steps repeatedly"
):
    """The bias steps repeatedly between levels."""

    steps: int  # minimum number of steps

    def text(self, channel: str) -> str:
        return (
            f"The bias of {channel_name(channel)} steps at least {self.steps} times, as telegraph "
            "noise does. The steps remain in the noise, so B, T_B and K are doubtful. "
            "Look for a loose contact or popcorn noise of the sensor"
        )


class NoiseTrend(FindingData, code="noise_grows", affects=NONE):
    """The white noise grows or falls steadily."""

    trend: float  # N at the end divided by N at the start, minus 1
    error: float  # half width of the 95 % interval of the trend

    def text(self, channel: str) -> str:
        verb = "grows" if self.trend > 0.0 else "falls"
        return (
            f"The white noise of {channel_name(channel)} {verb} by {percent_text(abs(self.trend))} "
            f"(± {percent_text(self.error, 2)}) over the log. N is its mean over the log, and its "
            "limits contain the change. Look for a change of temperature or supply voltage"
        )
