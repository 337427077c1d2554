"""Expected navigation errors of a recording, and their growth: rows of two tables."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache, partial
from itertools import product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.datasheets.printed_noise import End
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.estimates import ErrorGrowthRow
from imubench_pipeline.model.states import MEASURED, Measured
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget import in_use, uncertainty
from imubench_pipeline.navigation.error_budget.budget import (
    ACCEL_ORDER,
    GYRO_ORDER,
    Start,
    budget,
    get_angle_factor,
    time_until,
)
from imubench_pipeline.navigation.error_budget.gyrocompass import Gyrocompass
from imubench_pipeline.navigation.error_budget.parts import Budget, Quantity, compute_radius_factor
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated, Uncalibrated
from imubench_pipeline.noise.model import stack_models, sum_over_stacked_terms
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.settings.requirements import DIMENSIONS, Axis, Error, Requirement
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.typing import Array
from imubench_pipeline.units import SI_UNITS, parse_difference, parse_quantity
from imubench_pipeline.words.reasons import budgets as texts

NO_FIGURES_OF_CHANNELS: Mapping[str, in_use.Figures] = MappingProxyType({})


@dataclass(frozen=True)
class AxisErrors:
    """Error sources of one axis: its noise, and figures of the errors in use."""

    model: NoiseModel = field(default_factory=NoiseModel)
    figures: in_use.Figures = field(default_factory=dict)
    # models with the median and the best of the class where the sensor prints no noise
    likely: NoiseModel | None = None
    best: NoiseModel | None = None

    def at(self, end: End) -> "AxisErrors":
        """Return the sources with the likely or best figures of the class, not the worst."""
        model = {"in_use": None, "likely": self.likely, "best": self.best}[end]
        figures = {cause: figure.at(end) for cause, figure in self.figures.items()}
        return AxisErrors(model or self.model, figures)

    @property
    def noise(self) -> "AxisErrors":
        """The same axis with its noise as the only error."""
        return AxisErrors(self.model)


_TAIL = (1.0 - 0.95) / 2.0  # probability beyond each 95 % limit

_NO_AXIS_ERRORS = AxisErrors()
_NO_ERRORS = {"gyro": _NO_AXIS_ERRORS, "accel": _NO_AXIS_ERRORS}


@dataclass(frozen=True)
class Question:
    """An error to be computed: which error, when, how it starts, and for which axis."""

    requirement: str | None  # name of the requirement; None for the standard times
    error: Error
    time: float  # s
    start: Start
    axis: Axis  # which axis of the sensor is used
    latitude: float | None = None  # rad; for ``north``
    positions: int = 1  # for ``north``
    limit: float | None = None  # largest standard deviation that fulfils the requirement, SI
    confidence: float | None = None  # of a radius; None: errors along one axis
    use: in_use.Use = in_use.NO_USE  # motion, temperature and vibration

    @property
    def needs(self) -> tuple[Measured, ...]:
        """Quantities, ``gyro`` and ``accel``, that the error depends on."""
        return ("gyro",) if self.error in ("heading", "cross_track", "north") else MEASURED

    def answer(self, gyro: AxisErrors, accel: AxisErrors) -> Budget:
        """Return the error budget for this axis of a gyro and this axis of an accelerometer."""
        if self.error == "north":
            return self._make_gyrocompass(gyro, accel).heading(self.time)
        return self._after(self.time, gyro, accel)

    def answer_all(self, gyro: AxisErrors, accel: AxisErrors) -> tuple[Budget, float, float, float]:
        """Return the budget, and totals with only noise, and with likely and best class figures."""
        likely, best = (self.answer(gyro.at(end), accel.at(end)).total for end in _OTHER_ENDS)
        noise = self.answer(gyro.noise, accel.noise).total
        return self.answer(gyro, accel), noise, likely, best

    def reached(self, gyro: AxisErrors, accel: AxisErrors) -> float | None:
        """Return the time, s, at which the limit is reached (north: time at rest), or None."""
        if self.limit is None:
            return None
        if self.error == "north":
            return self._make_gyrocompass(gyro, accel).time_needed(self.limit)
        lines = bool(gyro.model.sinusoids or accel.model.sinusoids)
        return time_until(self.limit, lambda time: self._after(time, gyro, accel), oscillates=lines)

    @property
    def confidence_in_plane(self) -> float | None:
        """The confidence, if the error is a radius; None: it is along one axis."""
        return self.confidence if self.error in ("velocity", "position") else None

    def _after(self, time: float, gyro: AxisErrors, accel: AxisErrors) -> Budget:
        along = self.along_axis(time, gyro, accel)
        radius = self.confidence_in_plane
        return along if radius is None else along.to_radius(radius)

    def along_axis(self, time: float, gyro: AxisErrors, accel: AxisErrors) -> Budget:
        """Return the budget along one axis after a time of dead reckoning, s."""
        assert self.error != "north"
        return budget(
            self.error,
            time,
            gyro=gyro.model,
            accel=accel.model,
            start=self.start,
            use=self.use,
            gyro_figures=gyro.figures,
            accel_figures=accel.figures,
        )

    def _make_gyrocompass(self, gyro: AxisErrors, accel: AxisErrors) -> Gyrocompass:
        assert self.latitude is not None  # checked with the requirement
        bias, accel_bias = (
            start.bias if isinstance(start, Uncalibrated) else None
            for start in (self.start.gyro, self.start.accel)
        )
        if self.requirement is None:  # at arbitrary times turning the gyro removes the biases
            return Gyrocompass(gyro=gyro.model, latitude=self.latitude)
        return Gyrocompass(
            gyro=gyro.model,
            accel=accel.model,
            latitude=self.latitude,
            positions=self.positions,
            bias=bias,
            accel_bias=accel_bias,
            figures=gyro.figures,
            accel_figures=accel.figures,
            temperature_change=self.use.temperature_change,
        )


_OTHER_ENDS: tuple[End, ...] = ("likely", "best")


def list_standard_questions(
    times: Sequence[float], window: float, latitude: float, axes: Sequence[Axis]
) -> Iterator[Question]:
    """Yield every error at each time, for each axis; times and window in s, latitude in rad."""
    start = Start.calibrated(window)
    quantities: tuple[Quantity, ...] = ("attitude", "heading", "velocity", "position")
    for axis in axes:
        for time in times:
            for error in quantities:
                yield Question(None, error, time, start, axis)
            yield Question(None, "north", time, start, axis, latitude)


def list_requirement_questions(name: str, requirement: Requirement) -> Iterator[Question]:
    """Yield the error to compute for each limit of a requirement in dead reckoning."""
    latitude = requirement.latitude
    if requirement.static_window is not None:
        start = Start.calibrated(parse_quantity(requirement.static_window, "time"))
    elif requirement.turn_on is not None:
        gyro, accel = requirement.turn_on.gyro, requirement.turn_on.accel
        on = partial(Uncalibrated, on_time=parse_quantity(requirement.turn_on.on_time, "time"))
        start = Start(
            gyro=on(bias=None if gyro is None else parse_quantity(gyro, "angular_rate")),
            accel=on(bias=None if accel is None else parse_quantity(accel, "acceleration")),
        )
    environment = requirement.environment
    stated = {
        "turns": (environment.turns, "angle"),
        "speed_change": (environment.speed_change, "velocity"),
        "speed": (environment.speed or environment.speed_change, "velocity"),
        "vibration": (environment.vibration, "acceleration"),
        "vibration_frequency": (environment.vibration_frequency, "frequency"),
    }
    use = {name: parse_quantity(text, of) for name, (text, of) in stated.items() if text}
    if environment.temperature_change:
        use["temperature_change"] = parse_difference(environment.temperature_change, "temperature")
    for limit in requirement.by_dead_reckoning:
        yield Question(
            name,
            limit.error,
            limit.seconds,
            start,  # a limit of dead reckoning has one
            requirement.axis,
            None if latitude is None else parse_quantity(latitude, "angle"),
            requirement.positions,
            limit.size / requirement.sigmas,
            requirement.confidence,
            in_use.Use(over=limit.seconds, **use),
        )


def list_error_rows(
    names: Mapping[str, str],
    estimates: Mapping[str, Estimate],
    questions: Iterable[Question],
    *,
    draws: int,
    seed: int,
    figures: Mapping[str, in_use.Figures] = NO_FIGURES_OF_CHANNELS,
) -> Iterator[ErrorBudgetRow]:
    """Yield the rows of the table ``error_budget`` of a recording.

    ``names`` has ``sensor`` and ``recording``. ``estimates`` has the recommended estimate of each
    channel, from which ``draws`` noise models are drawn for the interval of a total. Each channel
    has its own random stream of the seed. ``figures`` are errors other than noise, by channel, and
    by quantity for a recording without the quantity (`in_use.collect_figures_in_use`).
    """
    axes = collect_axis_errors(estimates, figures)
    without = {q: AxisErrors(figures=figures.get(q, in_use.NO_FIGURES)) for q in MEASURED}
    drawn = {
        channel: draw_axis_errors(channel, estimates[channel], errors.figures, draws, seed)
        for channel, errors in axes.items()
    }
    variances = _draw_variances(lambda channel: [one.model for one in drawn[channel]])
    for question in questions:
        unit = SI_UNITS[DIMENSIONS[question.error]]
        asked = ErrorBudgetRow.taken_from(question, **names, source="total", unit=unit)
        chosen = select_channels(question, axes)
        if chosen is None:
            missing = []
            for quantity in question.needs:
                silent = _list_channels(quantity, estimates)
                if not silent:
                    missing.append(texts.not_recorded(quantity))
                elif not _list_channels(quantity, axes):
                    missing.append(
                        texts.noise_not_known(silent, _find_reason(estimates[silent[0]]))
                    )
            yield replace(asked, reasons=tuple(missing))
            continue
        gyro, accel = chosen["gyro"], chosen["accel"]
        pair = [axes[c] if c else without[q] for q, c in chosen.items()]
        many = [drawn[c] if c else [without[q]] * draws for q, c in chosen.items()]
        nominal, noise, likely, best = question.answer_all(*pair)
        if question.error == "north":
            each = zip(*many, strict=True)
            totals = np.array([question.answer(*axes_drawn).total for axes_drawn in each])
        else:
            assert gyro is not None  # every error needs one
            totals = _compute_drawn_totals(variances(question, gyro, accel), question, pair, many)
        asked = replace(asked, gyro=gyro, accel=accel)
        lower, upper = uncertainty.compute_limits(totals, nominal.total, _TAIL)
        used = [channel for channel in chosen.values() if channel]
        apart = [channel for channel in used if estimates[channel].draws is None]
        reasons = (
            *(
                texts.parameter_status(name, channel, parameter.status)
                for channel in used
                for _, name, parameter in estimates[channel].components()
                if name not in estimates[channel].curve
                and parameter.status in ("not_identified", "at_bound")
            ),
            *(texts.independent_draws(estimates[channel].method, channel) for channel in apart),
            *(
                texts.channel_not_used(channel, _find_reason(estimate))
                for channel, estimate in estimates.items()
                if quantity_of(channel) in question.needs and not estimate.model.terms
            ),
        )
        yield replace(
            asked,
            sigma=nominal.total,
            lower=lower,
            upper=upper,
            noise=noise,
            likely=likely,
            best=best,
            drawn="one by one" if apart else "jointly",
            within=question.limit and uncertainty.compute_chance_within(question.limit, totals),
            reasons=reasons,
            reached_after=question.reached(*pair),
        )
        largest = find_largest_figures(nominal, question.limit, upper)
        for part in sorted(nominal.contributions, key=lambda part: -part.sigma):
            yield replace(
                asked,
                **asdict(part.source),
                sigma=part.sigma,
                origin=part.figure.origin if part.figure else "measured",
                largest=largest.get(part.source),
            )


def _draw_variances(
    models: Callable[[str], Sequence[NoiseModel]],
) -> Callable[[Question, str, str | None], Array]:
    """Return a function for the variance of an error from noise, for each drawn model of a channel.

    Its arguments are a question, other than ``north``, and the channels of the gyro and of the
    accelerometer; the result is in rad^2, (m/s)^2 or m^2, shape (draws,).
    """

    @cache
    def stack(channel: str) -> tuple[int, list[tuple[NDArray[np.intp], Term]]]:
        drawn = models(channel)
        return len(drawn), list(stack_models(drawn))

    @cache
    def grown(channel: str, order: int, time: float, start: Calibrated | Uncalibrated) -> Array:
        return sum_over_stacked_terms(
            *stack(channel), lambda term: np.asarray(term.growth(order, time, start))
        )

    def variance(question: Question, gyro: str, accel: str | None) -> Array:
        error, time, start = question.error, question.time, question.start
        assert error != "north"
        factor = get_angle_factor(error, question.use)
        total = factor**2 * grown(gyro, GYRO_ORDER[error], time, start.gyro)
        if error in ACCEL_ORDER and accel:
            total = total + grown(accel, ACCEL_ORDER[error], time, start.accel)
        levelled = error == "attitude" and start.tilt is None
        if levelled and accel and isinstance(start.accel, Calibrated):
            window = start.accel.window
            at_rest = grown(accel, 0, window, Uncalibrated(bias=0.0, on_time=0.0))
            total = total + at_rest / (window * STANDARD_GRAVITY) ** 2
        return total

    return variance


def _compute_drawn_totals(
    variance: Array,
    question: Question,
    pair: Sequence[AxisErrors],
    drawn: Sequence[Sequence[AxisErrors]],
) -> Array:
    """Return the totals, rad, m/s or m, of an error for each draw, shape (draws,).

    ``variance`` is from noise, shape (draws,). ``pair`` has the sources of the gyro and of the
    accelerometer, ``drawn`` draws of both; the noise models in them are not used.
    """
    gyro, accel = (
        AxisErrors(
            figures={
                cause: replace(figure, sigma=1.0) if figure.spread else figure
                for cause, figure in axis.figures.items()
            }
        )
        for axis in pair
    )
    sizes: dict[tuple[str | None, str], Array] = {
        (quantity, cause): np.array([each.figures[cause].sigma for each in draws])
        for quantity, axis, draws in zip(MEASURED, pair, drawn, strict=True)
        for cause, figure in axis.figures.items()
        if figure.spread
    }
    vectors: list[complex | NDArray[np.complexfloating]] = []
    for part in question.along_axis(question.time, gyro, accel).contributions:
        spread = part.figure is not None and part.figure.spread
        size = sizes[part.source.quantity, part.source.source] if spread else np.ones(1)
        if part.vector is None:
            variance = variance + (part.sigma * size) ** 2
        else:
            vectors.append(part.vector * size)
    planar = sum((np.abs(vector) ** 2 for vector in vectors), np.zeros(1))
    confidence = question.confidence_in_plane
    if confidence is None:
        return np.sqrt(variance + planar)
    factor = compute_radius_factor(variance, vectors, confidence)
    return factor * np.sqrt(2.0 * variance + planar)


def find_largest_figures(
    nominal: Budget, limit: float | None, upper: float
) -> dict[ErrorSource, float]:
    """Return the largest figures, SI, that meet a limit if they replace class limits.

    The variance that other sources leave below the limit is divided equally; figures are 0 if none
    is left. Sources whose class limit needs less than this share are omitted. The other sources
    include the uncertainty of the total, up to ``upper``, unless they then exceed the limit.
    """
    parts = [
        part
        for part in nominal.contributions
        if part.figure and part.figure.origin == "class limit" and part.sigma > 0.0
    ]
    if limit is None or not parts:
        return {}
    known = nominal.total**2 - math.fsum(part.sigma**2 for part in parts)
    excess = upper**2 - nominal.total**2
    if known + excess < limit**2:
        known += excess
    room = max(limit**2 - known, 0.0)
    parts.sort(key=lambda part: part.sigma)
    while parts and parts[0].sigma ** 2 <= room / len(parts):
        room -= parts.pop(0).sigma ** 2
    largest: dict[ErrorSource, float] = {}
    for part in parts:
        assert part.figure is not None  # of every limit of a class
        figure = part.figure.sigma * math.sqrt(room / len(parts)) / part.sigma
        largest[part.source] = min(figure, largest.get(part.source, math.inf))
    return largest


def collect_axis_errors(
    estimates: Mapping[str, Estimate], figures: Mapping[str, in_use.Figures]
) -> dict[str, AxisErrors]:
    """Return the error sources of axes with a noise model; axes with unknown noise are omitted."""
    return {
        channel: AxisErrors(estimate.model, figures.get(channel, in_use.NO_FIGURES))
        for channel, estimate in estimates.items()
        if estimate.model.terms
    }


def draw_axis_errors(
    channel: str, estimate: Estimate, figures: in_use.Figures, draws: int, seed: int
) -> list[AxisErrors]:
    """Draw error sources of a channel from their uncertainty; each channel has a random stream."""
    stream = partial(channel_rng, seed, repr(estimate.model), channel)
    models = uncertainty.draw_models(estimate, draws, stream("budget"))
    of_use = _draw_figures(figures, draws, stream("temperature of the budget"))
    return [AxisErrors(*pair) for pair in zip(models, of_use, strict=True)]


def select_channels(
    question: Question, axes: Mapping[str, AxisErrors]
) -> dict[Measured, str | None] | None:
    """Return the channel of each quantity, the worst or the median axis; None if one is missing."""
    chosen: dict[Measured, str | None] = {"gyro": None, "accel": None}
    # Accelerometers level a gyro for north, if they are recorded.
    for quantity in MEASURED if question.error == "north" else question.needs:
        channels = _list_channels(quantity, axes)
        if not channels and quantity in question.needs:
            return None
        if not channels:
            continue
        # Rank the axes by their own part of the error.
        parts = {
            channel: question.answer(**{**_NO_ERRORS, quantity: axes[channel]}).total
            for channel in channels
        }
        ranked = sorted(parts, key=parts.__getitem__)
        # Of two axes the median is the worse one.
        chosen[quantity] = ranked[-1] if question.axis == "worst" else ranked[len(ranked) // 2]
    return chosen


def _list_channels(quantity: str, channels: Iterable[str]) -> list[str]:
    return [channel for channel in channels if quantity_of(channel) == quantity]


def _draw_figures(
    figures: in_use.Figures, draws: int, rng: np.random.Generator
) -> list[in_use.Figures]:
    """Return draws of the figures of an axis, from the spread of measured sensors."""
    spread = {cause: figure for cause, figure in figures.items() if figure.spread}
    if not spread:
        return [figures] * draws
    normal = rng.standard_normal((draws, len(spread)))

    def moved(figure: in_use.Figure, number: float) -> in_use.Figure:
        return replace(figure, sigma=abs(figure.sigma + figure.spread * float(number)))

    return [
        {**figures, **dict(zip(spread, map(moved, spread.values(), numbers), strict=True))}
        for numbers in normal
    ]


def _find_reason(estimate: Estimate) -> str | None:
    reasons = (parameter.reason for parameter in estimate.parameters.values())
    return next((reason for reason in reasons if reason), None)


_STANDARD_TIMES = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0)
_STANDARD_WINDOWS = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0)


def list_growth_rows(
    names: Mapping[str, str],
    estimates: Mapping[str, Estimate],
    *,
    times: Iterable[float],
    window: float,
    draws: int,
    seed: int,
    figures: Mapping[str, in_use.Figures] = NO_FIGURES_OF_CHANNELS,
) -> Iterator[ErrorGrowthRow]:
    """Yield the rows of the table ``error_growth`` of a recording.

    They are for the worst axes, and for each of x, y and z if the recording has several. ``times``
    and ``window``, s, are used in addition to the default times. The other arguments are as in
    `list_error_rows`.
    """
    axes = collect_axis_errors(estimates, figures)

    def draw(channel: str) -> list[NoiseModel]:
        stream = channel_rng(seed, repr(estimates[channel].model), channel, "budget")
        return uncertainty.draw_models(estimates[channel], draws, stream)

    variances = _draw_variances(draw)
    # The candidate channels for the worst axes, and for each axis alone.
    answerers = {"worst": axes}
    letters = sorted({channel[-1] for channel in axes})
    for letter in letters if len(letters) > 1 else []:
        answerers[letter] = {name: errors for name, errors in axes.items() if name[-1] == letter}
    for axis, at_rest in product(answerers, sorted({*_STANDARD_WINDOWS, window})):
        for question in list_standard_questions(
            sorted({*_STANDARD_TIMES, *times}), at_rest, 0.0, ["worst"]
        ):
            if question.error == "north":
                continue
            chosen = select_channels(question, answerers[axis])
            if chosen is None:
                continue
            budget = question.answer(*(axes[c] if c else AxisErrors() for c in chosen.values()))
            gyro, accel = chosen["gyro"], chosen["accel"]
            assert gyro is not None  # every error needs one
            drawn = variances(question, gyro, accel)
            row = partial(
                ErrorGrowthRow,
                sensor=names["sensor"],
                recording=names["recording"],
                axis=axis,
                gyro=gyro,
                accel=accel,
                window=at_rest,
                error=question.error,
                time=question.time,
                unit=SI_UNITS[DIMENSIONS[question.error]],
            )
            sure = math.fsum(
                part.sigma**2 for part in budget.contributions if not part.source.is_noise
            )
            lower, upper = uncertainty.compute_limits(np.sqrt(drawn + sure), budget.total)
            yield row(source="total", sigma=budget.total, lower=lower, upper=upper)
            for part in sorted(budget.contributions, key=lambda one: -one.sigma):
                yield row(**asdict(part.source), sigma=part.sigma)
