"""What the estimates of a recording mean: rows of the table ``error_budget``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from imubench_pipeline.error_budget import (
    Budget,
    Gyrocompass,
    Quantity,
    Start,
    budget,
    chance_within,
    draw_models,
    drawn_jointly,
    interval,
    time_until,
)
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.requirements import DIMENSIONS, Axis, Error, Requirement
from imubench_pipeline.sensor import quantity_of
from imubench_pipeline.simulate import channel_rng
from imubench_pipeline.units import SI_UNITS, quantity_to_si

Row = Mapping[str, Any]

_NOTHING = NoiseModel()
_NAMES = {"gyro": "gyro", "accel": "accelerometer"}


@dataclass(frozen=True)
class Question:
    """One error that is asked for.

    Attributes
    ----------
    requirement : str or None
        Name of the requirement; None for the times that are always given.
    error : str
    time : float
        s.
    start : Start
    axis : str
        Which axis of the sensor answers.
    latitude : float or None
        rad; for ``north``.
    limit : float or None
        Largest standard deviation that fulfils the requirement, SI.
    """

    requirement: str | None
    error: Error
    time: float
    start: Start
    axis: Axis
    latitude: float | None = None
    limit: float | None = None

    @property
    def needs(self) -> tuple[str, ...]:
        """The quantities that it takes to answer."""
        return ("gyro",) if self.error in ("heading", "north") else ("gyro", "accel")

    def answer(self, gyro: NoiseModel, accel: NoiseModel) -> Budget:
        """Return the budget with these axes."""
        if self.error == "north":
            return self._compass(gyro).heading(self.time)
        return budget(self.error, self.time, gyro=gyro, accel=accel, start=self.start)

    def reached(self, gyro: NoiseModel, accel: NoiseModel) -> float | None:
        """Return after which time the limit is reached, s; for north, the rest that it takes."""
        if self.limit is None:
            return None
        if self.error == "north":
            return self._compass(gyro).time_needed(self.limit)
        return time_until(self.limit, self.error, gyro=gyro, accel=accel, start=self.start)

    def _compass(self, gyro: NoiseModel) -> Gyrocompass:
        assert self.latitude is not None  # checked with the requirement
        return Gyrocompass(gyro=gyro, latitude=self.latitude)


def standard(
    times: Sequence[float], window: float, latitude: float, axes: Sequence[Axis]
) -> Iterator[Question]:
    """Yield the questions that every recording answers.

    Parameters
    ----------
    times : sequence of float
        s.
    window : float
        Static window before, s.
    latitude : float
        rad.
    axes : sequence of str
    """
    start = Start.calibrated(window)
    quantities: tuple[Quantity, ...] = ("attitude", "heading", "velocity", "position")
    for axis in axes:
        for time in times:
            for error in quantities:
                yield Question(None, error, time, start, axis)
            yield Question(None, "north", time, start, axis, latitude)


def of_requirement(name: str, requirement: Requirement) -> Iterator[Question]:
    """Yield the questions of a requirement."""
    latitude = requirement.latitude and quantity_to_si(requirement.latitude, "angle")
    for limit in requirement.limits:
        yield Question(
            name,
            limit.error,
            limit.seconds,
            start_of(requirement),
            requirement.axis,
            latitude if isinstance(latitude, float) else None,
            limit.size / requirement.sigmas,
        )


def start_of(requirement: Requirement) -> Start:
    """Return how dead reckoning begins in an application."""
    if requirement.static_window is not None:
        return Start.calibrated(quantity_to_si(requirement.static_window, "time"))
    assert requirement.turn_on is not None  # checked with the requirement
    return Start.uncalibrated(
        gyro_bias=quantity_to_si(requirement.turn_on.gyro, "angular_rate"),
        accel_bias=quantity_to_si(requirement.turn_on.accel, "acceleration"),
        on_time=quantity_to_si(requirement.turn_on.on_time, "time"),
    )


def error_rows(
    names: Mapping[str, str],
    estimates: Mapping[str, Estimate],
    questions: Iterable[Question],
    *,
    draws: int,
    seed: int,
) -> Iterator[Row]:
    """Yield the rows of the table ``error_budget`` of a recording.

    Parameters
    ----------
    names : mapping of str to str
        ``sensor`` and ``recording``.
    estimates : mapping of str to Estimate
        The recommended one of each channel.
    questions : iterable of Question
    draws : int
        Noise models drawn from what each log leaves open; they give the interval of a total.
    seed : int
        Of the run; each channel has a stream of its own.
    """
    # Of a log too short for any estimate nothing is known: that is not a sensor without noise.
    known = {channel: estimate for channel, estimate in estimates.items() if estimate.model.terms}
    drawn = {
        channel: draw_models(estimate, draws, channel_rng(seed, *names.values(), channel, "budget"))
        for channel, estimate in known.items()
    }
    for question in questions:
        asked: dict[str, Any] = {
            **names,
            "requirement": question.requirement,
            "axis": question.axis,
            "error": question.error,
            "time": question.time,
            "limit": question.limit,
            "unit": SI_UNITS[DIMENSIONS[question.error]],
        }
        missing = [
            _missing(quantity, estimates)
            for quantity in question.needs
            if not any(quantity_of(channel) == quantity for channel in known)
        ]
        if missing:
            yield asked | {"source": "total", "reason": "; ".join(missing)}
            continue
        chosen = {
            quantity: _axis(question, quantity, known) if quantity in question.needs else None
            for quantity in ("gyro", "accel")
        }
        models = [estimates[c].model if c else _NOTHING for c in chosen.values()]
        many = [drawn[c] if c else [_NOTHING] * draws for c in chosen.values()]
        found = question.answer(*models)
        budgets = [question.answer(*pair) for pair in zip(*many, strict=True)]
        lower, upper = interval(budgets)
        apart = [c for c in chosen.values() if c and not drawn_jointly(estimates[c])]
        yield (
            asked
            | chosen
            | {
                "source": "total",
                "sigma": found.total,
                # The draws of what is absent lie above it: the value itself is inside.
                "lower": min(lower, found.total),
                "upper": max(upper, found.total),
                "drawn": "one by one" if apart else "jointly",
                "within": question.limit and chance_within(question.limit, budgets),
                "reached_after": question.reached(*models),
                "reason": "; ".join(
                    [
                        *found.assumptions,
                        *_doubts(chosen, estimates),
                        *_apart(apart, estimates),
                        *_unknown(question, estimates),
                    ]
                )
                or None,
            }
        )
        for contribution in sorted(found.contributions, key=lambda one: -one.sigma):
            yield asked | chosen | {"source": contribution.source, "sigma": contribution.sigma}


def _missing(quantity: str, estimates: Mapping[str, Estimate]) -> str:
    """Return why there is no noise of a quantity to answer with."""
    silent = [channel for channel in estimates if quantity_of(channel) == quantity]
    if not silent:
        return f"no {_NAMES[quantity]} in the recording"
    return f"nothing is known of the noise of {', '.join(silent)}: {_why(estimates[silent[0]])}"


def _unknown(question: Question, estimates: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield the axes that could not answer."""
    for channel, estimate in estimates.items():
        if quantity_of(channel) in question.needs and not estimate.model.terms:
            yield f"{channel} does not count: nothing is known of its noise ({_why(estimate)})"


