import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from imubench_pipeline.readers import read
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.profile_forms import DayCycleForm
from imubench_pipeline.settings.sensor import LogFormat, Sensor
from imubench_pipeline.settings.simulated_recordings import (
    SimulatedRecording,
    ToSimulate,
    layout,
    profile_files,
    read_simulated,
)
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.simulate.models import list_true_figures
from imubench_pipeline.steps.simulate import write_simulated
from imubench_pipeline.units import parse_quantity
from tests.conftest import PROJECT, catalogue
from tests.test_configuration import SENSOR

DEGREE = np.pi / 180
SENSORS = {name: parse(Sensor, SENSOR, f"{name}.yaml") for name in ("s", "t")}
PUBLISHED = {
    "where": "Table 1",
    "figure": "drift",
    "printed": "0.4 °/s",
    "parameter": "B",
    "means": "0.6 deg/s",
}
OF_S: dict[str, Any] = {
    "sensor": "s",
    "duration": "100 s",
    "rate": "50 Hz",
    "source": "here",
    "channels": {"gyro_x": {"N": "0.6 deg/sqrt(h)", "B": "10 deg/h", "published": [PUBLISHED]}},
}
OF_T: dict[str, Any] = {
    "sensor": "t",
    "duration": "1 h",
    "rate": "10 Hz",
    "source": "there",
    "temperature_step": "0.5 K",
    "channels": {
        "gyro_x": {"bias": "1 deg/s", "drift": {"sensitivity": "0.2 deg/s/K"}},
        "accel_x": {"N": "1 m/s^2/sqrt(Hz)"},
    },
}
WARMING = {"form": "warm_up", "start": "20 degC", "end": "30 degC", "time_constant": "60 s"}
BOARD: dict[str, Any] = {
    "title": "two on one board",
    "seed": 7,
    "sensors": [OF_S, OF_T],
    "temperature": WARMING,
    "motion": {"gyro_x": "3 deg/s"},
}


def written(
    folder: Path, board: Mapping[str, Any] = BOARD, name: str = "pair", **listed: Any
) -> Path:
    """Write a board, and the list of what is simulated, of which it is the only one."""
    (folder / "boards").mkdir(parents=True, exist_ok=True)
    (folder / f"boards/{name}.yaml").write_text(yaml.safe_dump(dict(board)))
    path = folder / "simulated.yaml"
    path.write_text(yaml.safe_dump({"boards": [f"boards/{name}.yaml"]} | listed))
    return path


def simulated(folder: Path, **changes: Any) -> ToSimulate:
    return read_simulated(written(folder, BOARD | changes), SENSORS)


def with_channel(**figures: Any) -> dict[str, Any]:
    """What changes of the board: one sensor, which has one channel with these figures."""
    return {"sensors": [OF_S | {"channels": {"gyro_x": figures}}]}


# What a board gives.


def test_a_board_gives_a_recording_of_each_sensor(tmp_path: Path) -> None:
    found = simulated(tmp_path)
    assert list(found.boards) == ["pair"]
    assert [(one.sensor, one.recording) for one in found.recordings] == [
        ("s", "sim_pair"),
        ("t", "sim_pair"),
    ]
    one, other = found.recordings
    assert (one.rate, one.duration, one.source) == ("50 Hz", "100 s", "here")
    assert (other.rate, other.duration, other.source) == ("10 Hz", "1 h", "there")
    assert other.temperature_step == "0.5 K" and one.temperature_step is None
    assert one.channels["gyro_x"].si("gyro_x")["N"] == pytest.approx(0.01 * DEGREE)
    assert set(other.channels) == {"gyro_x", "accel_x"}
    for recording in found.recordings:
        assert recording.seed == 7
        assert recording.temperature == found.boards["pair"].temperature is not None
        assert recording.motion == found.boards["pair"].motion != {}


def test_recordings_stand_beside_boards(tmp_path: Path) -> None:
    alone = OF_S | {"recording": "sim_alone", "seed": 1}
    found = read_simulated(written(tmp_path, recordings=[alone]), SENSORS)
    assert [one.recording for one in found.recordings] == ["sim_alone", "sim_pair", "sim_pair"]
    assert found.recordings[0].temperature is None
    assert read_simulated(None, SENSORS) == ToSimulate([], {})


