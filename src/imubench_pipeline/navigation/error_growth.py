"""Growth of the errors of a recording after static windows of several lengths: rows of a table.

The errors are as in `expected_errors`, at more times and windows. The variances of all drawn
models are computed at once: separate budgets would take a thousand times as long.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import cache, partial
from itertools import product

import numpy as np

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.model.estimates import ErrorGrowthRow
from imubench_pipeline.navigation import expected_errors
from imubench_pipeline.navigation.error_budget.budget import ACCEL_ORDER, GYRO_ORDER
from imubench_pipeline.navigation.error_budget.in_use import Figures
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.growth import Calibrated, Uncalibrated
from imubench_pipeline.noise.model import sum_over_terms
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.requirements import DIMENSIONS
from imubench_pipeline.typing import Array
from imubench_pipeline.units import SI_UNITS

_STANDARD_TIMES = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0)
_STANDARD_WINDOWS = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0)
_TAIL_PROBABILITY = 0.025  # probability beyond each 95 % limit


def list_growth_rows(
    names: Mapping[str, str],
    estimates: Mapping[str, Estimate],
    *,
    times: Iterable[float],
    window: float,
    draws: int,
    seed: int,
    figures: Mapping[str, Figures] = expected_errors.NO_FIGURES_OF_CHANNELS,
) -> Iterator[ErrorGrowthRow]:
    """Yield the rows of the table ``error_growth`` of a recording.

    They are for its worst axes, and if it has several, for each letter alone. ``times`` and
    ``window``, s, are used in addition to the default times; the others are as in
    `expected_errors.error_rows`.
    """
    axes = expected_errors.collect_axis_errors(estimates, figures)

    @cache
    def models(channel: str) -> Sequence[NoiseModel]:
        stream = channel_rng(seed, repr(estimates[channel].model), channel, "budget")
        return draw_models(estimates[channel], draws, stream)

    @cache
    def grown(channel: str, order: int, time: float, start: Calibrated | Uncalibrated) -> Array:
        return sum_over_terms(
            models(channel), lambda term: np.asarray(term.growth(order, time, start))
        )

    def noise(error: str, time: float, start: Calibrated, gyro: str, accel: str | None) -> Array:
        """Return the variances of an error from noise, shape (draws,)."""
        order = GYRO_ORDER[error]  # type: ignore[index]  # north is not asked for
        gravity = STANDARD_GRAVITY if order else 1.0
        total = gravity**2 * grown(gyro, order, time, start)
        if error in ACCEL_ORDER and accel:
            total = total + grown(accel, ACCEL_ORDER[error], time, start)
        if error == "attitude" and accel:
            at_rest = grown(accel, 0, start.window, Uncalibrated(bias=0.0, on_time=0.0))
            total = total + at_rest / (start.window * STANDARD_GRAVITY) ** 2
        return total

    # The candidate channels for the worst axes, and for each axis alone.
    answerers = {"worst": axes}
    letters = sorted({channel[-1] for channel in axes})
    for letter in letters if len(letters) > 1 else []:
        answerers[letter] = {name: errors for name, errors in axes.items() if name[-1] == letter}
    for axis, at_rest in product(answerers, sorted({*_STANDARD_WINDOWS, window})):
        for question in expected_errors.list_standard_questions(
            sorted({*_STANDARD_TIMES, *times}), at_rest, 0.0, ["worst"]
        ):
            if question.error == "north":
                continue
            chosen = expected_errors.select_channels(question, answerers[axis])
            if chosen is None:
                continue
            budget = question.answer(
                *(axes[c] if c else expected_errors.AxisErrors() for c in chosen.values())
            )
            gyro, accel = chosen["gyro"], chosen["accel"]
            assert gyro is not None  # every error needs one
            drawn = noise(question.error, question.time, Calibrated(at_rest), gyro, accel)
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
            ends = np.quantile(np.sqrt(drawn + sure), [_TAIL_PROBABILITY, 1.0 - _TAIL_PROBABILITY])
            # Draws of an absent term are above 0: extend the limits to the value.
            lower, upper = min(float(ends[0]), budget.total), max(float(ends[1]), budget.total)
            yield row(source="total", sigma=budget.total, lower=lower, upper=upper)
            for part in sorted(budget.contributions, key=lambda one: -one.sigma):
                yield row(**asdict(part.source), sigma=part.sigma)
