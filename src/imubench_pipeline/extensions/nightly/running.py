"""Run Snakemake in a separate process; its output goes to a file, and to a terminal if any."""

from __future__ import annotations

import contextlib
import os
import re
import select
import signal
import subprocess
import sys
import termios
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from imubench_pipeline.run.faults import TOLD
from imubench_pipeline.run.lock import INHERITED, Lock
from imubench_pipeline.run.recovery import end_group

_MAX_STOP_TIME = 60.0  # s; for Snakemake to stop its steps
_MAX_LAST_LINES = 20
_TRACEBACK = re.compile(
    r"^Traceback \(most recent call last\):\n(?:[ \t].*\n)*(\S.*)", re.MULTILINE
)
_ERASED_LINE = re.compile(rb".*\x1b\[2K", re.DOTALL)
_ERASE_SEQUENCE = b"\x1b[1A\x1b[2K"
_CONTROL_SEQUENCE = re.compile(rb"\x1b\[[0-9;?]*[A-Za-z]|\r")


def run_snakemake(arguments: Sequence[str], project: Path, output: Path, lock: Lock) -> int:
    """Run Snakemake; return its exit status, negative where a signal ended it.

    All output goes to the file `output`. Snakemake also holds the lock, since it may outlive this
    process.
    """
    with output.open("ab", buffering=0) as file:
        terminal = _Terminal(file) if sys.stderr.isatty() else None
        process = subprocess.Popen(
            [sys.executable, "-m", "snakemake", *arguments],
            cwd=project,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=terminal.end if terminal else subprocess.STDOUT,
            pass_fds=(lock.descriptor,),
            env=os.environ | {TOLD: "1", INHERITED: str(lock.descriptor)},
            start_new_session=True,  # all its steps can be ended together
        )
        try:
            lock.note(snakemake=process.pid)
            if terminal:
                terminal.follow(process)
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
            if terminal:
                os.close(terminal.begin)
                os.close(terminal.end)


class _Terminal:
    """A pseudo-terminal for Snakemake, so that it shows its progress as in a terminal.

    The output is passed to the real terminal unchanged, and to a file without erased lines.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._pending = b""
        self._last: bytes | None = None
        self.begin, self.end = os.openpty()
        with contextlib.suppress(termios.error):
            termios.tcsetwinsize(self.end, termios.tcgetwinsize(sys.stderr.fileno()))

    def follow(self, process: subprocess.Popen[bytes]) -> None:
        """Pass on the output of a process until it ends."""
        while True:
            ended = process.poll() is not None
            while select.select([self.begin], [], [], 0.0 if ended else 0.2)[0]:
                written = os.read(self.begin, 65536)
                sys.stderr.buffer.write(written)
                sys.stderr.buffer.flush()
                *lines, self._pending = (self._pending + written).split(b"\n")
                for line in lines:
                    self._keep(line)
            if ended:
                self._keep(self._pending)
                self._keep(b"")
                return

    def _keep(self, line: bytes) -> None:
        """Write a line to the file once the next line does not erase it."""
        if self._last is not None and _ERASE_SEQUENCE not in line:
            with contextlib.suppress(OSError):  # a full disk: the steps say so themselves
                self._file.write(self._last + b"\n")
        text = _CONTROL_SEQUENCE.sub(b"", _ERASED_LINE.sub(b"", line)).rstrip()
        self._last = text if text or not _ERASED_LINE.match(line) else None


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
