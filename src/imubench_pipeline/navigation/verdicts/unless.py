"""Verdicts that a doubt of a unit could turn: as logged, and with the factor of the doubt.

Every noise source of a quantity in another unit is multiplied by one factor f, since all errors
are linear in it: sigma'^2 = sum of the other sources^2 + f^2 sum of its own^2. What a requirement
states, or a datasheet prints, stays. The limits keep their distance from sigma as factors: exact
where one quantity makes the error, as it does where a unit turns a verdict.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from scipy.special import ndtr

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.navigation.pooled import NORMAL_QUANTILE
from imubench_pipeline.navigation.suitability.conditions import with_sigma
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.evidence import quantity_behind
from imubench_pipeline.navigation.verdicts.standing import Standing, deciding, limit_of, standings

Factors = Mapping[str, float]  # by quantity

_UNIT_OF_FACTOR = {
    "gyro": (
        (math.radians(1.0), "°/s, and not rad/s"),
        (math.degrees(1.0), "rad/s, and not °/s"),
    ),
    "accel": (
        (STANDARD_GRAVITY, "g, and not m/s²"),
        (1.0 / STANDARD_GRAVITY, "m/s², and not g"),
        (1e-3, "mg, and not g"),
        (1e3, "g, and not mg"),
    ),
}
"""What is meant where a factor mends figures."""


@dataclass(frozen=True)
class Unless:
    """What the verdict on a sensor would be."""

    # the limit that would decide with the figures as they were logged; None: as it does
    logged: Standing | None
    mended: Standing | None  # with the factors of the doubts; None where there are none
    factors: Factors  # by quantity
    doubts: Mapping[tuple[str, str], str]  # what is doubted of each recording that is concerned


def unless(sensor: str, rows: Sequence[ErrorBudgetRow], basis: Basis) -> Unless | None:
    """Return what the verdict on a sensor would be if what is doubted were mended.

    The rows are those of one requirement, with the figures of all recordings. None where there is
    nothing to say. Where all recordings of a sensor were left out, it says what they would give as
    they were logged; else what another unit would turn.
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
    mended = deciding(standings(list(_correct_rows(own, factors)), devices)) if factors else None
    if mended is not None and not unjudged and mended.verdict == logged.verdict:
        mended = None
    if not logged.known or (mended is None and not unjudged):
        return None
    doubts = {key: basis.doubted(key) for key in (doubted or apart)}
    together = {name: f for of_recording in factors.values() for name, f in of_recording.items()}
    return Unless(logged if unjudged else None, mended, together, doubts)


def _correct_rows(
    rows: Iterable[ErrorBudgetRow], factors: Mapping[tuple[str, str], Factors]
) -> Iterator[ErrorBudgetRow]:
    """Yield rows with the figures that recordings would have in the other unit."""
    by_total: dict[tuple[Any, ...], list[ErrorBudgetRow]] = {}
    for row in rows:
        by_total.setdefault((row.sensor, row.recording, *limit_of(row)), []).append(row)
    for (sensor, recording, *_), parts in by_total.items():
        yield from scaled(parts, factors.get((sensor, recording), {}))


def scaled(parts: Sequence[ErrorBudgetRow], factors: Factors) -> list[ErrorBudgetRow]:
    """Return the rows of one error of one recording with the quantities of factors multiplied.

    They are ``total``, and its sources.
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
    within = _compute_chance_within(total.limit, sigma, lower, upper)
    return [
        replace(total, sigma=sigma, lower=lower, upper=upper, within=within, reached_after=None),
        *(replace(row, sigma=size) for row, size in sources),
        *missing,
    ]


def _compute_chance_within(
    limit: float | None, sigma: float, lower: float, upper: float
) -> float | None:
    """Return the chance that an error is within its limit, log-normal on either side."""
    if limit is None:
        return None
    away = math.log(limit / sigma)
    if away <= 0.0 and lower <= 0.0:
        return 0.5  # the limits leave it open
    side = upper / sigma if away > 0.0 else sigma / lower
    half = math.log(side)
    if half <= 0.0:
        return 1.0 if away >= 0.0 else 0.0
    return float(ndtr(NORMAL_QUANTILE * away / half))


def unless_words(alternative: Unless) -> str:
    """Return in words what the verdict would be."""
    parts = []
    if alternative.logged is not None:
        parts.append(f"as logged it {_describe_outcome(alternative.logged)}")
    if alternative.mended is not None:
        outcome = _describe_outcome(alternative.mended)
        if (
            alternative.logged is not None
            and alternative.logged.verdict == alternative.mended.verdict
        ):
            outcome = outcome.replace(alternative.mended.verdict, "does so too")
        parts.append(f"if {_describe_units(alternative.factors)}, it {outcome}")
    return "; ".join(parts)


def _describe_outcome(standing: Standing) -> str:
    if standing.verdict == "not enough data":
        reason = "" if standing.known else f" ({standing.total.reason})"
        return f"cannot be judged{reason}"
    return f"{standing.verdict} (margin {standing.margin:.3g})"


def _describe_units(factors: Factors) -> str:
    named = []
    for quantity, factor in sorted(factors.items(), reverse=True):
        name = "gyro" if quantity == "gyro" else "accelerometer"
        for size, units in _UNIT_OF_FACTOR[quantity]:
            if math.isclose(factor, size, rel_tol=1e-6):
                named.append(f"the {name} is in {units}")
                break
        else:
            times, way = (1.0 / factor, "large") if factor < 1.0 else (factor, "small")
            named.append(f"the figures of the {name} are {times:.3g} times too {way}")
    return " and ".join(named)
