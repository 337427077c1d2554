import json
from pathlib import Path

import jsonschema
import pytest
import yaml

from imubench_pipeline.cli import SCHEMAS, main
from tests.conftest import PROJECT


@pytest.mark.parametrize("name", SCHEMAS)
def test_schemas_are_schemas(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema", name]) == 0
    jsonschema.Draft202012Validator.check_schema(json.loads(capsys.readouterr().out))


@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("run", ["config/config.yaml"]),
        ("simulated", ["config/simulated.yaml"]),
        ("sensor", sorted(p.relative_to(PROJECT) for p in PROJECT.glob("config/sensors/*.yaml"))),
    ],
)
def test_what_ships_fits_its_schema(name: str, files: list[str], tmp_path: Path) -> None:
    main(["schema", name, "--output", str(tmp_path / "schema.json")])
    schema = json.loads((tmp_path / "schema.json").read_text())
    for file in files:
        jsonschema.validate(yaml.safe_load((PROJECT / file).read_text()), schema)


def test_a_schema_refuses_an_unknown_key(tmp_path: Path) -> None:
    main(["schema", "run", "--output", str(tmp_path / "schema.json")])
    with pytest.raises(jsonschema.ValidationError, match="alan"):
        jsonschema.validate({"alan": {}}, json.loads((tmp_path / "schema.json").read_text()))