def test_the_same_temperature_is_in_every_log_and_each_log_is_of_its_own(tmp_path: Path) -> None:
    sensors = [one | {"duration": "100 s", "rate": "50 Hz", "temperature_step": None,
                      "channels": {"gyro_x": {"N": "1 deg/s/sqrt(Hz)"}}}
               for one in (OF_S, OF_T)]  # fmt: skip
    found = simulated(tmp_path, sensors=sensors)
    one, other = (read_back(recording, tmp_path) for recording in found.recordings)
    np.testing.assert_array_equal(one["temperature"], other["temperature"])
    t = np.arange(5000) / 50.0
    np.testing.assert_allclose(one["temperature"], 30 - 10 * np.exp(-t / 60), rtol=1e-6)
    for log in (one, other):
        assert log["gyro_x"].mean() == pytest.approx(3 * DEGREE, abs=5 * 0.1 * DEGREE)
    together = np.corrcoef(one["gyro_x"], other["gyro_x"])[0, 1]
    assert abs(together) < 5 / np.sqrt(5000)


def test_the_board_says_of_a_figure_what_the_figure_does_not_say(tmp_path: Path) -> None:
    figures = [PUBLISHED, PUBLISHED | {"why": "of its own"}, PUBLISHED | {"figure": "other"}]
    changes = with_channel(N="0.6 deg/sqrt(h)", published=figures)
    found = simulated(tmp_path, why={"drift": "of the board"}, **changes)
    shown = found.recordings[0].channels["gyro_x"].published
    assert [one.why for one in shown] == ["of the board", "of its own", None]


def test_a_published_figure_is_taken_to_si_in_the_dimension_of_its_parameter(
    tmp_path: Path,
) -> None:
    means = {"N": "0.6 deg/sqrt(h)", "B": "36 deg/h", "bias": "2 deg/s", "sensitivity": "3 deg/s/K"}
    figures = [PUBLISHED | {"parameter": name, "means": text} for name, text in means.items()]
    found = simulated(tmp_path, **with_channel(published=figures))
    values = [one.si("gyro") / DEGREE for one in found.recordings[0].channels["gyro_x"].published]
    assert values == pytest.approx([0.01, 0.01, 2.0, 3.0])


