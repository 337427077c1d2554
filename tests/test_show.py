import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.cells import cell_len

from imubench_pipeline.model.verdicts import UnitFactor
from imubench_pipeline.report.show import show
from imubench_pipeline.report.terminal import render_logs
from imubench_pipeline.run.cli import main
from imubench_pipeline.tables.files import build, write

DEGREE = 3.141592653589793 / 180
N = DEGREE / 60  # 1 °/√h


def recording(sensor: str, **values: object) -> dict[str, Any]:
    row = {"sensor": sensor, "device": "1", "recording": "run", "kind": "static",
           "simulated": False, "status": "ok", "duration": 3600.0}  # fmt: skip
    return row | values


def parameter(sensor: str, channel: str, symbol: str, **values: object) -> dict[str, Any]:
    row = {"sensor": sensor, "recording": "run", "channel": channel, "method": "likelihood",
           "recommended": True, "model": "N+GM", "component": 1, "parameter": symbol,
           "unit": "x", "status": "ok"}  # fmt: skip
    return row | values


def standing(sensor: str, **values: object) -> dict[str, Any]:
    row = {"requirement": "robot", "sensor": sensor, "recording": "run", "verdict": "meets",
           "rank": 1, "decides": True, "error": "heading", "time": 60.0, "limit": DEGREE,
           "sigma": DEGREE / 4, "lower": DEGREE / 5, "upper": DEGREE / 3, "unit": "rad",
           "margin": 4.0, "chance": 1.0, "limit_verdict": "meets"}  # fmt: skip
    return row | values


PARAMETERS = [
    parameter("good", "gyro_x", "N", value=N, lower=0.9 * N, upper=1.1 * N),
    parameter("good", "gyro_x", "B", status="not_identified", duration_needed=21 * 3600.0,
              lower=1.0 * DEGREE / 3600, upper=7.0 * DEGREE / 3600),
    parameter("good", "gyro_x", "T_B", value=300.0, status="at_bound"),
    parameter("good", "gyro_x", "K", status="absent", lower=0.0, upper=DEGREE / 3600 / 60),
    *(parameter("made", channel, "N", value=2 * N) for channel in ("gyro_x", "gyro_y")),
    parameter("made", "accel_x", "N", value=9.80665e-6),
    parameter("made", "gyro_x", "N", method="curve", recommended=False, value=3 * N),
]  # fmt: skip
RANKING = [
    standing("good", tied_with=("made",)),
    standing("good", decides=False, error="position", unit="m", limit=2.0, sigma=1.0, margin=2.0),
    standing("made", rank=2, margin=0.5, sigma=2 * DEGREE, verdict="fails", specimens=1,
             recordings=1, longest_log=660.0, evidence="weak",
             evidence_reasons=("one_specimen", "short_log")),
    standing("third", rank=None, verdict="not_enough_data", sigma=None, margin=None,
             reasons=["no accelerometer in the recording"],
             corrected_verdict="meets", corrected_margin=7.5,
             corrected_units=(UnitFactor("gyro", DEGREE),)),
    standing("made", requirement="drone"),
]  # fmt: skip


@pytest.fixture
def results(tmp_path: Path) -> Path:
    rows = {
        "recordings": [
            recording("good"),
            recording("made", simulated=True),
            recording("third"),
            recording("bad", status="rejected", reason="no column 'wx'; found [bold]wy\x1b[31m"),
        ],
        "findings": [
            {"sensor": "good", "recording": "run", "channel": "gyro_x", "severity": "warning",
             "finding": "suspicious_unit", "detail": "is it in degrees? " * 10},
            {"sensor": "good", "recording": "run", "finding": "short", "severity": "note",
             "detail": "a note"},
            {"sensor": "bad", "recording": "run", "finding": "rejected", "severity": "fatal",
             "detail": "twice"},
        ],
        "ranking": RANKING,
        "next_steps": [
            {"sensor": "third", "recording": "run",
             "requirements": ("robot",), "action": "check_unit",
             "verdicts_turned": 4 - i, "verdicts_strengthened": 0, "text": f"step {i}"}
            for i in range(4)
        ],
        "failures": [],
        "parameters": PARAMETERS,
    }  # fmt: skip
    for name, table in rows.items():
        write(name, table, tmp_path / f"tables/{name}.parquet")
    return tmp_path


