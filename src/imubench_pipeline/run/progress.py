"""Show the progress of a run, a line for each finished recording, and errors.

This is a logger plugin of Snakemake (`snakemake_logger_plugin_imubench`): ``logger: imubench`` of a
profile. The messages of Snakemake are in its log file; the path is printed at the end.
"""

import logging
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text
from snakemake.logging import ColorizingTextHandler
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

from imubench_pipeline.report.run_summary import fold_text

OURS: Mapping[str, Any] = {"imubench": True}  # shown unchanged: `logger.info(text, extra=OURS)`

_EVENTS_OF_PROGRESS_LINE = {
    *(LogEvent.JOB_INFO, LogEvent.JOB_STARTED, LogEvent.JOB_FINISHED, LogEvent.PROGRESS),
    *(LogEvent.RUN_INFO, LogEvent.SHELLCMD, LogEvent.RESOURCES_INFO),
}
_LOG_FILE_PREFIX = "Complete log"
_BAR_WIDTH = 16
_MIN_WIDTH_FOR_BAR = 60
_LEVEL_STYLES = {logging.ERROR: "red", logging.WARNING: "yellow"}
_MAX_LINE_LENGTH = 200
_MIN_LINE_INTERVAL = 10.0  # min. time between two lines of progress in a pipe, s.
_TIME_UNITS = ((3600, "h"), (60, "min"))
Recording = tuple[str, str]  # sensor and name
_expected: Counter[Recording] = Counter()
_describe_end: list[Callable[[str, str], str]] = []


def follow(jobs: Iterable[Recording], describe: Callable[[str, str], str]) -> None:
    """Print `describe(sensor, name)` after the last job of a recording; `jobs`: one entry a job."""
    _expected.clear()
    _expected.update(jobs)
    _describe_end[:] = [describe]


class LogHandler(LogHandlerBase):
    """Shows the progress of a run, errors and warnings; a dry run shows the output of Snakemake.

    A terminal has a single line while jobs run: a taller display would cover the errors of steps.
    """

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def __post_init__(self) -> None:
        asked = self.common_settings
        stream = sys.stdout if asked.stdout else sys.stderr
        self._whole: ColorizingTextHandler | None = None
        if asked.dryrun or asked.verbose or asked.debug_dag:
            self._whole = ColorizingTextHandler(nocolor=asked.nocolor, stream=stream)
        self._console = Console(
            file=stream, highlight=False, markup=False, emoji=False, no_color=asked.nocolor
        )
        self._moves = stream.isatty() and not self._console.is_dumb_terminal
        self._running: dict[int, tuple[str, float]] = {}
        self._of: dict[int, Recording] = {}
        self._begin = self._last_line = time.monotonic()
        self._spinner = Spinner("dots")
        self._live: Live | None = None
        self._done, self._total = 0, 0

    def emit(self, record: logging.LogRecord) -> None:
        """Print a log record of Snakemake, or update the line of progress."""
        if self._whole is not None:
            self._whole.setFormatter(self.formatter)
            self._whole.emit(record)
            return
        about: Mapping[str, Any] = record.__dict__
        event = about.get("event")
        if event == LogEvent.JOB_INFO:
            wildcards: Mapping[str, Any] = about.get("wildcards") or {}
            label = fold_text(f"{about.get('rule_name')} {'/'.join(map(str, wildcards.values()))}")
            self._running[about["jobid"]] = (label, time.monotonic())
            if wildcards.get("sensor") and wildcards.get("recording"):
                self._of[about["jobid"]] = str(wildcards["sensor"]), str(wildcards["recording"])
            if self._live is None and self._moves:
                self._live = Live(
                    get_renderable=self._make_line,
                    console=self._console,
                    transient=True,
                    redirect_stdout=False,
                    redirect_stderr=False,
                    refresh_per_second=4,
                )
                self._live.start()
        elif event == LogEvent.JOB_FINISHED:
            self._end_job(about.get("job_id"))
        elif event == LogEvent.PROGRESS:
            self._done, self._total = about["done"], about["total"]
            now = time.monotonic()
            waited = now - self._last_line >= _MIN_LINE_INTERVAL
            if not self._moves and waited and self._done < self._total:
                self._last_line = now
                self._print(self._describe_progress(now))
        if event in _EVENTS_OF_PROGRESS_LINE:
            return
        text = self.format(record)
        shown = record.levelno >= logging.WARNING or "imubench" in about
        if text and (shown or text.startswith(_LOG_FILE_PREFIX)):
            self._print(text, _LEVEL_STYLES.get(record.levelno, ""))
        if event == LogEvent.JOB_ERROR:
            self._end_job(about.get("jobid"))

    def close(self) -> None:
        """Remove the line of progress."""
        self._running.clear()
        self._hide()
        super().close()

    def _print(self, text: str, style: str = "") -> None:
        self._console.print(Text(text, style=style), soft_wrap=True)

    def _end_job(self, job: int | None) -> None:
        if job is not None:
            self._running.pop(job, None)
            recording = self._of.pop(job, None)
            if recording and recording in _expected:
                _expected[recording] -= 1
                if _expected[recording] == 0:  # its last job has ended
                    for describe in _describe_end:
                        self._print(fold_text(describe(*recording), _MAX_LINE_LENGTH))
        if not self._running:
            self._hide()

    def _hide(self) -> None:
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _make_line(self) -> Table:
        room = self._console.width
        line = Table.grid(padding=(0, 1))
        cells: list[RenderableType] = [self._spinner]
        line.add_column(width=1)
        if room >= _MIN_WIDTH_FOR_BAR:
            line.add_column(width=_BAR_WIDTH)
            cells.append(ProgressBar(self._total or 1, self._done, width=_BAR_WIDTH))
        width = sum(column.width or 0 for column in line.columns) + len(cells)
        line.add_column(width=room - width, no_wrap=True, overflow="ellipsis")
        now = time.monotonic()
        running = ", ".join(
            f"{label} {int(now - begin) // 60}:{int(now - begin) % 60:02}"
            for label, begin in list(self._running.values())
        )
        progress = self._describe_progress(now) if self._done else "first steps"
        line.add_row(*cells, Text(f"{progress}: {running}"))
        return line

    def _describe_progress(self, now: float) -> str:
        left = (now - self._begin) / self._done * (self._total - self._done)
        size, unit = next((one for one in _TIME_UNITS if left >= 2 * one[0]), (1, "s"))
        return f"{self._done} of {self._total} steps, about {round(left / size)} {unit} left"
