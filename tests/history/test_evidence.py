"""What an ingest concluded is looked at again whenever its files are others."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path

import pytest

from tests.history.project import Project, on_access
from tests.workflow.project import put_log


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path / "project")


class Replacer:
    """Puts another file in the place of a log, before one of the times that it is opened."""

    def __init__(self, log: Path, other: Path, at: int) -> None:
        self.log, self.other, self.at, self.count = log, other, at, 0
        self.kept = other.with_name("kept.csv")

    def __call__(self, event: str, path: Path, flags: int) -> None:
        self.count += path == self.log
        if path == self.log and self.count == self.at:
            self.log.rename(self.kept)
            self.other.rename(self.log)

    def undo(self) -> None:
        if self.kept.exists():
            self.log.rename(self.other)
            self.kept.rename(self.log)


def test_a_log_that_is_replaced_while_it_is_read_is_read_again(
    project: Project, tmp_path: Path
) -> None:
    log, other = project.logs / "s/a.csv", tmp_path / "other.csv"
    put_log(other, 2, samples=300)
    put_log(log, 1, samples=300)
    for at in range(1, 30):
        log.touch()  # so that each run reads it
        replacer = Replacer(log, other, at)
        with on_access(replacer):
            project.run()
        replacer.undo()
        project.run()
        assert project.outcome() == project.from_nothing(), at
        if replacer.count < at:
            return
    pytest.fail("the log is opened without end")


def test_two_folders_that_change_places_are_noticed(project: Project) -> None:
    folders = [project.logs / "s" / name for name in ("a", "b")]
    for number, folder in enumerate(folders):
        folder.mkdir()
        rows = "".join(f"{(k * (number + 3)) % 7 / 10:.1f},9.8{k % 5}\n" for k in range(60))
        (folder / "log.csv").write_text(f"wx,ax\n{rows}")
        os.utime(folder / "log.csv", (1e9, 1e9))
    time.sleep(2.1)  # stamps are trusted
    project.run()
    folders[0].rename(project.logs / "s/.c")
    folders[1].rename(folders[0])
    (project.logs / "s/.c").rename(folders[1])
    assert project.run() == ["s/a", "s/b"]
    assert project.outcome() == project.from_nothing()


def test_a_link_whose_target_is_away_has_failed_and_stops_nothing(
    project: Project, tmp_path: Path
) -> None:
    put_log(project.logs / "s/b.csv", 1, samples=300)
    put_log(tmp_path / "store/b.v2/log.csv", 2, samples=300)
    put_log(tmp_path / "store/t/c.csv", 3, samples=300)
    (project.logs / "s/b.v2").symlink_to(tmp_path / "store/b.v2")
    (project.logs / "t").symlink_to(tmp_path / "store/t")
    project.run()
    expected = project.outcome()
    assert {"s/b", "s/b.v2", "t/c"} < expected.keys()
    (tmp_path / "store").rename(tmp_path / "away")
    project.run()
    assert project.outcome()["s/b"] == expected["s/b"]
    assert project.failed() == {"s/b.v2", "t/t"}
    (tmp_path / "away").rename(tmp_path / "store")
    project.run()
    assert project.outcome() == expected


def test_a_link_to_itself_and_a_deep_folder_stop_nothing(project: Project) -> None:
    put_log(project.logs / "s/a.csv", 1, samples=300)
    (project.logs / "s/loop.csv").symlink_to("loop.csv")
    inside = os.open(project.logs / "s", os.O_RDONLY)
    for _ in range(1500):
        os.mkdir("deep", dir_fd=inside)
        below = os.open("deep", os.O_RDONLY, dir_fd=inside)
        os.close(inside)
        inside = below
    os.close(inside)
    try:
        assert project.run() == ["s/a", "s/deep", "s/loop"]
        assert project.outcome()["s/a"][0]["status"] == "ok"
        assert project.run() == []
    finally:  # Python cannot remove so deep a folder
        subprocess.run(["rm", "-rf", str(project.logs / "s/deep")], check=True, timeout=60)


def test_a_sparse_file_of_two_terabytes_costs_the_plan_nothing(project: Project) -> None:
    huge = project.logs / "s/huge.csv"
    huge.touch()
    os.truncate(huge, 2 << 40)
    begin = time.process_time()
    project.run()
    assert project.outcome()["s/huge"][0]["status"] == "rejected"
    huge.touch()
    project.run()
    assert time.process_time() - begin < 20.0  # to read it takes half an hour


def test_files_that_no_channel_is_read_from_are_named(project: Project) -> None:
    put_log(project.logs / "s/a/log.csv", 1, samples=300)
    (project.logs / "s/a/more").mkdir()
    (project.logs / "s/a/more/notes.yaml").write_text("device: '7'\n")
    project.run()
    about, findings, _ = project.outcome()["s/a"]
    assert about["status"] == "ok" and about["device"] == "a"
    (note,) = [row for row in findings if row["finding"] == "unused_files"]
    assert note["value"] == 1 and "more/notes.yaml" in note["detail"]
