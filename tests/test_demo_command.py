"""`imubench demo`, without a network."""

from __future__ import annotations

import contextlib
import hashlib
import io
import tarfile
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from imubench_pipeline.run import demo_command
from imubench_pipeline.run.cli import main
from imubench_pipeline.run.demo_command import REAL_LOG, RealLog, analyse_real_log
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.settings.yaml_files import read_settings


def test_without_a_file_five_lines_say_where_to_get_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--real"]) == 0
    said = capsys.readouterr().out
    assert len(said.splitlines()) == 5
    for part in (REAL_LOG.command, REAL_LOG.digest, "AGPL-3.0", "34.6 MB"):
        assert part in said


def test_another_file_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = tmp_path / REAL_LOG.file
    other.write_bytes(b"another file")
    assert main(["demo", str(tmp_path / "out"), "--real", str(other)]) == 2
    assert f"found 12 bytes that are not {REAL_LOG.file}" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def archive_of(folder: Path) -> tuple[Path, RealLog]:
    """Write an archive like the published one, with white noise, and its declaration."""
    rng = np.random.default_rng(1)
    log = folder / "log.nc"
    with h5py.File(log, "w") as file:
        file["acceleration"] = rng.normal([0.0, 0.0, 9.8], 0.01, (3000, 3))
        file["angular_velocity"] = rng.normal(0.0, 1e-3, (3000, 6))
    path = folder / "archive.tar.gz"
    with tarfile.open(path, "w:gz") as archive:
        archive.add(log, REAL_LOG.member)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return path, replace(REAL_LOG, size=path.stat().st_size, digest=digest)


def test_the_log_in_the_archive_is_analysed(tmp_path: Path) -> None:
    path, log = archive_of(tmp_path)
    assert analyse_real_log(log, path, tmp_path / "out") == 0
    assert (tmp_path / "out/report.html").is_file()
    with pytest.raises(ConfigError, match="SHA-256"):
        analyse_real_log(replace(log, digest=REAL_LOG.digest), path, tmp_path / "other")


def test_the_sensor_file_has_six_axes() -> None:
    assert len(read_settings(Sensor, REAL_LOG.sensor).log.channels) == 6


def test_the_simulated_one_is_made_once_and_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The run itself becomes Snakemake in place of this process: .ci/run has it.
    runs = []
    monkeypatch.setattr(
        demo_command.project, "run", lambda options: runs.append(options.folder) or 0
    )
    folder = tmp_path / "demo"
    for _ in range(2):
        with contextlib.redirect_stdout(io.StringIO()):
            assert main(["demo", str(folder)]) == 0
    assert runs == [folder, folder]
    assert (folder / "config/boards/engers.yaml").is_file()
