import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.report.run_summary import (
    describe_failure,
    fold_text,
    list_best_sensors,
    list_warnings,
    summarise_run,
)
from imubench_pipeline.tables.files import write


def recording(sensor: str, name: str = "run", **values: object) -> dict[str, Any]:
    row = {"sensor": sensor, "device": "1", "recording": name, "kind": "static",
           "simulated": False, "status": "ok"}  # fmt: skip
    return row | values


def finding(sensor: str, name: str, severity: str = "warning") -> dict[str, Any]:
    return {"sensor": sensor, "recording": "run", "finding": name, "severity": severity,
            "detail": "x"}  # fmt: skip


def standing(sensor: str, **values: object) -> dict[str, Any]:
    row = {"requirement": "robot", "sensor": sensor, "recording": "run", "verdict": "meets",
           "rank": 1, "decides": True, "error": "heading", "unit": "rad", "margin": 2.0,
           "time": 1.0, "limit_verdict": "meets",
           "evidence": "strong"}  # fmt: skip
    return row | values


def said(folder: Path, **rows: list[dict[str, Any]]) -> list[str]:
    for name in ("recordings", "findings", "ranking", "failures"):
        write(name, rows.get(name, []), folder / f"tables/{name}.parquet")
    return summarise_run(folder).splitlines()


def test_a_run_says_what_became_of_the_recordings(tmp_path: Path) -> None:
    recordings = [
        recording("a"),
        recording("b", simulated=True),
        recording("b", "night", status="rejected", reason="the file\nis empty"),
    ]
    lines = said(
        tmp_path,
        recordings=recordings,
        findings=[finding("a", "short", "note"), finding("b", "knock")],
        ranking=[standing("a")],
    )
    assert lines == [
        "2 recordings analysed, 1 rejected; 1 of all are simulated, not measured",
        "  rejected: b/night: the file is empty",
        "warnings in 1 of the recordings:",
        "  b/run: 1 warning: knock",
        "robot: a meets the limits. Only sensor with usable data.",
        f"report: {tmp_path / 'report/index.html'}",
    ]


def test_long_lists_end_with_how_many_more(tmp_path: Path) -> None:
    rejected = [recording("a", f"{i:02}", status="rejected", reason="x " * 500) for i in range(30)]
    lines = said(tmp_path, recordings=rejected)
    assert lines[0] == "0 recordings analysed, 30 rejected"
    assert lines[10].startswith("  rejected: a/09: x x") and lines[11] == "  and 20 more"
    assert max(map(len, lines[1:12])) < 220


def test_the_recording_with_the_worst_warnings_comes_first() -> None:
    rows = [
        finding("few", "gap"),
        *(finding("many", name) for name in ("gap", "knock", "knock", "warm_up")),
        finding("broken", "saturated", "fatal"),
        finding("rejected", "rejected", "fatal"),
    ]
    assert list(list_warnings([FindingRow(**row) for row in rows])) == [
        "broken/run: 1 warning: saturated",
        "many/run: 4 warnings: knock (2), gap, warm up",
        "few/run: 1 warning: gap",
    ]


def test_a_line_says_which_sensor_leads_a_requirement() -> None:
    rows = [
        standing("second", rank=2),
        standing("best", tied_with=("other",), evidence="weak", evidence_reasons=("one_specimen",)),
        standing("best", decides=False, verdict="fails"),
        standing("made", requirement="hard", verdict="fails"),
        standing("short", requirement="vague", verdict="not_enough_data"),
        standing("c", requirement="dear", rank=None, verdict="excluded"),
    ]
    ranking = [RankingRow(**row) for row in rows]
    recordings = [RecordingRow(**recording("best")),
                  RecordingRow(**recording("made", simulated=True))]  # fmt: skip
    assert list(list_best_sensors(ranking, recordings)) == [
        "robot: best meets the limits. Best of 2 sensors (weak evidence: only one specimen). "
        "The difference from other is not significant.",
        "hard: No sensor meets the limits. made (simulated) is closest, but fails. "
        "Only sensor with usable data.",
        "vague: No sensor is shown to meet the limits. short is closest, but there is not enough "
        "data. Only sensor with usable data.",
        "dear: No sensor has the required properties and usable data.",
    ]


def test_nothing_is_said_without_tables(tmp_path: Path) -> None:
    assert summarise_run(tmp_path) == ""


