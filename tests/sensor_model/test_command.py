"""`imubench simulate`, read back by the project's own readers."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import yaml

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.readers import read
from imubench_pipeline.readers.arrays.arrow import METADATA
from imubench_pipeline.recordings.ingest import ingest
from imubench_pipeline.recordings.recording import LogNames, open_channel_logs, read_metadata
from imubench_pipeline.run.cli import main
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import RecordingNotes, merged_log
from imubench_pipeline.settings.validation import parse
from imubench_pipeline.settings.yaml_files import read_yaml
from imubench_pipeline.tables.files import write, write_arrow
from imubench_pipeline.tables.keys import Key
from tests.conftest import PROJECT, catalogue, few
from tests.report.tables import HOUR, joined, recording_rows

SENSORS = PROJECT / "config/sensors"
WARM = "time [min],temperature [degC]\n0,22\n10,30\n60,35\n"


def simulate(*arguments: object) -> int:
    return main(["simulate", *map(str, arguments), "--sensors", str(SENSORS)])


def ingested(path: Path, sensor: str, folder: Path) -> dict[str, np.ndarray]:
    """Read a log as a run does, with its sensor file and the notes beside it."""
    notes = parse(RecordingNotes, read_yaml(path.with_suffix(".yaml")), "notes")
    log = merged_log(catalogue()[sensor], notes, "notes")
    kept = ingest(path, log, notes, QualitySettings(), folder, LogNames())
    assert kept.row.rate == 100.0
    found = {
        name: np.concatenate([*one.blocks()]) for name, one in open_channel_logs(folder).items()
    }
    found["temperature_range"] = np.array(
        [kept.row.temperature_min, kept.row.temperature_max], dtype=float
    )
    return found


@pytest.mark.parametrize("sensor", few(["adis16405"], ["bno055", "mpu9250", "mti_7"]))
def test_a_log_is_read_with_its_sensor_file(sensor: str, tmp_path: Path, capsys) -> None:
    (tmp_path / "warm.csv").write_text(WARM)
    found = {}
    for suffix in ("csv", "parquet"):
        path = tmp_path / f"log_{suffix}.{suffix}"
        given = ["--duration", "40 s", "--rate", "100 Hz", "--temperature", tmp_path / "warm.csv"]
        assert simulate(sensor, *given, "--out", path) == 0
        said = capsys.readouterr().out
        assert said.startswith("SIMULATED by imubench, not measured: 4,000 samples")
        assert "assumed: " in said and "datasheet" in said
        found[suffix] = ingested(path, sensor, tmp_path / suffix)
        path.with_suffix(".yaml").unlink()
    assert set(found["csv"]) == set(found["parquet"]) >= {"gyro_x"}
    for name, values in found["csv"].items():
        np.testing.assert_allclose(values, found["parquet"][name], rtol=1e-9, atol=1e-12)
    assert found["csv"]["temperature_range"] == pytest.approx([22.0, 22 + 8 * 39.99 / 600])


def test_a_text_log_of_a_sensor_with_names_needs_no_notes(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    assert simulate("bno055", "--duration", "40 s", "--out", path) == 0
    log = catalogue()["bno055"].log
    ingest(path, log, RecordingNotes(), QualitySettings(), tmp_path / "kept", LogNames())
    (block,) = open_channel_logs(tmp_path / "kept")["gyro_x"].blocks()
    steps = np.degrees(block) * 16  # 16 LSB/(deg/s)
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    assert path.read_text().startswith(
        "# SIMULATED by imubench, not measured\n# from the datasheet of bno055"
    )


def test_parquet_is_a_kept_recording(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    given = ["--duration", "60 s", "--temperature", "30 degC", "--seed", 7]
    assert simulate("bno055", *given, "--out", path) == 0
    assert read_metadata(path).simulated
    about = json.loads(pq.read_metadata(path).metadata[METADATA])
    assert about["simulation"]["seed"] == 7
    assert "N 0.014 deg/s/sqrt(Hz)" in json.dumps(about["simulation"]["figures"])
    assert pq.read_schema(path).names == ["gyro_x", "gyro_y", "gyro_z", "temperature"]
    kept = open_channel_logs(tmp_path)
    assert kept["gyro_x"].grid == 6000 and kept["gyro_x"].segments == ((0, 6000),)
    # Printed offset 1 deg/s, drift 0.015 deg/s/K over 5 K, signs drawn.
    means = np.degrees([abs(one.mean()) for one in kept.values()])
    assert (np.abs(np.abs(means - 1) - 0.075) < 0.02).all()
    first = path.read_bytes()
    assert simulate("bno055", *given, "--out", path, "--force") == 0
    assert path.read_bytes() == first
    assert simulate("bno055", *given[:-1], 8, "--out", path, "--force") == 0
    assert path.read_bytes() != first


MODEL = {
    "sensor": "bno055",
    "temperature_step": "1 K",
    "misalignment": {"gyro": [[1, 0, 0.5], [0, 1, 0], [0, 0, 1]]},
    "axes": {
        "gyro_x": {
            "N": "0.6 deg/sqrt(h)",
            "K": "1 deg/h/sqrt(h)",
            "further": [{"B": "1 deg/h", "T_B": "5 s"}],
            "sinusoids": [{"amplitude": "1e-3 deg/s", "frequency": "30 Hz"}],
            "bias": "-5.4 deg/s",
            "drift": {"sensitivity": "0.1 deg/s/K", "reference": "295.15 K", "lag": "1 s",
                      "quadratic": "0.01 deg/s/K^2"},
            "low_pass": {"cutoff": "64 Hz"},
            "resolution": "1e-3 deg/s",
            "full_scale": "100 deg/s",
        }
    },
}  # fmt: skip


def test_a_file_of_models_with_motion_and_temperature(tmp_path: Path) -> None:
    (tmp_path / "model.yaml").write_text(yaml.safe_dump(MODEL))
    (tmp_path / "warm.csv").write_text("time,temperature\n0,22\n10,22\n10.01,26.4\n20,26.4\n")
    (tmp_path / "turn.yaml").write_text(
        yaml.safe_dump(
            {"gyro_z": {"form": "steps", "times": ["0 s", "30 s"], "values": ["0 dps", "20 dps"]}}
        )
    )
    path = tmp_path / "out.parquet"
    given = ["--duration", "60 s", "--temperature", tmp_path / "warm.csv"]
    model = tmp_path / "model.yaml"
    assert simulate(model, *given, "--motion", tmp_path / "turn.yaml", "--out", path) == 0
    table = pq.read_table(path)
    x = np.degrees(table["gyro_x"].to_numpy())
    parts = [x[:900].mean(), x[2000:2900].mean(), x[3500:].mean()]
    drift = 0.1 * 4.4 + 0.01 * 4.4**2
    np.testing.assert_allclose(parts, [-5.4, -5.4 + drift, -5.4 + drift + 10.0], atol=0.03)
    assert set(table["temperature"].to_numpy()) == {22.0, 26.0}
    assert ingested(path, "bno055", tmp_path / "kept")["gyro_x"].shape == (6000,)


def parameters(**values: float) -> Estimate:
    return Estimate("likelihood", {name: Parameter(value) for name, value in values.items()})


def test_estimates_of_a_run_are_simulated_as_the_log_showed_them(tmp_path: Path, capsys) -> None:
    """Behind a low-pass above Nyquist, N of a log holds what was folded, and must not twice."""
    tables = tmp_path / "results/tables"
    about = {
        "sensor": "bno055", "device": "d", "recording": "night", "kind": "static",
        "simulated": False, "status": "ok", "rate": 100.0, "duration": 3600.0,
    }  # fmt: skip
    write("recordings", [about], tables / "recordings.parquet")
    estimate = parameters(N=3e-3, B=1e-4, T_B=200.0, K=0.0)
    rows = make_parameter_rows(Key("bno055", "night", "gyro_y"), estimate, recommended=True)
    write("parameters", list(rows), tables / "parameters.parquet")
    bias = {"sensor": "bno055", "recording": "night", "channel": "gyro_y", "value": 0.02}
    write("fixed_bias", [bias | {"unit": "rad/s"}], tables / "fixed_bias.parquet")
    for table in ("temperature", "low_pass"):
        write(table, [], tables / f"{table}.parquet")
    path = tmp_path / "log.parquet"
    given = ["--duration", "2000 s", "--results", tmp_path / "results", "--out", path]
    assert simulate("bno055", *given) == 0
    said = capsys.readouterr().out
    assert "gyro_y: noise N+GM: estimated by method likelihood from bno055/night" in said
    assert "cut-off 64 Hz" in said
    log = open_channel_logs(tmp_path)["gyro_y"]
    assert log.mean() == pytest.approx(0.02, abs=3e-4)
    curve = allan_variance(np.concatenate([*log.blocks()]), 100.0, cluster_sizes=np.array([100]))
    assert curve.deviation[0] == pytest.approx(3e-3, rel=0.05)
    assert simulate("mti_7", *given, "--duration", "1 s", "--force") == 2
    assert "no estimate of sensor 'mti_7'; there are: bno055" in capsys.readouterr().err


def test_drift_and_cut_off_are_those_of_the_run(tmp_path: Path, capsys) -> None:
    rows = recording_rows("bno055", "night", temperature="followed")
    for name, table in joined(rows).items():
        write_arrow(table, tmp_path / f"tables/{name}.parquet")
    out = tmp_path / "log.parquet"
    given = ["--duration", "2000 s", "--rate", "10 Hz", "--results", tmp_path, "--out", out]
    warm = ["--temperature", "42.5 degC"]
    assert simulate("bno055", *given, *warm) == 0
    said = capsys.readouterr().out
    assert "noise N+GM+K: estimated by method compensated from bno055/night" in said
    assert "cut-off 64 Hz: estimated from bno055/night" in said
    assert "temperature sensitivity 0.0004363 rad/s/K: estimated" in said
    assert "no drift" not in said and "first order" not in said
    # 20 K above T_0, by 90 °/h/K, beside the bias there.
    assert open_channel_logs(tmp_path)["gyro_x"].mean() == pytest.approx(
        (20 * 90 + 5) * HOUR, rel=0.01
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nosuch", "--hours", "1"], "no such sensor file; there are: 3dm_cv7"),
        (["bno055", "--hours", "0"], "--hours 0: 0 s at 100 Hz are 0 samples; expected 1 to"),
        (["bno055", "--hours", "-0.5"], "--hours -0.5: -1800 s at 100 Hz are -180000 samples"),
        (
            ["bno055", "--hours", "nan"],
            "--hours nan: nan s at 100 Hz are nan samples; expected 1 to",
        ),
        (["bno055", "--duration", "1 ms"], "--duration 1 ms: 0.001 s at 100 Hz are 0 samples"),
        (["bno055", "--duration", "5"], "--duration: '5' is not a number with its unit"),
        (["bno055", "--hours", "1", "--rate", "100"], "--rate: '100' is not a number with its"),
        (["bno055", "--hours", "1", "--rate", "100 deg"], "--rate: 'deg' is no unit of frequency"),
        (["bno055", "--hours", "1", "--temperature", "25"], "--temperature: '25' is not a number"),
        (["bno055", "--hours", "1", "--temperature", "3 m"], "no unit of temperature"),
        (["bno055", "--hours", "1", "--temperature", "no.csv"], "no.csv: no such file"),
        (["bno055", "--hours", "1", "--channels", "gyro_q"], "--channels: found 'gyro_q'"),
        (["bno055", "--hours", "1", "--channels", ""], "--channels: found ''"),
        (
            ["bno055", "--hours", "1", "--channels", "gyro_x, gyro_x"],
            "found gyro_x twice; expected each channel once",
        ),
        (["bno055", "--hours", "1", "--channels", "accel_x"], "no figures of accel_x"),
        (["lsm9ds1", "--hours", "1", "--rate", "100 Hz"], "prints no noise"),
        (["no.yaml", "--hours", "1"], "no.yaml: no such file"),
        (["bno055", "--hours", "1", "--results", "nowhere"], "no table recordings"),
    ],
)
def test_what_cannot_be_simulated_is_said(
    arguments: list[str], said: str, tmp_path, capsys
) -> None:
    assert simulate(*arguments, "--out", tmp_path / "log.csv") == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_other_formats_and_other_notes_are_left_alone(tmp_path: Path, capsys) -> None:
    assert simulate("bno055", "--hours", "1", "--out", tmp_path / "log.txt") == 2
    assert ".parquet or .csv" in capsys.readouterr().err
    (tmp_path / "log.yaml").write_text("device: mine\n")
    assert simulate("bno055", "--hours", "1", "--out", tmp_path / "log.csv") == 2
    assert "not belong to a simulation" in capsys.readouterr().err
    assert (tmp_path / "log.yaml").read_text() == "device: mine\n"


def test_notes_of_another_log_are_kept_while_it_is_there(tmp_path: Path, capsys) -> None:
    text, binary = tmp_path / "log.csv", tmp_path / "log.parquet"
    given = ["bno055", "--duration", "1 s"]
    assert simulate(*given, "--out", text) == 0
    before = text.with_suffix(".yaml").read_bytes()
    capsys.readouterr()
    for more in ([], ["--force"]):
        assert simulate(*given, "--out", binary, *more) == 2
        assert "log.csv is a recording of the same name" in capsys.readouterr().err
        assert text.with_suffix(".yaml").read_bytes() == before and not binary.exists()
    text.unlink()
    assert simulate(*given, "--out", binary) == 2
    assert "log.yaml exists already" in capsys.readouterr().err
    assert text.with_suffix(".yaml").read_bytes() == before and not binary.exists()
    assert simulate(*given, "--out", binary, "--force") == 0
    assert b"reader: arrow" in binary.with_suffix(".yaml").read_bytes()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"axes": {"gyro_x": {"bias": "3 m"}}}, "axes.gyro_x.bias: 'm' is no unit"),
        ({"axes": {"gyro_x": {"low_pass": {"cutoff": "0 Hz"}}}}, "frequency above zero"),
        ({"axes": {"gyro_x": {"N": "-1 deg/sqrt(h)"}}}, "N is -"),
        ({"axes": {}}, "axes"),
        ({"misalignment": {"gyro": [[1, 0, 0]]}}, "three rows"),
        ({"misalignment": {"mag": [[1, 0, 0]] * 3}}, "expected gyro or accel"),
        ({"sensor": "nosuch"}, "nosuch.yaml: no such sensor file"),
    ],
)
def test_a_wrong_file_of_models_names_the_key(change: dict, said: str, tmp_path, capsys) -> None:
    (tmp_path / "model.yaml").write_text(yaml.safe_dump(MODEL | change))
    out = tmp_path / "log.csv"
    assert simulate(tmp_path / "model.yaml", "--hours", "1", "--rate", "1 Hz", "--out", out) == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("names", few([["mti_7", "bno055"]], [sorted(catalogue())]))
def test_a_log_of_every_sensor_file_is_read(tmp_path: Path, names: Sequence[str]) -> None:
    """Whatever a sensor file says of its logs, the notes say what is otherwise."""
    for name, sensor in ((name, catalogue()[name]) for name in names):
        axes = {str(channel): {"bias": "0.25 rad/s" if "gyro" in channel else "0.25 m/s^2"}
                for channel in sensor.log.channels}  # fmt: skip
        model = tmp_path / f"{name}.model.yaml"
        model.write_text(yaml.safe_dump({"sensor": name, "axes": axes}))
        # Parquet for one of them: what is written is the same.
        for suffix in ("csv", "parquet") if name == "mti_7" else ("csv",):
            path = tmp_path / f"{name}.{suffix}"
            given = ["--duration", "5 s", "--rate", "100 Hz", "--temperature", "30 degC"]
            assert simulate(model, *given, "--out", path) == 0
            notes = parse(RecordingNotes, read_yaml(path.with_suffix(".yaml")), "notes")
            log = merged_log(sensor, notes, "notes")
            found = [batch for file in read(path, log) for batch in file.batches()]
            assert log.rate_hz == 100.0 and sum(map(len, found)) == 500
            assert set(found[0].columns) == {*axes, "temperature"}
            for column, values in found[0].columns.items():
                np.testing.assert_allclose(values, 30.0 if column == "temperature" else 0.25)
            path.unlink()  # its notes are protected while it is there
            path.with_suffix(".yaml").unlink()


def test_nothing_is_left_of_a_log_that_could_not_be_finished(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    from imubench_pipeline.recordings.recording import LogWriter

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(LogWriter, "write", full)
    assert simulate("bno055", "--duration", "5 s", "--out", tmp_path / "log.parquet") == 2
    assert "No space left on device" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_simulated_log_does_not_change_a_measured_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("logs: logs\n")
    logs = tmp_path / "logs/bno055"
    (logs / "rec").mkdir(parents=True)
    for name in ("b.txt", "rec/one.csv", "c.csv.gz"):
        (logs / name).write_text("1,2\n")
    before = sorted(logs.rglob("*"))
    given = ["bno055", "--duration", "1 s", "--out"]
    for name, said in (
        ("b.csv", "b.txt is a recording of the same name"),
        ("rec.csv", "rec is a recording of the same name"),
        ("c.parquet", "c.csv.gz is a recording of the same name"),
        ("rec/two.csv", "expected <sensor>/<recording>"),
        ("../x.csv", "expected <sensor>/<recording>"),
    ):
        assert simulate(*given, logs / name, "--force") == 2
        assert said in capsys.readouterr().err
    assert sorted(logs.rglob("*")) == before
    assert simulate(*given, logs / "new.csv") == 0
