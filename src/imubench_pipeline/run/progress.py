"""While a run goes on: one line in the terminal that says how far it is.

Where there is no terminal, Snakemake's own lines stay as they are. They go to its log file in
either case.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from typing import Any, TextIO

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.spinner import Spinner
from rich.table import Table
from rich.text import Text
from snakemake_interface_logger_plugins.common import LogEvent

from imubench_pipeline.report.run_summary import one_line

_LOGGER = "snakemake.logging"
_TO_TERMINAL = "DefaultStreamHandler"
_SHOWN_BY_THE_LINE = {
    LogEvent.JOB_INFO,
    LogEvent.JOB_STARTED,
    LogEvent.JOB_FINISHED,
    LogEvent.PROGRESS,
    LogEvent.SHELLCMD,
    LogEvent.RESOURCES_INFO,
}
_OF_THE_SCHEDULER = ("Select jobs to execute...", "Execute ")
_BAR = 16
_ROOM_FOR_BAR = 60
_STYLES = {logging.ERROR: "red", logging.WARNING: "yellow"}


def follow() -> None:
    """Show the progress of the jobs of this run, if Snakemake writes to a terminal.

    Nothing changes where another logger was asked for, or all details (``--verbose``).
    """
    logger = logging.getLogger(_LOGGER)
    for handler in logger.handlers:
        if (
            handler.name == _TO_TERMINAL
            and isinstance(handler, logging.StreamHandler)
            and handler.stream.isatty()
            and not Console(file=handler.stream).is_dumb_terminal
            and not logger.isEnabledFor(logging.DEBUG)
        ):
            logger.removeHandler(handler)
            logger.addHandler(_OneLine(handler))
            return


class _OneLine(logging.Handler):
    """Stands in for Snakemake's handler: what is more than progress is printed above the line.

    The line is there while jobs run. It is a single one, because a step writes its errors to the
    terminal by itself: a taller display would be drawn over them.
    """

    def __init__(self, replaced: logging.StreamHandler[TextIO]) -> None:
        super().__init__()
        self._replaced = replaced
        self._console = Console(file=replaced.stream, highlight=False, markup=False, emoji=False)
        self._running: dict[int, tuple[str, float]] = {}
        self._begin = time.monotonic()
        self._spinner = Spinner("dots")
        self._live: Live | None = None
        self._done, self._total = 0, 0

    def emit(self, record: logging.LogRecord) -> None:
        """Show a record."""
        if not self._replaced.filter(record):
            return
        about: Mapping[str, Any] = record.__dict__
        event = about.get("event")
        if event == LogEvent.JOB_INFO:
            self._started(about)
        elif event == LogEvent.JOB_FINISHED:
            self._ended(about.get("job_id"))
        elif event == LogEvent.PROGRESS:
            self._done, self._total = about["done"], about["total"]
        if event in _SHOWN_BY_THE_LINE or record.getMessage().startswith(_OF_THE_SCHEDULER):
            return
        text = self._replaced.format(record)
        if text:
            self._console.print(Text(text, style=_STYLES.get(record.levelno, "")), soft_wrap=True)
        if event == LogEvent.JOB_ERROR:
            self._ended(about.get("jobid"))

    def close(self) -> None:
        """Take the line away."""
        self._running.clear()
        self._hide()
        super().close()

    def _started(self, about: Mapping[str, Any]) -> None:
        of = "/".join(str(value) for value in (about.get("wildcards") or {}).values())
        label = one_line(f"{about.get('rule_name')} {of}")
        self._running[about["jobid"]] = (label, time.monotonic())
        if self._live is None:
            self._live = Live(
                get_renderable=self._line,
                console=self._console,
                transient=True,
                redirect_stdout=False,
                redirect_stderr=False,
                refresh_per_second=4,
            )
            self._live.start()

    def _ended(self, job: int | None) -> None:
        if job is not None:
            self._running.pop(job, None)
        if not self._running:
            self._hide()

    def _hide(self) -> None:
        if self._live is not None:
            self._live.stop()
            self._live = None

    def _line(self) -> Table:
        room = self._console.width
        line = Table.grid(padding=(0, 1))
        cells: list[RenderableType] = [self._spinner]
        line.add_column(width=1)
        if room >= _ROOM_FOR_BAR:
            line.add_column(width=_BAR)
            cells.append(ProgressBar(self._total or 1, self._done, width=_BAR))
        width = sum(column.width or 0 for column in line.columns) + len(cells)
        line.add_column(width=room - width, no_wrap=True, overflow="ellipsis")
        line.add_row(*cells, Text(self._said()))
        return line

    def _said(self) -> str:
        now = time.monotonic()
        running = ", ".join(
            f"{label} {_clock(now - begin)}" for label, begin in list(self._running.values())
        )
        if not self._done:
            return f"first steps: {running}"
        left = (now - self._begin) / self._done * (self._total - self._done)
        return f"{self._done} of {self._total} steps, about {_rough(left)} left: {running}"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes}:{rest:02}"


def _rough(seconds: float) -> str:
    for size, name in ((3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{round(seconds / size)} {name}"
    return f"{round(seconds)} s"
