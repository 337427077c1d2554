"""One nightly run: lock, recover, postpone incomplete logs, run, compare, report."""

import contextlib
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from shutil import disk_usage
from types import FrameType

import yaml

from imubench_pipeline.extensions.nightly.recovery import end_group, end_left_over, remove_doubtful
from imubench_pipeline.extensions.nightly.run_differences import Results, load_results
from imubench_pipeline.extensions.nightly.settling import (
    Found,
    Skip,
    find_changed_logs,
    find_settled_logs,
    scan_drop_zone,
)
from imubench_pipeline.extensions.nightly.summary import (
    Changes,
    Skipped,
    State,
    StateError,
    Summary,
    compare_states,
    describe_reanalysis,
    format_summary,
    load_tables,
    make_state,
    read_state,
)
from imubench_pipeline.report.run_summary import describe_drop_zone
from imubench_pipeline.run.faults import TOLD
from imubench_pipeline.run.lock import INHERITED, Lock, locate_lock
from imubench_pipeline.run.project import find_snakefile
from imubench_pipeline.run.recovery import remove_temporary, was_restarted
from imubench_pipeline.settings.config import read_config, read_run
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.files import write_content, write_json
from imubench_pipeline.tables.seals import NIGHTS, seal_files

_MAX_STOP_TIME = 60.0  # s; for Snakemake to stop its steps
_MAX_LAST_LINES = 20
_TRACEBACK = re.compile(
    r"^Traceback \(most recent call last\):\n(?:[ \t].*\n)*(\S.*)", re.MULTILINE
)
_PATH_SETTINGS = ("logs", "results", "held_back")
_OWN_FLAGS = {"--config", "-C", "--configfile", "--configfiles"}
_LOW_DISK_SPACE = 200e6  # bytes
_MAX_ERRORS = 5
_CHANGED_WHILE_READ = "it was written to while it was read; the results may be of a part of it"


def run_snakemake(arguments: Sequence[str], project: Path, output: Path, lock: Lock) -> int:
    """Run Snakemake, which holds the lock, too; return its exit status, negative for a signal."""
    with output.open("ab", buffering=0) as file:
        process = subprocess.Popen(
            [sys.executable, "-m", "snakemake", *arguments],
            cwd=project,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            pass_fds=(lock.descriptor,),
            env=os.environ | {TOLD: "1", INHERITED: str(lock.descriptor)},
            start_new_session=True,  # all its steps can be ended together
        )
        try:
            lock.note(snakemake=process.pid)
            return process.wait()
        except BaseException:
            # Like Ctrl-C in a terminal: Snakemake and its steps remove incomplete outputs.
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_MAX_STOP_TIME)
            raise
        finally:
            end_group(process.pid)
            process.wait()


def find_errors(path: Path) -> list[str]:
    """Return the errors of failed steps from the output of a run, each once."""
    return list(dict.fromkeys(_TRACEBACK.findall(_read_output(path))))


def read_last_lines(path: Path) -> list[str]:
    """Return the last lines of the output of a run, without empty ones."""
    lines = [line.rstrip() for line in _read_output(path).splitlines() if line.strip()]
    return lines[-_MAX_LAST_LINES:]


