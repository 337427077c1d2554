"""Convert log files to Parquet in SI, one file per clock, with findings, in bounded memory."""

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.states import Severity
from imubench_pipeline.readers import log_files, read
from imubench_pipeline.readers.content import recognise_folder
from imubench_pipeline.recordings import timebase
from imubench_pipeline.recordings.availability import check_opening, watch_log
from imubench_pipeline.recordings.kept import AnalysedChannel, KeptFile, Quality, identify_files
from imubench_pipeline.recordings.known_logs import KnownFile, identify_log_files, write_known
from imubench_pipeline.recordings.parts import Part, leave_out_disturbed, read_part
from imubench_pipeline.recordings.quality.columns import check_columns
from imubench_pipeline.recordings.quality.copies import find_copied_channels
from imubench_pipeline.recordings.quality.knocks import Knock
from imubench_pipeline.recordings.quality.levels import summarise_level
from imubench_pipeline.recordings.quality.rest import find_still_spans
from imubench_pipeline.recordings.quality.rotation import GravityTurn, detect_gravity_turn
from imubench_pipeline.recordings.recording import (
    BESIDE,
    LogMetadata,
    LogNames,
    LogWriter,
    SampleCounts,
    SourceFile,
    list_log_files,
    open_channel_logs,
)
from imubench_pipeline.recordings.separation import separate_clocks
from imubench_pipeline.settings.experiments import AT_REST
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import (
    TEMPERATURE,
    IngestPlan,
    LogFormat,
    RecordingNotes,
    UsedPart,
    quantity_of,
)
from imubench_pipeline.tables.failures import Failure
from imubench_pipeline.tables.findings import Finding, RecordingError, UnavailableError, find
from imubench_pipeline.tables.parquet import open_parquet, read_row_group
from imubench_pipeline.words.findings import files, samples

_MAX_NAMES = 5
_MAX_TIMES = 5  # of knocks that are listed
_MAX_HARMLESS_STRAIGHT = 1e-3  # of samples on straight lines, which are left out
_MAX_HARMLESS_SHARE = 0.01  # of samples that are left out with knocks


@dataclass(frozen=True)
class Ingested:
    """The stored data of a recording."""

    row: RecordingRow
    findings: list[Finding]
    channels: dict[str, AnalysedChannel] = field(default_factory=dict)
    kept: dict[str, KeptFile] = field(default_factory=dict)
    gravity: GravityTurn | None = None  # how gravity turns against the sensor
    sources: dict[str, KnownFile] | None = None  # of the log, by place; None: not read to the end

    def quality(self) -> Quality:
        """Return the content of ``quality.json``."""
        row = self.row
        findings = [finding.row(row.sensor, row.recording) for finding in self.findings]
        return Quality(row, findings, self.channels, self.kept, gravity=self.gravity)


def ingest(
    source: Path,
    log: LogFormat,
    notes: RecordingNotes,
    settings: QualitySettings,
    folder: Path,
    names: LogNames,
) -> Ingested:
    """Read a recording (a log file or a folder) and store it as Parquet in ``folder``.

    Files of an earlier run are replaced. ``names`` are stored in the metadata of every file. Knocks
    and changes are searched for only if ``names.kind`` is at rest. Raises `RecordingError` if the
    recording cannot be used; no samples are then left in ``folder``.
    """
    folder.mkdir(parents=True, exist_ok=True)
    remove_kept(folder)
    scratch = Path(tempfile.mkdtemp(prefix=".ingest.", suffix=".part", dir=folder))
    # The files are identified while they are read; to the end only where they can be used.
    beside, rejected = ThreadPoolExecutor(1), Event()
    sources = beside.submit(identify_log_files, source, rejected.is_set)
    try:
        whole = _ingest(source, log, notes, settings, folder, scratch, names, sources)
        chosen = _choose_part(whole, notes.use, settings)
        if chosen is None:
            return whole
        part, note = chosen
        fewer = notes.model_copy(update={"use": part})
        trimmed = _ingest(source, log, fewer, settings, folder, scratch, names, sources)
        return replace(trimmed, findings=[note, *trimmed.findings])
    except BaseException:
        rejected.set()
        raise
    finally:
        beside.shutdown()
        shutil.rmtree(scratch)


