import io
import json

import numpy as np
import pytest
from scipy.linalg import expm

from imubench_pipeline.extensions.exports import matrices
from imubench_pipeline.extensions.exports.imu import AxisNoise, Imu
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from tests.exports.sensors import GYRO, Array, imu

EVERYTHING = NoiseModel(
    N=1e-3, B=2e-3, T_B=7.0, K=3e-4, R=1e-5, further=[GaussMarkov(1e-3, 50.0)],
    sinusoids=[Sinusoid(0.01, 0.3)],
)  # fmt: skip


def discretised(F: Array, Q: Array, interval: float) -> tuple[Array, Array]:
    """Return Phi and Q_d of a continuous model (C. Van Loan, 1978)."""
    m = len(F)
    block = np.zeros((2 * m, 2 * m))
    block[:m, :m], block[:m, m:], block[m:, m:] = -F, Q, F.T
    power = expm(block * interval)
    phi = power[m:, m:].T
    return phi, phi @ power[:m, m:]


@pytest.mark.parametrize("model", [GYRO, EVERYTHING, NoiseModel(N=1e-4, B=1e-4)])
def test_the_discrete_model_is_the_continuous_one_sampled(model: NoiseModel) -> None:
    continuous, discrete, states = matrices.compute_matrices(model, 20.0, 30.0)
    phi, drive = discretised(continuous["F"], continuous["Q"], 0.05)
    np.testing.assert_allclose(discrete["Phi"], phi, atol=1e-12)
    np.testing.assert_allclose(discrete["Q_d"], drive, rtol=1e-6, atol=1e-18)
    np.testing.assert_array_equal(discrete["H"], continuous["H"])
    assert discrete["R_d"] == pytest.approx(continuous["R"] * 20.0)
    assert len(states) == len(discrete["H"]) == len(discrete["x0"])


def test_quantization_noise_is_in_the_discrete_model_alone() -> None:
    model = NoiseModel(Q=1e-6, N=1e-4, K=1e-6)
    continuous, discrete, _ = matrices.compute_matrices(model, 20.0, 30.0)
    assert continuous["F"].shape == (1, 1)
    assert discrete["Phi"].shape == (3, 3)


def test_json_holds_the_matrices_to_the_last_bit() -> None:
    found = json.loads(matrices.write_json(imu(rate=20.0)))
    space = GYRO.state_space(20.0)
    discrete = found["gyro"]["discrete"]
    np.testing.assert_array_equal(discrete["Phi"], space.transition)
    np.testing.assert_array_equal(discrete["Q_d"], space.process_noise)
    np.testing.assert_array_equal(discrete["H"], space.output)
    np.testing.assert_array_equal(discrete["P0"], space.initial_variance)
    assert discrete["R_d"] == space.measurement_noise
    assert found["gyro"]["parameters"]["T_B"] == GYRO.T_B
    assert found["accel"]["model"] == "N+GM+K"
    assert found["accel"]["unit"] == "m/s^2"


def test_npz_holds_the_same_as_json() -> None:
    sensor = imu(accel=NoiseModel(N=1e-3, B=3e-4), rate=20.0)
    text = json.loads(matrices.write_json(sensor))
    with np.load(io.BytesIO(matrices.write_npz(sensor))) as arrays:
        for quantity in ("gyro", "accel"):
            for key in ("Phi", "Q_d", "H", "R_d", "x0", "P0"):
                np.testing.assert_array_equal(
                    arrays[f"{quantity}_{key}"], text[quantity]["discrete"][key]
                )
        assert "gyro_z of recording a" in " ".join(arrays["about"])


def test_a_sensor_of_one_quantity_and_of_white_noise_alone() -> None:
    alone = Imu(
        sensor="one", rate=10.0, estimated={"accel": AxisNoise(NoiseModel(N=1.0), "accel_x")}
    )
    found = json.loads(matrices.write_json(alone))
    assert "gyro" not in found
    assert found["accel"]["discrete"]["Phi"] == []
    assert found["accel"]["discrete"]["R_d"] == 10.0
