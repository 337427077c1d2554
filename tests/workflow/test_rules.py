"""Every rule is whole: a forgotten part of a step fails here, and not in a run."""

from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.registry import FOLDER
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, PARTS_OF, TABLES
from tests.conftest import PROJECT
from tests.workflow.dry_runs import dry_run
from tests.workflow.rules import costs, rules


def package_of(script: Path) -> str:
    """The package that has the module of a step, by its script."""
    folder = script.parents[1]
    return f"extensions.{folder.name}" if folder.parent == FOLDER else "steps"


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return {rule.name: rule for rule in rules(tmp_path_factory.mktemp("rules"))}


def test_each_rule_has_a_script_and_a_module_of_its_name(known: dict[str, Any]) -> None:
    scripts = {
        rule.name: Path(rule.basedir.get_path_or_uri(secret_free=True), rule.script).resolve()
        for rule in known.values()
    }
    places = (PROJECT / "workflow/scripts", *FOLDER.glob("*/scripts"))
    assert {path.stem: path for place in places for path in place.glob("*.py")} == scripts
    codes = {name: rule.params.get("code") for name, rule in known.items()}
    assert codes == {name: Plan.code(name, package_of(script)) for name, script in scripts.items()}
    assert len(set(codes.values())) == len(codes)


def test_each_rule_names_all_that_it_reads_and_writes(known: dict[str, Any]) -> None:
    for name, rule in known.items():
        for files in (rule.input, rule.output):
            named = sum(end - begin if end else 1 for begin, end in files._names.values())
            assert named == len(files), name
        assert str(rule.log[0]).endswith(f"/{name}.log")


def test_each_rule_says_what_it_takes(known: dict[str, Any]) -> None:
    assert costs().keys() == known.keys()
    for rule in known.values():
        assert {"mem_mb", "runtime"} <= set(rule.resources)


def test_what_is_of_one_recording_or_sensor_is_left_out_alone(known: dict[str, Any]) -> None:
    # A simulated recording that cannot be made is a fault of the settings.
    alone = {name for name, rule in known.items() if rule.params.get("attempt")}
    assert alone == {name for name, rule in known.items() if rule.wildcard_names} - {"simulate"}


def test_each_table_is_made_by_one_rule(known: dict[str, Any]) -> None:
    made: dict[str, list[str]] = {}
    for name, rule in known.items():
        for path in map(Path, rule.output):
            if path.suffix == ".parquet":
                assert path.stem in {*TABLES, *PARTS_OF}, (name, path)
                if path.parent.name == "tables":
                    made.setdefault(path.stem, []).append(name)
    assert {table for table, by in made.items() if len(by) > 1} == set()
    assert made.keys() == TABLES.keys() - set(OF_ONE_RECORDING)


def test_texts_of_the_configuration_are_as_they_are_written(tmp_path: Path) -> None:
    (tmp_path / "Snakefile").write_text(
        f'include: "{PROJECT / "Snakefile"}"\n'
        "print([plan.run.exports.axis, plan.run.exports.because, plan.run.requirements])\n"
    )
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text(
        "exports: {axis: 0017, because: 12:30:45}\nsimulated: no\nrequirements: off\n"
    )
    (tmp_path / "logs/s").mkdir(parents=True)
    (tmp_path / "logs/s/a.csv").write_text("gx\n1\n")
    done = dry_run(tmp_path, ["-c1"])
    assert "['0017', '12:30:45', None]" in done.stdout, done.stderr
    done = dry_run(tmp_path, ["-c1", "--config", 'exports={"axis": "2"}'])
    assert "['2', '12:30:45', None]" in done.stdout, done.stderr
    other = tmp_path / "other.yaml"
    other.write_text("exports: {axis: 1.10}\nresults: 0017\n")
    done = dry_run(tmp_path, ["-c1", "--configfile", "other.yaml"])
    assert "['1.10', '12:30:45', None]" in done.stdout, done.stderr
    done = dry_run(tmp_path, ["-c1", "--configfile", "other.yaml", "--replace-workflow-config"])
    assert "['1.10', None, (" in done.stdout, done.stderr
    (tmp_path / "config/config.yaml").write_text("logs: a\nresults: [1\n")
    done = dry_run(tmp_path, ["-c1"])
    assert "config/config.yaml, line 3: not readable as YAML" in done.stdout
