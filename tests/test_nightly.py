import errno
import os
import platform
import subprocess
import sys
import threading
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psutil
import pytest
import yaml

from imubench_pipeline.extensions.nightly.night import Night
from imubench_pipeline.extensions.nightly.recovery import end_left_over, remove_doubtful
from imubench_pipeline.extensions.nightly.run_differences import load_results
from imubench_pipeline.extensions.nightly.settling import (
    Skip,
    find_changed_logs,
    find_complete_name,
    find_settled_logs,
    find_unsettled_logs,
    scan_drop_zone,
)
from imubench_pipeline.extensions.nightly.summary import (
    STATUS,
    Changes,
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
from imubench_pipeline.run import recovery
from imubench_pipeline.run.lock import Lock, TakenError, read_note
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.files import replace_file, write, write_json
from tests.test_configuration import SENSOR

NOW = datetime(2026, 10, 20, 1, 30, tzinfo=UTC)
OLD = time.time() - 3600.0


# The lock


def test_a_second_run_is_told_who_goes_on(tmp_path: Path) -> None:
    with Lock(tmp_path / "lock") as first:
        first.acquire()
        with pytest.raises(TakenError, match=rf"process {os.getpid()} \(.*\), since 20\d\d-"):
            Lock(tmp_path / "lock").acquire()
    with Lock(tmp_path / "lock") as second:
        second.acquire()
        assert second.left_over == {}


def test_a_run_may_wait_for_the_one_before(tmp_path: Path) -> None:
    first = Lock(tmp_path / "lock")
    first.acquire()
    threading.Timer(0.3, first.release).start()
    with Lock(tmp_path / "lock") as second:
        second.acquire(wait=30.0)


HOLDER = """
import subprocess, sys
from pathlib import Path
from imubench_pipeline.run.lock import Lock
lock = Lock(Path(sys.argv[1]))
lock.acquire()
child = subprocess.Popen(["sleep", "600"], pass_fds=[lock.descriptor])
lock.note(snakemake=child.pid)
print(child.pid, flush=True)
child.wait()
"""


@pytest.mark.release
def test_the_lock_holds_while_snakemake_lives_and_its_note_stays(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout
        child = psutil.Process(int(holder.stdout.readline()))
        holder.kill()
    with pytest.raises(TakenError, match=rf"process {holder.pid} .*is gone, but .*{child.pid}"):
        Lock(path).acquire()
    child.kill()
    for _ in range(2):  # who does not put it right leaves it to the next
        with Lock(path) as lock:
            lock.acquire(wait=10.0)
            assert lock.left_over["snakemake"] == child.pid
    with Lock(path) as lock:
        lock.acquire()
        lock.left_over = {}
    assert read_note(path) == {}


def test_a_full_disk_takes_no_lock_away(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "no space")

    monkeypatch.setattr(os, "pwrite", full)
    with Lock(tmp_path / "lock") as lock:
        lock.acquire()
        with pytest.raises(TakenError, match="not known"):
            Lock(tmp_path / "lock").acquire()


# Logs that are still being written


@pytest.mark.parametrize(
    ("name", "complete"),
    [
        ("run.csv", None),
        ("run.csv.gz", None),
        ("run.csv.part", "run.csv"),
        ("run.csv.gz.TMP", "run.csv.gz"),
        ("run.csv.filepart", "run.csv"),
        ("run.csv.crdownload", "run.csv"),
        (".run.csv.Xy12Zq", "run.csv"),
        (".run_7.Ab3dE9", "run_7"),
        (".run.csv", "run.csv"),
        (".run.csv.part", "run.csv"),
        (".DS_Store", None),
        ("._run.csv", None),
        (".directory", None),
    ],
)
def test_names_say_what_is_not_complete(name: str, complete: str | None) -> None:
    assert find_complete_name(name) == complete


def put(logs: Path, name: str, age: float = 3600.0) -> Path:
    path = logs / "s" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("1,2\n")
    os.utime(path, (time.time() - age,) * 2)
    os.utime(path.parent, (time.time() - age,) * 2)
    return path


def skips(logs: Path, settle: float = 10.0) -> dict[str, Skip]:
    found = scan_drop_zone(logs)
    return {
        skip.recording: skip for skip in find_unsettled_logs(found, found, settle, time.time(), {})
    }


def test_complete_logs_are_read(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv.gz", "c/x.csv", "c/.hidden.txt", "notes.md", ".DS_Store"):
        put(tmp_path, name)
    assert list(scan_drop_zone(tmp_path)) == ["s/a", "s/b", "s/c"]
    assert skips(tmp_path) == {}
    assert scan_drop_zone(tmp_path / "nowhere") == {}


def test_a_partial_file_is_held_back(tmp_path: Path) -> None:
    put(tmp_path, "a.csv.part")
    put(tmp_path, "b/gyro.csv")
    put(tmp_path, "b/.accel.csv.Xy12Zq")
    put(tmp_path, "c.part/gyro.csv")
    found = skips(tmp_path)
    assert found["s/a"] == Skip("s/a", "a.csv.part is still being transferred")
    assert found["s/b"].reason == "b/.accel.csv.Xy12Zq is still being transferred"
    assert found["s/c.part"].held_back


def test_a_complete_log_beside_a_partial_one_is_read(tmp_path: Path) -> None:
    put(tmp_path, "a.csv")
    put(tmp_path, "a.csv.part")
    assert not skips(tmp_path)["s/a"].held_back
    put(tmp_path, "a.csv", age=1.0)
    assert skips(tmp_path)["s/a"].held_back


def test_a_transfer_that_was_given_up_keeps_no_results(tmp_path: Path) -> None:
    put(tmp_path, "a.csv.part", age=3.2 * 86400)
    (skip,) = skips(tmp_path).values()
    assert not skip.held_back
    assert skip.reason.endswith("nothing was written to it for 3 days")


def test_a_young_log_is_held_back(tmp_path: Path) -> None:
    put(tmp_path, "a.csv", age=3.0)
    put(tmp_path, "b.csv", age=60.0)
    put(tmp_path, "c.csv", age=-400 * 86400)  # of a clock that was never set
    assert list(skips(tmp_path)) == ["s/a"]
    assert skips(tmp_path)["s/a"].reason == "last written to 3 s ago"
    assert set(skips(tmp_path, settle=90.0)) == {"s/a", "s/b"}
    assert skips(tmp_path, settle=0.0) == {}


def test_a_folder_that_is_being_filled_is_held_back(tmp_path: Path) -> None:
    (tmp_path / "s/a").mkdir(parents=True)
    assert list(skips(tmp_path)) == ["s/a"]


def test_what_moves_between_two_looks_is_held_back(tmp_path: Path) -> None:
    put(tmp_path, "same.csv")
    grows, gone = put(tmp_path, "grows.csv"), put(tmp_path, "gone.csv")
    first = scan_drop_zone(tmp_path)
    with grows.open("a") as log:
        log.write("3,4\n")
    os.utime(grows, (OLD, OLD))
    gone.unlink()
    found = list(find_unsettled_logs(first, scan_drop_zone(tmp_path), 10.0, time.time(), {}))
    said = "it changed during the check"
    assert found == [Skip("s/gone", said), Skip("s/grows", said)]
    assert find_changed_logs(first, scan_drop_zone(tmp_path)) == {"s/grows"}


def test_what_is_open_for_writing_is_held_back(tmp_path: Path) -> None:
    path = put(tmp_path, "a.csv")
    with path.open("a"):
        _, found = find_settled_logs(tmp_path, 0.0, {})
    assert [skip.recording for skip in found] == ["s/a"]
    assert found[0].reason.startswith(f"process {os.getpid()} (")
    with path.open():
        assert find_settled_logs(tmp_path, 0.0, {})[1] == []


def test_logs_as_they_were_need_no_second_look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[float] = []
    monkeypatch.setattr("imubench_pipeline.extensions.nightly.settling.time.sleep", waited.append)
    put(tmp_path, "a.csv")
    found, _ = find_settled_logs(tmp_path, 300.0, {})
    assert waited == [10.0]
    find_settled_logs(tmp_path, 300.0, {name: one.files for name, one in found.items()})
    assert waited == [10.0]


# Held back in the plan


def planned(tmp_path: Path, *held_back: str) -> Plan:
    (tmp_path / "sensors").mkdir(exist_ok=True)
    (tmp_path / "sensors/s.yaml").write_text(yaml.safe_dump(SENSOR))
    settings = {name: str(tmp_path / name) for name in ("logs", "sensors", "results")}
    return Plan(settings | {"simulated": "false", "held_back": held_back})


def put_results(tmp_path: Path, name: str) -> None:
    for file in ("quality.json", "envelope.parquet", "histogram.parquet"):
        path = tmp_path / "results/recordings/s" / name / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()


def test_a_recording_without_results_is_left_out(tmp_path: Path) -> None:
    put(tmp_path / "logs", "a.csv")
    put(tmp_path / "logs", "b.csv")
    assert list(planned(tmp_path, "s/b", "s/nowhere").recordings) == [("s", "a")]


def test_a_recording_with_results_stays_in_its_place(tmp_path: Path) -> None:
    for name in ("a.csv", "b.csv", "b.csv.gz", "c.csv"):
        put(tmp_path / "logs", name)
    put(tmp_path / "logs", "b.yaml").write_text("log: {bandwidth: 9 Hz}\n")
    put_results(tmp_path, "b")
    plan = planned(tmp_path, "s/b")
    assert list(plan.recordings) == [("s", "a"), ("s", "b"), ("s", "c")]
    kept = plan.recordings["s", "b"]
    assert kept.held_back
    assert not any(file.exists() for file in kept.inputs)
    assert plan.bandwidth("s", "b") == 9.0
    left_out = planned(tmp_path).recordings
    assert "would both be" in str(left_out["s", "b"].error)
    assert left_out["s", "a"].error is None


def test_a_recording_whose_log_is_gone_for_the_moment_stays(tmp_path: Path) -> None:
    put(tmp_path / "logs", "a.csv")
    put_results(tmp_path, "b")
    assert list(planned(tmp_path, "s/b").recordings) == [("s", "a"), ("s", "b")]


def test_names_of_recordings_have_two_parts(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="held_back"):
        planned(tmp_path, "b")


# What a killed run leaves


def stamp(path: Path, when: float) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        path.write_text("x")
    os.utime(path, (when, when))
    return path


def test_old_temporary_files_of_ours_are_removed(tmp_path: Path) -> None:
    taken = time.time()
    with pytest.raises(KeyboardInterrupt), replace_file(tmp_path / "tables/a.csv") as temporary:
        names = [temporary.name]
        raise KeyboardInterrupt
    gone = [
        stamp(tmp_path / "tables" / names[0], OLD),
        stamp(tmp_path / "recordings/s/r/.ingest.abcd_123.part/x", OLD).parent,
        stamp(tmp_path / "simulated/s/.sim_r.abcd_123.part/log/x", OLD).parents[1],
        stamp(tmp_path / ".exports.abcd_123.part/exports/x", OLD).parents[1],
    ]
    kept = [
        stamp(tmp_path / "tables/.b.csv.abcd_123.part", taken - 5.0),
        stamp(tmp_path / "recordings/s/r/.ingest.abcd_124.part/x", taken),
        stamp(tmp_path / "recordings/s/r/run.csv.part", OLD),
        stamp(tmp_path / "recordings/s/r/.run.csv.part", OLD),
        stamp(tmp_path / ".mine.abcd_123.part/x", OLD),
        stamp(tmp_path / "mine/.b.csv.abcd_123.part", OLD),
        stamp(tmp_path / "elsewhere/x", OLD),
    ]
    link = tmp_path / "tables/.c.csv.abcd_123.part"
    link.symlink_to(tmp_path / "elsewhere")
    for folder in (gone[1], gone[2] / "log", gone[2], gone[3] / "exports", gone[3]):
        os.utime(folder, (OLD, OLD))
    number, size = recovery.remove_temporary(tmp_path, taken)
    assert number == 4 and size >= 4
    assert not any(path.exists() for path in gone)
    assert all(path.exists() for path in (*kept, link))


def test_what_was_on_its_way_when_the_power_went_is_made_again(tmp_path: Path) -> None:
    gone = [
        stamp(tmp_path / "recordings/s/r/quality.json", OLD),
        stamp(tmp_path / "recordings/s/r/allan.parquet", OLD - 30.0),
        stamp(tmp_path / "report/pages/a.html", OLD - 5.0),
        stamp(tmp_path / "report/index.html", OLD - 500.0),
        stamp(tmp_path / "simulated/s/sim_r/log.csv", OLD - 500.0),
        stamp(tmp_path / "simulated/s/sim_r/b/log.csv", OLD - 5.0),
    ]
    kept = [
        stamp(tmp_path / "recordings/s/q/quality.json", OLD - 90.0),
        stamp(tmp_path / "exports/s/kalibr.yaml", OLD - 90.0),
        stamp(tmp_path / "nightly/latest.txt", OLD + 90.0),
    ]
    assert remove_doubtful(tmp_path) == 4
    assert not any(path.exists() for path in gone)
    assert all(path.exists() for path in kept)


def test_only_a_machine_that_was_restarted_lost_files() -> None:
    note = {"since": NOW.isoformat(), "host": platform.node()}
    assert recovery.was_restarted(note, NOW.timestamp() + 60.0)
    assert not recovery.was_restarted(note, NOW.timestamp() - 60.0)
    assert not recovery.was_restarted(note | {"host": "another"}, NOW.timestamp() + 60.0)
    assert not recovery.was_restarted({}, NOW.timestamp() + 60.0)


def waiting(folder: Path, *words: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", "import time; time.sleep(600)", *words]
    return subprocess.Popen(command, cwd=folder, start_new_session=True)


def test_steps_that_run_on_are_ended(tmp_path: Path) -> None:
    since = datetime.now(UTC).isoformat()
    (tmp_path / "project").mkdir()
    with waiting(tmp_path / "project") as step, waiting(tmp_path) as other:
        try:
            note = {"host": platform.node(), "since": since}
            project = tmp_path / "project"
            assert end_left_over({}, project) == 0
            assert end_left_over(note | {"snakemake": other.pid}, project) == 0
            strange = note | {"snakemake": step.pid, "host": "another"}
            assert end_left_over(strange, project) == 0
            assert end_left_over(note | {"snakemake": step.pid}, project) == 1
            step.wait(10)
            assert other.poll() is None
        finally:
            step.kill()
            other.kill()


# What is new


def recording(name: str, **values: object) -> dict[str, Any]:
    row = {"sensor": "s", "device": "1", "recording": name, "kind": "static",
           "simulated": False, "status": "ok"}  # fmt: skip
    return row | values


def rejected(name: str, reason: str = "empty") -> dict[str, Any]:
    return recording(name, status="rejected", reason=reason)


def finding(name: str, kind: str, severity: str = "warning") -> dict[str, Any]:
    return {"sensor": "s", "recording": name, "channel": "gyro_x", "finding": kind,
            "severity": severity, "detail": "in words"}  # fmt: skip


def bias(name: str, value: float) -> dict[str, Any]:
    return {"sensor": "s", "recording": name, "channel": "gyro_x", "value": value, "unit": "rad/s"}


def drift(name: str, verdict: str | None) -> dict[str, Any]:
    return {"sensor": "s", "device": "1", "channel": "gyro_x", "parameter": "bias",
            "recording": name, "position": 4, "value": 2e-3, "unit": "rad/s",
            "expected_lower": 0.0, "expected_upper": 1e-3, "verdict": verdict,
            "reasons": ["above what the 3 before it lead one to expect"]}  # fmt: skip


def standing(sensor: str, verdict: str = "meets", margin: float = 2.0) -> dict[str, Any]:
    return {"requirement": "robot", "sensor": sensor, "recording": "a", "verdict": verdict,
            "rank": 1, "decides": True, "error": "heading", "unit": "rad", "margin": margin,
            "time": 1.0, "limit_verdict": verdict, "evidence": None}  # fmt: skip


def state(
    folder: Path, logs: dict[str, int], **rows: list[dict[str, Any]]
) -> tuple[State, dict[str, Any]]:
    for name in (
        "recordings",
        "parameters",
        "fixed_bias",
        "failures",
        "findings",
        "drift",
        "ranking",
    ):
        write(name, rows.get(name, []), folder / f"tables/{name}.parquet")
    tables = load_tables(folder)
    signatures = {f"s/{name}": ((f"{name}.csv", size, 0),) for name, size in logs.items()}
    return make_state(tables, NOW, signatures, {}), tables


def summary(found: Changes) -> Summary:
    return Summary(began=NOW, finished=NOW, seconds=61.0, **dict(found))


def test_at_the_first_run_all_is_new(tmp_path: Path) -> None:
    after, tables = state(
        tmp_path,
        {"a": 1, "b": 1},
        recordings=[recording("a"), rejected("b")],
        findings=[finding("a", "knocks"), finding("a", "short", "note"), finding("b", "rejected")],
        drift=[drift("a", "changed")],
        ranking=[standing("s")],
    )
    found = summary(compare_states(None, after, tables, []))
    assert found.since is None and STATUS[found.outcome] == 1
    assert found.new == ["s/a", "s/b"]
    assert [one.finding for one in found.warnings] == ["knocks"]
    assert [(one.recording, one.new) for one in found.rejected] == [("s/b", True)]
    assert len(found.drift) == 1
    assert found.answers[0] == "robot: s meets the limits. Only sensor with usable data."


def test_what_is_known_is_fine(tmp_path: Path) -> None:
    rows: dict[str, Any] = {
        "recordings": [recording("a"), rejected("b")],
        "findings": [finding("a", "knocks")],
        "drift": [drift("a", "changed")],
        "ranking": [standing("s")],
        "failures": [],
    }
    before, _ = state(tmp_path, {"a": 1, "b": 1}, **rows)
    before.write(tmp_path / "state.json")
    assert read_state(tmp_path / "state.json") == before
    after, tables = state(tmp_path, {"a": 1, "b": 1}, **rows)
    found = summary(compare_states(read_state(tmp_path / "state.json"), after, tables, []))
    assert STATUS[found.outcome] == 0
    assert [(one.recording, one.new) for one in found.rejected] == [("s/b", False)]
    assert not (found.new or found.changed or found.removed or found.warnings or found.answers)
    assert "rejected (none of them new):\n  s/b: empty\n" in format_summary(found)


def test_what_changed_is_told_with_its_reason(tmp_path: Path) -> None:
    names = ("log", "settings", "same", "gone")
    before, _ = state(
        tmp_path,
        dict.fromkeys(names, 1),
        recordings=[recording(name) for name in names],
        fixed_bias=[bias(name, 1.0) for name in names],
        ranking=[standing("s")],
    )
    after, tables = state(
        tmp_path,
        {"log": 2, "settings": 1, "same": 1, "new": 1},
        recordings=[recording(name) for name in ("log", "settings", "same", "new")],
        fixed_bias=[bias("log", 2.0), bias("settings", 2.0), bias("same", 1.0), bias("new", 1.0)],
        ranking=[standing("t", "fails", 0.5), standing("u", "fails", 0.9)],
    )
    found = summary(compare_states(before, after, tables, []))
    assert {one.recording: one.because for one in found.changed} == {
        "s/log": "its log changed",
        "s/settings": "settings, or the code of the analysis, changed",
    }
    assert (found.new, found.removed, STATUS[found.outcome]) == (["s/new"], ["s/gone"], 0)
    text = format_summary(found)
    assert "1 new, 2 analysed again, 1 removed, 0 skipped; 4 in all" in text
    assert "robot: No sensor meets the limits. u is closest, but fails." in text


def test_another_version_is_told_from_another_sensor(tmp_path: Path) -> None:
    def noise(value: float) -> list[dict[str, Any]]:
        row = {"sensor": "s", "recording": "a", "channel": "gyro_x", "method": "robust",
               "recommended": True, "model": "N", "component": 1, "parameter": "N",
               "unit": "rad/s/sqrt(Hz)", "status": "ok", "value": value, "lower": 0.9 * value,
               "upper": 1.1 * value}  # fmt: skip
        return [row, row | {"recording": "b"}]

    def night(version: str, value: float, verdict: str | None, log: int) -> tuple[State, Any, Any]:
        write_json(
            {"software": {"version": version, "settings": "0"}},
            tmp_path / "tables/datapackage.json",
        )
        rows = {"recordings": [recording("a"), recording("b")], "parameters": noise(value),
                "drift": [drift("a", verdict), drift("b", verdict)]}  # fmt: skip
        return *state(tmp_path, {"a": 1, "b": log}, **rows), load_results(tmp_path)

    before, _, old = night("1.0", 1e-4, None, 1)
    after, tables, new = night("1.1", 2e-4, "changed", 2)
    changes = compare_states(before, after, tables, [])
    reasons = {each.recording: (each.because, each.new_log) for each in changes.changed}
    assert reasons == {
        "s/a": ("the program changed from version 1.0 to 1.1", False),
        "s/b": ("its log changed", True),
    }
    assert [each.recording for each in changes.drift] == ["a", "b"]
    changes.reanalysis += describe_reanalysis(old, new, {"s/a"})
    text = format_summary(summary(changes))
    assert "changed by the analysis, with the same logs:\n" in text
    assert "Values changed beyond their intervals: 1, by a factor of up to 2\n" in text
    assert "s/a gyro_x N: 0.34 °/√h (0.31 to 0.38), now 0.69 °/√h (0.62 to 0.76) (2 times)" in text
    (line,) = (line for line in text.splitlines() if "the analysis may be the cause" in line)
    assert " in a" in line


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ({"recordings": [rejected("a", "worse")]}, "s/a (new): worse"),
        ({"findings": [finding("a", "step", "fatal")]}, "s/a: gyro_x: step: in words"),
        (
            {"drift": [drift("a", "changed")]},
            "s, device 1: gyro_x bias 0.002 rad/s in a, expected 0 to 0.001 (above what",
        ),
    ],
)
def test_what_somebody_should_look_at_is_flagged(
    tmp_path: Path, rows: dict[str, Any], said: str
) -> None:
    before, _ = state(tmp_path, {"a": 1}, recordings=[rejected("a")], drift=[drift("a", None)])
    after, tables = state(tmp_path, {"a": 1}, **({"recordings": [rejected("a")]} | rows))
    found = summary(compare_states(before, after, tables, []))
    assert STATUS[found.outcome] == 1
    assert said in format_summary(found)


def test_of_a_log_written_to_during_the_run_nothing_is_said_yet(tmp_path: Path) -> None:
    before, _ = state(tmp_path, {"a": 1}, recordings=[recording("a")], fixed_bias=[bias("a", 1.0)])
    after, tables = state(
        tmp_path,
        {"a": 2, "b": 1},
        recordings=[recording("a"), rejected("b")],
        fixed_bias=[bias("a", 3.0)],
        findings=[finding("a", "knocks")],
    )
    found = summary(compare_states(before, after, tables, ["s/a", "s/b"]))
    assert STATUS[found.outcome] == 0
    assert not (found.new or found.changed or found.rejected or found.warnings)
    kept = after.without(["s/a", "s/b"], before)
    assert kept.recordings == before.recordings
    assert not any(known.warned for known in kept.recordings.values()) and kept.logs == {}


@pytest.mark.parametrize(
    "text",
    ['{"finished": "2026-', '{"finished": "2026-01-01T00:00:00Z", "logs": {}}', "[]"],
    ids=["cut off", "of an older version", "no state"],
)
def test_a_state_that_cannot_be_read_is_told(tmp_path: Path, text: str) -> None:
    assert read_state(tmp_path / "state.json") is None
    (tmp_path / "state.json").write_text(text)
    with pytest.raises(StateError, match=r"state\.json is damaged, or of another version"):
        read_state(tmp_path / "state.json")


def test_long_lists_end_with_how_many_more() -> None:
    found = summary({"outcome": "fine", "new": [f"s/{number}" for number in range(99)]})
    assert "  s/19\n  and 79 more\n" in format_summary(found)


def test_a_failed_run_says_why() -> None:
    text = format_summary(summary({"outcome": "failed", "failure": ["Error\x1b[31m in rule"]}))
    assert "why it failed:\n  Error [31m in rule\n" in text
    assert "took 61 s" in text


# Settings


def test_settings_come_from_the_file_and_the_command_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no Snakefile"):
        Night(tmp_path, [])
    (tmp_path / "Snakefile").touch()
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("logs: drop\nallan: {overlap: full}\n")
    night = Night(tmp_path, ["results=/data/results", "allan={}"])
    assert (night.logs, night.results) == (tmp_path / "drop", Path("/data/results"))
    with pytest.raises(ConfigError, match="expected KEY=VALUE"):
        Night(tmp_path, ["results"])
    with pytest.raises(ConfigError, match="expected --config"):
        Night(tmp_path, [], flags=["--configfile", "x"])
