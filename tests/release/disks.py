"""Disks that are full, or may not be written to, and the run that makes it good."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from tests.release.small import (
    LONGEST,
    NIGHTLY,
    SNAKEMAKE,
    FaultError,
    Undisturbed,
    command,
    completed,
    left_over,
    put_state,
    small_project,
    visible,
)
from tests.workflow.project import Project

_FULL = (
    (SNAKEMAKE, 0.02, False),
    (NIGHTLY, 0.3, False),
    (SNAKEMAKE, 0.8, False),
    (SNAKEMAKE, 0.5, True),
    (NIGHTLY, 0.5, True),
)
"""What runs, the share of the room that its results need, and whether all the project is there."""


def disks(folder: Path, expected: Undisturbed) -> Iterator[tuple[str, Callable[[], str]]]:
    """Yield the name of each case, and what tries it and says what the run met.

    Each raises `FaultError` where something is not as it should be, or cannot be tried.
    """
    for run, share, notes in _FULL:
        name = f"{run}, disk of the {'project' if notes else 'results'} full at {share:.0%}"
        place = folder / f"full_{run}_{share}"
        yield name, partial(_disk_full, place, expected, run, share, notes=notes)
    for run in (SNAKEMAKE, NIGHTLY):
        name = f"{run}, results on a read-only disk"
        yield name, partial(_read_only, folder / f"read_only_{run}", expected, run)


@contextlib.contextmanager
def _small_disk(place: Path, size: int) -> Iterator[Callable[[str], None]]:
    """Mount a file system in memory; gives what mounts it again with other options."""
    place.mkdir(parents=True, exist_ok=True)
    if shutil.which("mount") is None or os.geteuid() != 0:
        raise FaultError("not tried: only root mounts a disk")
    mount = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
    done = subprocess.run(mount, capture_output=True, text=True, check=False)
    if done.returncode:
        raise FaultError(f"not tried: {done.stderr.strip()}")

    def again(options: str) -> None:
        subprocess.run(["mount", "-o", f"remount,{options}", str(place)], check=True)

    try:
        yield again
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def _disk_full(folder: Path, expected: Undisturbed, run: str, share: float, *, notes: bool) -> str:
    """Let a run meet a full disk, then give it room; return what it met."""
    needed = sum(path.stat().st_blocks * 512 for path in visible(expected.results[0]))
    place = folder if notes else folder / "results"
    with _small_disk(place, 1 << 30) as again:
        made = small_project(folder, 0, expected.samples)
        used = shutil.disk_usage(place).used
        again(f"size={used + int(needed * share)}")
        met = _refused(made, expected, run, "No space left on device")
        again(f"size={1 << 30}")
        _made_good(made, expected, run, 0)
    return met


def _read_only(folder: Path, expected: Undisturbed, run: str) -> str:
    """Let a run meet results that it may not write, then let it; return what it met."""
    made = small_project(folder, 0, expected.samples)
    with _small_disk(made.results, 1 << 30) as again:
        if made.run().returncode:
            raise FaultError("a run failed on a file system in memory")
        put_state(made.folder, 1, expected.samples)
        again("ro")
        reason = "Write-protected output files" if run == SNAKEMAKE else "Read-only file system"
        met = _refused(made, expected, run, reason)
        if found := expected.differences(made.results, 0):
            raise FaultError(f"read-only results have changed: {found}")
        again("rw")
        _made_good(made, expected, run, 1)
    return met


def _run(made: Project, run: str) -> tuple[int, str]:
    done = subprocess.run(
        command(made, run), cwd=made.place, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, check=False, timeout=LONGEST,
    )  # fmt: skip
    return done.returncode, done.stdout


def _refused(made: Project, expected: Undisturbed, run: str, reason: str) -> str:
    status, said = _run(made, run)
    if completed(run, status):
        raise FaultError(f"the run completed:\n{said[-4000:]}")
    if reason not in said:
        raise FaultError(f"status {status}, and not a word of {reason!r}:\n{said[-4000:]}")
    if found := expected.faults(made.results):
        raise FaultError(f"status {status}: {found}")
    return f"status {status}, {reason!r}, all files whole; made good by the next run"


def _made_good(made: Project, expected: Undisturbed, run: str, state: int) -> None:
    if run == SNAKEMAKE:
        made.run("--unlock").check_returncode()
    status, said = _run(made, run)
    if not completed(run, status):
        raise FaultError(f"the next run ended with {status}:\n{said[-4000:]}")
    if found := expected.differences(made.results, state):
        raise FaultError(f"afterwards: {found}")
    if left := left_over(made.results):
        raise FaultError(f"left over: {left}")
    if jobs := made.job_list():
        raise FaultError(f"left to do: {sorted(jobs)}")
