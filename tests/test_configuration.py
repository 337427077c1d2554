import copy
import re
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from imubench_pipeline.settings.config import Run, given_beside, read_run
from imubench_pipeline.settings.sensor import RecordingNotes, Sensor, merged_log, read_sensors
from imubench_pipeline.settings.simulated_recordings import read_simulated
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.settings.yaml_files import read_yaml
from tests.conftest import PROJECT


def told_to_snakemake(settings: list[str]) -> dict[str, Any]:
    """Return what Snakemake takes ``--config`` for."""
    from snakemake.cli import parse_config  # a worker without these tests need not load it

    return dict(parse_config(settings))


SENSOR: dict[str, Any] = {
    "vendor": "V",
    "model": "M",
    "log": {
        "rate": "100 Hz",
        "channels": {
            "gyro_x": {"column": "wx", "unit": "deg/s"},
            "accel_x": {"column": 2, "unit": "g"},
        },
    },
    "datasheet": {"gyro": {"noise_density": {"value": 0.01, "unit": "deg/s/sqrt(Hz)"}}},
}


def with_change(path: str, value: object) -> dict[str, Any]:
    changed = copy.deepcopy(SENSOR)
    *parents, last = path.split(".")
    node = changed
    for parent in parents:
        node = node.setdefault(parent, {})
    if value is None:
        node.pop(last)
    else:
        node[last] = value
    return changed


def test_a_sensor_file_is_read() -> None:
    sensor = parse(Sensor, SENSOR, "s.yaml")
    assert sensor.log.rate_hz == 100.0
    assert sensor.log.channels["accel_x"].column == 2


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("vender", "x", r"vender: unknown key; did you mean 'vendor'\?"),
        ("log.chanels", {}, r"log.chanels: unknown key; did you mean 'channels'\?"),
        ("log.channels.gyro_w", {"column": 1, "unit": "g"}, r"gyro_w"),
        (
            "log.channels.gyro_x.unit",
            "deg",
            r"gyro_x.unit: 'deg' is no unit of angular rate.*deg/s",
        ),
        ("log.channels.gyro_x.unit", "m/s^2", r"'m/s\^2' is no"),
        ("log.channels.gyro_x.column", None, r"log.channels.gyro_x.column: missing"),
        ("log.channels.gyro_x.column", 0, r"counted from 1"),
        ("log.rate", "100", r"log.rate: .*'100' is not a number with its unit"),
        ("log.rate", "0 Hz", r"above zero"),
        ("log.rate", None, r"expected 'rate'.*or 'time'"),
        ("log.time", {"column": "t"}, r"exactly one of 'unit'"),
        ("log.reader", "cvs", r"log.reader: found 'cvs'; input should be"),
        ("datasheet.gyro.noise_density.unit", "deg/s", r"noise_density.unit: 'deg/s' is no"),
        ("datasheet.gyro.noise_density.sidedness", "both", r"found 'both'"),
    ],
)
def test_faults_name_file_key_value_and_what_was_expected(
    path: str, value: object, expected: str
) -> None:
    with pytest.raises(ConfigError) as error:
        parse(Sensor, with_change(path, value), "config/sensors/s.yaml")
    assert str(error.value).startswith("config/sensors/s.yaml: ")
    assert re.search(expected, str(error.value)), str(error.value)


def test_the_shipped_configuration_is_valid_and_states_the_defaults() -> None:
    shipped = read_run(read_yaml(PROJECT / "config/config.yaml"))
    assert shipped == Run()
    sensors = read_sensors(PROJECT / "config/sensors")
    assert {"mti_7", "c102_f9r", "sirrs01_03", "adis16405", "mpu6050", "cats_tag"} <= set(sensors)
    assert read_simulated(PROJECT / "config/simulated.yaml", sensors).recordings


def test_snakemake_hands_text_over() -> None:
    run = read_run({"simulated": "false", "allan": {"per_decade": "5", "longest": "1/4"}})
    assert run.simulated is None
    assert run.allan.per_decade == 5
    assert run.allan.longest == 0.25


