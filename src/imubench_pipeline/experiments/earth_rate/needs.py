"""What a gyro needs to find the Earth's rate and north: rows of the table of predictions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.experiments.earth_rate.prediction import Outlook

Row = dict[str, Any]

_POINTS = 60
"""Numbers of turns on the curve over time."""

_MOST_TURNS = 20_000
"""The curve over time goes no further; what is needed is found beyond."""


def prediction_rows(
    outlook: Outlook, dwell: float, goals: Sequence[float], run_time: float
) -> Iterator[Row]:
    """Yield the rows of the table ``earth_rate_prediction``, without the names.

    Parameters
    ----------
    outlook : Outlook
    dwell : float
        Data in each dwell, s.
    goals : sequence of float
        Standard deviations that are wanted, relative to the Earth's rate.
    run_time : float
        For which the best dwell is sought, s.

    Raises
    ------
    ValueError
        If the run time does not hold two dwells and a turn.
    """
    for row in _rows(outlook, dwell, goals, run_time):
        yield {"latitude": outlook.latitude, **row}


def _rows(outlook: Outlook, dwell: float, goals: Sequence[float], run_time: float) -> Iterator[Row]:
    most = 1
    for goal in sorted(goals, reverse=True):
        turns = outlook.turns_needed(dwell, goal)
        most = max(most, turns)
        time = (turns + 1) * dwell + turns * outlook.turning
        # What is reached: the last turn that is needed may give far more than was asked for.
        sigma = outlook.sigma_after(dwell, turns)
        yield {"of": "goal", "goal": goal} | _row(dwell, turns, time, sigma)
    course = outlook.against_time(dwell, min(max(most, 2), _MOST_TURNS))
    shown = np.unique(np.rint(np.geomspace(1, len(course.turns), _POINTS)).astype(np.int64)) - 1
    for k in shown.tolist():
        point = int(course.turns[k]), float(course.time[k]), float(course.sigma[k])
        yield {"of": "time"} | _row(dwell, *point)
    curve = outlook.over_dwell(run_time)
    low, high = curve.nearly_best()
    for k, number in enumerate(curve.dwells.tolist()):
        length = float(curve.dwell[k])
        yield (
            {"of": "dwell", "best": k == curve.best, "nearly_best": low <= length <= high}
            | _row(length, number - 1, run_time, float(curve.sigma[k]))
        )


def _row(dwell: float, turns: int, time: float, sigma: float) -> Row:
    known = sigma if math.isfinite(sigma) else None
    relative = None if known is None else known / EARTH_RATE
    # The heading that a gyro across north finds is off by sigma cos(latitude) over what it would
    # see of the Earth's rate, w_ie cos(latitude): `Outlook.heading`.
    return {
        "dwell": dwell,
        "turns": turns,
        "time": time,
        "sigma": known,
        "relative": relative,
        "heading": relative,
    }