def _choose_part(
    whole: Ingested, use: UsedPart, settings: QualitySettings
) -> tuple[UsedPart, Finding] | None:
    """Return the part of a log that the settings ask for, and a note; None: all of it."""
    if settings.at_rest:
        moved = [(f.start or 0.0, f.end or 0.0) for f in whole.findings if f.finding == "motion"]
        end = use.start + (whole.row.duration or 0.0)
        still = find_still_spans(moved, use.start, end)
        if moved and still:
            start, stop = max(still, key=lambda span: span[1] - span[0])
            note = find(files.PartAtRest(start, stop), "note", stop - start, None, start, stop)
            return UsedPart(start=start, end=stop), note
    end = max((f.end or 0.0 for f in whole.findings if f.finding == "warm_up"), default=0.0)
    if settings.trim_warm_up and end:
        note = find(files.WarmUpTrimmed(end), "note", end, start=0.0, end=end)
        return UsedPart(start=end, end=use.end), note
    return None


def remove_kept(folder: Path) -> None:
    """Remove the samples of an earlier run, and the scratch files of a killed one."""
    for path in list_log_files(folder):
        path.unlink()
    for path in folder.glob(".ingest.*.part"):
        shutil.rmtree(path, ignore_errors=True)


def _ingest(
    source: Path,
    log: LogFormat,
    notes: RecordingNotes,
    settings: QualitySettings,
    folder: Path,
    scratch: Path,
    names: LogNames,
    sources: Future[dict[str, KnownFile]],
) -> Ingested:
    parts: list[Part] = []
    for number, file in enumerate(read(source, log)):
        part = read_part(file, notes.use, scratch, number)
        stated, whole = log.rate_hz or file.rate, partial(_base, part, log, settings)
        parts += separate_clocks(part, stated, whole, settings, scratch)
    bases = [_base(part, log, settings) for part in parts]
    # Files share a clock if they have the same stamps, or as many samples and none.
    by_clock: dict[tuple[object, ...], list[int]] = {}
    for index, (part, base) in enumerate(zip(parts, bases, strict=True)):
        stamps = part.digest() if len(parts) > 1 else ""
        by_clock.setdefault((stamps, part.rows, base.rate), []).append(index)
    groups = list(by_clock.values())
    findings = _findings(parts, bases, groups, settings, scratch, static=names.kind == AT_REST)
    marked = [part.source.path.name for part in parts if part.source.simulated]
    if marked and notes.simulated is False:
        findings.append(find(files.SimulatedByMark(marked[0]), "warning", len(marked)))
    findings += _unused_files(source, parts)
    unusable = {finding.channel for finding in findings if finding.severity == "fatal"}
    names = replace(names, simulated=bool(marked or notes.simulated or names.simulated))
    started = notes.started or next((p.source.started for p in parts if p.source.started), None)
    describe = partial(
        LogMetadata,
        **vars(names),
        sources=tuple(
            SourceFile((source / place).name, file.size, file.sha256)
            for place, file in sources.result().items()
        ),
        reader=log.reader,
        begins=notes.use.start,
        started=started,
        unusable=tuple(sorted(channel for channel in unusable if channel)),
    )
    written: list[tuple[Path, Path]] = []
    counts: dict[str, SampleCounts] = {}
    for name, group in zip(name_parquet_files(parts, groups), groups, strict=True):
        chosen, base = [parts[index] for index in group], bases[group[0]]
        holes, empty = _find_holes(chosen, base)
        about = describe(
            rate=base.rate,
            rate_from=base.source,
            rows=base.rows,
            grid=base.grid,
            segments=base.segments,
            uniform=base.uniform,
            holes=holes,
            empty=tuple(empty),
        )
        assembled, repeated = assemble(chosen, base, settings, about, scratch / name)
        counts |= count_samples(assembled, chosen, repeated)
        written.append((assembled, folder / name))
    about_log = partial(RecordingRow, started=started, power_cycled=notes.power_cycled)
    row = _complete_row(partial(about_log, **vars(names)), parts, bases)
    if all(channel in unusable for channel in log.channels):
        reasons = ". ".join(f.detail for f in findings if f.severity == "fatal")
        raise RecordingError(f"no channel can be used: {reasons}")
    for temporary, final in written:
        temporary.replace(final)
    column = {name: summary_of for part in parts for name, summary_of in part.columns.items()}
    timed = {name for part in parts if part.stamped for name in part.columns}
    units = {str(name): source.unit for name, source in log.channels.items()}
    channels = {
        name: AnalysedChannel(
            grid=channel.grid,
            segments=channel.segments,
            **vars(counts[name]),
            **vars(summarise_level(column[name], channel.rate, units[name], timed=name in timed)),
        )
        for name, channel in open_channel_logs(folder).items()
    }
    begin = notes.use.start
    findings = [
        f if f.start is None else replace(f, start=f.start + begin, end=(f.end or 0.0) + begin)
        for f in findings
    ]
    kept = identify_files(list_log_files(folder))
    return Ingested(row, findings, channels, kept, _gravity(parts, bases), sources.result())


