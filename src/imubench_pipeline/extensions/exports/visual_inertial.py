"""Programs of visual- and lidar-inertial navigation, with white noise N and random walk K.

Kalibr, OpenVINS, Basalt, ORB-SLAM3 and LIO-SAM take densities that are continuous in time and
two-sided, SI, all above 0; VINS-Fusion takes standard deviations of samples, and FAST-LIO their
variances.
"""

import json
from dataclasses import replace

from imubench_pipeline.extensions.exports import programs
from imubench_pipeline.extensions.exports.comments import format_decimal, format_setting
from imubench_pipeline.extensions.exports.imu import Imu

_HUB = "https://github.com/"
KALIBR = programs.declare(
    "Kalibr",
    _HUB + "ethz-asl/kalibr/wiki/IMU-Noise-Model",
    "N as *_noise_density and K as *_random_walk: continuous in time, two-sided (sigma^2(tau) = "
    "N^2 / tau and K^2 tau / 3), SI; not multiplied by the root of the rate.",
    (programs.WHITE, "gyroscope_noise_density", "accelerometer_noise_density"),
    (programs.WALK, "gyroscope_random_walk", "accelerometer_random_walk"),
    positive=True,
)
OPENVINS = replace(
    KALIBR,
    name="OpenVINS",
    source=_HUB + "rpng/open_vins/blob/HEAD/ov_msckf/src/utils/NoiseManager.h",
)
VINS_FUSION = programs.declare(
    "VINS-Fusion, VINS-Mono",
    _HUB + "HKUST-Aerial-Robotics/VINS-Fusion/blob/HEAD/vins_estimator/src/factor/"
    "integration_base.h",
    "acc_n, gyr_n = N sqrt(2 rate) and acc_w, gyr_w = K sqrt(rate): discrete in time, for samples "
    "at {rate:g} Hz only. What the midpoint propagation makes of them is N^2 and K^2 times the "
    "time; N and K are two-sided densities. These lines replace the lines of the same name in the "
    "configuration.",
    (programs.MIDPOINT, "gyr_n", "acc_n"),
    (programs.STEP, "gyr_w", "acc_w"),
)
BASALT = programs.declare(
    "Basalt",
    "https://gitlab.com/VladyslavUsenko/basalt-headers/-/blob/HEAD/include/basalt/calibration/"
    "calibration.hpp",
    "*_noise_std is N (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)) and *_bias_std is K (rad/s^2/sqrt(Hz), "
    "m/s^3/sqrt(Hz)), continuous in time and two-sided, of x, y and z.",
    (programs.WHITE, "gyro_noise_std", "accel_noise_std"),
    (programs.WALK, "gyro_bias_std", "accel_bias_std"),
    each=True,
    positive=True,
)
ORB_SLAM3 = programs.declare(
    "ORB-SLAM3",
    _HUB + "UZ-SLAMLab/ORB_SLAM3/blob/HEAD/src/Tracking.cc",
    "N as IMU.Noise* and K as IMU.*Walk: continuous in time, two-sided, SI; the program itself "
    "multiplies by the root of IMU.Frequency, or divides by it. These lines go into the settings "
    "of the camera, beside IMU.T_b_c1.",
    (programs.WHITE, "IMU.NoiseGyro", "IMU.NoiseAcc"),
    (programs.WALK, "IMU.GyroWalk", "IMU.AccWalk"),
    positive=True,
)
LIO_SAM = programs.declare(
    "LIO-SAM",
    _HUB + "TixiaoShan/LIO-SAM/blob/HEAD/src/imuPreintegration.cpp",
    "imu*Noise is N and imu*BiasN is K: continuous in time, two-sided, SI; not multiplied by the "
    "root of the rate. These lines replace the lines of the same name in params.yaml.",
    (programs.WHITE, "imuGyrNoise", "imuAccNoise"),
    (programs.WALK, "imuGyrBiasN", "imuAccBiasN"),
    positive=True,
)
FAST_LIO = programs.declare(
    "FAST-LIO, FAST-LIVO2",
    _HUB + "hku-mars/FAST_LIO/blob/HEAD/src/IMU_Processing.hpp",
    "*_cov are variances of a sample, discrete in time, for samples at {rate:g} Hz only: N^2 rate, "
    "and K^2 rate for b_*_cov; N and K are two-sided densities, SI. FAST-LIO reads them from "
    "mapping, FAST-LIVO2 from imu, where it ignores b_*_cov and takes 1e-4. These lines replace "
    "the lines of the same name in the configuration.",
    (programs.SAMPLE_VARIANCE, "gyr_cov", "acc_cov"),
    (programs.STEP_VARIANCE, "b_gyr_cov", "b_acc_cov"),
)


