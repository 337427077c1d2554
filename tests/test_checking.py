from pathlib import Path

import numpy as np
import pytest
import yaml

from imubench_pipeline.noise import NoiseModel, Sinusoid
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.run.cli import main

RATE = 100.0
GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
SENSOR = {
    "vendor": "none",
    "model": "test",
    "log": {"rate": "100 Hz", "channels": {"gyro_x": {"column": "wx", "unit": "rad/s"}}},
}


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    (tmp_path / "sensors").mkdir()
    (tmp_path / "sensors/one.yaml").write_text(yaml.safe_dump(SENSOR))
    (tmp_path / "logs/one").mkdir(parents=True)
    return tmp_path / "logs"


def drop(logs: Path, name: str, log: np.ndarray) -> None:
    text = "wx\n" + "\n".join(f"{value:.9g}" for value in log) + "\n"
    (logs / f"one/{name}.csv").write_text(text)


def check(logs: Path, *more: str) -> int:
    return main(["check", str(logs), "--sensors", str(logs.parent / "sensors"), *more])


def test_a_good_log_has_nothing_to_say(
    logs: Path, rng: np.random.Generator, capsys: pytest.CaptureFixture[str]
) -> None:
    drop(logs, "good", simulate(GYRO, RATE, 100_000, rng))
    assert check(logs) == 0
    assert capsys.readouterr().out == "one/good: ok\n"


def test_warnings_and_rejections_set_the_exit_status(
    logs: Path, rng: np.random.Generator, capsys: pytest.CaptureFixture[str]
) -> None:
    log = simulate(GYRO, RATE, 30_000, rng)
    log[15_000:] += 0.01
    drop(logs, "moved", log)
    (logs / "one/empty.csv").write_text("")
    assert check(logs) == 1
    printed = capsys.readouterr().out
    assert "one/moved: warnings\n  warning  step: The mean of gyro x changes by 0.57" in printed
    assert "one/empty: rejected\n  fatal    rejected: empty.csv: the file is empty" in printed
    # Nothing is left behind.
    assert sorted(path.name for path in logs.rglob("*")) == ["empty.csv", "moved.csv", "one"]


@pytest.mark.release
def test_lines_and_the_band_are_notes(
    logs: Path, rng: np.random.Generator, capsys: pytest.CaptureFixture[str]
) -> None:
    model = NoiseModel(N=8.4e-5, sinusoids=(Sinusoid(2e-4, 17.0),))
    log = simulate(model, RATE, 400_000, rng)
    for taps in (3, 4, 5):  # such a cascade is no filter that is tried
        log = np.convolve(log, np.ones(taps) / taps, "valid")
    drop(logs, "line", log)
    assert check(logs) == 0
    printed = capsys.readouterr().out
    assert "note     lines: gyro x has 1 spectral line at " in printed
    assert "at 17 Hz" in printed or "at 16.99" in printed or "at 17.00" in printed
    assert "note     band_limit: The spectrum of gyro x bends above " in printed


def test_wrong_settings_are_told_apart(
    logs: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert check(logs) == 2
    assert "no log found" in capsys.readouterr().err
    assert check(tmp_path / "nowhere") == 2
    assert "which is no folder" in capsys.readouterr().err
    settings = tmp_path / "config.yaml"
    settings.write_text("quality: {knock: 1}\n")
    (logs / "one/a.csv").write_text("wx\n1\n2\n")
    assert check(logs, "--config", str(settings)) == 2
    assert "quality.knock: found 1" in capsys.readouterr().err
