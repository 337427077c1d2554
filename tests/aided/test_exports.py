"""The matrices of the exports, run in the filter as a user would load them."""

import io
import json
import math
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.extensions.aided.axis_states import (
    AxisStates,
    add_turn_on_bias,
    make_axis_states,
)
from imubench_pipeline.extensions.aided.runs import Drive
from imubench_pipeline.extensions.aided.trajectories import (
    Spreads,
    simulate_signals,
    simulate_trajectory,
)
from imubench_pipeline.extensions.exports.imu import AxisNoise, Imu
from imubench_pipeline.extensions.exports.matrices import FLICKER_TAU_OVER_HORIZON
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.simulate.model import SensorModel

# The filter takes longest of all to compile; every day, the demonstration has it.
pytestmark = pytest.mark.release

RATE, HORIZON = 50.0, 60.0
GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
ACCEL = NoiseModel(N=9.6e-4, B=3.4e-4, T_B=38.3, K=1.7e-5)
FLICKER = {"gyro": NoiseModel(N=8.4e-5, B=6.7e-5), "accel": NoiseModel(N=9.6e-4, B=3.4e-4)}
PAPERS = {"gyro": GYRO, "accel": ACCEL}
SPREADS = Spreads(1e-3, 0.02)
WAY = simulate_trajectory("car", 100.0, RATE)
DRIVE = Drive(WAY, [(60.0, 30.0)])
SIGNALS = simulate_signals(
    WAY,
    {c: SensorModel(noise=PAPERS[c.split("_")[0]]) for c in CHANNELS},
    SPREADS,
    DRIVE.every,
    3,
    ("car", "0"),
)


def of_npz(content: Any, name: str) -> StateSpace:
    with np.load(io.BytesIO(content), allow_pickle=False) as found:
        parts = [found[f"{name}_{key}"] for key in ("Phi", "Q_d", "H", "R_d", "x0", "P0")]
    return StateSpace(*parts[:3], float(parts[3]), *parts[4:])


def of_json(content: Any, name: str) -> StateSpace:
    found = json.loads(content)[name]["discrete"]
    Phi, Q_d, H, x0, P0 = (np.array(found[key]) for key in ("Phi", "Q_d", "H", "x0", "P0"))
    return StateSpace(Phi, Q_d, H, found["R_d"], x0, P0)


def of_matlab(content: Any, name: str) -> StateSpace:
    """What an imuSensor does with its figures, as MathWorks describes it ("Algorithms")."""
    code = re.sub(r"%.*", "", content)
    member = {"gyro": "Gyroscope", "accel": "Accelerometer"}[name]
    (given,) = re.findall(rf"IMU\.{member} = \w+\((.*?)\);", code, re.DOTALL)
    rate = float(re.findall(r"IMU\.SampleRate = (\S+);", code)[0])
    assert "'NoiseType', 'single-sided'" in given

    def first(key: str) -> float:
        return float(re.findall(rf"'{key}', \[([^,]+),", given)[0])

    p = -float(re.findall(r"'Denominator', \[1, ([^\]]+)\]", given)[0])
    drive = first("BiasInstability")
    return StateSpace(
        np.diag([p, 1.0]),
        np.diag([drive**2, first("RandomWalk") ** 2 / rate]),
        np.ones(2),
        first("NoiseDensity") ** 2 * rate,
        np.zeros(2),
        np.diag([drive**2 / (1.0 - p**2), 0.0]),
    )


LOADED: dict[str, Callable[[Any, str], StateSpace]] = {
    "npz": of_npz,
    "json": of_json,
    "matlab": of_matlab,
}


def filtered(axes: list[AxisStates]) -> tuple[np.ndarray, np.ndarray]:
    errors, variances, *_ = DRIVE.filter(DRIVE.stacked(axes), SIGNALS)
    return errors, variances


def exported(target: str, models: dict[str, NoiseModel]) -> list[AxisStates]:
    imu = Imu(
        sensor="imu",
        rate=RATE,
        estimated={name: AxisNoise(model, "a log") for name, model in models.items()},
        horizon=HORIZON,
    )
    content = TARGETS[target].write(imu)
    return [
        AxisStates(add_turn_on_bias(LOADED[target](content, c.split("_")[0]), SPREADS.bias(c)))
        for c in CHANNELS
    ]


# Flicker noise in MATLAB is a filter of 2000 poles that the program makes: it has no matrices.
@pytest.mark.parametrize(
    ("target", "models"),
    [
        *((target, PAPERS) for target in LOADED),
        *((target, FLICKER) for target in LOADED if target != "matlab"),
    ],
    ids=lambda value: value if isinstance(value, str) else value["gyro"].name,
)
def test_exported_matrices_navigate_as_the_model(
    target: str, models: dict[str, NoiseModel]
) -> None:
    own = [
        make_axis_states(
            models[channel.split("_")[0]],
            RATE,
            turn_on=SPREADS.bias(channel),
            shortest=1.0 / RATE,
            longest=FLICKER_TAU_OVER_HORIZON * HORIZON,
        )
        for channel in CHANNELS
    ]
    errors, variances = filtered(own)
    of_file, claimed = filtered(exported(target, models))
    digits = 1e-6 if target == "matlab" else 1e-9  # it has nine digits
    np.testing.assert_allclose(claimed, variances, rtol=digits)
    scale = np.sqrt(variances)
    np.testing.assert_allclose(of_file / scale, errors / scale, atol=1e3 * digits)


def test_a_file_of_another_sensor_navigates_otherwise() -> None:
    other = {name: NoiseModel(N=3.0 * model.N, K=model.K) for name, model in PAPERS.items()}
    _, claimed = filtered(exported("npz", other))
    _, variances = filtered(exported("npz", PAPERS))
    ratio = math.sqrt(claimed[-11, 0] / variances[-11, 0])  # at the end of the outage
    assert ratio > 1.1