def _unused_files(source: Path, parts: list[Part]) -> list[Finding]:
    if not source.is_dir() or recognise_folder(source) is not None:
        return []
    used = {path for part in parts for path in (part.source.path, *part.source.path.parents)}
    unused = [file.relative_to(source).as_posix() for file in log_files(source) if file not in used]
    if not unused:
        return []
    data = files.UnusedFiles(tuple(unused[:_MAX_NAMES]), len(unused), source.name)
    return [find(data, "note", len(unused))]


def _findings(
    parts: list[Part],
    bases: list[timebase.TimeBase],
    groups: list[list[int]],
    settings: QualitySettings,
    scratch: Path,
    *,
    static: bool,
) -> list[Finding]:
    read_files = {id(part.source): part.source for part in parts}.values()
    findings = [finding for file in read_files for finding in file.findings]
    findings += [finding for file in read_files for finding in file.contradicted_units()]
    for part, base in zip(parts, bases, strict=True):
        found = check_columns(part.columns | part.left_out, base.rate, settings, static=static)
        knocks: dict[str, list[Knock]] = {}
        if static:  # a turn looks like a knock
            longest = round(settings.longest_knock * base.rate)
            knocks = leave_out_disturbed(part, settings.knock, longest, scratch)
            calm = check_columns(part.calm, base.rate, settings)
            moved = {f.channel for f in calm if f.finding == samples.Motion.code}
            found = [
                f  # no motion that is one knock
                for f in found
                if f.finding != samples.Motion.code
                or f.channel in moved
                or _count_knocks(knocks.get(f.channel or "", ()), f, base.rate) != 1
            ]
        findings += [finding for finding in found if finding not in findings]
        findings += part.findings
        if static:
            for channel, events in knocks.items():
                worst = max(events, key=lambda knock: knock.size)
                times = tuple(max(knock.first, 0) / base.rate for knock in events[:_MAX_TIMES])
                begin, end = max(events[0].first, 0) / base.rate, events[-1].last / base.rate
                number = part.knocks[channel]
                knocked = files.Knocks(len(events), worst.size, times, number)
                few = number < _MAX_HARMLESS_SHARE * part.columns[channel].present
                severity: Severity = "note" if few else "warning"
                findings.append(find(knocked, severity, number, channel, begin, end))
            for channel, number in part.interpolated.items():
                if number:
                    share = number / part.columns[channel].present
                    straight = samples.Interpolated(number, share)
                    grade: Severity = "note" if share < _MAX_HARMLESS_STRAIGHT else "warning"
                    findings.append(find(straight, grade, number, channel))
    channels = {name: column for part in parts for name, column in part.columns.items()}
    findings += find_copied_channels({n: c for n, c in channels.items() if n not in BESIDE})
    whole = [part for part in parts if part.base is None]
    if len({part.rows for part in whole if not part.stamped}) > 1:
        rows = tuple(part.rows for part in whole)
        data = files.UnequalLength(tuple(part.source.path.name for part in whole), rows)
        findings.append(find(data, "warning", max(rows) - min(rows)))
    duration = max(base.grid / base.rate for base in bases)
    if static and duration < settings.short:
        findings.append(find(files.ShortRecording(duration), "note", duration))
    for group in groups:
        findings += [f for f in bases[group[0]].findings if f not in findings]
    return findings


def _count_knocks(knocks: Iterable[Knock], span: Finding, rate: float) -> int:
    begin, end = (span.start or 0.0) * rate, (span.end or 0.0) * rate
    return sum(knock.first < end and knock.last > begin for knock in knocks)


