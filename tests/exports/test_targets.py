"""The programs that a noise model can be exported to, and the list of them."""

from __future__ import annotations

import math
import re

import pytest

from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.readers.formats import FILE_FORMATS
from imubench_pipeline.run.cli import main
from tests.exports.sensors import GYRO, imu


def test_names_and_files_of_programs_differ() -> None:
    assert all(target.name == name for name, target in TARGETS.items())
    assert len({target.file_name for target in TARGETS.values()}) == len(TARGETS)


def test_every_format_and_every_program_is_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["formats"]) == 0
    read, exported = capsys.readouterr().out.split("\n\n")
    for name, known in FILE_FORMATS.items():
        (line,) = (text for text in read.splitlines() if text.split()[0] == name)
        words = (known.title, *known.endings, *known.time_columns, *known.settings)
        assert all(word in line for word in words)
    for target in TARGETS.values():
        (line,) = (text for text in exported.splitlines() if text.split()[0] == target.name)
        assert all(word in line for word in (target.title, target.file_name, target.family))


@pytest.mark.parametrize("name", [name for name, target in TARGETS.items() if target.entries])
def test_the_declared_numbers_are_those_of_the_file(name: str) -> None:
    target = TARGETS[name]
    text = target.write(imu(rate=100.0))
    assert isinstance(text, str)
    assert target.source.startswith("https://")
    for entry in target.entries:
        assert re.search(rf"\b{re.escape(entry.name)}\b", text), entry.name
        assert entry.form.convention and entry.unit
        # a unit of the file is one of the same dimension
        assert entry.compute(GYRO, 100.0, 60.0) > 0.0
    quantities = {entry.quantity for entry in target.entries}
    assert quantities >= {"gyro", "accel"}


def test_all_but_matrices_declare_their_numbers() -> None:
    without = {name for name, one in TARGETS.items() if not one.entries}
    assert without == {"json", "npz"}


def test_units_of_programs_are_converted() -> None:
    # 1 rad/s/sqrt(Hz) = 180 / pi * 60 deg/sqrt(h), 1 m/s^2 = 1e5 mGal
    numbers = {one.name: one for one in TARGETS["kf-gins"].entries}
    model = NoiseModel(N=2.0, B=3.0, T_B=7200.0)
    assert numbers["arw"].compute(model, 1.0, 1.0) == pytest.approx(2.0 * 180.0 / math.pi * 60.0)
    assert numbers["abstd"].compute(model, 1.0, 1.0) == pytest.approx(3.0 * 1.0761 * 1e5, rel=1e-4)
    assert numbers["corrtime"].compute(model, 1.0, 1.0) == pytest.approx(2.0)
