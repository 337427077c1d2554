import csv
import shutil
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from imubench_pipeline.extensions.nightly.difference_rows import DifferenceKind, Result, ResultKey
from imubench_pipeline.extensions.nightly.run_differences import KINDS, list_differences
from imubench_pipeline.run.cli import main
from imubench_pipeline.tables.datapackage import describe_tables
from imubench_pipeline.tables.files import write, write_json
from tests.test_show import PARAMETERS, RANKING, parameter, recording, standing

N = 1.0e-5
TABLES: dict[str, list[dict[str, Any]]] = {
    "recordings": [recording(name, fitness="fit") for name in ("good", "made", "third")],
    "parameters": [
        parameter("good", "gyro_x", "N", value=N, lower=0.9 * N, upper=1.1 * N),
        parameter("made", "gyro_x", "N", value=N, lower=0.9 * N, upper=1.1 * N),
        parameter("made", "gyro_x", "N", method="curve", recommended=False, value=N),
    ],
    "ranking": RANKING,
    "findings": [],
}


def put(folder: Path, **changed: list[dict[str, Any]]) -> Path:
    for name, rows in {**TABLES, **changed}.items():
        write(name, rows, folder / f"tables/{name}.parquet")
    return folder


def compare(capsys: pytest.CaptureFixture[str], *arguments: object, status: int = 0) -> str:
    assert main(["compare", *map(str, arguments)]) == status
    return capsys.readouterr().out


@pytest.fixture
def before(tmp_path: Path) -> Path:
    return put(tmp_path / "before")


def test_equal_runs_have_no_differences(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # 1e-10 is the rounding of another processor.
    other = parameter("good", "gyro_x", "N", value=N * (1 + 1e-10), lower=0.9 * N, upper=1.1 * N)
    after = put(tmp_path / "after", parameters=[other, *TABLES["parameters"][1:]])
    said = compare(capsys, before, after, "--fail-on", "regression")
    assert said == "Recordings: 3 in A, 3 in B, 3 in both\nNo differences\n"


CASES: dict[DifferenceKind, tuple[dict[str, Any], str, bool]] = {
    "recording_status": (
        {"recordings": [*TABLES["recordings"][:2], recording("third", status="rejected",
                                                             reason="no column 'wx'")]},
        "third/run: usable, now rejected: no column 'wx'",
        True,
    ),
    "value_lost": (
        {"parameters": [parameter("good", "gyro_x", "N", status="not_identified"),
                        *TABLES["parameters"][1:]]},
        "good/run gyro_x N: 1×10⁻⁵ rad/s/√Hz (9×10⁻⁶ to 1.1×10⁻⁵), now not determined",
        True,
    ),
    "verdict": (
        {"ranking": [standing("good", verdict="likely_fails"), *RANKING[1:]]},
        "good robot: meets, now likely fails",
        True,
    ),
    "beyond_intervals": (
        {"parameters": [parameter("good", "gyro_x", "N", value=2 * N, lower=1.8 * N,
                                  upper=2.2 * N), *TABLES["parameters"][1:]]},
        "good/run gyro_x N: 1×10⁻⁵ rad/s/√Hz (9×10⁻⁶ to 1.1×10⁻⁵), "
        "now 2×10⁻⁵ rad/s/√Hz (1.8×10⁻⁵ to 2.2×10⁻⁵) (2 times)",
        False,
    ),
    "within_intervals": (
        {"parameters": [parameter("good", "gyro_x", "N", value=1.05 * N, lower=0.95 * N,
                                  upper=1.15 * N), *TABLES["parameters"][1:]]},
        "(1.05 times)",
        False,
    ),
    "new_finding": (
        {"findings": [{"sensor": "good", "recording": "run", "channel": "gyro_x",
                       "severity": "warning", "finding": "suspicious_unit", "detail": "in rad?"}]},
        "good/run gyro_x suspicious unit: none, now warning: in rad?",
        False,
    ),
    "parameter_status": (
        {"parameters": [parameter("good", "gyro_x", "N", value=N, lower=0.9 * N, upper=1.1 * N,
                                  status="doubtful"), *TABLES["parameters"][1:]]},
        "(9×10⁻⁶ to 1.1×10⁻⁵; doubtful)",
        False,
    ),
    "only_in_a": ({"recordings": TABLES["recordings"][:2]}, "third/run: usable, now none", False),
}  # fmt: skip
"""Changed tables, the line about them, and whether they are a regression; the inverse is none."""
INVERSE: dict[DifferenceKind, DifferenceKind] = {
    "value_lost": "value_gained",
    "new_finding": "finding_gone",
    "only_in_a": "only_in_b",
}


@pytest.mark.parametrize("kind", CASES)
def test_each_kind_of_difference(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: DifferenceKind
) -> None:
    changed, line, regression = CASES[kind]
    after = put(tmp_path / "after", **changed)
    table = tmp_path / "differences.csv"
    options = ("--units", "si", "--output", table, "--force", "--fail-on", "regression")
    said = compare(capsys, before, after, *options, status=int(regression))
    assert line in said and "No differences" not in said
    with table.open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["kind"], row["regression"]) == (kind, str(regression).lower())
    compare(capsys, after, before, *options)
    with table.open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["kind"], row["regression"]) == (INVERSE.get(kind, kind), "false")
    assert kind != "beyond_intervals" or float(row["ratio"]) == pytest.approx(0.5)