def _find_holes(parts: list[Part], base: timebase.TimeBase) -> tuple[dict[str, bool], list[str]]:
    """Return which columns lack samples, and the columns beside the channels without any."""
    holes, empty = {}, []
    for part in parts:
        for name, column in part.columns.items():
            left_out = (part.knocks.get(name), part.interpolated.get(name))
            holes[name] = any((base.missing, column.missing, column.not_finite, *left_out))
            if name in BESIDE and not column.present:
                empty.append(name)
    return holes, empty


def _gravity(parts: list[Part], bases: list[timebase.TimeBase]) -> GravityTurn | None:
    axes = [f"accel_{axis}" for axis in "xyz"]
    place = {name: n for n, part in enumerate(parts) for name in part.columns if name in axes}
    used = set(place.values())
    if len(place) < 3 or (
        len(used) > 1 and len({(parts[n].digest(), parts[n].rows) for n in used}) > 1
    ):
        return None  # they have no clock in common
    blocks = [parts[place[name]].columns[name].blocks() for name in axes]
    return detect_gravity_turn(blocks, bases[place[axes[0]]].rate)


def _base(part: Part, log: LogFormat, settings: QualitySettings) -> timebase.TimeBase:
    if part.base is not None:
        return part.base
    if not part.stamped:
        assert log.rate_hz is not None  # checked with the sensor file
        return timebase.assume_stated_rate(part.rows, log.rate_hz)
    try:
        return timebase.fit_time_base(part.stamps, log.rate_hz or part.source.rate, settings)
    except RecordingError as error:
        raise RecordingError(f"{part.source.path.name}: {error}") from None


def _complete_row(
    row: partial[RecordingRow], parts: list[Part], bases: list[timebase.TimeBase]
) -> RecordingRow:
    measured = [i for i, part in enumerate(parts) if set(part.columns) - BESIDE]
    longest = max(measured, key=lambda index: bases[index].rows)
    base = bases[longest]
    readings = [part.columns[TEMPERATURE] for part in parts if TEMPERATURE in part.columns][:1]
    temperature = next((column for column in readings if column.present), None)
    return row(
        status="ok",
        rate=base.rate,
        rate_from=base.source,
        rate_error=base.rate_error,
        samples=base.samples,
        duration=base.grid / base.rate,
        temperature_min=temperature.low if temperature else None,
        temperature_max=temperature.high if temperature else None,
    )


def ingest_as_planned(
    source: Path, settings: str, sensor: str, recording: str, folder: Path, *, guarded: bool = False
) -> Quality:
    """Ingest a recording by its plan; an unusable recording is rejected, with the reason.

    ``settings`` are from `imubench_pipeline.run.plan.Plan.ingest_settings`. ``guarded``: whether a
    separate process opens the log first (`availability.check_opening`, 0.1 s), since a log may hang
    or crash its reader. Raises `UnavailableError` if the log cannot be read now, for a reason
    outside of it.
    """
    plan = IngestPlan.model_validate_json(settings)
    notes = plan.notes or RecordingNotes()
    names = _name_recording(plan, sensor, recording)
    if plan.unavailable is not None:
        raise UnavailableError(plan.unavailable)
    sources: dict[str, KnownFile] = {}
    try:
        if plan.log is None:
            raise RecordingError(plan.error or "")
        with watch_log(source, plan.files or ()) as is_same:
            if guarded:
                check_opening(source, plan.log, plan.quality.opening)
            ingested = ingest(source, plan.log, notes, plan.quality, folder, names)
        sources = ingested.sources or {}
        if not is_same():  # the samples and the digest may be from two logs
            # Without digest and stamps they count as changed.
            sources = {
                name: replace(file, sha256=None, stamps=None) for name, file in sources.items()
            }
    except RecordingError as error:
        remove_kept(folder)
        row = RecordingRow(
            **vars(names),
            started=notes.started,
            power_cycled=notes.power_cycled,
            status="rejected",
            reason=str(error),
        )
        ingested = Ingested(row, [find(files.Rejected(str(error)), "fatal", 1)])
        if plan.files is not None:
            with suppress(OSError):  # a path that cannot be listed at all
                sources = identify_log_files(source, lambda: True)  # no digests of large files
    if plan.files:
        write_known(sources, folder, plan.files)
    return ingested.quality()