# What cannot be used.


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"sensors": [OF_S, OF_T, OF_S]}, "sensors: s occurs twice"),
        ({"sensors": [OF_S | {"sensor": "q"}]}, "sensors.0.sensor: found 'q'; expected .* s, t"),
        (
            {"sensors": [OF_T, OF_S | {"channels": {"gyro_z": {}}}]},
            "sensors.1.channels: found gyro_z; expected channels of the sensor file s: gyro_x",
        ),
        (with_channel(N="1 deg/sqrt(h)", assumed=["N", "K"]), "gyro_x: assumed: 'K' is no figure"),
        (with_channel(assumed=["noise"]), "gyro_x: assumed: 'noise' is no figure"),
        (
            with_channel(published=[PUBLISHED | {"means": "0.6 deg/sqrt(h)"}]),
            "sensors.0: channels.gyro_x.published.0.means: 'deg/sqrt.h.' is no unit of",
        ),
        (
            with_channel(published=[PUBLISHED | {"parameter": "sensitivity"}]),
            "channels.gyro_x.published.0.means: 'deg/s' is no unit",
        ),
        (
            with_channel(read={"N": "0.6 deg/sqrt(h)", "K": "1 deg/s"}),
            "channels.gyro_x.read.K: 'deg/s' is no unit",
        ),
        (with_channel(N="1 deg/s"), "channels.gyro_x.N: 'deg/s' is no unit of gyro density"),
        (
            with_channel(drift={"sensitivity": "1 deg/s"}),
            "channels.gyro_x.drift.sensitivity: 'deg/s' is no unit",
        ),
        (
            with_channel(further=[{"B": "1 deg/s", "T_B": "1 m"}]),
            "channels.gyro_x.further.0.T_B: 'm' is no unit",
        ),
        (
            with_channel(sinusoids=[{"amplitude": "1 deg", "frequency": "1 Hz"}]),
            "channels.gyro_x.sinusoids.0.amplitude: 'deg' is no unit",
        ),
        ({"sensors": [OF_S | {"duration": "0 s"}]},
         "sensors.0.duration: found '0 s'; expected a time above 0"),
        ({"sensors": [OF_S | {"duration": "-1 h"}]}, "sensors.0.duration: found '-1 h'"),
        ({"sensors": [OF_S | {"duration": "9 ms"}]},
         "sensors.0: duration: 9 ms at 50 Hz gives no sample"),
        ({"why": {"drift": "x", "bias": "y"}},
         "why: 'bias' names no published figure; expected drift"),
        ({"sensors": [OF_T], "why": {"drift": "x"}}, "why: 'drift' .* nothing is published"),
        ({"seed": None}, "seed"),
        ({"sensors": []}, "sensors"),
        ({"temperature": {"form": "sum", "parts": [{"form": "constant", "value": "1 degC"}]}},
         "temperature.sum.parts: .*at least 2"),
        ({"temperature": {"form": "sum", "parts": [{"form": "constant", "value": "1 degC"},
                                                   {"form": "file", "file": "warm.csv"}]}},
         "temperature.sum.parts.1"),
        ({"temperature": "20 m"}, "temperature: .*'m' is no unit of temperature"),
        ({"temperature": {"form": "sum", "parts": [{"form": "constant", "value": "20 degC"},
                                                   {"form": "day_cycle", "mean": "0 K",
                                                    "amplitude": "2 m/s"}]}},
         "temperature: 'm/s' is no unit of temperature"),
        ({"motion": {"accel_x": "1 deg/s"}}, "motion: accel_x: 'deg/s' is no unit"),
        ({"motion": {"gyro_x": {"form": "steps", "times": ["0 s"], "values": ["1 g"]}}},
         "motion: gyro_x: 'g' is no unit"),
        ({"motion": {"gyro_x": WARMING}}, "motion: gyro_x: 'degC' is no unit"),
        ({"titel": "x"}, "titel: unknown key; did you mean 'title'"),
    ],
)  # fmt: skip
def test_a_board_that_cannot_be_used_names_file_and_key(
    tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    with pytest.raises(ConfigError) as error:
        simulated(tmp_path, **changes)
    assert str(error.value).startswith(str(tmp_path / "boards/pair.yaml: "))
    assert re.search(said, str(error.value)), str(error.value)


def test_two_boards_of_one_name_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, boards=["boards/pair.yaml", "others/pair.yaml"])
    (tmp_path / "others").mkdir()
    (tmp_path / "others/pair.yaml").write_bytes((tmp_path / "boards/pair.yaml").read_bytes())
    with pytest.raises(ConfigError, match=r"simulated.yaml: boards: two are named pair"):
        read_simulated(path, SENSORS)


@pytest.mark.parametrize("name", ["my board", "pläne", "b+c"])
def test_a_board_whose_name_no_recording_can_have_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(ConfigError, match=r"simulated.yaml: boards: found 'boards/.*letters"):
        read_simulated(written(tmp_path, name=name), SENSORS)


def test_a_recording_that_is_simulated_twice_is_refused(tmp_path: Path) -> None:
    alone = OF_T | {"recording": "sim_pair", "seed": 1}
    with pytest.raises(ConfigError, match=r"simulated.yaml: t/sim_pair is simulated twice"):
        read_simulated(written(tmp_path, recordings=[alone]), SENSORS)
    alone |= {"recording": "sim_x"}
    with pytest.raises(ConfigError, match=r"simulated.yaml: t/sim_x is simulated twice"):
        read_simulated(written(tmp_path, recordings=[alone, alone]), SENSORS)