def write_kalibr(imu: Imu) -> str:
    """Return ``imu.yaml``; Kalibr itself multiplies N by sqrt(update_rate).

    Sources: ethz-asl/kalibr, wiki page "IMU Noise Model" (E[n n'] = sigma^2 delta, sigma_d = sigma
    / sqrt(dt)), and aslam_offline_calibration/kalibr/python/kalibr_common/ConfigReader.py, class
    ImuParameters (names, checks, conversion).
    """
    head, lines = programs.compose(imu, KALIBR, programs.YAML)
    return (
        head
        + lines
        + format_setting("rostopic", json.dumps(imu.ros_topic), "of sensor_msgs/Imu")
        + format_setting("update_rate", format_decimal(imu.rate), "Hz")
    )


def write_openvins(imu: Imu) -> str:
    """Return ``kalibr_imu_chain.yaml``, with the identity for extrinsics and intrinsics.

    The propagation takes sigma^2 / dt for the white noise and sigma^2 dt for the biases.

    Sources: rpng/open_vins, config/euroc_mav/kalibr_imu_chain.yaml (form and names),
    ov_msckf/src/utils/NoiseManager.h (units), ov_msckf/src/state/Propagator.cpp (discretisation).
    """
    indent = "  "
    head, lines = programs.compose(imu, OPENVINS, indent + programs.YAML)

    def matrix(name: str, size: int, diagonal: float = 1.0) -> str:
        rows = [[diagonal if i == j else 0.0 for j in range(size)] for i in range(size)]
        return f"  {name}:\n" + "".join(f"    - {row}\n" for row in rows)

    return (
        f"%YAML:1.0\n\n{head}imu0:\n"
        + matrix("T_i_b", 4)
        + lines
        + format_setting("rostopic", json.dumps(imu.ros_topic), "of sensor_msgs/Imu", indent)
        + format_setting("time_offset", format_decimal(0.0), "s", indent)
        + format_setting("update_rate", format_decimal(imu.rate), "Hz", indent)
        + format_setting("model", '"kalibr"', "of the intrinsics", indent)
        + "".join(matrix(name, 3) for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC"))
        + matrix("Tg", 3, diagonal=0.0)
    )


def write_vins_fusion(imu: Imu) -> str:
    """Return the lines of the configuration of VINS-Fusion and VINS-Mono that concern the sensor.

    The configuration calls ``acc_n``, ``gyr_n``, ``acc_w`` and ``gyr_w`` standard deviations and
    gives no unit. The propagation takes them per sample, discrete in time: a step of dt adds
    (dt / 2)^2 (n_k^2 + n_(k+1)^2) to the variance of angle and velocity, where the noises of both
    samples are independent and equal ``*_n``, and (dt ``*_w``)^2 to the variance of the bias. The
    true increments are N^2 dt and K^2 dt, so

        acc_n = N sqrt(2 rate),   acc_w = K sqrt(rate).

    A sample has the standard deviation N sqrt(rate). The factor sqrt(2) compensates for the
    midpoint rule: each sample enters two steps with half the weight, and the propagation treats it
    as two independent samples. With N sqrt(rate) the covariance would be half of the true one.

    Sources: HKUST-Aerial-Robotics/VINS-Fusion, vins_estimator/src/factor/integration_base.h
    (``noise``, ``V`` of the midpoint integration), vins_estimator/src/estimator/parameters.cpp and
    config/euroc/euroc_mono_imu_config.yaml (names).
    """
    head, lines = programs.compose(imu, VINS_FUSION, programs.YAML)
    return (
        f"%YAML:1.0\n\n{head}"
        + format_setting("imu", "1", "use it")
        + format_setting("imu_topic", json.dumps(imu.ros_topic), "of sensor_msgs/Imu")
        + lines
        + format_setting("g_norm", format_decimal(imu.gravity), "gravity, m/s^2")
    )


def write_basalt(imu: Imu) -> str:
    """Return JSON with the fields of the sensor in ``value0``; copy them into your own file.

    The noises are vectors of three axes (older releases take scalars); Basalt multiplies N by
    sqrt(imu_update_rate) and divides the weight of a change of bias by sqrt(dt).

    Sources: VladyslavUsenko/basalt, data/euroc_ds_calib.json (form);
    basalt-headers, include/basalt/calibration/calibration.hpp ("continuous time noise standard
    deviation", sigma_d = sigma_c sqrt(r)) and include/basalt/serialization/headers_serialization.h
    (names); VladyslavUsenko/basalt, src/vi_estimator/sqrt_keypoint_vio.cpp (weight of the biases).
    """
    mapped = programs.map_models(imu, BASALT)
    content = {
        "about": programs.describe(imu, BASALT, mapped),
        "value0": {
            "imu_update_rate": imu.rate,
            **{entry.name: programs.compute_values(entry, imu, mapped) for entry in BASALT.entries},
        },
    }
    return json.dumps(content, indent=4) + "\n"


def write_orb_slam3(imu: Imu) -> str:
    """Return the lines ``IMU.*`` of the settings of ORB-SLAM3 that concern the noise.

    The tracking multiplies N by sqrt(IMU.Frequency) and divides K by it. Each value must be written
    as a real number, the frequency too, or the program ends.

    Sources: UZ-SLAMLab/ORB_SLAM3, src/Settings.cc (readIMU, readParameter<float>), src/Tracking.cc
    (``IMU::Calib(Tbc, Ng*sf, Na*sf, Ngw/sf, Naw/sf)`` and the units it prints), src/ImuTypes.cc
    (the propagation).
    """
    head, lines = programs.compose(imu, ORB_SLAM3, programs.YAML)
    rate = format_setting("IMU.Frequency", format_decimal(imu.rate), "Hz")
    return f"%YAML:1.0\n\n{head}{lines}{rate}"


def write_lio_sam(imu: Imu) -> str:
    """Return the lines of ``params.yaml`` of LIO-SAM that concern the sensor.

    The squares are the continuous covariances of GTSAM's PreintegrationParams, which divides them
    by the interval of the samples. Between two key frames the bias may change by BiasN times the
    root of the time between them: BiasN is K. The lines are for ROS 1; the branch ``ros2`` has the
    same names below ``ros__parameters``.

    Sources: TixiaoShan/LIO-SAM, include/utility.h (names), src/imuPreintegration.cpp
    (``accelerometerCovariance``, ``noiseModelBetweenBias`` times the root of ``deltaTij``);
    borglab/gtsam, gtsam/navigation/ImuFactor.cpp (``aCov / dt``).
    """
    head, lines = programs.compose(imu, LIO_SAM, "  " + programs.YAML)
    gravity = format_setting("imuGravity", format_decimal(imu.gravity), "m/s^2", "  ")
    return f"{head}lio_sam:\n{lines}{gravity}"


def write_fast_lio(imu: Imu) -> str:
    """Return the lines of the configuration of FAST-LIO, FAST-LIO2 and FAST-LIVO2.

    Over the interval dt of two samples, the prediction adds dt^2 ``gyr_cov`` to the variance of the
    angle, dt^2 ``acc_cov`` to the one of the velocity, and dt^2 ``b_*_cov`` to the one of the bias.
    The true increments are N^2 dt and K^2 dt, so the covariances are N^2 rate and K^2 rate. The
    reading of a step is the mean of two samples, each of which belongs to two steps; their sum has
    the same variance.

    Sources: hku-mars/FAST_LIO, src/laserMapping.cpp (names), src/IMU_Processing.hpp (``Q``, set
    anew after the initialisation), include/IKFoM_toolkit/esekfom/esekfom.hpp (``predict``);
    hku-mars/FAST-LIVO2, src/LIVMapper.cpp (names, and 0.0001 for the biases),
    src/IMU_Processing.cpp (``cov_w``).
    """
    head, lines = programs.compose(imu, FAST_LIO, "  " + programs.YAML)
    return f"{head}mapping:\n{lines}imu:\n{lines}"
