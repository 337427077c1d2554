"""Exports from Python against the command of the same logs."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

import imubench_pipeline as imu
from imubench_pipeline.extensions.exports.command import read_in_use
from imubench_pipeline.extensions.exports.imu import ExportError
from imubench_pipeline.run.cli import main

RATE = 20.0
GYRO = imu.NoiseModel(N=2e-4, B=3e-5, K=2e-6)
ACCEL = imu.NoiseModel(N=2e-3, K=4e-5)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated log of one gyro and one accelerometer: 20 minutes."""
    columns = [np.arange(24_000) / RATE]
    columns += [imu.simulate(GYRO, RATE, duration="20 min", seed=1) + 0.01]
    columns += [imu.simulate(ACCEL, RATE, duration="20 min", seed=2) + 9.81]
    names = ["gyro_x [rad/s]", "accel_x [m/s^2]"]
    path = tmp_path_factory.mktemp("logs") / "bench.csv"
    header = ",".join(["time [s]", *names])
    np.savetxt(path, np.column_stack(columns), "%.12g", ",", header=header, comments="")
    return path


def read(text: str | bytes) -> dict[str, float]:
    values = yaml.safe_load(str(text).replace("%YAML:1.0", ""))
    return {key: value for key, value in values.items() if isinstance(value, float)}


def test_the_command_and_the_library_write_the_same_values(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "imu.yaml"
    asked = ["--rate", "20 Hz", "--target", "kalibr", "--output", str(file)]
    plain = tmp_path / "bench.csv"  # without stamps
    plain.write_text(re.sub(r"^[^,]*,", "", log.read_text(), flags=re.MULTILINE))
    assert main(["calibrate", str(plain), *asked]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) <= 12
    assert shown[0] == f"{file}: for Kalibr"
    assert "BENCH" in shown[1]
    assert any("usable" in line for line in shown)
    written = read(file.read_text())
    assert written["gyroscope_noise_density"] == pytest.approx(GYRO.N, rel=0.02)
    assert written["accelerometer_noise_density"] == pytest.approx(ACCEL.N, rel=0.02)

    estimates = imu.estimate(imu.read_log(plain, rate="20 Hz"))
    assert read(estimates.export("kalibr")) == pytest.approx(written)


@pytest.mark.release  # every day the parts: pool_recordings, and what is written
def test_several_logs_of_a_device_are_pooled(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "second.csv"
    louder = imu.NoiseModel(N=2 * GYRO.N, B=2 * GYRO.B, K=2 * GYRO.K)
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    table[:, 1] = imu.simulate(louder, RATE, duration="20 min", seed=7)
    table[:, 2] = imu.simulate(ACCEL, RATE, duration="20 min", seed=8) + 9.81
    header = log.read_text().splitlines()[0]
    np.savetxt(other, table, "%.12g", ",", header=header, comments="")
    file = tmp_path / "imu.yaml"
    assert (
        main(["calibrate", str(log), str(other), "--target", "kalibr", "--output", str(file)]) == 0
    )
    # The mean of the spectra of 1 and of 2 times the noise.
    found = read(file.read_text())["gyroscope_noise_density"]
    assert found == pytest.approx(np.sqrt((1.0 + 4.0) / 2.0) * GYRO.N, rel=0.02)
    assert "2 recordings of the device" in " ".join(file.read_text().replace("#  ", "").split())
    assert capsys.readouterr().out.count("usable") == 2


def test_noise_of_a_log_in_use(log: Path, tmp_path: Path) -> None:
    driving = tmp_path / "drive.csv"
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    rng = np.random.default_rng(8)
    wave = np.sin(2 * np.pi * 0.3 * table[:, :1] + np.arange(2))
    table[:, 1:] += 0.5 * wave + 0.05 * rng.standard_normal((len(table), 2))
    header = log.read_text().splitlines()[0]
    np.savetxt(driving, table, "%.12g", ",", header=header, comments="")
    found = read_in_use(driving, None, 2.0)
    assert found["gyro_x"].N == pytest.approx(np.hypot(0.05 / np.sqrt(RATE), GYRO.N), rel=0.03)
    assert found["accel_x"].motion == pytest.approx(0.5 / np.sqrt(2.0), rel=0.03)
    with pytest.raises(ExportError, match=r"drive.csv: .* lower --motion"):
        read_in_use(driving, None, 9.0)
    with pytest.raises(ExportError, match="no such file"):
        read_in_use(tmp_path / "other.csv", None, 2.0)


@pytest.mark.release  # its pages take a minute
def test_what_analyse_wrote_is_exported(log: Path, tmp_path: Path) -> None:
    folder = tmp_path / "analysed"
    assert main(["analyse", str(log), "--output", str(folder)]) == 0
    written = {}
    for mode in ("--bench", "--bounded", "--in-use"):
        file = tmp_path / mode
        asked = ["--target", "kalibr", "--output", str(file), "--horizon", "10 s", mode]
        assert main(["export", str(folder), *asked]) == 0
        written[mode] = read(file.read_text())
    for key, bench in written["--bench"].items():
        factor = 1.0 if key == "update_rate" else 10.0
        assert written["--in-use"][key] == pytest.approx(factor * bench, rel=1e-5)
        assert written["--bounded"][key] >= 0.999 * bench or "random" in key
    assert "BOUNDED" in (tmp_path / "--bounded").read_text()


def test_models_are_written_without_a_log(tmp_path: Path) -> None:
    path = tmp_path / "imu.yaml"
    text = imu.export({"gyro": GYRO, "accel": ACCEL}, "kalibr", path, rate="200 Hz")
    assert path.read_text() == text
    assert read(text)["update_rate"] == 200.0
    assert read(text)["accelerometer_random_walk"] == pytest.approx(ACCEL.K)
    with pytest.raises(ValueError, match="there are: kalibr"):
        imu.export({"gyro": GYRO, "accel": ACCEL}, "colmap", rate=200.0)
    with pytest.raises(ValueError, match="expected only 'gyro' and 'accel'"):
        imu.export({"gyro_x": GYRO}, "kalibr", rate=200.0)


def test_the_file_is_not_where_notes_of_a_log_are(
    log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    notes = log.with_suffix(".yaml")
    assert main(["calibrate", str(log), "--target", "kalibr", "--output", str(notes)]) == 2
    assert "notes of a log" in capsys.readouterr().err
    assert not notes.exists()


def test_a_moved_log_is_not_written(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    moved = tmp_path / "moved.csv"
    table = np.loadtxt(log, delimiter=",", skiprows=1)
    table[8_000:16_000, 1] += np.sin(table[8_000:16_000, 0])
    header = "time [s],gyro_x [rad/s]"
    np.savetxt(moved, table[:, :2], "%.12g", ",", header=header, comments="")
    file = tmp_path / "imu.yaml"
    assert main(["calibrate", str(moved), "--target", "kalibr", "--output", str(file)]) == 2
    assert not file.exists()
    assert "not written" in capsys.readouterr().err