def test_a_board_is_run_as_its_page_of_the_manual_says(tmp_path: Path) -> None:
    manual = (PROJECT / "docs/how-to/boards.md").read_text(encoding="utf-8")
    listed = re.search(r"^boards: .*", manual, re.MULTILINE)
    named = re.search(r"named (sim_\w+)$", listed[0]) if listed else None
    assert listed and named and "--config simulated=my_simulated.yaml" in manual
    (tmp_path / "boards").mkdir()
    (tmp_path / "boards/oven.yaml").write_text(yaml.safe_dump(BOARD))
    (tmp_path / "my_simulated.yaml").write_text(listed[0])
    found = read_simulated(tmp_path / "my_simulated.yaml", SENSORS)
    assert {one.recording for one in found.recordings} == {named[1]}


def test_the_manual_has_the_defaults_of_a_day_cycle() -> None:
    manual = (PROJECT / "docs/how-to/simulator.md").read_text(encoding="utf-8")
    period, highest = (DayCycleForm.model_fields[name].default for name in ("period", "highest"))
    assert f"period is {period} and highest, the time of the highest value, {highest}" in manual


def test_a_board_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = written(tmp_path, boards=["boards/none.yaml"])
    with pytest.raises(
        ConfigError,
        match=r"simulated.yaml: boards: .*/boards/none.yaml: no such file; expected the",
    ):
        read_simulated(path, SENSORS)


# Files of profiles.