def run(*arguments: object) -> int:
    return main(["show", *map(str, arguments)])


def shown(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert run(*arguments, "--all") == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert run(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == "" and "Traceback" not in err
    return err


def words(text: str) -> str:
    """The text on one line and without gaps."""
    return " ".join(text.split())


def after(text: str, head: str) -> str:
    """What stands below a head."""
    return words(text.partition(head)[2].partition("\n\n")[0])


def test_what_was_compared_comes_first(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = shown(capsys, results)
    assert text.startswith("Recordings: 4 of 4 sensors; 3 analysed, 1 rejected; 1 simulated")
    assert after(text, "Rejected: 1") == "bad/run: no column 'wx'; found [bold]wy\\x1b[31m"
    assert after(text, "Warnings: 1").startswith(
        "good/run gyro_x (suspicious unit): is it in degrees? is it"
    )
    assert "twice" not in text and "a note" not in text


def test_the_overview_has_ten_lines_and_names_the_way_to_all_others(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(results) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 10
    assert lines[0].endswith("1 simulated, not measured; 1 warning in 1 of them")
    assert lines[1].startswith("robot: good") and lines[2].startswith("drone: made (simulated)")
    assert [line.split(":")[0] for line in lines[3:6]] == ["Next"] * 3
    assert lines[6] == "Every ranking, warning and parameter: --all"


def test_terminal_shows_weak_evidence_corrected_verdicts_and_next_steps(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = shown(capsys, results, "--width", 200)
    assert after(text, "What to do next: 3") == (
        "third: step 0 (robot) third: step 1 (robot) third: step 2 (robot)"
    )
    ranking = after(text, "Ranking for robot")
    for part in ("weak evidence: only one specimen", "meets the limits (margin 7.5)",
                 "the gyro data read as °/s, not"):  # fmt: skip
        assert part in ranking


def test_a_ranking_has_its_verdicts_in_words(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = shown(capsys, results, "--width", 120)
    lines = text.partition("Ranking for robot")[2].partition("\n\n")[0].splitlines()
    (good,) = (i for i, line in enumerate(lines) if line.startswith("1 "))
    assert words(lines[good]) == "1 good meets the limits 0.25 ° of 1 ° heading 4"
    assert words(lines[good + 1]) == "similar to made 0.2 to 0.33 after 60 s"
    assert "fails" in lines[good + 2] and "made (simulated)" in lines[good + 2]
    (third,) = (line for line in lines if "not enough data" in line)
    assert "no accelerometer in the recording" in third
    assert "position" not in text  # another limit decides
    assert "Ranking for drone" in text


def test_one_requirement_has_all_its_limits(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = shown(capsys, results, "--requirement", "robot", "--width", 120)
    assert "1 m of 2 m" in text and "horizontal position" in text
    assert "drone" not in text


def test_parameters_have_units_intervals_and_reasons(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = shown(capsys, results, "--width", 120)
    gyro = text.partition("Gyroscopes: the recommended method")[2].partition("\n\n")[0]
    heads, units, _, first, *more = gyro.splitlines()[1:]
    assert words(heads) == "N B T_B K"
    assert words(units) == "recording °/√h °/h s °/h/√h"
    assert words(first) == "good / run gyro_x 1 not determined 300 (bounded) not in the model"
    assert words(more[0]) == "0.9 to 1.1 1 to 7 below 1"
    assert words(more[1]) == "(needs 21 h)"
    assert words(more[2]) == "made / run gyro_x (simulated) 2 – – –"
    assert "Accelerometers" in text and "µg/√Hz" in text


def test_choices_of_channel_method_and_units(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = shown(capsys, results, "--channel", "gyro_y")
    assert "made / run gyro_y" in " ".join(text.split()) and "gyro_x (sim" not in text
    assert "Accelerometers" not in text
    curve = after(shown(capsys, results, "--method", "curve"), "Gyroscopes: method curve")
    assert curve.endswith("made / run gyro_x (simulated) 3 – – –")
    assert "rad/s/√Hz" in shown(capsys, results, "--units", "si")


@pytest.mark.parametrize("width", [40, 48, 60, 80, 200])
def test_nothing_is_wider_than_the_terminal_and_no_number_is_broken(
    results: Path, capsys: pytest.CaptureFixture[str], width: int
) -> None:
    text = shown(capsys, results, "--width", width)
    tables = text.partition("Ranking")[2].partition("No report")[0]
    assert max(map(cell_len, tables.splitlines())) <= width
    assert {"0.333", "0.9"} <= set(tables.split())
    assert ("no room for: " in text) == (width < 60)
    if width >= 60:
        assert {"300", "(bounded)", "determined", "(needs", "below"} <= set(tables.split())


def test_a_pipe_gets_whole_lines_of_plain_text(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = shown(capsys, results)
    assert "\x1b" not in text
    assert len(next(line for line in text.splitlines() if "suspicious" in line)) > 180
    assert not [line for line in text.splitlines() if line != line.rstrip()]


def test_a_terminal_gets_colours_unless_it_wants_none(
    results: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    text = shown(capsys, results)
    assert "\x1b[32mmeets the limits" in text
    assert "suspicious" in text
    assert max(map(cell_len, re.sub("\x1b\\[[0-9;]*m", "", text).splitlines()[:-1])) <= 80
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b[3" not in shown(capsys, results)


def test_where_the_report_is(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = results / "report/index.html"
    assert f"No report at {page}; `snakemake -c2` makes it" in shown(capsys, results)
    page.parent.mkdir()
    page.touch()
    assert shown(capsys, results / "tables").endswith(f"Report: {page}\n")


def test_results_without_tables_say_what_is_missing(
    results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = refused(capsys, results / "nowhere")
    assert "no table recordings, findings, failures, ranking, next_steps, parameters" in said
    assert "expected the folder of the results" in said and "`snakemake -c2` makes it" in said
    (results / "tables/ranking.parquet").write_bytes(b"")
    assert "is damaged" in (said := refused(capsys, results)) and "makes it again" in said
    (results / "tables/ranking.parquet").unlink()
    assert "tables: no table ranking;" in refused(capsys, results)


@pytest.mark.parametrize(
    ("option", "there"),
    [("requirement", "robot, drone"), ("channel", "gyro_x, gyro_y, accel_x"),
     ("method", "likelihood, curve")],
)  # fmt: skip
def test_a_wrong_name_is_answered_with_those_that_are_there(
    results: Path, capsys: pytest.CaptureFixture[str], option: str, there: str
) -> None:
    said = refused(capsys, results, f"--{option}", "nothing")
    assert said == f"no {option} 'nothing'; there are: {there}\n"


@pytest.mark.usefixtures("capsys")
def test_a_reader_that_has_gone_is_seen_by_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(lines: object) -> None:
        raise BrokenPipeError

    monkeypatch.setattr(sys.stdout, "writelines", gone, raising=False)
    with pytest.raises(BrokenPipeError):
        show(lambda _: ["a line"])


def test_other_commands_do_not_wait_for_what_draws() -> None:
    code = "import sys, imubench_pipeline.report.show; sys.exit(sum(n in sys.modules for n in %r))"
    names = ("rich", "pyarrow", "numpy", "imubench_pipeline.units")
    assert subprocess.run([sys.executable, "-c", code % (names,)], check=False).returncode == 0


def test_a_problem_of_a_log_is_printed_once_with_the_parameters_that_it_affects() -> None:
    names = {"sensor": "good", "recording": "run", "channel": "gyro_x"}
    finding = names | {"finding": "knocks", "severity": "warning", "detail": "3 knocks"}
    doubts = [
        names | {"code": "knocks", "fitness": "fit with doubts", "parameters": ["N", "Q"],
                 "reason": "3 knocks"},
        names | {"code": "doubtful", "fitness": "fit with doubts", "parameters": ["K"],
                 "reason": "the walk is doubtful"},
    ]  # fmt: skip
    tables = {
        "recordings": [recording("good")],
        "findings": [finding | {"affects": ["N", "Q"]}],
        "doubts": doubts,
        "parameters": PARAMETERS[:1],
        "allan": [],
    }
    built = {name: build(name, rows) for name, rows in tables.items()}
    text = "".join(str(part) for part in render_logs(built, "practical", 80))
    assert text.count("3 knocks") == 1
    assert "gyro_x (knocks, affects N, Q): 3 knocks" in text
    assert "gyro_x K: the walk is doubtful" in text
