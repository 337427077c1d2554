"""The summary of a run in the terminal: drop zone, states of recordings, and the best sensors."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import get_args

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.recordings import FailureRow, FileRow, FindingRow, RecordingRow
from imubench_pipeline.model.states import FileStatus
from imubench_pipeline.report.folder import read_failed_pages
from imubench_pipeline.tables.files import locate_table, read
from imubench_pipeline.tables.findings import LEFT_OUT
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.tables.texts import escape_invisible
from imubench_pipeline.words.numbers import counted, join_names
from imubench_pipeline.words.verdicts import answer_text

SUMMARISED_TABLES = ("recordings", "findings", "ranking", "failures")
_MOST_LINES = 10
_MOST_LETTERS, _MOST_LETTERS_OF_ANSWER = 200, 1000

_FAILED = re.compile(r"^Error in rule (\w+):\n((?:    .*\n)*)", re.MULTILINE)
"""A step that failed, as Snakemake writes it into its log."""

_FAILED_GROUP = re.compile(
    r"^    message: Error in group .*\n(?:    log: (.+) \(check .*\n)?    jobs:\n((?: {8}.*\n)*)",
    re.MULTILINE,
)
"""Steps in one job of a cluster, which failed; its log names the step."""

_JOB = re.compile(r"^ +jobid: (\d+)$", re.MULTILINE)
_OUTPUT = re.compile(r"^ +output: (.+)$", re.MULTILINE)
_RULE = re.compile(r"^ +rule (\w+):$", re.MULTILINE)
_DONE = re.compile(r"^Finished jobid: (\d+) ", re.MULTILINE)
_INTERRUPTED = "Terminating processes on user request"


def summarise_run(results: Path) -> str:
    """Return the summary of a finished run; empty without tables."""
    paths = {name: locate_table(results, name) for name in SUMMARISED_TABLES}
    if not all(path.exists() for path in paths.values()):
        return ""
    try:
        tables = {name: read(name, [path]) for name, path in paths.items()}
    except (OSError, ValueError) as error:
        # A run for one file alone succeeds even if older tables cannot be read.
        return fold_text(f"no summary: {error}")
    recordings = RecordingRow.rows_of(tables["recordings"])
    rejected = list(list_rejections(recordings))
    warned = list(list_warnings(FindingRow.rows_of(tables["findings"])))
    simulated = sum(row.simulated for row in recordings)
    failed = list(list_failures(FailureRow.rows_of(tables["failures"])))
    analysed = sum(row.status == "ok" for row in recordings)
    lines = [f"{counted(analysed, 'recording')} analysed, {len(rejected)} rejected"]
    not_read = len(recordings) - analysed - len(rejected)
    lines[0] += f", {not_read} failed" * (not_read > 0)
    lines[0] += f"; {simulated} of all are simulated, not measured" * (simulated > 0)
    lines += _bounded(f"  failed: {line}" for line in failed)
    lines += _bounded(f"  rejected: {line}" for line in rejected)
    lines += describe_drop_zone(results)
    if warned:
        lines.append(f"warnings in {len(warned)} of the recordings:")
        lines += _bounded(f"  {line}" for line in warned)
    lines += _bounded(list_best_sensors(RankingRow.rows_of(tables["ranking"]), recordings))
    lines.append(f"report: {results / 'report/index.html'}")
    return "\n".join(lines)


def list_failed_pages(results: Path) -> str:
    """Return a text with the failed pages of the report and the reasons; empty without any."""
    failed = read_failed_pages(results / "report")
    lines = (f"\n  {fold_text(f'{path}: {reason}')}" for path, reason in failed.items())
    return "pages that could not be made; the next run tries again" * bool(failed) + "".join(lines)


def describe_failure(logs: Sequence[str], results: Path) -> str:
    """Return the summary of a run that failed or was stopped, from the logs of Snakemake."""
    texts = [Path(log).read_text(encoding="utf-8", errors="replace") for log in logs]
    steps = dict.fromkeys(step for text in texts for step in _failed_steps(text, results))
    again = "run the same command again: it continues where this run stopped"
    if any(_INTERRUPTED in text for text in texts):
        lines = [f"stopped before its end; to continue, {again}"]
    else:
        lines = [f"{counted(len(steps), 'step') if steps else 'a step'} failed; see above"]
        lines += _bounded(f"  {step}" for step in steps)
        lines.append(f"all independent steps are done; to continue, correct the cause and {again}")
    lines += [f"log: {log}" for log in logs]
    return "\n".join(lines)


def _failed_steps(log: str, results: Path) -> Iterator[str]:
    """Yield step and recording of each failed attempt, from a log of Snakemake."""
    of_one = re.compile(rf"{re.escape(str(results))}/(?:recordings|simulated)/([^/]+/[^/,]+)")
    done = set(_DONE.findall(log))

    def recording(about: str) -> str | None:
        named = map(of_one.match, _OUTPUT.findall(about))
        return next((match[1] for match in named if match), None)

    for rule, about in _FAILED.findall(log):
        if done.isdisjoint(_JOB.findall(about)):
            of = recording(about)
            yield f"{rule} of {of}" if of else rule
    last: dict[str, str] = {}
    for cluster_log, about in _FAILED_GROUP.findall(log):
        if done.isdisjoint(_JOB.findall(about)):
            of = recording(about)
            last[f"a step of {of}" if of else " or ".join(_RULE.findall(about))] = cluster_log
    for what, cluster_log in last.items():
        yield what + f" ({cluster_log})" * bool(cluster_log)


def list_rejections(recordings: Iterable[RecordingRow]) -> Iterator[str]:
    """Yield a line for each rejected recording: its name and the reason."""
    for row in recordings:
        if row.status == "rejected":
            reason = row.reason or "no reason is recorded"
            yield fold_text(f"{row.sensor}/{row.recording}: {reason}")


def list_failures(failures: Iterable[FailureRow]) -> Iterator[str]:
    """Yield a line for each step that failed, with the lost recording and the reason."""
    for row in failures:
        of = f"{row.sensor}/{row.recording}" if row.recording else row.sensor
        yield fold_text(f"{of}: {row.reason}")


def list_warnings(findings: Iterable[FindingRow]) -> Iterator[str]:
    """Yield a line for each recording that has warnings, the worst first."""
    by_recording: dict[str, Counter[str]] = {}
    left_out: Counter[str] = Counter()
    for row in select_warnings(findings):
        name = f"{row.sensor}/{row.recording}"
        by_recording.setdefault(name, Counter())[row.finding.replace("_", " ")] += 1
        left_out[name] += row.severity == "fatal"
    for name, of in sorted(by_recording.items(), key=lambda i: (-left_out[i[0]], -i[1].total())):
        kinds = ", ".join(kind + f" ({n})" * (n > 1) for kind, n in of.most_common())
        yield fold_text(f"{name}: {counted(of.total(), 'warning')}: {kinds}")


def select_warnings(findings: Iterable[FindingRow]) -> Iterator[FindingRow]:
    """Yield the warnings and errors, except the finding that a recording is left out."""
    for row in findings:
        if row.severity != "note" and row.finding not in LEFT_OUT:
            yield row


def list_best_sensors(
    ranking: Iterable[RankingRow], recordings: Iterable[RecordingRow]
) -> Iterator[str]:
    """Yield a line for each requirement: the best sensor, and whether it meets the limits."""
    deciding = [row for row in ranking if row.decides]
    simulated = {(row.sensor, row.recording) for row in recordings if row.simulated}
    marks = {row.sensor: (row.sensor, row.recording) in simulated for row in deciding}
    names = {sensor: sensor + " (simulated)" * mark for sensor, mark in marks.items()}
    for name, own in group_rows(deciding, lambda row: row.requirement).items():
        ranked = [row for row in own if row.rank is not None]
        ranked.sort(key=lambda row: (row.rank, -(row.margin or 0.0)))
        text = answer_text(ranked, names, len(own), sum(row.verdict == "excluded" for row in own))
        if ranked and ranked[0].tied_with:
            others = join_names([names.get(each, each) for each in ranked[0].tied_with])
            text += f" The difference from {others} is not significant."
        yield fold_text(f"{name}: {text}", _MOST_LETTERS_OF_ANSWER)


def fold_text(text: str, longest: int = _MOST_LETTERS) -> str:
    """Return a text on one line, without control characters, of up to ``longest`` characters."""
    shown = "".join(letter if letter.isprintable() else " " for letter in text)
    shown = " ".join(shown.split())
    return shown if len(shown) <= longest else shown[: longest - 1] + "…"


def _bounded(lines: Iterable[str]) -> list[str]:
    listed = list(lines)
    more = len(listed) - _MOST_LINES
    return listed if more <= 1 else [*listed[:_MOST_LINES], f"  and {more} more"]


def describe_drop_zone(results: Path) -> list[str]:
    """Return how many files the last run analysed, rejected and skipped, and why, as lines."""
    try:
        files = FileRow.rows_of(read("files", [results / "tables/files.parquet"]))
    except (OSError, ValueError):
        return []  # missing and damaged files are reported elsewhere
    if not files:
        return []
    counts = Counter(row.status for row in files)
    parts = [f"{counts[name]} {name}" for name in get_args(FileStatus) if counts[name]]
    lines = [f"{counted(len(files), 'file')} in the drop zone = {' + '.join(parts)}"]
    skipped = [row for row in files if row.status == "skipped"]
    for row in skipped[:_MOST_LINES]:
        lines.append(escape_invisible(f"  skipped: {row.file}: {row.reason}"))
    if (more := len(skipped) - _MOST_LINES) > 0:
        lines.append(f"  and {more} more in the table files")
    return lines
