"""Decide from findings and estimates whether a recording is used in comparisons.

A doubt is *unfit* if the figures may not be the noise of a sensor at rest in the stated unit, or if
no such sensor is sold. Other doubts are reported with the figures.
"""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from imubench_pipeline.model.comparisons import DatasheetRow, ErrorBudgetRow, PooledRow
from imubench_pipeline.model.estimates import FixedBiasRow, ModelRow, ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, FindingRow, RecordingRow
from imubench_pipeline.model.states import Fitness
from imubench_pipeline.model.table import OfRecordingRow, TableRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.tables.findings import LEFT_OUT
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words.findings import FINDINGS
from imubench_pipeline.words.reasons import simulations as texts

Key = tuple[str, str]  # sensor, recording
BESIDE_MEASURED = "simulated_beside_measured"  # leaves out simulated recordings

WITH_DOUBTS: Mapping[str, type[ErrorBudgetRow] | type[DatasheetRow]] = {
    "error_budget": ErrorBudgetRow,
    "datasheet": DatasheetRow,
}
"""Tables of one recording whose rows repeat the doubts about it."""

Estimated = TypeVar("Estimated", ParameterRow, FixedBiasRow)
Doubted = TypeVar("Doubted", bound=TableRow)


def derive_doubts(
    findings: Iterable[FindingRow], parameters: Iterable[ParameterRow], models: Iterable[ModelRow]
) -> Iterator[DoubtRow]:
    """Yield the doubts from findings and recommended estimates, the most serious ones first."""
    every: list[DoubtRow] = []
    for finding in findings:
        code = finding.finding
        kind = FINDINGS[code]
        affected = finding.affects if finding.data else kind.affects
        harmless = finding.severity != "warning" or not affected
        if code in LEFT_OUT or (harmless and not kind.unfit):
            continue
        # One doubt for each factor by which parameters may change.
        by_factor: dict[float | None, list[str]] = {}
        if finding.value is not None:
            for name, power in kind.scales.items():
                by_factor.setdefault(finding.value**power, []).append(name)
        every += [
            _doubt(
                finding,
                code,
                finding.detail,
                finding.channel,
                unfit=kind.unfit,
                parameters=tuple(sorted(names)),
                factor=factor,
                start=finding.start,
                end=finding.end,
            )
            for factor, names in (by_factor or {None: [*affected]}).items()
        ]
    every += [
        _doubt(row, "not_explained", texts.no_model_explains(row.channel), row.channel)
        for row in models
        if row.chosen and row.verdict == "not explained"
    ]
    every += [
        _doubt(
            row,
            "doubtful",
            row.reason or texts.ESTIMATE_DOUBTFUL,
            row.channel,
            parameters=(row.parameter,),
        )
        for row in parameters
        if row.status == "doubtful"
    ]
    yield from sorted(every, key=lambda doubt: doubt.fitness != "unfit")


def doubt_unsold_sensors(
    recordings: Iterable[RecordingRow], sensors: Collection[str]
) -> Iterator[DoubtRow]:
    """Yield a doubt for each recording of ``sensors``, which are not for sale."""
    for row in recordings:
        if row.sensor in sensors:
            yield _doubt(row, "not_sold", texts.NOT_SOLD, unfit=True)


def doubt_simulated_recordings(recordings: Sequence[RecordingRow]) -> Iterator[DoubtRow]:
    """Yield a doubt for each simulated recording, if any measured recording was analysed."""
    reason = texts.SIMULATED_BESIDE_MEASURED
    if any(row.status == "ok" and not row.simulated for row in recordings):
        for row in recordings:
            if row.simulated:
                yield _doubt(row, BESIDE_MEASURED, reason, unfit=True)


def exclude_simulated(
    recordings: Sequence[RecordingRow],
) -> tuple[list[RecordingRow], list[DoubtRow]]:
    """Return the recordings, the simulated ones excluded if any was measured, and the new doubts.

    Comparisons use simulated recordings only until a measured recording of any sensor is known.
    """
    known = {_key(row) for row in recordings if any(d.code == BESIDE_MEASURED for d in row.doubts)}
    new = [doubt for doubt in doubt_simulated_recordings(recordings) if _key(doubt) not in known]
    apart = {_key(doubt): mark_doubts([doubt]) for doubt in new}
    judged_anew = [
        replace(
            row,
            fitness=row.fitness and "unfit",
            decides=False,
            doubts=(*apart[_key(row)], *row.doubts),
        )
        if _key(row) in apart
        else row
        for row in recordings
    ]
    return judged_anew, new


