"""Runs in surroundings that programs seldom meet: the tables must be those of any other run.

``python -m tests.release.surroundings`` lets a small project run without folders for caches, with
few descriptors or addresses, in another locale, as another user, with clocks that are wrong. Each
run must complete and leave the very files that an undisturbed run leaves.
"""

from __future__ import annotations

import argparse
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import imubench_pipeline
from tests.release.small import (
    LONGEST,
    FaultError,
    Undisturbed,
    left_over,
    put_state,
    small_project,
    visible,
)
from tests.workflow.project import Project

_SAMPLES = 4000
_COMPILING = 3  # times as long, where what numba has compiled is not there
_NOWHERE = "/proc/nowhere"  # where root cannot make a folder, either
_NOBODY = 65534


@dataclass(frozen=True)
class Surroundings:
    """What a run meets.

    Attributes
    ----------
    environment : mapping
        Of the run, beside that of this process; None: without this variable. ``{folder}`` is that
        of the project, ``{clock}`` the library of another clock.
    before : tuple of str
        Words before its command.
    prepare : callable
        Is given the project first.
    check : callable
        Is given the project afterwards.
    refused : str
        What the run may say and end with, unless this is empty; the next one, without the
        surroundings, must make it good.
    """

    environment: Mapping[str, str | None] = field(default_factory=dict)
    before: tuple[str, ...] = ()
    prepare: Callable[[Project], None] = lambda made: None
    check: Callable[[Project], None] = lambda made: None
    refused: str = ""


def _limited(words: str) -> tuple[str, ...]:
    return ("sh", "-c", f'{words} && exec "$0" "$@"')


def _all_private(made: Project) -> None:
    for path in visible(made.results):
        if stat.S_IMODE(path.stat().st_mode) & 0o077:
            raise FaultError(f"{path} is not as the umask says")


def _stamped(seconds: float) -> Callable[[Project], None]:
    """Have all logs and settings a stamp so far from now."""

    def stamp(made: Project) -> None:
        for path in (*made.folder.glob("logs/*/*"), *made.folder.glob("sensors/*")):
            os.utime(path, (time.time() + seconds,) * 2)

    return stamp


def _given_to_nobody(made: Project) -> None:
    made.folder.parent.chmod(0o755)
    for path in (made.folder, *made.folder.rglob("*")):
        os.chown(path, _NOBODY, _NOBODY, follow_symlinks=False)


def _clock(*offsets: float) -> dict[str, str | None]:
    """Return the environment of a clock that is ahead by these, s, one after the other."""
    return {"LD_PRELOAD": "{clock}", "OTHER_CLOCK": " ".join(f"{ahead:.0f}" for ahead in offsets)}


def _all_done(made: Project) -> None:
    if left := made.job_list():
        raise FaultError(f"left to do: {sorted(left)}")


def _run_a_year_ahead(made: Project) -> None:
    """Leave results of other logs and settings, whose stamps are of the next year."""
    put_state(made.folder, 1, _SAMPLES)
    made.environment = _environment(_clock(_YEAR), made)
    if (done := made.run()).returncode:
        raise FaultError(f"status {done.returncode}:\n{(done.stdout + done.stderr)[-3000:]}")
    made.environment = None
    put_state(made.folder, 0, _SAMPLES)


def _environment(changes: Mapping[str, str | None], made: Project) -> dict[str, str]:
    clock = made.folder.parent / _CLOCK
    if "{clock}" in changes.values() and not clock.exists():
        raise FaultError("not tried: there is no compiler of C")
    places = {"{folder}": str(made.folder), "{clock}": str(clock)}
    environment = {}
    for key, value in (os.environ | changes).items():
        if value is not None:
            for word, place in places.items():
                value = value.replace(word, place)
            environment[key] = value
    return environment


def _build_clock(folder: Path) -> None:
    """Compile the library of another clock; without a compiler, there is none."""
    if (compiler := shutil.which("cc") or shutil.which("gcc")) is not None:
        source = Path(__file__).with_name("other_clock.c")
        options = ["-O1", "-Wall", "-Werror", "-shared", "-fPIC"]
        subprocess.run([compiler, *options, "-o", folder / _CLOCK, source, "-ldl"], check=True)


