"""Mistakes in a real log, read as a user's log is: what is found, where, and that it is unfit."""

import gzip
from pathlib import Path

import pytest
import yaml

from imubench_pipeline.recordings.fitness import derive_doubts, judge_fitness
from imubench_pipeline.recordings.ingest import ingest
from imubench_pipeline.recordings.recording import LogNames
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat, RecordingNotes
from imubench_pipeline.tables.findings import Finding
from tests.conftest import PROJECT

LINES = 20_000


@pytest.fixture
def tag(shared: Path) -> list[str]:
    """Return the header and the first lines of the log of an animal-borne tag, 1 Hz."""
    with gzip.open(shared / "logs/cats/day1.csv.gz", "rt") as file:
        return [next(file) for _ in range(LINES + 1)]


def found(lines: list[str], folder: Path, **channels: dict[str, str]) -> list[Finding]:
    (folder / "log.csv").write_text("".join(lines))
    log = yaml.safe_load((PROJECT / "config/sensors/cats_tag.yaml").read_text())["log"]
    log["channels"] |= channels
    layout = LogFormat.model_validate(log)
    kept = ingest(
        folder / "log.csv", layout, RecordingNotes(), QualitySettings(), folder / "kept", LogNames()
    )
    return kept.findings


def verdict(findings: list[Finding]) -> str:
    return judge_fitness(derive_doubts([f.row("cats_tag", "day1") for f in findings], [], []))


def test_one_column_for_two_channels(tag: list[str], tmp_path: Path) -> None:
    twice = {"column": "gyro_x_mrad_s", "unit": "deg/s"}
    findings = found(tag, tmp_path, gyro_y=twice)
    told = {f.channel: f.value for f in findings if f.finding == "channel_twice"}
    # 1 deg/s is 17.45 mrad/s.
    assert told == pytest.approx({"gyro_y": 17.4533, "gyro_x": 1 / 17.4533}, rel=1e-5)
    assert verdict(findings) == "unfit"


def test_the_log_as_it_is_has_none_of_it(tag: list[str], tmp_path: Path) -> None:
    names = {f.finding for f in found(tag, tmp_path)}
    mistakes = {"channel_twice", "log_twice", "repeated_stretch", "joined", "interleaved"}
    mistakes |= {"shared_noise"}
    assert not names & (mistakes | {"held_samples", "missing_samples", "segments", "stuck"})


def test_holes_and_pauses_are_placed(tag: list[str], tmp_path: Path) -> None:
    header, *rows = tag
    del rows[9000:9250], rows[4000:4100]
    rows[100] = rows[100].split(",")[0] + 7 * "," + "\n"
    findings = {(f.finding, f.channel): f for f in found([header, *rows], tmp_path)}
    missing = findings["missing_samples", None]
    assert missing.value == 350
    assert (missing.start, missing.end) == pytest.approx((9000.0, 9250.0), abs=1.0)
    assert "the longest 250 s, from 9000" in missing.detail
    empty = findings["empty_cells", "gyro_y"]
    assert (empty.start, empty.end) == pytest.approx((100.0, 101.0), abs=0.1)


def test_an_axis_of_zeros(tag: list[str], tmp_path: Path) -> None:
    header, *rows = tag
    cells = [row.split(",") for row in rows]
    zero = [",".join([*row[:2], "0", *row[3:]]) for row in cells]
    findings = found([header, *zero], tmp_path)
    (stuck,) = [f for f in findings if f.finding == "stuck"]
    assert (stuck.channel, stuck.value, stuck.severity) == ("gyro_x", 0.0, "fatal")
    assert "is exactly 0" in stuck.detail
    assert verdict(findings) == "unfit"


def test_a_log_that_was_appended_to_itself(tag: list[str], tmp_path: Path) -> None:
    header, *rows = tag
    findings = found([header, *rows[:5000], *rows[:5000]], tmp_path)
    (twice,) = [f for f in findings if f.finding == "log_twice"]
    assert (twice.start, twice.end) == pytest.approx((5000.0, 10_000.0), abs=20.0)
    assert verdict(findings) == "unfit"
