from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.readers import read
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording, read_simulated
from imubench_pipeline.simulate.from_datasheet import from_datasheet
from imubench_pipeline.simulate.models import make_axis_model
from imubench_pipeline.steps.simulate import write_simulated
from tests.conftest import PROJECT, catalogue

RECORDING = SimulatedRecording.model_validate(
    {
        "sensor": "s",
        "recording": "sim_a",
        "duration": "100 s",
        "rate": "50 Hz",
        "seed": 1,
        "source": "here",
        "channels": {
            "gyro_x": {"N": "60 deg/sqrt(h)", "bias": "100 deg/s"},
            "accel_z": {"N": "1 m/s^2/sqrt(Hz)", "bias": "1 g"},
        },
    }
)
X = {"unit": "deg/s"}
Z = {"unit": "mg"}


@pytest.mark.parametrize(
    "log",
    [
        {"channels": {"gyro_x": X | {"column": "wx"}, "accel_z": Z | {"column": "az"}}},
        {
            "comment": "//",
            "delimiter": "\t",
            "channels": {"gyro_x": X | {"column": "wx"}, "accel_z": Z | {"column": "az"}},
        },
        {"channels": {"gyro_x": X | {"column": 4}, "accel_z": Z | {"column": 2}}, "skip_lines": 2},
        {
            "channels": {
                "gyro_x": X | {"column": 1, "file": "g.csv", "scale": 0.01, "offset": 2048},
                "accel_z": Z | {"column": 1, "file": "a.csv"},
            }
        },
        {
            "time": {"column": "t", "unit": "ms"},
            "channels": {"gyro_x": X | {"column": "wx"}, "accel_z": Z | {"column": "az"}},
        },
    ],
)
def test_the_reader_of_a_layout_reads_what_is_written(log: dict[str, Any], tmp_path: Path) -> None:
    layout = LogFormat.model_validate(({} if "time" in log else {"rate": "50 Hz"}) | log)
    write_simulated(RECORDING, layout, tmp_path / "r")
    blocks: dict[str, list[np.ndarray]] = {}
    for file in read(tmp_path / "r", layout):
        for batch in file.batches():
            for name, values in batch.columns.items():
                blocks.setdefault(name, []).append(values)
            if batch.time is not None:
                np.testing.assert_allclose(np.diff(batch.time), 0.02, atol=1e-8)
        assert file.findings == []
    gyro, accel = np.concatenate(blocks["gyro_x"]), np.concatenate(blocks["accel_z"])
    assert len(gyro) == len(accel) == 5000
    degree = np.pi / 180
    assert gyro.mean() == pytest.approx(100 * degree, abs=5 * degree / 10)
    assert gyro.std() == pytest.approx(degree * np.sqrt(50), rel=0.05)
    assert accel.mean() == pytest.approx(9.80665, abs=0.5)


OPTIONS = {"stim300": "10 g", "mti_3": "later data sheets"}
"""Of which model or revision the simulated figures are, where its sensor file leaves it open."""


def test_those_of_data_sheets_are_typical_on_axis_y_and_a_tenth_off_on_the_others() -> None:
    sensors = catalogue()
    shipped = read_simulated(PROJECT / "config/simulated.yaml", sensors).recordings
    simulated = [entry for entry in shipped if entry.recording == "sim_data_sheet"]
    assert len(simulated) == 4
    for entry in simulated:
        sensor = sensors[entry.sensor]
        if entry.sensor in OPTIONS:
            sheet = sensor.datasheet.model_copy(update={"options": (OPTIONS[entry.sensor],)})
            sensor = sensor.model_copy(update={"datasheet": sheet})
        printed = from_datasheet(entry.sensor, sensor, 1).imu.axes
        assert {*entry.channels} == {*printed}
        for name, settings in entry.channels.items():
            factor = {"x": 0.9, "y": 1.0, "z": 1.1}[name[-1]]
            expected = printed[name].noise
            noise = make_axis_model(settings, name).noise
            assert noise.N == pytest.approx(factor * expected.N, rel=1e-3)
            assert noise.B == pytest.approx(factor * expected.B, rel=1e-3)
            assert (noise.T_B, noise.K) == (expected.T_B, expected.K) == (None, 0.0)


def test_the_shipped_ones_can_all_be_written() -> None:
    sensors = catalogue()
    shipped = read_simulated(PROJECT / "config/simulated.yaml", sensors).recordings
    assert len(shipped) == 18
    assert all(sensors[entry.sensor].log.reader in (None, "csv") for entry in shipped)
    first = shipped[0].channels["gyro_x"].si("gyro_x")
    assert first == {"N": 8.4e-5, "B": 6.7e-5, "T_B": 89.5, "K": 8.2e-7}
