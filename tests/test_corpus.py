"""Broken and odd logs: each ends in what is expected of it, alone and among all others."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from imubench_pipeline.datasheets.plausibility import implausible_of
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.recordings.known_logs import KNOWN
from imubench_pipeline.recordings.recording import list_log_files, open_channel_logs
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables.findings import UnavailableError
from tests.conftest import few
from tests.corpus import ENTRIES, Cut, Entry, Kept, Rejected

LIMIT_S = 60
LIMIT_MB = 500
LONGEST_REASON = 1500
GOOD = "csv"
CHECK = """
import sys
from pathlib import Path
from imubench_pipeline.run.cli import main

status = main(sys.argv[1:])
peak = Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]
print(f"peak: {int(peak) // 1024} MB", file=sys.stderr)
sys.exit(status)
"""
"""The command, which then says how much memory it took. Not ru_maxrss, which begins with the size
of the process that started this one."""

SAID_OF_ALL = {"short_recording"}
SAID = re.compile(r"^(\S.*)/[^/\n]+: (ok|warnings|rejected|failed)$", re.MULTILINE)


@contextmanager
def watched(seconds: int) -> Iterator[None]:
    """Fail where what is done takes longer."""

    def stop(*_: object) -> None:
        pytest.fail(f"not done in {seconds} s")  # no error that a reader takes for one of a file

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def plan_of(place: Path) -> Plan:
    places = {"logs": str(place / "logs"), "sensors": str(place / "sensors")}
    return Plan({**places, "simulated": None})


def ingested(plan: Plan, sensor: str, kept: Path) -> Quality:
    """Ingest the one recording of a sensor, and hold it against its sensor file."""
    (key,) = (key for key in plan.recordings if key[0] == sensor)
    settings = plan.ingest_settings(*key)
    quality = ingest_as_planned(plan.recordings[key].path, settings, *key, kept)
    quality.findings.extend(implausible_of(quality, plan.sensors[sensor]))
    return quality


def names_of(quality: Quality) -> set[str]:
    return {str(finding["finding"]) for finding in quality.findings} - SAID_OF_ALL


def check_accounts(quality: Quality, kept: Path) -> None:
    """Every sample that was read is used, or counted under a finding."""
    told = {
        (finding["finding"], finding["channel"]): finding["value"] for finding in quality.findings
    }
    for name, log in open_channel_logs(kept).items():
        counts = quality.channels[name]
        present = counts.used + counts.knocks + counts.repeated
        assert counts.present == present > 0, name
        without = sum(int(told.get((kind, name), 0)) for kind in ("empty_cells", "not_finite"))
        file = pq.ParquetFile(log.path)
        rows = file.metadata.num_rows
        values = file.read([name]).column(name)
        assert len(values) - values.null_count == counts.used, name
        # A record left out for its stamp may lack the sample too.
        assert rows <= present + without <= rows + int(told.get(("repeated_stamps", None), 0)), name


CUT_DAILY = {
    f"{name} (cut)"
    for name in (
        *("csv", "csv in UTF-16", "csv of binary data", "time in ISO 8601", "vectornav", "xsens"),
    )
}
"""Of the texts that are cut short, some of each reader."""

READ_DAILY = {
    # tests/readers/test_text_layout.py and test_csv.py
    *("csv in Latin-1", "csv in UTF-16", "csv in UTF-8 with a mark", "csv by position"),
    *("csv with tabs", "csv with semicolons", "csv with spaces", "csv with a decimal comma"),
    *("csv with a line of units", "csv with mixed ends of lines", "csv with zeros at the end"),
    *("csv with the header again", "csv with an empty cell", "csv with NaN", "csv of nothing"),
    *("csv with a word in a cell", "csv without a column that is named", "csv of a header"),
    *("csv with a short record", "csv with zeros between records", "csv with an open quote"),
    *("csv cut in a record", "csv with a name twice"),
    # test_text_time.py
    *("time in ns of the epoch", "time of the epoch in ms", "time in ISO 8601"),
    *("time of a day that is none", "time of day over midnight", "counter that wraps"),
    # test_compressed.py: what unpacks without end is among others below, too
    *(f"csv in {way}" for way in ("bz2", "gz", "xz", "zst")),
    *(f"csv in {way} with a flipped bit" for way in ("bz2", "gz", "xz", "zip", "zst")),
    *(f"csv in {way} cut short" for way in ("gz", "xz", "zip")),
    *("gzip of nothing", "gzip in gzip", "zip archive of nothing", "zip archive of several logs"),
    *(name for name in ENTRIES if "bomb" in name),
    # test_rosbag.py, test_phone.py, test_vectornav.py, test_ubx.py and those of arrays
    *("ros 1 bag in bz2", "ros 1 bag in lz4", "ros 2 bag in mcap", "ros 2 bag in packed mcap"),
    *("ros 2 bag in sqlite alone", "sensor logger in a folder", "phyphox in a folder"),
    *("phyphox with decimal commas", "ros 2 bag of temperatures", "vectornav in gzip"),
    *("feather cut short", "hdf5 cut short", "matlab 5 cut short", "matlab 7.3 cut short"),
    *("npy cut short", "npz cut short", "parquet cut short"),
    *("npy of objects", "npy that promises too much", "npy of three dimensions"),
    *("parquet with a wrong checksum", "parquet without records", "parquet without a column"),
    *("ubx without sensors", "ubx of both messages", "ubx without an axis", "ubx in gzip"),
    *("ubx between NMEA and RTCM", "ubx with counters that wrap"),
    *("phyphox cut short", "sensor logger packed with its folder", "xsens cut in a record"),
    *("ros 2 bag of two sensors", "ros 2 bag with damaged messages", "mcap cut short"),
    *("ros 2 bag without acceleration", "ubx of the beginnings of long messages"),
    # test_text_hostile.py: lines and headers without end
    *("csv of lines of 10 MB", "csv of a million columns"),
    "zip archive of thousands of pictures and a log",  # that of thousands of logs
    # tests/quality: a stuck axis and one of spikes are here every day
    *("axis that is stuck for a while", "axis that is saturated", "axis in visible steps"),
    *("axis that is repeated", "log with knocks", "log of a sensor that was moved"),
    *("log of a sensor that was shaken", "log of a sensor that warms up", "log that becomes noisy"),
    *("log with 1e300 in a cell", "gyro that turns", "acceleration in g that is said to be m s-2"),
}
"""The tests of the readers read the like every day."""

LEFT = [
    name
    for name, entry in ENTRIES.items()
    if name in READ_DAILY or (isinstance(entry.expected, Cut) and name not in CUT_DAILY)
]


def test_what_is_chosen_is_in_the_corpus() -> None:
    assert ENTRIES.keys() >= CUT_DAILY | READ_DAILY


@pytest.mark.parametrize("name", few([one for one in ENTRIES if one not in LEFT], LEFT))
def test_entry(name: str, tmp_path: Path) -> None:
    entry = ENTRIES[name]
    if entry.skip:
        pytest.skip(entry.skip)  # its reason, such as that root may read every file
    entry.place(tmp_path / "logs", tmp_path / "sensors")
    before = sorted((tmp_path / "logs").rglob("*"))
    if isinstance(entry.expected, Rejected) and not entry.expected.is_final:
        with watched(LIMIT_S), pytest.raises(UnavailableError, match=entry.expected.reason):
            ingested(plan_of(tmp_path), name, tmp_path / "kept")
        return
    with watched(LIMIT_S):
        quality = ingested(plan_of(tmp_path), name, tmp_path / "kept")
    check_outcome(entry, quality)
    check_accounts(quality, tmp_path / "kept")
    assert sorted((tmp_path / "logs").rglob("*")) == before
    if (tmp_path / "kept").exists():
        kept = sorted(path for path in (tmp_path / "kept").iterdir() if path.name != KNOWN)
        assert kept == list_log_files(tmp_path / "kept")


def check_outcome(entry: Entry, quality: Quality) -> None:
    status, reason = quality.recording.status, str(quality.recording.reason)
    match entry.expected:
        case Rejected(reason=expected):
            assert status == "rejected"
            assert re.search(expected, reason), reason
            assert names_of(quality) == {"rejected"}
            assert len(reason) < LONGEST_REASON
        case Kept(samples, findings):
            assert status == "ok", reason
            assert names_of(quality) == findings, quality.findings
            assert quality.recording.samples == samples
        case Cut():
            if status == "ok":
                assert "truncated_file" in names_of(quality)
            else:
                assert re.match(r"\w+\.\w+\.gz[:,] |no channel can be used: ", reason), reason
                assert len(reason) > 40


def checked(place: Path) -> subprocess.CompletedProcess[str]:
    command = ["check", str(place / "logs"), "--sensors", str(place / "sensors")]
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", CHECK, *command],
        capture_output=True,
        text=True,
        check=False,
        timeout=5 * LIMIT_S,
    )


@pytest.mark.release  # every day each by itself, and some beside good ones: tests/workflow
def test_entries_beside_a_good_recording(tmp_path: Path) -> None:
    present = [entry for entry in ENTRIES.values() if not entry.skip]
    for entry in present:
        entry.place(tmp_path / "logs", tmp_path / "sensors")
    ENTRIES[GOOD].place(tmp_path / "alone/logs", tmp_path / "alone/sensors")
    checked(tmp_path / "alone")  # compiles what is not yet: that takes memory, once
    done = checked(tmp_path)
    assert done.returncode == 1, done.stderr[-3000:]
    assert re.fullmatch(r"peak: \d+ MB\n", done.stderr), done.stderr[-3000:]
    assert int(done.stderr.split()[1]) < LIMIT_MB
    lines = [line for line in done.stdout.splitlines() if not line.startswith("  ")]
    said = dict(SAID.findall(done.stdout))
    assert len(lines) == len(said) == len(present)
    assert said[GOOD] == "ok"
    for entry in present:
        if not isinstance(entry.expected, Cut):
            refused = entry.expected if isinstance(entry.expected, Rejected) else None
            assert (said[entry.name] in ("rejected", "failed")) == (refused is not None)
            assert (said[entry.name] == "failed") == (refused is not None and not refused.is_final)
    qualities = []
    for place, kept in ((tmp_path, tmp_path / "among"), (tmp_path / "alone", tmp_path / "kept")):
        qualities.append(ingested(plan_of(place), GOOD, kept))
    assert qualities[0] == qualities[1]
    assert (tmp_path / "among/log.parquet").read_bytes() == (
        tmp_path / "kept/log.parquet"
    ).read_bytes()