def write_failed(settings: str, failure: Failure, path: Path) -> None:
    """Write the ``quality.json`` of a recording whose ingest failed; remove its samples."""
    plan = IngestPlan.model_validate_json(settings)
    names = _name_recording(plan, failure.sensor, str(failure.recording))
    started = plan.notes.started if plan.notes else None
    row = RecordingRow(**vars(names), started=started, status="failed", reason=failure.reason)
    finding = failure.finding().row(names.sensor, names.recording)
    remove_kept(path.parent)
    Quality(row, [finding], {}, {}, failure).write(path)


def _name_recording(plan: IngestPlan, sensor: str, recording: str) -> LogNames:
    notes = plan.notes or RecordingNotes()
    return LogNames(
        sensor=sensor,
        device=notes.device or recording,
        recording=recording,
        kind=plan.kind,
        simulated=plan.simulated or bool(notes.simulated),
    )


def name_parquet_files(parts: list[Part], groups: list[list[int]]) -> list[str]:
    """Return the name of the Parquet file of each clock, from its quantity or its channels."""
    if len(groups) == 1:
        return ["log.parquet"]
    contents = []
    for group in groups:
        columns = [name for index in group for name in parts[index].columns]
        contents.append([name for name in columns if name not in BESIDE] or columns)
    quantities = [sorted({quantity_of(name) for name in names}) for names in contents]
    names = []
    for channels, kinds in zip(contents, quantities, strict=True):
        alone = len(kinds) == 1 and quantities.count(kinds) == 1
        names.append(f"log.{kinds[0] if alone else '+'.join(channels)}.parquet")
    return names


def assemble(
    parts: list[Part],
    base: timebase.TimeBase,
    settings: QualitySettings,
    metadata: LogMetadata,
    path: Path,
) -> tuple[Path, dict[str, int]]:
    """Join ``parts``, which share a clock, in the file ``path``; one uniform part is not copied.

    Returns the path of the data, and how many samples of each column repeat a stamp (left out).
    """
    for part in parts:
        part.writer.finish(asdict(metadata))
    if len(parts) == 1 and base.uniform:
        return parts[0].data, {}
    repeated: dict[str, int] = {}
    names = [name for part in parts for name in part.columns]
    columns = dict.fromkeys(names, pa.float64())
    if not base.uniform:
        sample = {"sample": pa.int64()} if base.stamped else {}
        columns = {"time": pa.float64()} | sample | columns
    blocks = _read_columns(parts)
    with LogWriter(path, columns) as writer:
        if base.uniform:
            for block in blocks:
                writer.write(block)
        else:
            first = None
            places = timebase.locate_samples(base, parts[0].stamps, settings)
            for block, stamps, points in zip(blocks, parts[0].stamps(), places, strict=True):
                first = stamps[0] if first is None else first
                block["time"] = stamps - first
                if base.stamped:
                    block["sample"] = points
                keep = points >= 0
                for name in names:
                    left = int(np.isfinite(block[name][~keep]).sum())
                    repeated[name] = repeated.get(name, 0) + left
                writer.write({name: values[keep] for name, values in block.items()})
        writer.finish(asdict(metadata))
    return path, repeated


def _read_columns(parts: list[Part]) -> Iterator[dict[str, NDArray[Any]]]:
    files = [open_parquet(part.data) for part in parts]
    try:
        for group in range(files[0].num_row_groups):
            block: dict[str, NDArray[Any]] = {}
            for file in files:
                table = read_row_group(file, group)
                block |= {name: table.column(name).to_numpy() for name in table.column_names}
            yield block
    finally:
        for file in files:
            file.close()


def count_samples(
    path: Path, parts: list[Part], repeated: Mapping[str, int]
) -> dict[str, SampleCounts]:
    """Return how many samples of each column are used and left out, by reason (see `assemble`)."""
    file = pq.read_metadata(path)
    used = dict.fromkeys(file.schema.names, 0)
    for group in range(file.num_row_groups):
        for index, name in enumerate(file.schema.names):
            column = file.row_group(group).column(index)
            used[name] += column.num_values - column.statistics.null_count
    counts = {}
    for part in parts:
        for name, column in part.columns.items():
            count = SampleCounts(
                present=column.present,
                used=used[name],
                knocks=part.knocks.get(name, 0),
                interpolated=part.interpolated.get(name, 0),
                repeated=repeated.get(name, 0),
            )
            left_out = count.knocks + count.interpolated + count.repeated
            if count.present != count.used + left_out:
                raise RuntimeError(f"{name}: used and omitted samples do not add up: {count}")
            counts[name] = count
    return counts
