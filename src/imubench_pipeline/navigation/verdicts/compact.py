"""Pack requirements and the models of sensors, for judgements in a browser.

`report/static/requirement.js` reads them. Noise models are drawn as for the table ``error_budget``.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.model.states import Cause
from imubench_pipeline.navigation import suitability
from imubench_pipeline.navigation.error_budget import in_use
from imubench_pipeline.navigation.error_budget.parts import tabulate_radii
from imubench_pipeline.navigation.expected_errors import (
    AxisErrors,
    collect_axis_errors,
    draw_axis_errors,
    list_requirement_questions,
)
from imubench_pipeline.noise import GaussMarkov
from imubench_pipeline.noise.growth import Calibrated
from imubench_pipeline.noise.model import stack_models
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import quantity_of

MAX_RECORDINGS = 20
"""Maximum number of packed recordings of a sensor; of more, they are evenly selected."""

_MIN_DRAWS = 100
_MAX_DRAWN = 800  # maximum number of drawn models of all recordings of a sensor, or `_MIN_DRAWS`

Packed = dict[str, Any]
"""Plain values, SI."""


def pack_requirement(name: str, requirement: Requirement) -> Packed | None:
    """Return a requirement as plain values; None if it has limits in outages or for north."""
    questions = list(list_requirement_questions(name, requirement))
    if requirement.in_outages or any(question.error == "north" for question in questions):
        return None
    start, use = questions[0].start, asdict(questions[0].use)
    if isinstance(start.gyro, Calibrated):
        packed_start: Packed = {"window": start.gyro.window}
    else:
        biases = {"gyro": start.gyro.bias, "accel": getattr(start.accel, "bias", None)}
        packed_start = {"on": start.gyro.on_time, **biases}
    return {
        "name": name,
        "title": requirement.title,
        "axis": requirement.axis,
        "sigmas": requirement.sigmas,
        "start": packed_start,
        "use": {key: value for key, value in use.items() if key != "over"},
        "limits": [
            {"error": limit.error, "time": limit.seconds, "at_most": limit.size}
            for limit in requirement.limits
        ],
        "radii": tabulate_radii(requirement.confidence)[1].tolist(),
    }


def pack_demands(
    requirement: Requirement, price_class: str | None, has: suitability.Abilities
) -> Packed:
    """Return whether a sensor is excluded, and the number of its unknown properties."""
    lacking, unknown = suitability.judge(requirement, has)
    return {
        "excluded": bool(lacking) or not requirement.admits(price_class),
        "unknown": len(unknown),
    }


def select_recordings(recordings: Sequence[Any]) -> tuple[Sequence[Any], int | None]:
    """Return the recordings to pack, and the maximum number of draws of each; None: all."""
    count = len(recordings)
    if count > MAX_RECORDINGS:
        recordings = [recordings[i * count // MAX_RECORDINGS] for i in range(MAX_RECORDINGS)]
    return recordings, max(_MIN_DRAWS, _MAX_DRAWN // count) if count > 1 else None


def pack_channels(
    estimates: Mapping[str, Estimate],
    figures: Mapping[str, in_use.Figures],
    *,
    draws: int,
    seed: int,
    most: int | None = None,
) -> list[Packed]:
    """Return channels as plain values, with ``most`` draws at most (see `list_error_rows`)."""
    packed = []

    def pack_figure(cause: Cause, every: Sequence[AxisErrors]) -> list[Any]:
        figure = every[0].figures[cause]
        packed = [figure.sigma, figure.likely, figure.best, figure.origin == "class limit"]
        drawn = _round(errors.figures[cause].sigma for errors in every[1:])
        return [*packed, drawn] if figure.spread else packed

    for channel, nominal in collect_axis_errors(estimates, figures).items():
        drawn = draw_axis_errors(channel, estimates[channel], nominal.figures, draws, seed)
        every = [nominal, *drawn[:: max(1, draws // (most or draws))]]
        packed.append(
            {
                "quantity": quantity_of(channel),
                "size": len(every),
                "terms": _pack_terms(every),
                "figures": {cause: pack_figure(cause, every) for cause in nominal.figures},
            }
        )
    return packed


def _pack_terms(every: Sequence[AxisErrors]) -> list[list[Any]]:
    """Return symbol and parameters of each term over all models, 0 where one does not have it."""
    packed = []
    for places, term in stack_models([errors.model for errors in every]):
        values = np.zeros((len(term.parameters), len(every)))
        values[1:] = 1.0 if isinstance(term, GaussMarkov) else 0.0
        values[:, places] = list(term.values.values())
        packed.append([term.symbol, *map(_round, values.tolist())])
    return packed


def _round(values: Iterable[float]) -> list[float]:
    return [float(f"{value:.5g}") for value in values]
