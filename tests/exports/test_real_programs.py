"""Files in the programs that they are for, where Python can install or find these.

The other tests of exports read each file as its program does, after its source. Here the program
reads it. The large ones are for a release (`pip install -e ".[release]"`); without them, their
tests are skipped.
"""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.extensions.exports.overbound import growth
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.noise import NoiseModel
from tests.exports.sensors import EACH, Array, imu, imu_of_each, write_text
from tests.exports.test_filters import ekf2, mavparm

MODELS = {
    quantity: [models.get(axis, models["z"]) for axis in "xyz"] for quantity, models in EACH.items()
}


def run(text: str) -> dict[str, Any]:
    """Return the names that a file of Python defines."""
    namespace: dict[str, Any] = {}
    exec(text, namespace)
    return namespace


def walks(quantity: str, horizon: float) -> list[NoiseModel]:
    """Return N and K of each axis, with the Allan variance of the process at the horizon."""
    found = []
    for model in MODELS[quantity]:
        slow = NoiseModel(B=model.B, T_B=model.T_B).allan_variance(np.array([horizon]))[0]
        found.append(NoiseModel(N=model.N, K=float(np.sqrt(3.0 * slow / horizon))))
    return found


@pytest.mark.release
def test_gtsam_predicts_the_growth_of_the_errors() -> None:
    gtsam = pytest.importorskip("gtsam", reason="pip install gtsam; some 30 MB")
    sensor, seconds, dt = imu_of_each(horizon=20.0), 20.0, 0.01
    params = run(write_text("gtsam", sensor))["make_params"]()
    np.testing.assert_allclose(params.n_gravity, [0.0, 0.0, -STANDARD_GRAVITY])
    still = np.zeros(3)
    found = gtsam.PreintegratedCombinedMeasurements(params, gtsam.imuBias.ConstantBias())
    for _ in range(round(seconds / dt)):
        found.integrateMeasurement(still, still, dt)
    covariance = np.diag(found.preintMeasCov())
    for name, angle, bias in (("gyro", 0, 12), ("accel", 6, 9)):
        for axis, model in enumerate(walks(name, 20.0)):
            expected = growth(model, np.array([seconds]), 100.0)[0][0]
            assert covariance[angle + axis] == pytest.approx(expected, rel=2e-3), (name, axis)
            assert covariance[bias + axis] == pytest.approx(model.K**2 * seconds, rel=1e-5)
    # the position: white noise of the accelerometer, and its walk, integrated twice
    for axis, model in enumerate(walks("accel", 20.0)):
        expected = growth(model, np.array([seconds]), 100.0)[1][0]
        assert covariance[3 + axis] == pytest.approx(expected, rel=5e-3)
    # the same parameters, without the biases
    alone = gtsam.PreintegratedImuMeasurements(params, gtsam.imuBias.ConstantBias())
    for _ in range(100):
        alone.integrateMeasurement(still, still, dt)
    np.testing.assert_allclose(
        np.diag(alone.preintMeasCov())[:3], [m.N**2 for m in MODELS["gyro"]], rtol=1e-5
    )