def _read_output(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


class Night:
    """A run of the workflow of a project: a folder of logs, or a checkout.

    ``config``: settings ``key=value`` in addition to the file; ``flags``: further flags of
    Snakemake. A ConfigError is raised if the folder is no project, or a setting cannot be read.
    """

    def __init__(self, project: Path, config: Sequence[str], flags: Sequence[str] = ()) -> None:
        self.project = project.absolute()
        self._snakefile = find_snakefile(self.project)
        if own := set(flags) & _OWN_FLAGS:
            raise ConfigError(f"found {', '.join(own)} after --; expected --config before the --")
        file = self.project / "config/config.yaml"
        settings = dict(read_config(file))
        for entry in config:
            key, equals, value = entry.partition("=")
            if not equals:
                raise ConfigError(f"--config: found {entry!r}; expected KEY=VALUE")
            settings |= {key: yaml.load(value, Loader=yaml.BaseLoader)}
        paths = {key: settings[key] for key in _PATH_SETTINGS if key in settings}
        run = read_run(paths, f"{file} or --config")
        self.logs = self.project / run.logs
        self.results = self.project / run.results
        self.folder = self.results / "nightly"
        self._state = self.folder / "state.json"
        self._always_held_back = run.held_back
        self._config = [entry for entry in config if not entry.startswith("held_back=")]
        self._flags = flags
        self._put_right: list[str] = []

    def run(self, cores: str, settle: float, wait: float) -> Summary:
        """Run the workflow once; also write the summary to the folder ``nightly`` of the results.

        `settle`: min. time without change of a complete log, s; `wait`: max. time to wait for
        another run, s (then a TakenError).
        """
        with Lock(locate_lock(self.results)) as lock, _interrupt_on_signals():
            lock.acquire(wait)
            self._began = datetime.now(UTC)
            self._log = self.folder / f"{self._began:%Y%m%dT%H%M%SZ}.log"
            try:
                before = read_state(self._state)
            except StateError as error:
                before = None
                self._put_right.append(str(error))
            self._recover(lock)
            self._results_before = _load_results(self.results)
            seen, skips = find_settled_logs(self.logs, settle, before.logs if before else {})
            try:
                failure = self._run_snakemake(cores, skips, lock)
            except OSError as error:
                failure = [str(error)]
            except KeyboardInterrupt:
                failure = ["it was stopped by a signal; the next run continues"]
            summary, after = self._summarise(before, seen, skips, failure)
            try:
                self._keep(summary, after)
            except OSError as error:
                why = [f"the summary cannot be saved: {error}", *self._describe_disk_space()]
                failure = [*summary.failure, *why]
                return summary.model_copy(update={"outcome": "failed", "failure": failure})
        return summary

    def _recover(self, lock: Lock) -> None:
        if note := lock.left_over:
            self._put_right.append(f"the run of {note.get('since')} did not reach its end")
        if ended := end_left_over(note, self.project):
            self._put_right.append(f"steps that still ran, and were ended: {ended}")
        if was_restarted(note) and (doubtful := remove_doubtful(self.results)):
            self._put_right.append(
                f"the machine was restarted: files of its last minute made again: {doubtful}"
            )
        number, size = remove_temporary(self.results, lock.since)
        if number:
            self._put_right.append(f"temporary files removed: {number} ({size / 1e6:.1f} MB)")
        lock.left_over = {}

    def _run_snakemake(self, cores: str, skips: Sequence[Skip], lock: Lock) -> list[str]:
        names = {*self._always_held_back, *(skip.recording for skip in skips if skip.held_back)}
        held_back = self.folder / "held_back.yaml"
        write_json({"held_back": sorted(names)}, held_back)
        arguments = ["--snakefile", str(self._snakefile), f"-c{cores}", "--rerun-incomplete"]
        arguments += ["--nolock"]  # the lock on the results is held instead
        arguments += [*self._flags, "--configfile", str(held_back)]
        if self._config:
            arguments += ["--config", *self._config]
        status = run_snakemake(arguments, self.project, self._log, lock)
        if status == 0:
            return []
        messages = [f"a step said: {error}" for error in find_errors(self._log)[:_MAX_ERRORS]]
        why = f"Snakemake ended with exit status {status}; the last lines of its log:"
        return [*messages, why, *read_last_lines(self._log)]

    def _summarise(
        self,
        before: State | None,
        seen: Mapping[str, Found],
        skips: Sequence[Skip],
        failure: Sequence[str],
    ) -> tuple[Summary, State | None]:
        finished = datetime.now(UTC)
        changes, files = Changes(), []
        after, analysed = None, before.recordings if before else {}
        tables = None
        if not failure:
            try:
                tables = load_tables(self.results)
            except (OSError, ValueError) as error:
                failure = [f"the tables cannot be read: {error}"]
        held_back = {skip.recording for skip in skips if skip.held_back}
        late = sorted(find_changed_logs(seen, scan_drop_zone(self.logs)) - held_back)
        skips = [*skips, *(Skip(name, _CHANGED_WHILE_READ, held_back=False) for name in late)]
        was_skipped = before.skipped if before else {}
        since = {skip.recording: was_skipped.get(skip.recording, self._began) for skip in skips}
        if tables is not None:
            logs = {name: log.files for name, log in seen.items() if name not in held_back}
            after = make_state(tables, finished, logs, since)
            changes = compare_states(before, after, tables, late)
            if names := {each.recording for each in changes.changed if not each.new_log}:
                results = (self._results_before, _load_results(self.results))
                changes.reanalysis += describe_reanalysis(*results, names)
            files = describe_drop_zone(self.results)
            analysed = after.recordings
            after = after.without(late, before)
        summary = Summary(
            began=self._began,
            finished=finished,
            seconds=(finished - self._began).total_seconds(),
            files=files,
            skipped=[
                Skipped(
                    recording=skip.recording,
                    reason=skip.reason,
                    keeps_results=skip.held_back and skip.recording in analysed,
                    since=since[skip.recording],
                )
                for skip in skips
            ],
            put_right=self._put_right,
            failure=[*failure, *(self._describe_disk_space() if failure else [])],
            report=str(self.results / "report/index.html"),
            log=str(self._log),
            **dict(changes),
        )
        return summary, after

    def _describe_disk_space(self) -> list[str]:
        free = disk_usage(self.results).free
        if free >= _LOW_DISK_SPACE:
            return []
        return [f"the disk of the results has only {free / 1e6:.0f} MB left"]

    def _keep(self, summary: Summary, after: State | None) -> None:
        for name in (self._log.stem, "latest"):
            files = [self.folder / f"{name}.{kind}" for kind in ("json", "txt")]
            write_content(summary.model_dump_json(indent=1) + "\n", files[0])
            write_content(format_summary(summary), files[1])
            log = [self._log] if name != "latest" and self._log.is_file() else []
            seal_files(self.results, f"{NIGHTS}/{name}", [*files, *log], {})
        # Last: if the summary was not written, the next run reports the same news.
        if after is not None:
            after.write(self._state)
            seal_files(self.results, f"{NIGHTS}/state", [self._state], {})


def _load_results(results: Path) -> Results:
    """Return the results of a run to compare; empty if there are none that can be read."""
    try:
        return load_results(results)
    except (OSError, ValueError):
        return {}


@contextmanager
def _interrupt_on_signals() -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    replaced = {
        number: signal.signal(number, stop)
        for number in (signal.SIGTERM, signal.SIGHUP)
        if signal.getsignal(number) is not signal.SIG_IGN  # as nohup wants it
    }
    try:
        yield
    finally:
        for number, handler in replaced.items():
            signal.signal(number, handler)
