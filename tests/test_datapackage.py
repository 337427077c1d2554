import json
from pathlib import Path
from typing import Any

import jsonschema
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables.datapackage import describe_tables
from imubench_pipeline.tables.files import build, make_schema, write_arrow, write_json
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from tests.report.tables import joined, recording_rows
from tests.verification.finished import REQUIREMENT, put_requirement
from tests.workflow.project import put_log, put_sensor

SOFTWARE = {"version": "1.2", "settings": "0123456789abcdef"}

NAME = {"type": "string", "pattern": "^[-a-z0-9._/]+$"}
TEXTS = {"type": "array", "items": {"type": "string"}, "minItems": 1, "uniqueItems": True}
FIELD = {
    "required": ["name", "type"],
    "properties": {
        "type": {"enum": ["string", "number", "integer", "boolean", "list"]},
        "description": {"type": "string", "minLength": 3},
        "unit": {"type": "string", "minLength": 1},
    },
}
SCHEMA = {
    "required": ["fields"],
    "properties": {
        "fields": {"type": "array", "items": FIELD, "minItems": 1},
        "primaryKey": TEXTS,
        "foreignKeys": {"type": "array", "items": {"required": ["fields", "reference"]}},
    },
}
RESOURCE = {
    "required": ["name", "path", "type", "schema"],
    "properties": {
        "name": NAME,
        "path": {"type": "string", "pattern": r"^[^./~][^/]*$"},
        "type": {"const": "table"},
        "schema": SCHEMA,
    },
}
PROFILE = {
    "required": ["$schema", "name", "resources"],
    "properties": {
        "$schema": {"const": "https://datapackage.org/profiles/2.0/datapackage.json"},
        "name": NAME,
        "resources": {"type": "array", "minItems": 1, "items": RESOURCE},
    },
}
"""What version 2.0 of the standard asks of the parts that are used here."""


def test_the_descriptor_follows_the_standard() -> None:
    package = describe_tables(SOFTWARE)
    jsonschema.validate(package, PROFILE)
    assert json.dumps(package) == json.dumps(describe_tables(SOFTWARE))
    assert package["software"] == SOFTWARE
    described = [resource["name"] for resource in package["resources"]]
    assert described == [name for name in TABLES if name not in OF_ONE_RECORDING]


@pytest.mark.parametrize(
    "resource", describe_tables(SOFTWARE)["resources"], ids=lambda resource: resource["name"]
)
def test_a_table_is_described_as_it_is_written(resource: dict[str, Any], tmp_path: Path) -> None:
    name, schema = resource["name"], resource["schema"]
    for path in (tmp_path / resource["path"], tmp_path / resource["parquet"]):
        write_arrow(build(name, []), path)
    names = [field["name"] for field in schema["fields"]]
    assert (tmp_path / resource["path"]).read_text() == ",".join(f'"{n}"' for n in names) + "\n"
    # Programs that use Arrow read unit and meaning from the Parquet file itself.
    written = pq.read_schema(tmp_path / resource["parquet"])
    assert [
        {b"unit": field["unit"].encode(), b"meaning": field["description"].encode()}
        for field in schema["fields"]
    ] == [written.field(column).metadata for column in names]
    required = {field["name"] for field in schema["fields"] if field["constraints"]["required"]}
    lists = {field["name"] for field in schema["fields"] if field["type"] == "list"}
    assert required == {field.name for field in make_schema(name) if not field.nullable} - lists
    assert required >= {*schema.get("primaryKey", ())}
    for key in schema.get("foreignKeys", ()):
        assert required >= {*key["fields"]}
        assert key["reference"] == {"resource": "recordings", "fields": ["sensor", "recording"]}


def describe(tmp_path: Path, **config: object) -> dict[str, str]:
    (tmp_path / "logs").mkdir(parents=True, exist_ok=True)
    plan = Plan({"logs": str(tmp_path / "logs"), "simulated": None} | config)
    described: dict[str, str] = json.loads(plan.describe_software())
    return described


def test_the_digest_of_the_settings_changes_with_them_and_not_with_places(tmp_path: Path) -> None:
    first = describe(tmp_path)
    assert describe(tmp_path / "elsewhere", results=str(tmp_path / "r")) == first
    assert describe(tmp_path, tables={"csv": "none"}, samples={"keep": 30}) == first
    other = describe(tmp_path, estimate={"longest": 0.25})
    assert other["settings"] != first["settings"]
    assert other["version"] == first["version"]


def test_the_digest_of_the_settings_leaves_out_what_no_table_has(tmp_path: Path) -> None:
    def digest(requirement: dict[str, Any] = REQUIREMENT, **changes: object) -> str:
        put_sensor(tmp_path / "sensors/one.yaml", **changes)
        put_requirement(tmp_path, **requirement)
        folders = {name: str(tmp_path / name) for name in ("sensors", "requirements")}
        return describe(tmp_path, **folders)["settings"]

    put_log(tmp_path / "logs/one/a.csv", 1, 10)
    first = digest()
    assert digest({"title": "Rover", "note": "none", "example": True}) == first
    assert digest(price="20 EUR", interface="SPI") == first
    assert digest({"static_window": "20 s"}) != first
    assert digest(price_class="consumer") != first


@pytest.mark.release
def test_frictionless_finds_no_fault(tmp_path: Path) -> None:
    frictionless = pytest.importorskip("frictionless", reason="pip install frictionless; 60 MB")
    tables = joined(recording_rows("imu", "day 1"), recording_rows("imu", "day 2"))
    for name in TABLES:
        write_arrow(tables.get(name, build(name, [])), tmp_path / f"{name}.csv")
    write_json(describe_tables(SOFTWARE), tmp_path / "datapackage.json")
    report = frictionless.validate(tmp_path / "datapackage.json")
    assert report.valid, report.flatten(["type", "note"])
    # The keys find a row that is there twice, and a recording that is not there.
    path = tmp_path / "parameters.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines, lines[-1], lines[-1].replace("day 2", "day 3")]) + "\n")
    report = frictionless.validate(tmp_path / "datapackage.json")
    assert {"primary-key", "foreign-key"} <= {kind for (kind,) in report.flatten(["type"])}
