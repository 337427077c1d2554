"""Which sensor fulfils which requirement: rows of the table ``ranking``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import Judgement
from imubench_pipeline.navigation.verdicts.standing import Standing
from imubench_pipeline.navigation.verdicts.unless import unless_words
from imubench_pipeline.typing import Row

_SHOWN = 3
"""Recordings whose doubts are named; of more the number."""


def ranked(judged: Sequence[Judgement], basis: Basis) -> Iterator[Row]:
    """Yield the rows of the table ``ranking``.

    A sensor stands where its limit with the least margin stands. Its rank is one more than the
    number of sensors that are surely better, whose interval lies wholly above its own: sensors
    with overlapping intervals are tied. One with a figure that is not known is surely better than
    another only where that of the other is not known, too.

    Parameters
    ----------
    judged : sequence of Judgement
    basis : Basis
        Of the recordings that they stand on.
    """
    for name in dict.fromkeys(one.name for one in judged):
        own = [one for one in judged if one.name == name]
        compared = {one.sensor: one for one in own if one.compared}
        for one in own:
            rank, tied = _rank(one.sensor, compared) if one.sensor in compared else (None, [])
            place = {"rank": rank, "tied_with": ", ".join(tied) or None}
            apart = [reason for (of, _), reason in basis.apart.items() if of == one.sensor]
            of_sensor = {
                "requirement": name,
                "sensor": one.sensor,
                **place,
                "verdict": one.verdict,
                "conditions": one.conditions,
                "confidence": one.requirement.confidence,
                "left_out": "; ".join(apart) or None,
                **_unless_row(one),
            }
            for standing, weak in zip(one.standings, one.weak, strict=True):
                yield {
                    **of_sensor,
                    "at_most": standing.total["limit"] * one.requirement.sigmas,
                    "decides": standing is one.decides,
                    **_limit_row(standing),
                    **_evidence_row(one.sensor, standing, weak, basis),
                    **_backtest_row(name, standing, basis),
                    "doubts": _doubts(one.sensor, standing, basis),
                }


def _doubts(sensor: str, standing: Standing, basis: Basis) -> str:
    """Return what is doubted of the recordings that a standing rests on."""
    found = [row["recording"] for row in standing.totals]
    if len(found) < 2:
        return basis.doubted((sensor, standing.total["recording"]))
    said = [f"{name}: {words}" for name in found if (words := basis.doubted((sensor, name)))]
    more = len(said) - _SHOWN
    return "; ".join(said[:_SHOWN]) + (f"; and {more} more" if more > 0 else "")


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
        "parts": standing.parts,
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


def _backtest_row(requirement: str, standing: Standing, basis: Basis) -> Row:
    """Return what the log of the channel that an error mostly comes of shows of its part."""
    total = standing.total
    words = (standing.source or "").split()
    quantity = next((word for word in words if word in ("gyro", "accel")), None)
    where = {"requirement": requirement, "channel": total[quantity] if quantity else None}
    found = basis.backtest({**total, **where})
    return {
        "backtest_channel": where["channel"] if found.get("ratio") is not None else None,
        **{
            f"backtest_{name}": found.get(name)
            for name in ("ratio", "ratio_lower", "ratio_upper", "windows")
            if found.get("ratio") is not None
        },
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


def _rank(sensor: str, compared: Mapping[str, Judgement]) -> tuple[int, list[str]]:
    """Return the rank of a sensor, and the sensors that it is tied with."""

    def better(one: str, other: str) -> bool:
        this, that = compared[one], compared[other]
        known = this.rests.figures.keys() <= that.rests.figures.keys()
        return known and this.decides.margins[0] > that.decides.margins[1]

    above = [other for other in compared if better(other, sensor)]
    tied = [
        other for other in compared if other not in (sensor, *above) and not better(sensor, other)
    ]
    return 1 + len(above), tied
