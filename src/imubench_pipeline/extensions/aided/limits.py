"""Errors at the end of GNSS outages, as rows of the table ``error_budget`` for the verdicts.

For each sensor, the filter that is tuned by its recommended estimate is used, on simulated signals.
Errors are per axis: a root mean square in the plane is divided by sqrt(2).
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import pyarrow as pa
from scipy.special import ndtr

from imubench_pipeline.extensions.aided.tables import NavigationRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.pooled import NORMAL_QUANTILE
from imubench_pipeline.navigation.verdicts.standing import OutageErrorRow
from imubench_pipeline.settings.requirements import DIMENSIONS, Limit, Requirement
from imubench_pipeline.units import SI_UNITS

_AXIS_FACTORS = {"position": math.sqrt(2.0), "velocity": math.sqrt(2.0), "heading": 1.0}


def yield_outage_rows(
    navigation: pa.Table,
    recordings: Iterable[RecordingRow],
    requirements: Mapping[str, Requirement],
) -> Iterator[OutageErrorRow]:
    """Yield a row for each limit in outages and each sensor with static recordings."""
    runs: dict[tuple[Any, ...], NavigationRow] = {}
    for row in NavigationRow.rows_of(navigation):
        if row.recommended and row.signals != "log" and row.position is not None:
            runs[row.sensor, row.trajectory, row.outage] = row
    of_sensors: dict[str, RecordingRow] = {}
    for recording in recordings:
        if recording.status == "ok" and recording.kind == "static":
            of_sensors.setdefault(recording.sensor, recording)
    for name, requirement in requirements.items():
        for limit in requirement.in_outages:
            for sensor, about in of_sensors.items():
                run = runs.get((sensor, limit.trajectory, limit.seconds), about)
                yield _make_row(name, requirement, limit, run)


def _make_row(
    name: str, requirement: Requirement, limit: Limit, run: NavigationRow | RecordingRow
) -> OutageErrorRow:
    allowed = limit.size / requirement.sigmas
    unknown = OutageErrorRow(
        sensor=run.sensor,
        recording=run.recording,
        requirement=name,
        axis=requirement.axis,
        error=limit.error,
        time=limit.seconds,
        trajectory=limit.trajectory,
        source="total",
        limit=allowed,
        unit=SI_UNITS[DIMENSIONS[limit.error]],
        reasons=("no filter was run for this sensor (setting navigate: of)",),
    )
    if isinstance(run, RecordingRow):
        return unknown
    if run.consistent is False:
        inside = 100.0 * (run.nees_inside or 0.0)
        reason = (
            f"the filter of this sensor is inconsistent: NEES is inside its bounds in {inside:.0f} "
            "% instead of 95"
        )
        return replace(unknown, reasons=(reason,))
    found = [getattr(run, f"{limit.error}{end}") for end in ("", "_lower", "_upper")]
    if None in found:
        return replace(unknown, reasons=(f"the runs do not tell the error of the {limit.error}",))
    sigma, lower, upper = (size / _AXIS_FACTORS[limit.error] for size in found)
    spread = math.log(upper / lower) / (2.0 * NORMAL_QUANTILE)
    reason = "simulated drives; the limits are from the scatter of the runs, not from the estimate"
    return replace(
        unknown,
        sigma=sigma,
        lower=lower,
        upper=upper,
        within=float(ndtr(math.log(allowed / sigma) / spread)),
        reasons=(reason + (f"; assumed: {run.assumed}" if run.assumed else ""),),
    )