_CLOCK = "other_clock.so"
_YEAR = 365.25 * 86400.0
_NO_CACHES = dict.fromkeys(("NUMBA_CACHE_DIR", "MPLCONFIGDIR"), _NOWHERE)
CASES = {
    "caches that cannot be written": Surroundings(_NO_CACHES),
    # Snakemake keeps the sources of workflows there, and begins with making the folder.
    "no place for any cache": Surroundings(
        {"HOME": _NOWHERE, "XDG_CACHE_HOME": _NOWHERE}, refused=f"directory: '{_NOWHERE}'"
    ),
    "no HOME": Surroundings(dict.fromkeys(("HOME", "XDG_CACHE_HOME", "XDG_CONFIG_HOME"))),
    "TMPDIR that is not there": Surroundings({"TMPDIR": _NOWHERE}),
    "umask 077": Surroundings(before=_limited("umask 077"), check=_all_private),
    "64 descriptors": Surroundings(before=_limited("ulimit -n 64")),
    # Arrow and numba reserve addresses, and so does each thread of Snakemake.
    "2 GB of addresses": Surroundings(
        before=_limited("ulimit -v 2000000"), refused="can't start new thread"
    ),
    "4 GB of addresses": Surroundings(before=_limited("ulimit -v 4000000")),
    "LANG=C without UTF-8": Surroundings(
        {"LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    ),
    "every warning an error": Surroundings({"PYTHONWARNINGS": "error"}),
    "logs of the next year": Surroundings(prepare=_stamped(_YEAR)),
    "logs of 1971": Surroundings(prepare=_stamped(_YEAR - time.time())),
    "a user who owns nothing else": Surroundings(
        {"HOME": _NOWHERE, "XDG_CACHE_HOME": "{folder}/cache"},
        ("setpriv", f"--reuid={_NOBODY}", f"--regid={_NOBODY}", "--clear-groups"),
        _given_to_nobody,
    ),
    "a clock that is five years ahead": Surroundings(_clock(5 * _YEAR), check=_all_done),
    "a clock that jumps every two seconds": Surroundings(
        _clock(0.0, -3600.0, 86400.0, -_YEAR, 7.0, _YEAR), check=_all_done
    ),
    "a clock that has gone back a year since the run before": Surroundings(
        prepare=_run_a_year_ahead, check=_all_done
    ),
}


def _tried(name: str, folder: Path, expected: Undisturbed) -> str:
    """Run in some surroundings; return what came of it."""
    around = CASES[name]
    if around.before and shutil.which(around.before[0]) is None:
        return f"not tried: there is no {around.before[0]}"
    reached = [*around.before, "test", "-x", sys.executable]
    if subprocess.run(reached, check=False).returncode:
        return f"not tried: {sys.executable} is out of reach there"
    made = small_project(folder, 0, expected.samples)
    around.prepare(made)
    environment = _environment(around.environment, made)
    begin = time.monotonic()
    done = subprocess.run(
        [*around.before, *made.command()], cwd=made.place, env=environment, capture_output=True,
        text=True, errors="replace", check=False, timeout=_COMPILING * LONGEST,
    )  # fmt: skip
    came = "the same files"
    if done.returncode and around.refused and around.refused in done.stderr:
        came = f"status {done.returncode}, {around.refused!r}; made good by the next run"
        made.run("--unlock")
        done = made.run()
    if done.returncode:
        raise FaultError(f"status {done.returncode}:\n{(done.stdout + done.stderr)[-3000:]}")
    if found := expected.differences(made.results, 0):
        raise FaultError(f"differences: {found}")
    if left := left_over(made.results):
        raise FaultError(f"left over: {left}")
    around.check(made)
    return f"{came}, {time.monotonic() - begin:.0f} s"


def main() -> int:
    """Run in each of the surroundings, and say what came of it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    given = parser.parse_args()
    faults = 0
    print(f"of {Path(imubench_pipeline.__file__).parent}", flush=True)
    with tempfile.TemporaryDirectory(prefix="imubench.surroundings.") as name:
        folder = Path(name)
        expected = Undisturbed(folder, 1, _SAMPLES)
        _build_clock(folder)
        for number, case in enumerate(given.cases):
            try:
                print(f"{case}: {_tried(case, folder / f'case_{number}', expected)}", flush=True)
            except FaultError as fault:
                faults += 1
                print(f"{case}: FAULT: {fault}", flush=True)
    print(f"\n{len(given.cases)} surroundings, {faults} faults")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
