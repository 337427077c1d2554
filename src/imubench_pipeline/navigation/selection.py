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
    """Yield the rows of the table ``ranking``, of judgements and the recordings that they stand on.

    A sensor stands where its limit with the least margin stands. Its rank is one more than the
    number of sensors that are surely better, whose interval lies wholly above its own: sensors with
    overlapping intervals are tied. One with a figure that is not known is surely better than
    another only where that of the other is not known, too.
    """
    for name in dict.fromkeys(judgement.name for judgement in judged):
        own = [judgement for judgement in judged if judgement.name == name]
        compared = {judgement.sensor: judgement for judgement in own if judgement.compared}
        for judgement in own:
            sensor = judgement.sensor
            rank, tied = _rank(sensor, compared) if sensor in compared else (None, [])
            place = {"rank": rank, "tied_with": ", ".join(tied) or None}
            apart = [reason for (of, _), reason in basis.apart.items() if of == sensor]
            of_sensor = {
                "requirement": name,
                "sensor": sensor,
                **place,
                "verdict": judgement.verdict,
                "conditions": judgement.conditions,
                "confidence": judgement.requirement.confidence,
                "left_out": "; ".join(apart) or None,
                **_unless_row(judgement),
            }
            for standing, weak in zip(judgement.standings, judgement.weak, strict=True):
                yield {
                    **of_sensor,
                    "at_most": standing.total["limit"] * judgement.requirement.sigmas,
                    "decides": standing is judgement.decides,
                    **_limit_row(standing),
                    "longest_log": basis.longest(standing.totals),
                    "evidence": ("weak" if weak else "strong") if standing.known else None,
                    "evidence_reasons": ", ".join(weak) or None,
                    **_backtest_row(name, standing, basis),
                    "doubts": _doubts(sensor, standing, basis),
                }


def _doubts(sensor: str, standing: Standing, basis: Basis) -> str:
    """Return what is doubted of the recordings that a standing rests on."""
    recordings = [row["recording"] for row in standing.totals]
    if len(recordings) < 2:
        return basis.doubted((sensor, standing.total["recording"]))
    doubts = [f"{name}: {words}" for name in recordings if (words := basis.doubted((sensor, name)))]
    more = len(doubts) - _SHOWN
    return "; ".join(doubts[:_SHOWN]) + (f"; and {more} more" if more > 0 else "")


def _limit_row(standing: Standing) -> Row:
    total, expected = standing.total, standing.expected
    known = standing.known
    return {
        **{key: total[key] for key in ("recording", "error", "time", "limit", "unit")},
        "trajectory": total.get("trajectory"),
        "sigma": expected.sigma,
        "lower": expected.lower,
        "upper": expected.upper,
        "margin": _margin(standing),
        "chance": standing.chance if known else None,
        "limit_verdict": standing.verdict,
        "source": standing.source,
        "share": standing.share,
        "parts": standing.parts,
        "reached_after": total["reached_after"],
        "reason": total["reason"],
        "specimens": expected.specimens,
        "recordings": expected.recordings,
        "spread": expected.spread.variance**0.5 if expected.spread else None,
        "spread_of": expected.spread_of,
    }


def _backtest_row(requirement: str, standing: Standing, basis: Basis) -> Row:
    """Return what the log of the channel that an error mostly comes of shows of its part."""
    total = standing.total
    words = (standing.source or "").split()
    quantity = next((word for word in words if word in ("gyro", "accel")), None)
    where = {"requirement": requirement, "channel": total[quantity] if quantity else None}
    backtest = basis.backtest({**total, **where})
    return {
        "backtest_channel": where["channel"] if backtest.get("ratio") is not None else None,
        **{
            f"backtest_{name}": backtest.get(name)
            for name in ("ratio", "ratio_lower", "ratio_upper", "windows")
            if backtest.get("ratio") is not None
        },
    }


def _unless_row(judgement: Judgement) -> Row:
    unless = judgement.unless
    if unless is None or judgement.outside:
        return {}
    return {
        "unless": unless_words(unless),
        "unless_verdict": unless.mended and unless.mended.verdict,
        "unless_margin": _margin(unless.mended),
        "logged_verdict": unless.logged and unless.logged.verdict,
        "logged_margin": _margin(unless.logged),
    }


def _margin(standing: Standing | None) -> float | None:
    return standing.margin if standing is not None and standing.known else None


def _rank(sensor: str, compared: Mapping[str, Judgement]) -> tuple[int, list[str]]:
    """Return the rank of a sensor, and the sensors that it is tied with."""

    def better(first: str, second: str) -> bool:
        this, that = compared[first], compared[second]
        no_less_known = this.rests.figures.keys() <= that.rests.figures.keys()
        return no_less_known and this.decides.margins[0] > that.decides.margins[1]

    above = [other for other in compared if better(other, sensor)]
    tied = [
        other for other in compared if other not in (sensor, *above) and not better(sensor, other)
    ]
    return 1 + len(above), tied
