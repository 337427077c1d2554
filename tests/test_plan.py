import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from snakemake.io import IOFile

from imubench_pipeline.report.pages import list_pages
from imubench_pipeline.report.publish import make_site
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.sealing import limit_wildcards
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.files import build
from imubench_pipeline.tables.schemas import TABLES
from tests.test_configuration import SENSOR


@pytest.fixture
def project(tmp_path: Path) -> dict[str, Any]:
    (tmp_path / "sensors").mkdir()
    (tmp_path / "logs/s").mkdir(parents=True)
    (tmp_path / "sensors/s.yaml").write_text(yaml.safe_dump(SENSOR))
    return {
        "logs": str(tmp_path / "logs"),
        "sensors": str(tmp_path / "sensors"),
        "results": str(tmp_path / "results"),
        "simulated": "false",
    }


def put(project: dict[str, Any], name: str, text: str = "1,2\n") -> Path:
    path = Path(project["logs"]) / "s" / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def test_recordings_are_found_in_order(project: dict[str, Any]) -> None:
    for name in ("b.csv", "a.txt.gz", "c/x.csv", ".hidden", "notes.md", "d.csv.part", "b.yaml"):
        put(project, name, "{}")
    plan = Plan(project)
    assert list(plan.recordings) == [("s", "a"), ("s", "b"), ("s", "c")]
    assert [path.name for path in plan.recordings["s", "b"].files] == ["b.csv", "b.yaml"]
    assert [path.name for path in plan.recordings["s", "c"].files] == ["x.csv"]


