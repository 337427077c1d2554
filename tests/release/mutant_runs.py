"""Runs tests against a copy of the package: once to see which lines each runs, then with mutants.

A run is a fork of a process that has the libraries in memory, but nothing of the package: it begins
at once, and imports the copy. The copy keeps what numba has compiled, except of the module that is
changed and of those that import it: numba looks at the text of the module of a kernel alone, and
does not see that a kernel of another, which it has compiled into it, has changed.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

PROJECT = Path(__file__).parents[2]
PACKAGE = PROJECT / "src/imubench_pipeline"
LIBRARIES = (
    "numpy",
    "scipy.integrate",
    "scipy.linalg",
    "scipy.optimize",
    "scipy.signal",
    "scipy.special",
    "scipy.stats",
    "numba",
    "pandas",
    "pyarrow.parquet",
    "pydantic",
    "pint",
    "mpmath",
    "allantools",
    "hypothesis",
)

Lines = dict[str, list[int]]
"""Lines that were run, by module as a path within the package."""

_MEMORY = 12 << 30
_ELSEWHERE = 97
"""What a run ends with that imported another package than the copy."""


@dataclass(frozen=True)
class Seen:
    """What a file of tests does without a mutant."""

    imported: Lines
    tests: dict[str, tuple[float, Lines]]
    """Seconds and lines of each test."""
    shares: bool
    """Whether a test may use what another has computed."""


@dataclass(frozen=True)
class Run:
    """How tests ended."""

    failed: bool
    timed_out: bool
    last: str
    """The test that failed or was stopped."""


def prepare() -> None:
    """Import what all runs need, with one thread each."""
    for library in ("OMP", "OPENBLAS", "NUMBA"):
        os.environ[f"{library}_NUM_THREADS"] = "1"
    for name in LIBRARIES:
        importlib.import_module(name)


def copied(folder: Path) -> Path:
    """Return a folder with a copy of the package, without what was compiled elsewhere."""
    text = b"".join(path.read_bytes() for path in sorted(PACKAGE.rglob("*.py")))
    source = folder.resolve() / hashlib.sha256(text).hexdigest()[:16]
    if not source.is_dir():
        made = Path(tempfile.mkdtemp(dir=folder))
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(PACKAGE, made / "src" / PACKAGE.name, ignore=ignored)
        (made / "config").symlink_to(PROJECT / "config")  # which the package finds beside it
        made.rename(source)
    return source / "src"


def seen(tests: Path, source: Path) -> Seen:
    """Return what a file of tests does without a mutant; as kept beside the copy, if it is known.

    Raises
    ------
    RuntimeError
        If a test fails.
    """
    text = tests.read_bytes()
    kept = source / f"{tests.stem}-{hashlib.sha256(text).hexdigest()[:16]}.json"
    if not kept.exists():
        recorder = _Recorder(source / PACKAGE.name)
        status = _forked([tests], source, recorder, kept.with_suffix(".log"), 3600.0)
        if os.waitstatus_to_exitcode(status) not in (0, 5):
            raise RuntimeError(f"{tests} fails without a mutant: {kept.with_suffix('.log')}")
        recorder.kept.rename(kept)
    read = json.loads(kept.read_text())
    times = {name: (seconds, lines) for name, (seconds, lines) in read["tests"].items()}
    shares = re.search(rb"scope=|^@(functools\.)?(lru_)?cache", text, re.MULTILINE)
    return Seen(read["imported"], times, shares is not None)


def run(
    changed: Path, code: str, tests: Sequence[tuple[str, float]], source: Path, stale: Sequence[str]
) -> Run:
    """Run tests, in their order and to the first that fails, with a module of the copy changed.

    Parameters
    ----------
    changed
        The module, as a path within the package.
    code
        Its text with the change.
    tests
        Each with the seconds that it may take.
    source
        The folder with the copy.
    stale
        Modules whose compiled code is not to be used.
    """
    with tempfile.TemporaryDirectory() as folder:
        package = Path(folder).resolve() / PACKAGE.name
        shutil.copytree(source / PACKAGE.name, package)
        (package / changed).write_text(code)
        for module in map(Path, {str(changed), *stale}):
            for compiled in (package / module.parent / "__pycache__").glob(f"{module.stem}.*"):
                compiled.unlink()
        log = Path(folder, "log")
        files = dict.fromkeys(PROJECT / name.partition("::")[0] for name, _ in tests)
        longest = 60.0 + sum(seconds for _, seconds in tests)
        order = _Order(dict(tests), package, Path(folder, "last"))
        status = _forked(list(files), package.parent, order, log, longest)
        last = order.last.read_text() if order.last.exists() else _words(log)
        if os.WIFSIGNALED(status):
            return Run(True, os.WTERMSIG(status) in (signal.SIGALRM, signal.SIGKILL), last)
        if os.WEXITSTATUS(status) == _ELSEWHERE:
            raise RuntimeError(f"tests of {changed} did not import the copy: {log.read_text()}")
        return Run(os.WEXITSTATUS(status) not in (0, 5), False, last)


def _words(log: Path) -> str:
    """Return what a run said that came to no test."""
    said = re.findall(r"^E +(.*)", log.read_text(errors="replace"), re.MULTILINE)
    return f"import: {said[-1] if said else log.read_text(errors='replace')[-300:]}"


def _forked(files: list[Path], source: Path, plugin: _Order, log: Path, longest: float) -> int:
    """Run files of tests in a fork, and return how it ended, as `os.waitpid` says it."""
    child = os.fork()
    if child:
        return _awaited(child, longest)
    code = 1
    try:
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(output, 1)
        os.dup2(output, 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        for name in [name for name in sys.modules if name.split(".")[0] in (PACKAGE.name, "tests")]:
            del sys.modules[name]
        os.chdir(PROJECT)
        os.environ["PYTHONPATH"] = str(source)
        sys.path.insert(0, str(source))
        given = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not release", "--assert=plain"]
        code = int(pytest.main([*given, *map(str, files)], plugins=[plugin]))
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)


def _awaited(child: int, longest: float) -> int:
    end = time.monotonic() + longest
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            break
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
            end = float("inf")
        time.sleep(0.02)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what its tests have started
    return status


class _Order:
    """Runs the tests that are named alone, in their order, each within its time."""

    def __init__(self, tests: dict[str, float], package: Path, last: Path):
        self.tests, self.package, self.last = tests, package, last

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave out what is not named."""
        places = {name: place for place, name in enumerate(self.tests)}
        items[:] = sorted(
            (item for item in items if item.nodeid in places), key=lambda item: places[item.nodeid]
        )

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Stop the process if a test takes too long, in compiled code, too."""
        self.last.write_text(item.nodeid)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, self.tests[item.nodeid])
        ended = yield
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        return ended

    def pytest_sessionfinish(self) -> None:
        """Refuse a run against another package."""
        imported = sys.modules.get(PACKAGE.name)
        if imported is not None and Path(imported.__file__ or "").parent != self.package:
            os._exit(_ELSEWHERE)


class _Recorder(_Order):
    """Notes how long each test takes, and which lines of the package it runs."""

    def __init__(self, package: Path):
        super().__init__({}, package, package.parent / f"last-{os.getpid()}")
        self.kept = package.parent / f"seen-{os.getpid()}.json"
        self.prefix = f"{package}/"
        self.left: dict[tuple[str, int, str], set[int]] = {}
        self.lines: dict[str, set[int]] = {}
        self.imported: Lines = {}
        self.found: dict[str, tuple[float, Lines]] = {}
        self.caches: list[Any] = []
        self.compiling, self.compiled = 0, 0.0

    def pytest_sessionstart(self) -> None:
        """Begin with what importing runs; leave the compiler alone."""
        from numba.core import event

        event.Listener.register(type(self))
        event.register("numba:compile", self)
        self._trace()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Keep what importing has run."""
        self.imported = self._lines()
        self.caches = [
            value
            for name, module in list(sys.modules.items())
            if name.startswith(PACKAGE.name)
            for value in vars(module).values()
            if hasattr(value, "cache_clear")
        ]

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Note one test; what the package has kept of another does not hide what it needs."""
        for kept in self.caches:
            kept.cache_clear()
        self.left, self.lines, self.compiled = {}, {}, 0.0
        self._trace()
        begin = time.perf_counter()
        ended = yield
        seconds = time.perf_counter() - begin - self.compiled
        self.found[item.nodeid] = (seconds, self._lines())
        return ended

    def pytest_sessionfinish(self) -> None:
        """Write what was seen."""
        sys.settrace(None)
        super().pytest_sessionfinish()
        self.kept.write_text(json.dumps({"imported": self.imported, "tests": self.found}))

    def notify(self, event: Any) -> None:
        """Leave the compiler alone, which would be slow, as numba tells when it compiles."""
        if event.is_start:
            self.compiling += 1
            self.began = time.perf_counter() if self.compiling == 1 else self.began
            sys.settrace(None)
        else:
            self.compiling -= 1
            if self.compiling == 0:
                self.compiled += time.perf_counter() - self.began
                self._trace()

    def _trace(self) -> None:
        threading.settrace(self._traced)
        sys.settrace(self._traced)

    def _lines(self) -> Lines:
        return {name.removeprefix(self.prefix): sorted(rows) for name, rows in self.lines.items()}

    def _traced(self, frame: FrameType, event: str, argument: object) -> Any:
        code = frame.f_code
        if not code.co_filename.startswith(self.prefix):
            return None
        key = code.co_filename, code.co_firstlineno, code.co_name
        left = self.left.get(key)
        if left is None:
            left = self.left[key] = {line for *_, line in code.co_lines() if line is not None}
        if not left:
            return None  # nothing new will be seen
        rows = self.lines.setdefault(code.co_filename, set())

        def within(frame: FrameType, event: str, argument: object) -> Any:
            rows.add(frame.f_lineno)
            left.discard(frame.f_lineno)
            return within

        return within(frame, event, argument)