@pytest.mark.release
def test_what_a_run_was_given_beside_its_file_is_told_as_snakemake_takes_it(tmp_path: Path) -> None:
    file = tmp_path / "config.yaml"
    file.write_text("results: mine\nallan: {overlap: full}\n")
    given = {
        "results": "others, new", "logs": "/data/logs", "simulated": False, "held_back": ["a/b"],
        "allan": {"overlap": "full", "per_decade": 5}, "report": {"title": "Mine"},
        "error_budget": {"times": ["1 s", "3 min"]},
    }  # fmt: skip
    run = read_run(given)
    told = given_beside(run, file)
    assert "logs=/data/logs" in told and "simulated=false" in told
    assert 'allan={"per_decade": 5}' in told
    # What it takes is that run again, but for what matters to no recording.
    again = read_yaml(file) | told_to_snakemake(told)
    again["allan"] = {"overlap": "full"} | again["allan"]
    assert read_run(again) == read_run(
        {key: value for key, value in given.items() if key not in ("held_back", "report")}
    )
    assert given_beside(Run(results=Path("mine"), allan={"overlap": "full"}), file) == []
    assert given_beside(Run(), tmp_path / "none.yaml") == []


@pytest.mark.parametrize("longest", ["2/3", "0", "half", "1/0"])
def test_a_wrong_fraction(longest: str) -> None:
    with pytest.raises(ConfigError, match=r"allan.longest: found"):
        read_run({"allan": {"longest": longest}})


def test_a_broken_file_names_its_line(tmp_path: Path) -> None:
    (tmp_path / "s.yaml").write_text("vendor: V\nlog: [1,\n")
    with pytest.raises(ConfigError, match=r"s.yaml, line 3: not readable as YAML"):
        read_sensors(tmp_path)
    with pytest.raises(ConfigError, match="no such folder"):
        read_sensors(tmp_path / "none")


def test_notes_of_a_recording_go_over_its_sensor() -> None:
    sensor = parse(Sensor, SENSOR, "s.yaml")
    notes = parse(
        RecordingNotes,
        {"log": {"rate": "200 Hz", "channels": {"accel_x": None, "gyro_x": {"unit": "rad/s"}}}},
        "a.yaml",
    )
    log = merged_log(sensor, notes, "a.yaml")
    assert log.rate_hz == 200.0
    assert list(log.channels) == ["gyro_x"]
    assert log.channels["gyro_x"].column == "wx"
    assert log.channels["gyro_x"].unit == "rad/s"
    wrong = RecordingNotes(log={"rte": "200 Hz"})
    with pytest.raises(ConfigError, match=r"a.yaml: log: rte: unknown key"):
        merged_log(sensor, wrong, "a.yaml")


def test_simulated_recordings_name_known_sensors_and_channels(tmp_path: Path) -> None:
    entry = {
        "sensor": "s",
        "recording": "sim_a",
        "duration": "1 h",
        "rate": "10 Hz",
        "seed": 1,
        "source": "here",
        "channels": {"gyro_x": {"N": "1e-4 rad/s/sqrt(Hz)"}},
    }
    sensors = {"s": parse(Sensor, SENSOR, "s.yaml")}
    path = tmp_path / "simulated.yaml"

    def written(**changes: object) -> Path:
        path.write_text(yaml.safe_dump({"recordings": [entry | changes]}))
        return path

    assert read_simulated(written(), sensors).recordings[0].channels["gyro_x"].si("gyro_x") == {
        "N": 1e-4
    }
    for change, message in (
        ({"sensor": "t"}, "found 't'; expected one of the sensor files: s"),
        (
            {"channels": {"gyro_z": {"N": "1 rad/√s"}}},
            "found gyro_z; expected channels of the sensor file s",
        ),
        ({"channels": {"gyro_x": {"N": "1 m/s"}}}, "is no unit of gyro density"),
        ({"channels": {"gyro_x": {"T_B": "1 s"}}}, "correlation time of B, which is missing"),
        ({"recording": "a"}, "recording: found 'a'"),
    ):
        with pytest.raises(ConfigError, match=message):
            read_simulated(written(**change), sensors)
    assert read_simulated(None, sensors).recordings == []


@given(st.text(st.characters(codec="utf-8") | st.sampled_from("-'\" \n\x1f\x85\u2028${}[]:#!&*\\")))
@example("1e3")
@example("True")
@example("1_0")
@example("- a")
@example("a: b")
@example("\u0661")
@example("!!str x")
def test_a_folder_of_any_name_is_told_as_snakemake_takes_it(name: str) -> None:
    folder = "r" if name in ("", ".") else name
    told = given_beside(Run(results=Path(folder)), Path("none.yaml"))
    assert told_to_snakemake(told) == {"results": str(Path(folder))}
