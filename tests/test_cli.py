import json
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import jsonschema
import pytest
import yaml

from imubench_pipeline.run.cli import SCHEMAS, main
from imubench_pipeline.run.start import ONE_THREAD
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
    validator = jsonschema.validators.validator_for(schema)(schema)
    for file in files:
        validator.validate(yaml.safe_load((PROJECT / file).read_text()))


def test_a_schema_refuses_an_unknown_key(tmp_path: Path) -> None:
    main(["schema", "run", "--output", str(tmp_path / "schema.json")])
    with pytest.raises(jsonschema.ValidationError, match="alan"):
        jsonschema.validate({"alan": {}}, json.loads((tmp_path / "schema.json").read_text()))


COMPLETE = "Time (s),Gyroscope X (deg/s)\n" + "".join(f"{n / 100},0.5\n" for n in range(200))
UNSTATED = COMPLETE.replace(" (deg/s)", "")


def logged(tmp_path: Path, text: str) -> str:
    (tmp_path / "run.csv").write_text(text)
    return str(tmp_path / "run.csv")


def test_inspect_shows_a_log_and_a_sensor_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", logged(tmp_path, COMPLETE)]) == 0
    listing, _, block = capsys.readouterr().out.partition("# drafted from")
    assert listing.startswith("run.csv: text\n") and "Gyroscope X (deg/s)" in listing
    block, _, said = block.rpartition("\nread so: ")
    assert yaml.safe_load("#" + block)["log"]["time"] == {"column": "Time (s)", "unit": "s"}
    assert said == "1 channel, 100 Hz from the stamps\n"


def test_inspect_says_what_is_left_to_fill_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["inspect", "--block", logged(tmp_path, UNSTATED)]) == 1
    out, err = capsys.readouterr()
    assert yaml.safe_load(out)["log"]["channels"]["gyro_x"]["unit"] == "?"
    assert "left to fill in: channels.gyro_*.unit" in err


def test_inspect_writes_a_sensor_file_that_schema_and_check_take(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log, output = logged(tmp_path, COMPLETE), tmp_path / "sensors" / "mine.yaml"
    assert main(["inspect", log, "--output", str(output)]) == 0
    assert "vendor" not in capsys.readouterr().out
    written = output.read_text()
    assert yaml.safe_load(written)["model"] == "mine"
    main(["schema", "sensor", "--output", str(tmp_path / "schema.json")])
    jsonschema.validate(yaml.safe_load(written), json.loads((tmp_path / "schema.json").read_text()))
    assert main(["inspect", log, "--output", str(output)]) == 2
    assert "mine.yaml exists already" in capsys.readouterr().err
    assert output.read_text() == written and [*output.parent.iterdir()] == [output]


@pytest.mark.parametrize("name", ["missing", "empty", "folder"])
def test_inspect_refuses_what_is_no_log(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").touch()
    (tmp_path / "folder").mkdir()
    output = tmp_path / "x.yaml"
    assert main(["inspect", str(tmp_path / name), "--output", str(output)]) == 2
    out, err = capsys.readouterr()
    assert out == "" and name in err and err.count("\n") == 1
    assert not output.exists()


@pytest.mark.release
@pytest.mark.parametrize("command", ["schema", "inspect"])
def test_a_reader_that_goes_away_is_no_fault(tmp_path: Path, command: str) -> None:
    given = {"inspect": logged(tmp_path, COMPLETE), "schema": "run"}[command]
    code = "import sys; from imubench_pipeline.run.cli import main; sys.exit(main(sys.argv[1:]))"
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-c", code, command, given],
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writing)
    assert (done.stderr, done.returncode) == ("", 141)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ("exprot", "did you mean export?"),
        ("q\x1b[31m", "no command 'q\\x1b[31m'. There are: analyse,"),
    ],
)
def test_a_wrong_command_is_answered_with_the_right_ones(
    command: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([command])
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


def test_the_command_has_a_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"imubench {version('imubench_pipeline')}\n"


@pytest.mark.release
def test_a_command_has_one_thread() -> None:
    """Each fork of `imubench analyse` had threads of OpenBLAS that took two thirds of its time.

    Of a process with one more, such as an allocator's of pyarrow, Python warns when it forks.
    """
    code = (
        "import os; from imubench_pipeline.run.start import main; main(); "
        "import pyarrow, scipy.linalg; print(len(os.listdir('/proc/self/task')))"
    )
    ours = {key: value for key, value in os.environ.items() if key not in ONE_THREAD}
    command = [sys.executable, "-c", code, "formats"]
    done = subprocess.run(command, env=ours, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "1"