def test_files_of_profiles_are_found_from_the_file_that_names_them(tmp_path: Path) -> None:
    around = {
        "temperature": {"form": "file", "file": "warm.csv"},
        "motion": {
            "gyro_x": {"form": "file", "file": "turn.csv"},
            "accel_x": {"form": "file", "file": "turn.csv"},
            "gyro_z": "1 deg/s",
        },
    }
    for name in ("warm.csv", "turn.csv", "boards/warm.csv", "boards/turn.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("time,temperature,gyro_x,accel_x\n0,20,0,0\n1,20,0,0\n")
    alone = OF_S | around | {"recording": "sim_alone", "seed": 1}
    first, *of_the_board = read_simulated(
        written(tmp_path, BOARD | around, recordings=[alone]), SENSORS
    ).recordings
    assert profile_files(first) == [tmp_path / "turn.csv", tmp_path / "warm.csv"]
    for one in of_the_board:
        assert profile_files(one) == [tmp_path / "boards/turn.csv", tmp_path / "boards/warm.csv"]


def test_a_file_of_a_profile_that_is_not_there_names_file_and_key(tmp_path: Path) -> None:
    lost = {"form": "file", "file": "warm.csv"}
    (tmp_path / "warm.csv").write_text("time,temperature\n0,20\n")  # not where the board looks
    with pytest.raises(ConfigError) as error:
        simulated(tmp_path, temperature=lost)
    board, file = tmp_path / "boards/pair.yaml", tmp_path / "boards/warm.csv"
    said = f"{board}: temperature.file: {file}: no such file; expected a CSV or Parquet file"
    assert str(error.value).startswith(said)
    with pytest.raises(ConfigError, match=r"pair.yaml: motion.gyro_x.file: .*no such file"):
        simulated(tmp_path, motion={"gyro_x": lost})
    alone = OF_S | {"recording": "sim_a", "seed": 1, "motion": {"gyro_x": lost | {"file": "m"}}}
    with pytest.raises(ConfigError, match=r"simulated.yaml: recordings.0.motion.gyro_x.file: .*/m"):
        read_simulated(written(tmp_path, recordings=[alone]), SENSORS)


def test_a_file_of_a_profile_that_goes_later_is_named_by_the_plan(tmp_path: Path) -> None:
    (tmp_path / "boards").mkdir()
    profile = tmp_path / "boards/warm.csv"
    profile.write_text("time,temperature\n0,20\n")
    plan = plan_of(tmp_path, BOARD | {"temperature": {"form": "file", "file": "warm.csv"}})
    profile.unlink()
    with pytest.raises(ConfigError, match=r"s/sim_pair: .*boards/warm.csv cannot be read"):
        plan.simulated_settings("s", "sim_pair")


def test_formulas_have_no_files(tmp_path: Path) -> None:
    assert [profile_files(one) for one in simulated(tmp_path).recordings] == [[], []]


# How the logs are written.


def recording_of(**changes: Any) -> SimulatedRecording:
    own = OF_S | {"recording": "sim_a", "seed": 1} | changes
    return SimulatedRecording.model_validate(own)


WARM = recording_of(
    channels={"gyro_x": {"N": "1 deg/s/sqrt(Hz)"}, "accel_z": {"N": "1 mg/sqrt(Hz)"}},
    temperature=WARMING,
)
X, Z = {"unit": "deg/s"}, {"unit": "mg"}


def read_back(
    recording: SimulatedRecording, folder: Path, log: LogFormat | None = None
) -> dict[str, np.ndarray]:
    """Write a recording and read it; temperature in °C."""
    written_as = layout(recording, log or SENSORS[recording.sensor].log)
    place = folder / recording.sensor / recording.recording
    write_simulated(recording, written_as, place)
    blocks: dict[str, list[np.ndarray]] = {}
    for file in read(place, written_as):
        for batch in file.batches():
            for name, values in batch.columns.items():
                blocks.setdefault(name, []).append(values)
    return {name: np.concatenate(values) for name, values in blocks.items()}


LAYOUTS = [
    {"channels": {"gyro_x": X | {"column": "wx"}, "accel_z": Z | {"column": "az"}}},
    {"channels": {"gyro_x": X | {"column": 4}, "accel_z": Z | {"column": 2}}},
    {
        "channels": {
            "gyro_x": X | {"column": 1, "file": "g.csv"},
            "accel_z": Z | {"column": 1, "file": "a.csv"},
        }
    },
    {
        "time": {"column": "t", "unit": "ms"},
        "channels": {"gyro_x": X | {"column": "wx"}, "accel_z": Z | {"column": "az"}},
    },
    {
        "time": {"column": 3, "unit": "s"},
        "channels": {"gyro_x": X | {"column": 1}, "accel_z": Z | {"column": 2}},
    },
    {
        "time": {"column": 1, "unit": "s"},
        "channels": {
            "gyro_x": X | {"column": 2, "file": "g.csv"},
            "accel_z": Z | {"column": 2, "file": "a.csv"},
        },
    },
    {
        "header": True,
        "channels": {
            "gyro_x": X | {"column": "w", "file": "g.csv"},
            "accel_z": Z | {"column": "a", "file": "a.csv"},
        },
    },
]


@pytest.mark.parametrize("log", LAYOUTS)
def test_the_temperature_has_a_column_of_its_own_that_the_reader_reads(
    log: dict[str, Any], tmp_path: Path
) -> None:
    given = LogFormat.model_validate({"rate": "50 Hz"} | log)
    assert given.temperature is None
    found = read_back(WARM, tmp_path, given)
    assert set(found) == {"gyro_x", "accel_z", "temperature"}
    t = np.arange(5000) / 50.0
    np.testing.assert_allclose(found["temperature"], 30 - 10 * np.exp(-t / 60), rtol=1e-6)
    assert found["gyro_x"].std() == pytest.approx(DEGREE * np.sqrt(50), rel=0.05)
    assert found["accel_z"].std() == pytest.approx(9.80665e-3 * np.sqrt(50), rel=0.05)
    without = read_back(WARM.model_copy(update={"temperature": None}), tmp_path / "cold", given)
    assert set(without) == {"gyro_x", "accel_z"}
    np.testing.assert_array_equal(without["gyro_x"], found["gyro_x"])


def test_the_column_of_temperature_that_a_sensor_has_is_kept(tmp_path: Path) -> None:
    both = {"gyro_x": X | {"column": 1}, "accel_z": Z | {"column": 2}}
    log = LogFormat.model_validate(
        {"rate": "50 Hz", "channels": both, "temperature": {"column": 5, "unit": "K"}}
    )
    assert layout(WARM, log).temperature == log.temperature
    assert read_back(WARM, tmp_path, log)["temperature"][0] == pytest.approx(20.0, abs=1e-4)
    assert layout(recording_of(), log).temperature is None


def test_a_layout_has_the_channels_of_the_recording_alone() -> None:
    both = {"gyro_x": X | {"column": "wx"}, "accel_z": Z | {"column": "az"}}
    log = LogFormat.model_validate({"rate": "50 Hz", "channels": both})
    assert set(layout(recording_of(), log).channels) == {"gyro_x"}


def test_a_layout_has_the_rate_of_the_recording_where_one_is_stated() -> None:
    channels = {"gyro_x": X | {"column": "wx"}}
    stated = LogFormat.model_validate({"rate": "400 Hz", "channels": channels})
    stamped = LogFormat.model_validate({"time": {"column": "t", "unit": "s"}, "channels": channels})
    recording = recording_of()
    assert recording.rate != "400 Hz"
    assert layout(recording, stated).rate == recording.rate
    assert layout(recording, stamped).rate is None


def test_the_register_of_temperature_has_steps(tmp_path: Path) -> None:
    stepped = recording_of(
        channels={"gyro_x": {"drift": {"sensitivity": "1 deg/s/K", "reference": "20 degC"}}},
        temperature_step="0.5 K",
        temperature={"form": "sum", "parts": [
            {"form": "constant", "value": "293.25 K"},
            {"form": "day_cycle", "mean": "0 K", "amplitude": "2 degC", "period": "200 s"},
        ]},
    )  # fmt: skip
    found = read_back(stepped, tmp_path)
    true = 20.1 + 2 * np.cos(2 * np.pi * np.arange(5000) / 50.0 / 200)
    np.testing.assert_allclose(found["temperature"], np.rint(2 * true) / 2, atol=1e-6)
    # The sensor follows the temperature that there is, not what its register says of it.
    np.testing.assert_allclose(found["gyro_x"] / DEGREE, true - 20, atol=1e-5)


def test_a_figure_out_of_its_range_names_recording_and_channel(tmp_path: Path) -> None:
    wrong = recording_of(channels={"gyro_x": {"N": "-1 deg/sqrt(h)"}})
    with pytest.raises(ConfigError, match=r"^s/sim_a: channels.gyro_x: .* N is -"):
        write_simulated(wrong, layout(wrong, SENSORS["s"].log), tmp_path / "r")


# The board that ships.


def shipped() -> list[SimulatedRecording]:
    sensors = catalogue()
    found = read_simulated(PROJECT / "config/simulated.yaml", sensors)
    return [one for one in found.recordings if one.recording == "sim_engers"]


def test_n_in_the_log_of_the_shipped_board_is_sixty_times_what_the_paper_prints() -> None:
    printed = {
        ("scc2130", "gyro_x"): 0.000075,
        ("mpu9250", "gyro_x"): 0.00086,
        ("mpu9250", "gyro_y"): 0.00080,
        ("mpu9250", "gyro_z"): 0.00255,
        ("bno055", "gyro_x"): 0.0032,
        ("bno055", "gyro_y"): 0.0035,
        ("bno055", "gyro_z"): 0.00165,
    }  # Engers, Tables 5 to 7, (°/s)/√Hz
    found = {}
    for recording in shipped():
        rate = parse_quantity(recording.rate, "frequency")
        for channel, axis in recording.channels.items():
            key = (recording.sensor, str(channel))
            figures = {f.name: f.value for f in list_true_figures(axis, channel, rate)}
            found[key] = figures["N"]
            (density,) = (f for f in axis.published if f.figure == "PSD")
            assert float(density.printed.split()[0]) == printed[key]
            assert density.si("gyro") == pytest.approx(60 * printed[key] * DEGREE)
    assert found == pytest.approx({key: 60 * n * DEGREE for key, n in printed.items()}, rel=5e-3)


def test_shipped_board_figures_have_a_place_and_a_reason() -> None:
    figures = [
        (recording.sensor, channel, figure)
        for recording in shipped()
        for channel, axis in recording.channels.items()
        for figure in axis.published
    ]
    assert len(figures) >= 21
    for sensor, channel, figure in figures:
        assert figure.where.startswith("Table "), (sensor, channel, figure)
        assert figure.why, (sensor, channel, figure)


# What a plan makes of it.


def plan_of(folder: Path, board: Mapping[str, Any], **config: Any) -> Plan:
    (folder / "sensors").mkdir(exist_ok=True)
    for name in ("s", "t"):
        (folder / f"sensors/{name}.yaml").write_text(yaml.safe_dump(SENSOR))
    return Plan(
        {
            "logs": str(folder / "logs"),
            "sensors": str(folder / "sensors"),
            "results": str(folder / "results"),
            "requirements": "false",
            "simulated": str(written(folder, board)),
        }
        | config
    )


def settings_of_both(plan: Plan) -> list[str]:
    return [plan.simulated_settings(sensor, "sim_pair") for sensor in ("s", "t")]


def test_published_figure_texts_do_not_change_simulation_settings(tmp_path: Path) -> None:
    before = plan_of(tmp_path, BOARD)
    figures = dict(OF_S["channels"]["gyro_x"])
    reworded = [PUBLISHED | {"printed": "0.41 °/s", "means": "0.61 deg/s", "why": "because"}]
    read = {"N": "0.6 deg/sqrt(h)", "B": "36 deg/h"}
    said = figures | {"published": reworded, "figures": "curve: 3", "read": read}
    after = plan_of(tmp_path, BOARD | {"sensors": [OF_S | {"channels": {"gyro_x": said}}, OF_T]})
    assert settings_of_both(after) == settings_of_both(before)
    # The tables and the report show it, and what the source read is a method of the estimates.
    (found,) = json.loads(after.estimate_settings("s", "sim_pair"))["authors"].values()
    assert found == pytest.approx({"N": math.radians(0.6) / 60.0, "B": math.radians(0.01)})
    assert "authors" not in json.loads(before.estimate_settings("s", "sim_pair"))
    assert after.truths("s") != before.truths("s")
    assert after.report_settings() != before.report_settings()
    noisier = OF_S | {"channels": {"gyro_x": figures | {"N": "0.7 deg/sqrt(h)"}}}
    changed = plan_of(tmp_path, BOARD | {"sensors": [noisier, OF_T]})
    assert settings_of_both(changed)[0] != settings_of_both(before)[0]
    assert settings_of_both(changed)[1] == settings_of_both(before)[1]


def test_an_edit_of_the_file_of_a_profile_simulates_again(tmp_path: Path) -> None:
    board = BOARD | {"temperature": {"form": "file", "file": "warm.csv"}}
    (tmp_path / "boards").mkdir()
    profile = tmp_path / "boards/warm.csv"
    profile.write_text("time,temperature\n0,20\n3600,30\n")
    before = settings_of_both(plan_of(tmp_path, board))
    assert settings_of_both(plan_of(tmp_path, board)) == before
    profile.write_text("time,temperature\n0,20\n3600,31\n")
    after = settings_of_both(plan_of(tmp_path, board))
    assert all(one != other for one, other in zip(after, before, strict=True))


def test_what_is_simulated_is_read_as_it_is_written(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, BOARD)
    for sensor in ("s", "t"):
        told = json.loads(plan.simulated_settings(sensor, "sim_pair"))
        SimulatedRecording.model_validate(told["recording"])
        reader = json.loads(plan.ingest_settings(sensor, "sim_pair"))
        assert reader["simulated"] and reader["log"] == told["log"]
        assert reader["log"]["temperature"]["unit"] == "degC"


def test_a_report_is_told_of_the_boards(tmp_path: Path) -> None:
    told = json.loads(plan_of(tmp_path, BOARD | {"note": "a note"}).report_settings())["boards"]
    assert told == {
        "pair": {
            "title": "two on one board",
            "note": "a note",
            "sensors": {"s": {"gyro_x": None}, "t": {"gyro_x": None, "accel_x": None}},
            "temperature": True,
            "motion": ["gyro_x"],
        }
    }
    (tmp_path / "logs").mkdir()
    none = plan_of(tmp_path, BOARD, simulated="false")
    assert json.loads(none.report_settings())["boards"] == {}