def _why(estimate: Estimate) -> str:
    reasons = (parameter.reason for parameter in estimate.parameters.values())
    return next((reason for reason in reasons if reason), "its log does not show it")


def _axis(question: Question, quantity: str, estimates: Mapping[str, Estimate]) -> str:
    """Return the channel of a quantity whose own part of the error is the worst, or the median."""

    def part(channel: str) -> float:
        model = estimates[channel].model
        pair = (model, _NOTHING) if quantity == "gyro" else (_NOTHING, model)
        return question.answer(*pair).total

    ranked = sorted((c for c in estimates if quantity_of(c) == quantity), key=part)
    # Of two axes the median is the worse one.
    return ranked[-1] if question.axis == "worst" else ranked[len(ranked) // 2]


def _apart(channels: Sequence[str], estimates: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield the channels of which only limits of single parameters are known."""
    for channel in channels:
        yield (
            f"method {estimates[channel].method} tells the parameters of {channel} one by one: "
            "the interval is too wide where they trade off"
        )


def _doubts(chosen: Mapping[str, str | None], estimates: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield the parameters that the logs do not tell."""
    for channel in chosen.values():
        for _, name, parameter in estimates[channel].components() if channel else ():
            if parameter.status in ("not_identified", "at_bound"):
                yield f"{name} of {channel} is {parameter.status.replace('_', ' ')}"