def test_pymavlink_loads_the_parameters(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    module = pytest.importorskip("pymavlink.mavparm", reason="of the extra test")

    def load(text: str) -> dict[str, float]:
        path = tmp_path / "file"
        path.write_text(text, encoding="utf-8")
        parameters = module.MAVParmDict()
        assert parameters.load(str(path))
        return dict(parameters)

    found = load(write_text("px4-mavparm", imu()))
    assert found == ekf2(write_text("px4", imu())) and len(found) == 5
    of_ardupilot = write_text("ardupilot", imu())
    assert load(of_ardupilot) == mavparm(of_ardupilot)
    assert "Invalid line" not in capsys.readouterr().out
    assert load(write_text("px4", imu())) == {}  # a file of QGroundControl is another form


def test_pyins_takes_the_models_and_simulates_them() -> None:
    sensors = pytest.importorskip("pyins.inertial_sensor", reason="of the extra test")
    import pandas as pd

    sensor = imu_of_each(horizon=20.0)
    namespace = run(write_text("pyins", sensor))
    for name in ("gyro", "accel"):
        model, expected = namespace[f"{name}_model"], walks(name, 20.0)
        np.testing.assert_allclose(model.noise, [one.N for one in expected], rtol=1e-6)
        np.testing.assert_allclose(model.q, [one.K for one in expected], rtol=1e-6)
        # its own simulation of the model has the Allan deviation of N and K
        parameters = sensors.Parameters.from_EstimationModel(model, 5)
        samples = 200_000
        readings = pd.DataFrame(
            np.zeros((samples, 3)), index=np.arange(samples) / 100.0, columns=["x", "y", "z"]
        )
        noise = parameters.apply(readings, "rate").to_numpy()
        for axis, one in enumerate(expected):
            assert_allan(noise[:, axis], one, 100.0, (0.1, 1.0, 20.0))


def assert_allan(log: Array, model: NoiseModel, rate: float, tau: tuple[float, ...]) -> None:
    n = np.array([round(one * rate) for one in tau])
    curve = allan_variance(log, rate, cluster_sizes=n, overlap="octave")
    ratio = curve.variance / model.allan_variance(curve.tau)
    assert np.all(np.abs(ratio - 1.0) < 4.0 * np.sqrt(2.0 / curve.edf) + 1e-3), ratio


@pytest.mark.release
def test_gnss_ins_sim_simulates_each_axis() -> None:
    reason = "of github.com/Aceinna/gnss-ins-sim, on the path; not on PyPI"
    models = pytest.importorskip("gnss_ins_sim.sim.imu_model", reason=reason)
    pathgen = pytest.importorskip("gnss_ins_sim.pathgen.pathgen", reason=reason)
    sensor = imu_of_each()
    found = models.IMU(accuracy=run(write_text("gnss-ins-sim", sensor))["imu_err"])
    np.random.seed(3)  # noqa: NPY002  # the program draws from it
    still, rate = np.zeros((1_000_000, 3)), 20.0
    for name, log in (
        ("gyro", pathgen.gyro_gen(rate, still, found.gyro_err)),
        ("accel", pathgen.acc_gen(rate, still, found.accel_err)),
    ):
        for axis, model in enumerate(MODELS[name]):
            assert_allan(log[:, axis], model, rate, (0.1, 5.0, 60.0))


@pytest.mark.release
@pytest.mark.parametrize(
    ("target", "names"),
    [
        ("orb-slam3", ("IMU.NoiseGyro", "IMU.AccWalk", "IMU.Frequency")),
        ("vins-fusion", ("gyr_n", "acc_w", "g_norm")),
        ("openvins", ("imu0",)),
    ],
)
def test_opencv_reads_real_numbers(target: str, names: tuple[str, ...]) -> None:
    cv2 = pytest.importorskip("cv2", reason="pip install opencv-python-headless; some 60 MB")
    text = write_text(target, imu())
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    expected = yaml.safe_load(text.split("\n", 1)[1])
    for name in names:
        node, value = storage.getNode(name), expected[name]
        if isinstance(value, dict):
            node, value = node.getNode("gyroscope_noise_density"), value["gyroscope_noise_density"]
        assert node.isReal() and node.real() == value


@pytest.mark.release
@pytest.mark.parametrize("name", ["kalibr", "lio-sam", "fast-lio", "ros", "kf-gins", "ob-gins"])
def test_another_reader_of_yaml_finds_the_same(name: str) -> None:
    ruamel = pytest.importorskip("ruamel.yaml", reason="pip install ruamel.yaml: YAML 1.2")
    text = TARGETS[name].write(imu_of_each())
    assert ruamel.YAML(typ="safe", pure=True).load(text) == yaml.safe_load(text)


def test_a_message_of_ros_takes_the_covariances() -> None:
    stores = pytest.importorskip("rosbags.typesys", reason="the extra ros")
    store = stores.get_typestore(stores.Stores.ROS2_HUMBLE)
    found = yaml.safe_load(write_text("ros", imu_of_each()))
    kind = store.types["sensor_msgs/msg/Imu"]
    vector = store.types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    header = store.types["std_msgs/msg/Header"](
        stamp=store.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="imu"
    )
    message = kind(
        header=header,
        orientation=store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        angular_velocity=vector,
        linear_acceleration=vector,
        **{name: np.array(values) for name, values in found.items()},
    )
    again = store.deserialize_cdr(store.serialize_cdr(message, kind.__msgtype__), kind.__msgtype__)
    for name, values in found.items():
        np.testing.assert_array_equal(getattr(again, name), values)


def test_a_compiler_takes_the_header(tmp_path: Path) -> None:
    compiler = shutil.which("g++") or shutil.which("clang++")
    if compiler is None:
        pytest.skip("no compiler of C++ is installed")
    text = write_text("ceres", imu_of_each(cautions=["ends with a backslash \\"]))
    assert re.search(r"\\\.?$", text, re.MULTILINE)
    (tmp_path / "imu_noise.hpp").write_text(text, encoding="utf-8")
    gyro = [model.N for model in MODELS["gyro"]]
    checks = "".join(
        f"static_assert(close(imu_noise::kGyroNoiseDensity[{axis}], {value!r}));\n"
        for axis, value in enumerate(gyro)
    )
    program = tmp_path / "check.cpp"
    program.write_text(
        '#include "imu_noise.hpp"\n'
        "constexpr bool close(double a, double b) { return a < 1.00001 * b && b < 1.00001 * a; }\n"
        f"{checks}int main() {{ return imu_noise::kRate == 100.0 ? 0 : 1; }}\n",
        encoding="utf-8",
    )
    built = tmp_path / "check"
    command = [compiler, "-std=c++17", "-Wall", "-o", str(built), str(program)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert subprocess.run([str(built)], check=False).returncode == 0


def test_the_elements_of_gazebo_are_those_of_the_specification() -> None:
    # sdf/1.9/noise.sdf and imu.sdf of gazebosim/sdformat; its reader warns of any other
    text = write_text("gazebo", imu_of_each())
    noise = {
        "mean",
        "stddev",
        "bias_mean",
        "bias_stddev",
        "dynamic_bias_stddev",
        "dynamic_bias_correlation_time",
    }
    around = {"sdf", "model", "link", "sensor", "update_rate", "imu", "noise", "x", "y", "z"}
    axes = {"angular_velocity", "linear_acceleration"}
    assert set(re.findall(r"<(\w+)", text.split("-->")[1])) == noise | around | axes
