"""Rank the sensors for each requirement: rows of the table ``ranking``."""

from collections.abc import Iterator, Sequence

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.verdicts import UnitFactor
from imubench_pipeline.navigation.suitability import PASSING_VERDICTS
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import Judgement
from imubench_pipeline.navigation.verdicts.standing import Standing


def rank_sensors(judged: Sequence[Judgement], basis: Basis) -> Iterator[RankingRow]:
    """Yield the rows of the table ``ranking``, from judgements and the basis of all recordings.

    The rank of a sensor is 1 plus the number of significantly better sensors: they meet the limits
    and it does not, or else the 95 % interval of their margin lies wholly above its interval.
    """
    for name in dict.fromkeys(judgement.name for judgement in judged):
        own = [judgement for judgement in judged if judgement.name == name]
        compared = {judgement.sensor: judgement for judgement in own if judgement.compared}
        for judgement in own:
            sensor = judgement.sensor
            rank: int | None = None
            tied: list[str] = []
            if sensor in compared:
                above = [other for other in compared if _is_better(compared[other], judgement)]
                rank = 1 + len(above)
                tied = [
                    other
                    for other, theirs in compared.items()
                    if other not in (sensor, *above) and not _is_better(judgement, theirs)
                ]
            for standing, weak in zip(judgement.standings, judgement.weak, strict=True):
                yield _make_row(judgement, standing, weak, rank, tied, basis)


def _is_better(first: Judgement, second: Judgement) -> bool:
    """Return whether a sensor is significantly better; one that meets the limits is."""
    met = [judgement.verdict in PASSING_VERDICTS for judgement in (first, second)]
    if met[0] != met[1]:
        return met[0]
    return first.decides.margins[0] > second.decides.margins[1]


def _make_row(
    judgement: Judgement,
    standing: Standing,
    weak: Sequence[str],
    rank: int | None,
    tied: Sequence[str],
    basis: Basis,
) -> RankingRow:
    sensor, requirement, known = judgement.sensor, judgement.requirement, standing.known
    total, expected = standing.total, standing.expected
    unless = None if judgement.price else judgement.unless
    logged, corrected = (unless.logged, unless.corrected) if unless else (None, None)
    factors = unless.factors if unless and corrected else {}
    # The back-test of the channel that contributes most to the error.
    channels = {"gyro": total.gyro, "accel": total.accel}
    source = standing.source
    channel = channels[source.quantity] if source and source.quantity else None
    tested = basis.backtest(total, judgement.name, channel)
    if tested is not None and tested.ratio is None:
        tested = None
    return RankingRow.taken_from(
        total,
        requirement=judgement.name,
        sensor=sensor,
        rank=rank,
        tied_with=tuple(tied),
        verdict=judgement.verdict,
        decides=standing is judgement.decides,
        at_most=None if total.limit is None else total.limit * requirement.sigmas,
        confidence=requirement.confidence,
        sigma=expected.sigma,
        lower=expected.lower,
        upper=expected.upper,
        margin=_get_margin(standing),
        noise_margin=standing.scale_margin(total.noise),
        likely_margin=standing.scale_margin(total.likely),
        chance=standing.chance if known else None,
        limit_verdict=standing.verdict,
        source=source.source if source else None,
        share=standing.share,
        conditions=judgement.conditions,
        shortfalls=judgement.shortfalls,
        parts=standing.parts,
        doubts=tuple(
            doubt
            for row in standing.totals or [total]
            for doubt in basis.doubted((sensor, row.recording))
        ),
        left_out=tuple(
            doubt for (of, _), doubts in basis.apart.items() if of == sensor for doubt in doubts
        ),
        specimens=expected.specimens,
        recordings=expected.recordings,
        longest_log=basis.longest(standing.totals),
        spread=expected.spread.variance**0.5 if expected.spread else None,
        spread_of=expected.spread_of,
        evidence=("weak" if weak else "strong") if known else None,
        evidence_reasons=tuple(weak),
        corrected_units=tuple(
            UnitFactor(quantity, factor)
            for quantity, factor in sorted(factors.items(), reverse=True)
        ),
        corrected_verdict=corrected.verdict if corrected else None,
        corrected_margin=_get_margin(corrected),
        corrected_reasons=corrected.total.reasons if corrected and not corrected.known else (),
        logged_verdict=logged.verdict if logged else None,
        logged_margin=_get_margin(logged),
        backtest_channel=tested.channel if tested else None,
        backtest_ratio=tested.ratio if tested else None,
        backtest_ratio_lower=tested.ratio_lower if tested else None,
        backtest_ratio_upper=tested.ratio_upper if tested else None,
        backtest_windows=tested.windows if tested else None,
    )


def _get_margin(standing: Standing | None) -> float | None:
    return standing.margin if standing is not None and standing.known else None