def test_two_logs_of_one_name_are_both_rejected(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    put(project, "a.csv.gz")
    plan = Plan(project)
    assert list(plan.recordings) == [("s", "a"), ("s", "a (2)")]
    for name in ("a", "a (2)"):
        error = json.loads(plan.ingest_settings("s", name))["error"]
        assert "a.csv and " in error and "a.csv.gz would both be the recording s/a" in error


def test_a_sensor_without_a_file_rejects_its_logs_only(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    put(project, "../t/a.csv")
    plan = Plan(project)
    assert "error" not in json.loads(plan.ingest_settings("s", "a"))
    error = json.loads(plan.ingest_settings("t", "a"))["error"]
    assert "no sensor file" in error and "t.yaml" in error
    assert json.loads(plan.datasheet_settings("t"))["datasheet"] == {}


def test_a_broken_sensor_file_rejects_its_logs_only(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    put(project, "../t/a.csv")
    (Path(project["sensors"]) / "t.yaml").write_text("vendor: [\n")
    plan = Plan(project)
    assert "error" not in json.loads(plan.ingest_settings("s", "a"))
    error = json.loads(plan.ingest_settings("t", "a"))["error"]
    assert error.startswith("sensors/t.yaml, line 2: not readable as YAML")
    assert str(plan.unusable["t"]).endswith(error)
    simulated = Path(project["sensors"]).parent / "simulated.yaml"
    simulated.write_text("recordings: [{sensor: t, recording: a, channels: {}, duration: 1 s}]\n")
    with pytest.raises(ConfigError, match=r"simulated.yaml|t.yaml, line 2"):
        Plan(project | {"simulated": str(simulated)})


def test_a_log_in_no_folder_of_a_sensor_is_rejected(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    put(project, "../lost.csv")
    put(project, "../README.md")
    plan = Plan(project)
    assert list(plan.recordings) == [("(no sensor)", "lost"), ("s", "a")]
    error = json.loads(plan.ingest_settings("(no sensor)", "lost"))["error"]
    assert "lost.csv lies beside the folders of the sensors" in error


def test_notes_of_no_log_are_told(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    put(project, "b.yaml", "{}")
    put(project, "a.yml", "{}")
    plan = Plan(project)
    error = json.loads(plan.ingest_settings("s", "a"))["error"]
    assert "rename it to a.yaml" in error
    assert list(plan.recordings) == [("s", "a")]
    skipped = {file["file"]: file["reason"] for file in json.loads(plan.files()) if file["reason"]}
    assert skipped.keys() == {"s/a.yml", "s/b.yaml"}
    assert "rename the file to a.yaml" in skipped["s/a.yml"]
    assert "notes without a log b" in skipped["s/b.yaml"]


def test_a_folder_is_no_file_of_notes(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    put(project, "a.yaml/b.csv")
    plan = Plan(project)
    assert plan.recordings["s", "a"].notes is None
    assert [path.name for path in plan.recordings["s", "a.yaml"].files] == ["b.csv"]


def test_wrong_notes_reject_their_log_only(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    put(project, "a.yaml", "divice: 7\n")
    put(project, "b.csv")
    put(project, "b.yaml", "log: [\n")
    put(project, "c.csv")
    put(project, "c.yaml", "device: 12345\nstarted: 2024-01-01T10:00:00Z\n")
    plan = Plan(project)
    assert "did you mean 'device'" in json.loads(plan.ingest_settings("s", "a"))["error"]
    assert "not readable as YAML" in json.loads(plan.ingest_settings("s", "b"))["error"]
    notes = json.loads(plan.ingest_settings("s", "c"))["notes"]
    assert notes["device"] == "12345" and notes["started"].startswith("2024-01-01T10:00:00")


@pytest.mark.parametrize("name", ["a{b}", "d<e>", "x" * 200, "a\nb", "=1", "\u202e", "\udcff"])
@pytest.mark.parametrize("what", ["file", "folder"])
def test_a_name_that_cannot_be_used_rejects_its_log_only(
    project: dict[str, Any], name: str, what: str
) -> None:
    put(project, "good.csv")
    put(project, f"{name}.csv" if what == "file" else f"../{name}/a.csv")
    plan = Plan(project)
    assert len(plan.recordings) == 2
    (bad,) = [key for key in plan.recordings if key[1] != "good"]
    for part in bad:
        assert not set("{}<>\n=") & set(part) and part.isprintable() and len(part) <= 120
    assert f"rename the {what}" in json.loads(plan.ingest_settings(*bad))["error"]
    assert plan.recordings[bad].inputs == []


def test_a_link_to_nowhere_rejects_its_log_only(project: dict[str, Any]) -> None:
    put(project, "good.csv")
    (Path(project["logs"]) / "s/lost.csv").symlink_to("nowhere.csv")
    (Path(project["logs"]) / "s/empty").mkdir()
    plan = Plan(project)
    assert "No such file" in json.loads(plan.ingest_settings("s", "lost"))["unavailable"]
    assert "has no files" in json.loads(plan.ingest_settings("s", "empty"))["error"]


def pipe(notes: Path) -> None:
    os.mkfifo(notes)


def lost(notes: Path) -> None:
    notes.symlink_to("nowhere")


def deep(notes: Path) -> None:
    notes.write_text(200_000 * "[")


def twice(notes: Path) -> None:
    notes.write_text("device: a\ndevice: b\n")


def growing(notes: Path) -> None:
    lines = [f"a{k}: &a{k} [{', '.join(9 * [f'*a{k - 1}'])}]" for k in range(1, 12)]
    notes.write_text("\n".join(["a0: &a0 [x, x]", *lines]))


@pytest.mark.parametrize(
    ("make", "kind", "said"),
    [
        (pipe, "error", "not a regular file"),
        (lost, "unavailable", "no such file"),
        (deep, "error", "line 1: not readable as YAML: lists and mappings are nested more than"),
        (twice, "error", "line 2: not readable as YAML: the key 'device' occurs twice"),
        (growing, "error", "line 6: not readable as YAML: found more than"),
    ],
)
def test_notes_that_cannot_be_used_reject_their_own_recording_alone(
    make: Callable[[Path], None], kind: str, said: str, project: dict[str, Any]
) -> None:
    put(project, "a.csv")
    put(project, "b.csv")
    make(Path(project["logs"]) / "s/b.yaml")
    plan = Plan(project)
    assert set(plan.recordings) == {("s", "a"), ("s", "b")}
    assert json.loads(plan.ingest_settings("s", "b"))[kind].startswith("logs/s/b.yaml")
    assert said in json.loads(plan.ingest_settings("s", "b"))[kind]
    assert "error" not in json.loads(plan.ingest_settings("s", "a"))
    assert (
        plan.static_of("s") == ["a", "b"]
        and plan.of_experiment("rate_table", "positions", "pointing") == []
    )


def test_a_drop_zone_that_is_not_there(project: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"logs: found .*/nowhere', which is no folder"):
        Plan(project | {"logs": project["logs"] + "/nowhere"})


def test_an_edit_of_the_datasheet_changes_nothing_else(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    before = Plan(project)
    changed = SENSOR | {"datasheet": {}, "price_class": "cheap"}
    (Path(project["sensors"]) / "s.yaml").write_text(yaml.safe_dump(changed))
    after = Plan(project)
    assert after.ingest_settings("s", "a") == before.ingest_settings("s", "a")
    assert after.datasheet_settings("s") != before.datasheet_settings("s")


def test_a_log_of_another_size_is_another_log(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    before = Plan(project).ingest_settings("s", "a")
    put(project, "a.csv", "1,2\n3,4\n")
    assert Plan(project).ingest_settings("s", "a") != before


REQUIREMENT = {
    "title": "a robot",
    "static_window": "10 s",
    "limits": [{"error": "heading", "after": "100 s", "at_most": "1 deg"}],
}


def test_a_report_is_given_what_its_pages_show(project: dict[str, Any], tmp_path: Path) -> None:
    (tmp_path / "requirements").mkdir()
    (tmp_path / "requirements/robot.yaml").write_text(yaml.safe_dump(REQUIREMENT))
    (tmp_path / "sensors/unused.yaml").write_text(yaml.safe_dump(SENSOR))
    put(project, "a.csv")
    put(project, "../t/a.csv")
    plan = Plan(project | {"requirements": str(tmp_path / "requirements")})
    settings = json.loads(plan.report_settings())
    assert settings["results"] == project["results"]
    assert {f"logs={project['logs']}", "simulated=false"} <= set(settings["given"])
    assert set(settings["report"]) >= {"title", "units"}
    # Sensors with recordings; of one without a file nothing is known.
    assert list(settings["sensors"]) == ["s"]
    assert set(settings["sensors"]["s"]) == {"vendor", "model", "price_class", "sold"}
    assert settings["requirements"]["robot"]["title"] == "a robot"
    assert set(settings["models"]["sensors"]["s"]) == {"price_class", "abilities", "figures"}
    assert {"tau", "common"} <= set(settings["settings"]["fusion"])
    assert {"static_window", "latitude"} <= set(settings["settings"]["error_budget"])
    site = make_site({name: build(name, []) for name in TABLES}, plan.report_settings(), tmp_path)
    assert site.title == settings["report"]["title"]
    assert len(list(list_pages(site))) == 5


def test_a_new_log_does_not_change_the_settings_of_the_report(project: dict[str, Any]) -> None:
    put(project, "a.csv")
    before = Plan(project).report_settings()
    put(project, "b.csv")
    assert Plan(project).report_settings() == before


def test_names_with_braces_are_no_wildcards_and_reject_themselves_alone(
    project: dict[str, Any],
) -> None:
    for name in ("a.csv", "{y}.csv", "r#1.csv", "r_1.csv"):
        put(project, name)
    (Path(project["sensors"]) / "{x}.yaml").write_text(yaml.safe_dump(SENSOR))
    plan = Plan(project)
    for text in (plan.files(), plan.catalogue(), plan.ranking_settings()):
        assert not re.search(r"\{\s*\w", text)
    assert {file["file"] for file in json.loads(plan.files())} >= {"s/{y}.csv", "s/a.csv"}
    assert "{x}" in json.loads(plan.catalogue())
    errors = {log.path.name: bool(log.error) for log in plan.recordings.values()}
    assert errors == {"a.csv": False, "{y}.csv": True, "r#1.csv": True, "r_1.csv": False}


@pytest.mark.parametrize(
    ("csv", "left"),
    [
        ("all", {"parameters", "pooled", "not_ours"}),
        ("sensors", {"pooled", "not_ours"}),
        ("none", {"not_ours"}),
    ],
)
def test_tables_are_written_as_csv_by_the_setting(
    project: dict[str, Any], csv: str, left: set[str]
) -> None:
    plan = Plan(project | {"tables": {"csv": csv}})
    folder = Path(project["results"]) / "tables"
    folder.mkdir(parents=True)
    for name in ("parameters", "pooled", "not_ours"):
        (folder / f"{name}.csv").touch()
        (folder / f"{name}.parquet").touch()
    plan.remove_unused_csv()
    assert {path.stem for path in folder.glob("*.csv")} == left
    assert len([*folder.glob("*.parquet")]) == 3
    named = set(json.loads(plan.report_settings())["csv"])
    assert left - {"not_ours"} == named & {"parameters", "pooled"}


def test_wildcards_match_the_jobs_to_do_and_no_others() -> None:
    pattern = "r/{sensor,[^/]+}/{recording,[^/]+}/log.json"
    names = ["run 1", "a.b", "{x}", "n,2", "(c)+", "äö"]
    jobs = [{"sensor": "s"}, *({"sensor": "t", "recording": name} for name in names)]
    file = IOFile(limit_wildcards(pattern, jobs))
    for sensor in ("s", "t"):
        for name in names:
            found = file.match(f"r/{sensor}/{name}/log.json")
            assert found and found.groupdict() == {"sensor": sensor, "recording": name}
    for other in ("r/s/run 2/log.json", "r/s/aXb/log.json", "r/u/a.b/log.json"):
        assert not file.match(other)
    assert not IOFile(limit_wildcards(pattern, [])).match("r/s/a.b/log.json")
    many = [{"sensor": "s", "recording": f"night_{number}"} for number in range(201)]
    assert "{recording,[^/]+}" in limit_wildcards(pattern, many)
