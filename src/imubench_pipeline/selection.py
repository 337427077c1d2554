"""Which sensor fulfils which requirement: rows of the table ``ranking``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from imubench_pipeline.requirements import Requirement
from imubench_pipeline.verdicts.basis import Basis
from imubench_pipeline.verdicts.judgement import Judgement, judgements
from imubench_pipeline.verdicts.standing import Standing
from imubench_pipeline.verdicts.unless import unless_words

Row = Mapping[str, Any]


def ranking_rows(
    errors: Iterable[Row],
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Mapping[str, Any]],
    recordings: Iterable[Row] = (),
    doubts: Iterable[Row] = (),
    parameters: Iterable[Row] = (),
) -> Iterator[Row]:
    """Rank the sensors for each requirement (see `ranked`).

    Parameters
    ----------
    errors : iterable of mapping
        Rows of the table ``error_budget``.
    requirements : mapping of str to Requirement
    sensors : mapping of str to mapping
        ``price_class`` of each sensor.
    recordings, doubts, parameters : iterable of mapping
        Rows of the tables of these names: what is known of the recordings beside their errors.

    Yields
    ------
    mapping
        One a requirement, sensor and limit.
    """
    basis = Basis.of(recordings, doubts, parameters)
    yield from ranked(list(judgements(errors, requirements, sensors, basis)), basis)


def ranked(judged: Sequence[Judgement], basis: Basis) -> Iterator[Row]:
    """Yield the rows of the table ``ranking``.

    A sensor stands where its limit with the least margin stands. Its rank is one more than the
    number of sensors that are surely better, whose interval lies wholly above its own: sensors
    with overlapping intervals are tied.

    Parameters
    ----------
    judged : sequence of Judgement
    basis : Basis
        Of the recordings that they stand on.
    """
    for name in dict.fromkeys(one.name for one in judged):
        own = [one for one in judged if one.name == name]
        compared = {one.sensor: one.decides for one in own if one.decides.known and not one.outside}
        for one in own:
            rank, tied = _rank(one.sensor, compared) if one.sensor in compared else (None, [])
            place = {"rank": rank, "tied_with": ", ".join(tied) or None}
            apart = [reason for (of, _), reason in basis.apart.items() if of == one.sensor]
            of_sensor = {
                "requirement": name,
                "sensor": one.sensor,
                **place,
                "verdict": one.verdict,
                "confidence": one.requirement.confidence,
                "left_out": "; ".join(apart) or None,
                **_unless_row(one),
            }
            for standing, weak in zip(one.standings, one.weak, strict=True):
                key = one.sensor, standing.total["recording"]
                yield {
                    **of_sensor,
                    "at_most": standing.total["limit"] * one.requirement.sigmas,
                    "decides": standing is one.decides,
                    **_limit_row(standing),
                    **_evidence_row(one.sensor, standing, weak, basis),
                    "doubts": basis.doubted(key),
                }


def _limit_row(standing: Standing) -> Row:
    total, found = standing.total, standing.expected
    known = standing.known
    return {
        **{key: total[key] for key in ("recording", "error", "time", "limit", "unit")},
        "sigma": found.sigma,
        "lower": found.lower,
        "upper": found.upper,
        "margin": _margin(standing),
        "chance": standing.chance if known else None,
        "limit_verdict": standing.verdict,
        "source": standing.source,
        "share": standing.share,
        "reached_after": total["reached_after"],
        "reason": total["reason"],
        "specimens": found.specimens,
        "recordings": found.recordings,
        "spread": found.spread.variance**0.5 if found.spread else None,
        "spread_of": found.spread_of,
    }


def _evidence_row(sensor: str, standing: Standing, weak: Sequence[str], basis: Basis) -> Row:
    durations = (basis.duration((sensor, row["recording"])) for row in standing.totals)
    return {
        "longest_log": max((one for one in durations if one is not None), default=None),
        "evidence": ("weak" if weak else "strong") if standing.known else None,
        "evidence_reasons": ", ".join(weak) or None,
    }


def _unless_row(one: Judgement) -> Row:
    found = one.unless
    if found is None or one.outside:
        return {}
    return {
        "unless": unless_words(found),
        "unless_verdict": found.mended and found.mended.verdict,
        "unless_margin": _margin(found.mended),
        "logged_verdict": found.logged and found.logged.verdict,
        "logged_margin": _margin(found.logged),
    }


def _margin(standing: Standing | None) -> float | None:
    return standing.margin if standing is not None and standing.known else None


def _rank(sensor: str, ranked: Mapping[str, Standing]) -> tuple[int, list[str]]:
    """Return the rank of a sensor, and the sensors that it is tied with."""
    low, high = ranked[sensor].margins
    better, tied = 0, []
    for other, standing in ranked.items():
        other_low, other_high = standing.margins
        if other_low > high:
            better += 1
        elif other != sensor and other_high >= low:
            tied.append(other)
    return 1 + better, tied
