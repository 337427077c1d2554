"""Errors at the end of outages of GNSS as rows of the table ``error_budget``, to be judged.

Of a sensor the filter counts that is tuned by the recommended estimate, on simulated signals.
Errors are those of one axis: in the plane a root mean square is over sqrt(2).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from scipy.special import ndtr

from imubench_pipeline.navigation.pooled import NORMAL
from imubench_pipeline.settings.requirements import DIMENSIONS, Limit, Requirement
from imubench_pipeline.typing import Row
from imubench_pipeline.units import SI_UNITS

_AXES = {"position": math.sqrt(2.0), "velocity": math.sqrt(2.0), "heading": 1.0}

_MEANT = "simulated drives; the limits are those of the runs, not of the estimate"


def outage_rows(
    navigation: Iterable[Row],
    recordings: Iterable[Row],
    requirements: Mapping[str, Requirement],
) -> Iterator[Row]:
    """Yield the rows of the limits that are about outages, of every sensor with static recordings.

    Of the tables ``navigation`` and ``recordings``. A sensor without such a run has no figure.
    """
    runs: dict[tuple[Any, ...], Row] = {}
    for row in navigation:
        if row["recommended"] and row["signals"] != "log" and row["position"] is not None:
            runs[row["sensor"], row["trajectory"], row["outage"]] = row
    of_sensors: dict[str, Row] = {}
    for row in recordings:
        if row["status"] == "ok" and row["kind"] == "static":
            of_sensors.setdefault(row["sensor"], row)
    for name, requirement in requirements.items():
        for limit in requirement.in_outages:
            for sensor, about in of_sensors.items():
                found = runs.get((sensor, limit.trajectory, limit.seconds))
                yield _row(name, requirement, limit, found or about, found)


def _row(
    name: str, requirement: Requirement, limit: Limit, about: Row, run: Row | None
) -> dict[str, Any]:
    allowed = limit.size / requirement.sigmas
    row: dict[str, Any] = {
        "sensor": about["sensor"],
        "recording": about["recording"],
        "requirement": name,
        "axis": requirement.axis,
        "gyro": None,
        "accel": None,
        "error": limit.error,
        "time": limit.seconds,
        "trajectory": limit.trajectory,
        "source": "total",
        "limit": allowed,
        "unit": SI_UNITS[DIMENSIONS[limit.error]],
        "sigma": None,
        "lower": None,
        "upper": None,
        "within": None,
        "reached_after": None,
        "reason": "no filter was run for this sensor (setting navigate: of)",
    }
    if run is None:
        return row
    if run["consistent"] is False:
        inside = 100.0 * run["nees_inside"]
        reason = (
            f"the filter of this sensor goes astray: NEES is inside in {inside:.0f} % instead of 95"
        )
        return row | {"reason": reason}
    sigma, lower, upper = (
        run[f"{limit.error}{end}"] / _AXES[limit.error] for end in ("", "_lower", "_upper")
    )
    spread = math.log(upper / lower) / (2.0 * NORMAL)
    assumed = f"; assumed: {run['assumed']}" if run["assumed"] else ""
    return row | {
        "sigma": sigma,
        "lower": lower,
        "upper": upper,
        "within": float(ndtr(math.log(allowed / sigma) / spread)),
        "reason": _MEANT + assumed,
    }