def judge_fitness(of_recording: Iterable[DoubtRow]) -> Fitness:
    """Return whether a recording is fit for comparisons, from all doubts about it."""
    of_log = [doubt for doubt in of_recording if doubt.code != "doubtful"]
    if any(doubt.fitness == "unfit" for doubt in of_log):
        return "unfit"
    return "fit with doubts" if of_log else "fit"


def judge_recordings(
    recordings: Sequence[RecordingRow], doubts: Iterable[DoubtRow], included: Collection[str]
) -> list[RecordingRow]:
    """Return the recordings with their doubts, and whether comparisons use them (``decides``).

    ``included``: recordings, as ``sensor/recording``, that are used in spite of doubts.
    """
    by_recording = group_rows(doubts, _key)
    rows = []
    for row in recordings:
        own = by_recording.get(_key(row), [])
        verdict = judge_fitness(own) if row.status == "ok" else None
        named = f"{row.sensor}/{row.recording}" in included
        named &= all(doubt.code != BESIDE_MEASURED for doubt in own)
        decides = verdict is not None and (verdict != "unfit" or named)
        rows.append(replace(row, fitness=verdict, decides=decides, doubts=mark_doubts(own)))
    return rows


def mark_doubts(of_recording: Iterable[DoubtRow]) -> tuple[DoubtMark, ...]:
    """Return the codes of the doubts about a recording, in their order, with the channels."""
    channels: dict[tuple[str, str], dict[str, None]] = {}
    for doubt in of_recording:
        if doubt.code != "doubtful":
            own = channels.setdefault((doubt.recording, doubt.code), {})
            if doubt.channel:
                own[doubt.channel] = None
    return tuple(
        DoubtMark(recording, code, tuple(own)) for (recording, code), own in channels.items()
    )


def list_excluded(recordings: Iterable[RecordingRow]) -> dict[Key, tuple[DoubtMark, ...]]:
    """Return the analysed recordings that are not used in comparisons, each with its doubts."""
    return {
        _key(row): row.doubts for row in recordings if row.status == "ok" and row.decides is False
    }


def mask_excluded(rows: Iterable[Estimated], not_deciding: Collection[Key]) -> Iterator[Estimated]:
    """Yield rows of estimates; recordings in ``not_deciding`` lose their values (biases: NaN)."""
    for row in rows:
        if _key(row) not in not_deciding:
            yield row
        elif isinstance(row, FixedBiasRow):
            yield replace(row, value=math.nan)
        else:
            yield replace(row, value=None, lower=None, upper=None, status="does_not_decide")


def attach_doubts(
    rows: Iterable[Doubted],
    recordings: Iterable[RecordingRow],
    named: Collection[tuple[str, str]] = (("sensor", "recording"),),
) -> Iterator[Doubted]:
    """Yield each row with the doubts about the recordings that it names.

    ``named``: pairs of columns with sensor and recording. Doubts of the row are replaced.
    """
    by_recording: dict[tuple[str, str | None], list[str]] = {
        _key(row): [doubt.code for doubt in row.doubts] for row in recordings
    }
    for row in rows:
        keys = [(getattr(row, sensor), getattr(row, recording)) for sensor, recording in named]
        codes = [code for key in keys for code in by_recording.get(key, ())]
        yield replace(row, doubts=tuple(dict.fromkeys(codes)))  # type: ignore[type-var]  # a dataclass


def attach_doubts_to_pools(
    pools: Iterable[PooledRow], recordings: Iterable[RecordingRow]
) -> Iterator[PooledRow]:
    """Yield each pool with the doubts about the recordings of its sensor, or of its device."""
    listed = [row for row in recordings if row.decides and row.doubts]
    for row in pools:
        own = (
            doubt
            for recording in listed
            if recording.sensor == row.sensor and row.device in (None, recording.device)
            for doubt in recording.doubts
        )
        yield replace(row, doubts=tuple(own))


def _doubt(
    row: RecordingRow | OfRecordingRow,
    code: str,
    reason: str,
    channel: str | None = None,
    *,
    unfit: bool = False,
    **more: Any,
) -> DoubtRow:
    return DoubtRow(
        sensor=row.sensor,
        recording=row.recording,
        channel=channel,
        code=code,
        fitness="unfit" if unfit else "fit with doubts",
        reason=reason,
        **more,
    )


def _key(row: RecordingRow | OfRecordingRow) -> Key:
    return row.sensor, row.recording