def test_each_kind_has_a_case() -> None:
    assert {*CASES, *INVERSE.values()} == {*KINDS}


def test_counts_come_first_then_the_three_worst(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = [parameter("good", "gyro_x", "N", value=1.5 * N, lower=1.4 * N, upper=1.6 * N),
               parameter("made", "gyro_x", "N", value=N / 2, lower=0.4 * N, upper=0.6 * N),
               parameter("made", "gyro_x", "K", value=N)]  # fmt: skip
    worse = [standing("good", verdict="fails"), *RANKING[1:]]
    after = put(tmp_path / "after", parameters=changed, ranking=worse)
    lines = compare(capsys, before, after).splitlines()
    assert lines[:4] == [
        "Recordings: 3 in A, 3 in B, 3 in both",
        "Verdicts changed: 1 (1 regression)",
        "Values changed beyond their intervals: 2, by a factor of up to 2",
        "Values gained: 1",
    ]
    assert [line.split(":")[0].strip() for line in lines[6:]] == [
        "good robot", "made/run gyro_x N", "good/run gyro_x N", "1 more"
    ]  # fmt: skip
    assert len(compare(capsys, before, after, "--all").splitlines()) == len(lines)
    assert main(["compare", str(before), str(after)]) == 0  # none is asked for


def test_a_rejected_recording_counts_once() -> None:
    state, value = (
        ResultKey("recordings", "a", "1"),
        ResultKey("parameters", "a", "1", "gyro_x", "N"),
    )
    found = list_differences(
        {state: Result("fit"), value: Result("ok", 1.0)}, {state: Result("rejected")}
    )
    assert [each.kind for each in found] == ["recording_status"]


def test_what_only_one_run_judges_is_no_difference(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # The requirement `drone` is asked no more, and a new one is.
    rows = [row for row in RANKING if row["requirement"] == "robot"]
    after = put(tmp_path / "after", ranking=[*rows, standing("good", requirement="new")])
    assert "No differences" in compare(capsys, before, after, "--fail-on", "regression")


def test_a_run_of_another_version_is_compared(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    after = put(tmp_path / "after", parameters=PARAMETERS)
    path = before / "tables/parameters.parquet"
    table = pq.read_table(path)
    pq.write_table(table.drop_columns(["fitted"]).append_column("new", table["value"]), path)
    assert "Values changed beyond" in compare(capsys, before, after)
    pq.write_table(table.drop_columns(["status"]), path)
    assert main(["compare", str(before), str(after)]) == 2
    assert "it has no status" in capsys.readouterr().err


def test_a_table_in_parts_is_compared_as_one(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    after = put(tmp_path / "after")
    path = after / "tables/parameters.parquet"
    path.unlink()
    for row in TABLES["parameters"][:2]:
        write("parameters", [row], path / f"{row['sensor']}.parquet")
    assert compare(capsys, before, after).endswith("No differences\n")
    (path / "made.parquet").unlink()
    assert "Values lost: 1 (1 regression)" in compare(capsys, before, after)


def test_the_software_of_the_runs_is_named(
    before: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    after = put(tmp_path / "after")
    for path, version in ((before, "1.0"), (after, "1.1")):
        package = describe_tables({"version": version, "settings": "0123"})
        write_json(package, path / "tables/datapackage.json")
    lines = compare(capsys, before, after).splitlines()
    assert lines[:2] == ["A: imubench 1.0, settings 0123", "B: imubench 1.1, settings 0123"]
    (after / "tables/datapackage.json").write_text("{}")  # of nobody: nothing is said
    assert compare(capsys, before, after).splitlines()[1].startswith("Recordings")


def test_missing_results_are_named(before: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree(before / "tables")
    assert main(["compare", str(before), str(before)]) == 2
    assert "no table parameters, ranking, findings, recordings" in capsys.readouterr().err
