"""Which sensor fulfils which requirement: rows of the table ``ranking``."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from imubench_pipeline.fitness import left_out
from imubench_pipeline.requirements import Requirement
from imubench_pipeline.suitability.abilities import Abilities
from imubench_pipeline.suitability.conditions import (
    Rests,
    is_condition,
    named,
    once_calibrated,
    parts_of,
)

Row = Mapping[str, Any]

_SURE = 0.975
"""Chance from which a verdict is sure."""

_NOTHING = {"sigma": None, "lower": None, "upper": None, "within": None, "reached_after": None}
"""What is known from a recording that does not decide."""

_WORST_FIRST = (
    "surely fails",
    "probably fails",
    "not enough data",
    "probably passes",
    "passes",
)

_VAGUE = 4.0
"""Upper over lower limit of an error beyond which the logs say too little."""


@dataclass(frozen=True)
class Standing:
    """What a sensor makes of one limit of a requirement.

    Attributes
    ----------
    total : mapping
        Row ``total`` of the table ``error_budget`` of the recording that answers.
    source : str or None
        The largest contribution.
    share : float or None
        Its part of the variance.
    parts : str or None
        All sources that count.
    conditions : tuple of mapping
        Rows of sources whose figure is not known, or breaks the limit until it is calibrated.
    """

    total: Row
    source: str | None = None
    share: float | None = None
    parts: str | None = None
    conditions: tuple[Row, ...] = ()

    @property
    def known(self) -> bool:
        """Whether there is a figure."""
        return self.total["sigma"] is not None

    @property
    def margin(self) -> float:
        """How many times the error fits into the limit."""
        return _over(self.total["limit"], self.total["sigma"])

    @property
    def margins(self) -> tuple[float, float]:
        """95 % limits of the margin."""
        limit = self.total["limit"]
        return _over(limit, self.total["upper"]), _over(limit, self.total["lower"])

    @property
    def chance(self) -> float:
        """Chance that the error is within its limit, over the noise models that the log allows."""
        return float(self.total["within"])

    @property
    def verdict(self) -> str:
        """The chance in words."""
        if not self.known:
            return "not enough data"
        low, high = self.margins
        vague = low <= 0.0 or high / low > _VAGUE
        if vague and 1.0 - _SURE < self.chance < _SURE:
            return "not enough data"
        for least, words in ((_SURE, "passes"), (0.5, "probably passes")):
            if self.chance >= least:
                return words
        return "probably fails" if self.chance > 1.0 - _SURE else "surely fails"


def ranking_rows(
    errors: Iterable[Row],
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Mapping[str, Any]],
    recordings: Iterable[Row] = (),
) -> Iterator[Row]:
    """Rank the sensors for each requirement.

    A sensor stands where its limit with the least margin stands. Its rank is one more than the
    number of sensors that are surely better, whose interval lies wholly above its own: sensors
    with overlapping intervals are tied. One with a figure that is not known is surely better than
    another only where that of the other is not known, too.

    Parameters
    ----------
    errors : iterable of mapping
        Rows of the table ``error_budget``.
    requirements : mapping of str to Requirement
    sensors : mapping of str to mapping
        ``price_class`` of each sensor, and its ``abilities``, where known.
    recordings : iterable of mapping
        Rows of the table ``recordings``: those that do not decide are left out.

    Yields
    ------
    mapping
        One a requirement, sensor and limit.
    """
    about = {(row["sensor"], row["recording"]): row for row in recordings}
    apart = left_out(about.values())
    by_requirement = defaultdict(list)
    for row in errors:
        key = row["sensor"], row["recording"]
        by_requirement[row["requirement"]].append(
            row if key not in apart else {**row, **_NOTHING, "reason": apart[key]}
        )
    for name, requirement in requirements.items():
        standings = _standings(by_requirement[name], requirement)
        deciding = {sensor: _deciding(found) for sensor, found in standings.items()}
        rests = {
            sensor: Rests.of(
                requirement.must,
                Abilities.model_validate(sensors[sensor].get("abilities", {})),
                [row for standing in found for row in standing.conditions],
            )
            for sensor, found in standings.items()
        }
        ranked = {
            sensor: one
            for sensor, one in deciding.items()
            if one.known
            and requirement.admits(sensors[sensor]["price_class"])
            and not rests[sensor].lacking
        }
        for sensor, found in standings.items():
            one = deciding[sensor]
            rank, tied = _rank(sensor, ranked, rests) if sensor in ranked else (None, [])
            price_class = sensors[sensor]["price_class"]
            outside = None if requirement.admits(price_class) else "outside the price class"
            if outside and price_class is None:
                outside = "price class not stated"
            verdict, conditions = rests[sensor].verdict(_overall(found, one))
            for standing in found:
                yield {
                    "requirement": name,
                    "sensor": sensor,
                    "rank": rank,
                    "tied_with": ", ".join(tied) or None,
                    "verdict": outside or verdict,
                    "conditions": None if outside else conditions,
                    "confidence": requirement.confidence,
                    "at_most": standing.total["limit"] * requirement.sigmas,
                    "decides": standing is one,
                    **_limit_row(standing),
                    "doubts": about.get((sensor, standing.total["recording"]), {}).get(
                        "doubts", ""
                    ),
                    "left_out": "; ".join(
                        reason for (of, _), reason in apart.items() if of == sensor
                    )
                    or None,
                }


def _limit_row(standing: Standing) -> Row:
    total = standing.total
    known = standing.known
    return {
        **{
            key: total[key]
            for key in ("recording", "error", "time", "limit", "sigma", "lower", "upper", "unit")
        },
        "margin": standing.margin if known else None,
        "chance": standing.chance if known else None,
        "limit_verdict": standing.verdict,
        "source": standing.source,
        "share": standing.share,
        "parts": standing.parts,
        "reached_after": total["reached_after"],
        "reason": total["reason"],
    }


def _standings(rows: list[Row], requirement: Requirement) -> dict[str, list[Standing]]:
    """Return how each sensor stands to each limit, by the recording that answers."""
    found: dict[str, list[Standing]] = {}
    for sensor in dict.fromkeys(row["sensor"] for row in rows):
        own = [row for row in rows if row["sensor"] == sensor]
        standings = []
        for key in dict.fromkeys((row["error"], row["time"], row["limit"]) for row in own):
            parts = [row for row in own if (row["error"], row["time"], row["limit"]) == key]
            totals = [row for row in parts if row["source"] == "total"]
            known = sorted(
                (row for row in totals if row["sigma"] is not None), key=lambda row: row["sigma"]
            )
            if not known:
                standings.append(Standing(totals[0]))
                continue
            total = known[-1] if requirement.axis == "worst" else known[len(known) // 2]
            own_parts = [
                row
                for row in parts
                if row["source"] != "total" and row["recording"] == total["recording"]
            ]
            conditions = tuple(row for row in own_parts if is_condition(row))
            sources = [row for row in own_parts if row["sigma"] is not None]
            largest = max(sources, key=lambda row: row["sigma"], default=None)
            if largest is None or total["sigma"] == 0.0:
                standings.append(Standing(total, conditions=conditions))
            else:
                share = (largest["sigma"] / total["sigma"]) ** 2
                shares = parts_of(total["sigma"], sources)
                standings.append(Standing(total, named(largest), share, shares, conditions))
        found[sensor] = standings
    return found


def _deciding(standings: list[Standing]) -> Standing:
    """Return the limit that decides: one that surely fails, whatever is not known of others."""
    known = [one for one in standings if one.known]
    worst = min(known, key=lambda one: one.margin, default=standings[0])
    unknown = [one for one in standings if not one.known]
    return worst if not unknown or worst.verdict == "surely fails" else unknown[0]


def _overall(standings: list[Standing], deciding: Standing) -> str:
    """Return the verdict on a sensor: of the limit that decides, or of all if it is calibrated."""
    once = [once_calibrated(one.verdict, one.total, one.conditions) for one in standings]
    if deciding.known and once != [one.verdict for one in standings]:
        return min(once, key=_WORST_FIRST.index)
    return deciding.verdict


def _rank(
    sensor: str, ranked: Mapping[str, Standing], rests: Mapping[str, Rests]
) -> tuple[int, list[str]]:
    """Return the rank of a sensor, and the sensors that it is tied with."""

    def better(one: str, other: str) -> bool:
        known = rests[one].figures.keys() <= rests[other].figures.keys()
        return known and ranked[one].margins[0] > ranked[other].margins[1]

    above = [other for other in ranked if better(other, sensor)]
    tied = [
        other for other in ranked if other not in (sensor, *above) and not better(sensor, other)
    ]
    return 1 + len(above), tied


def _over(limit: float, error: float) -> float:
    return limit / error if error > 0.0 else math.inf
