"""Verdicts that a doubtful unit could change: as logged, and with the corrected unit.

Another unit multiplies each noise source of a quantity by one factor; figures from a requirement or
a datasheet do not change. The ratios of the limits to sigma are kept, which is exact if one
quantity dominates the error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from scipy.special import ndtr

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.navigation.pooled import NORMAL_QUANTILE
from imubench_pipeline.navigation.suitability.conditions import with_sigma
from imubench_pipeline.navigation.verdicts.basis import Basis, Key
from imubench_pipeline.navigation.verdicts.evidence import quantity_behind
from imubench_pipeline.navigation.verdicts.standing import Standing, deciding, limit_of, standings

Factors = Mapping[str, float]  # by quantity


@dataclass(frozen=True)
class Unless:
    """Alternative verdict on a sensor."""

    # the deciding limit with the figures as logged; None if it is the present one
    logged: Standing | None
    corrected: Standing | None  # with corrected units; None if there is no correction
    factors: Factors  # by quantity
    doubts: Mapping[Key, tuple[DoubtMark, ...]]  # by sensor and recording


def unless(sensor: str, rows: Sequence[ErrorBudgetRow], basis: Basis) -> Unless | None:
    """Return the verdict on a sensor with doubtful units corrected.

    The rows are those of one requirement. None without a figure, or if the verdict would not
    change. If all recordings were left out, the verdict from their figures as logged is returned
    too.
    """
    keys = list(dict.fromkeys((sensor, row.recording) for row in rows))
    apart = [key for key in keys if key in basis.apart]
    unjudged = len(apart) == len(keys) and bool(keys)
    doubted = [key for key in keys if basis.factors(key) and (unjudged or key not in apart)]
    if not unjudged and not doubted:
        return None
    own = [row for row in rows if unjudged or (sensor, row.recording) not in apart]
    devices = {name: basis.device((of, name)) for of, name in keys}
    logged = deciding(standings(own, devices))
    factors = {key: basis.factors(key) for key in doubted}
    corrected = None
    if factors:
        by_total: dict[tuple[str, tuple[Any, ...]], list[ErrorBudgetRow]] = {}
        for row in own:
            by_total.setdefault((row.recording, limit_of(row)), []).append(row)
        in_other_unit = [
            row
            for (recording, _), parts in by_total.items()
            for row in scaled(parts, factors.get((sensor, recording), {}))
        ]
        corrected = deciding(standings(in_other_unit, devices))
    if corrected is not None and not unjudged and corrected.verdict == logged.verdict:
        corrected = None
    if not logged.known or (corrected is None and not unjudged):
        return None
    doubts = {key: basis.doubted(key) for key in (doubted or apart)}
    together = {name: f for of_recording in factors.values() for name, f in of_recording.items()}
    return Unless(logged if unjudged else None, corrected, together, doubts)


def scaled(parts: Sequence[ErrorBudgetRow], factors: Factors) -> list[ErrorBudgetRow]:
    """Return the rows of one error of one recording, with quantities multiplied by factors.

    The rows are ``total`` and its sources.
    """
    own = [row for row in parts if row.source != "total"]
    sources = [
        (row, factors.get(quantity_behind(row.source) or "", 1.0) * sigma)
        for row, sigma in with_sigma(own)
    ]
    missing = [row for row in own if row.sigma is None]
    (total,) = (row for row in parts if row.source == "total")
    if not total.sigma or not sources or total.lower is None or total.upper is None:
        return list(parts)
    sigma = math.hypot(*(size for _, size in sources))
    by = sigma / total.sigma
    lower, upper = by * total.lower, by * total.upper
    within = None
    if total.limit is not None:
        # The error is log-normal on either side; without a lower limit, either is possible.
        away = math.log(total.limit / sigma)
        if away <= 0.0 and lower <= 0.0:
            within = 0.5
        elif (half := math.log(upper / sigma if away > 0.0 else sigma / lower)) > 0.0:
            within = float(ndtr(NORMAL_QUANTILE * away / half))
        else:
            within = 1.0 if away >= 0.0 else 0.0
    return [
        replace(total, sigma=sigma, lower=lower, upper=upper, within=within, reached_after=None),
        *(replace(row, sigma=size) for row, size in sources),
        *missing,
    ]
