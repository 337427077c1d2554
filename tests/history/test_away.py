"""A log that is taken away at any point of a run, and put back later, is never lost or judged."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.recordings.kept import Quality
from tests.conftest import few
from tests.history.project import Project, on_access
from tests.workflow.project import put_log

Outcome = dict[str, Any]

MAX_ACCESSES = 400
EVERY = pytest.mark.parametrize("step", few([23], [1]))
"""The accesses before which something is done: each before a release."""


def put(project: Project) -> dict[str, Path]:
    """Put a log, one in a folder, one that is rejected, and their notes; return their paths."""
    logs = project.logs / "s"
    put_log(logs / "a.csv", 1, samples=300)
    put_log(logs / "b/b.csv", 2, samples=300)
    (logs / "c.csv").write_text("wx,ax\n1,x\n")
    (logs / "a.yaml").write_text("device: '7'\n")
    return {"file": logs / "a.csv", "folder": logs / "b", "bad": logs / "c.csv",
            "inside": logs / "b/b.csv", "notes": logs / "a.yaml", "sensor": logs}  # fmt: skip


@pytest.fixture(scope="module")
def expected(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """What a run finds that nothing disturbs."""
    undisturbed = Project(tmp_path_factory.mktemp("undisturbed"))
    put(undisturbed)
    return undisturbed.from_nothing()


class Mover:
    """Takes a path away before one access of the drop zone, and puts it back before another."""

    def __init__(self, path: Path, logs: Path, first: int, until: int) -> None:
        self.path, self.logs, self.first, self.until = path, logs, first, until
        self.away = logs.parent / "away"
        self.count = 0

    def __call__(self, event: str, path: Path, flags: int) -> None:
        if self.logs in (path, *path.parents):
            self.count += 1
            if self.count >= self.until:
                self.put_back()
            elif self.count >= self.first and self.path.exists():
                self.path.rename(self.away)

    def put_back(self) -> None:
        if self.away.exists():
            self.away.rename(self.path)


@EVERY
@pytest.mark.parametrize("stays", few([2], [1, 5, MAX_ACCESSES]))
@pytest.mark.parametrize("which", ["file", "folder", "inside", "bad", "notes", "sensor"])
def test_a_log_that_is_away_for_a_moment_is_looked_at_again(
    which: str, stays: int, step: int, expected: Outcome, tmp_path: Path
) -> None:
    assert expected["s/c"][0]["status"] == "rejected"
    first = count = 0
    while first <= count:
        first += step
        project = Project(tmp_path / f"{first}")
        path = put(project)[which]
        mover = Mover(path, project.logs, first, first + stays)
        with on_access(mover):
            project.run()
        count = mover.count
        for name, (status, reason) in statuses(project).items():
            # While it is away, nothing is concluded about it, other than that a folder is empty.
            known = expected[name][0]["status"] if name in expected else "failed"
            assert status in (known, "failed") or "has no files" in reason, (first, name)
        mover.put_back()
        project.run()
        assert project.outcome() == expected, first
        assert project.run() == [], first
        assert count < MAX_ACCESSES


def statuses(project: Project) -> dict[str, tuple[str, str]]:
    """Return status and reason of each recording that runs have found."""
    return {
        "/".join(path.parts[-3:-1]): (about["status"], str(about.get("reason")))
        for path in sorted(project.results.glob("recordings/*/*/quality.json"))
        for about in [Quality.read(path).recording]
    }


class FailingDisk:
    """Fails when a file of the drop zone is opened, at one of the times that this is done."""

    def __init__(self, logs: Path, at: int, number: int) -> None:
        self.logs, self.at, self.number, self.count = logs, at, number, 0

    def __call__(self, event: str, path: Path, flags: int) -> None:
        if event == "open" and self.logs in path.parents:
            self.count += 1
            if self.count == self.at:
                raise OSError(self.number, os.strerror(self.number), str(path))


@EVERY
@pytest.mark.parametrize("number", few([errno.EIO, errno.ENOENT], [errno.ESTALE, errno.EACCES]))
def test_an_error_of_the_disk_is_no_property_of_a_log(
    number: int, step: int, expected: Outcome, tmp_path: Path
) -> None:
    at, count = 0, 1
    while at < count:
        at += step
        project = Project(tmp_path / f"{at}")
        put(project)
        disk = FailingDisk(project.logs, at, number)
        with on_access(disk):
            project.run()
        count = disk.count
        for name, (status, _) in statuses(project).items():
            assert status in (expected[name][0]["status"], "failed"), (at, name)
        project.run()
        assert project.outcome() == expected, at
        assert project.failed() == set()