def test_tables_of_another_form_make_no_run_fail(tmp_path: Path) -> None:
    said(tmp_path, recordings=[recording("a")])
    write("recordings", [recording("a")], tmp_path / "tables/ranking.parquet")
    expected = f"no summary: {tmp_path / 'tables/ranking.parquet'} was made by another version"
    assert summarise_run(tmp_path).startswith(expected)


def test_a_line_is_one_line_and_no_command_to_the_terminal() -> None:
    assert fold_text("a\r\n\x1b[31mb\t c") == "a [31mb c"
    assert fold_text("x" * 200, 10) == "x" * 9 + "…"


WORKFLOW = """
from pathlib import Path
from imubench_pipeline.report.run_summary import failure

rule all:
    input: "results/recordings/s/r/allan.parquet", "results/tables/ranking.parquet"
rule allan:
    output: "results/recordings/s/r/allan.parquet"
    shell: "{command}"
rule ranking:
    output: "results/tables/ranking.parquet"
    shell: "exit 3"
onerror:
    print(failure(log, Path("results")))
"""


# As from a terminal: a shell that runs something in its background lets it ignore interrupts.
SNAKEMAKE = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from snakemake.cli import main
main()
"""


def snakemake(folder: Path, command: str, *flags: str) -> list[str]:
    (folder / "Snakefile").write_text(WORKFLOW.replace("{command}", command))
    done = subprocess.run(
        [sys.executable, "-c", SNAKEMAKE, "-c1", "--keep-going", *flags],
        cwd=folder, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert done.returncode == 1
    return done.stdout.splitlines()


# Every day: what a run says whose step fails in tests/test_progress.py.
@pytest.mark.release
def test_a_failed_run_says_what_failed_and_how_to_go_on(tmp_path: Path) -> None:
    lines = snakemake(tmp_path, "exit 3")
    assert lines[0] == "2 steps failed; see above"
    assert set(lines[1:3]) == {"  allan of s/r", "  ranking"}
    assert lines[3].endswith("run the same command again: it continues where this run stopped")
    assert Path(lines[4].removeprefix("log: ")).is_file()


@pytest.mark.release
def test_a_quiet_run_says_that_a_step_failed(tmp_path: Path) -> None:
    assert snakemake(tmp_path, "exit 3", "--quiet", "all")[0] == "a step failed; see above"


# Every day: that a log of Snakemake which says so is understood, below.
@pytest.mark.release
def test_an_interrupted_run_says_how_to_go_on(tmp_path: Path) -> None:
    # Snakemake loses a signal that comes while it is busy: it is sent until the log has it.
    heard = "grep -qs 'on user request' .snakemake/log/*"
    send = (
        f"for try in 1 2 3 4 5 6 7 8; do sleep 1; kill -INT $PPID; sleep 2; {heard} && break; done"
    )
    lines = snakemake(tmp_path, f"{send}; exit 3")
    assert lines[0].startswith("stopped before its end; to continue, run the same command again")
    assert len(lines) == 2


def test_a_log_of_a_run_that_was_interrupted_is_understood(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text(
        "Terminating processes on user request, this might take some time.\n"
        "Error in rule allan:\n    jobid: 4\n    output: out/recordings/a/r/allan.parquet\n"
    )
    first, last = describe_failure([str(log)], Path("out")).splitlines()
    assert first.startswith("stopped before its end; to continue, run the same command again")
    assert last == f"log: {log}"


def test_a_step_that_was_tried_again_is_named_once(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text(
        "Error in rule allan:\n    message: None\n    jobid: 4\n"
        "    output: out/recordings/a, b/r (1)/allan.parquet, x\n" * 2
    )
    lines = describe_failure([str(log)], Path("out")).splitlines()
    assert lines[:2] == ["1 step failed; see above", "  allan of a, b/r (1)"]
    with log.open("a") as file:
        file.write("Finished jobid: 4 (Rule: allan)\n")
    assert describe_failure([str(log)], Path("out")).startswith("a step failed; see above\n")


def test_a_job_of_several_steps_is_named_with_its_last_log(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text(
        "".join(
            f"    message: Error in group comparison\n    log: {one}.log (check log file(s))\n"
            "    jobs:\n"
            "        rule ranking:\n            jobid: 4\n            output: out/tables/a.csv\n"
            "        rule report:\n            jobid: 5\n            output: out/report/a.html\n"
            "    [Mon]\n    Error in rule ranking:\n        jobid: 4\n"
            for one in (1, 2)
        )
    )
    lines = describe_failure([str(log)], Path("out")).splitlines()
    assert lines[:2] == ["1 step failed; see above", "  ranking or report (2.log)"]
