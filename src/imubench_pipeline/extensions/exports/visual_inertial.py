"""Programs of visual- and lidar-inertial navigation, with white noise N and random walk K.

Kalibr, OpenVINS, Basalt, ORB-SLAM3 and LIO-SAM take densities that are continuous in time and
two-sided, SI, all above 0; VINS-Fusion takes standard deviations of samples, and FAST-LIO their
variances.
"""

import json
from dataclasses import replace

from imubench_pipeline.extensions.exports import programs
from imubench_pipeline.extensions.exports.imu import Imu

_HUB = "https://github.com/"
KALIBR = programs.declare(
    "kalibr",
    "Kalibr",
    "imu.yaml",
    _HUB + "ethz-asl/kalibr/wiki/IMU-Noise-Model",
    "N as *_noise_density and K as *_random_walk: continuous in time, two-sided (sigma^2(tau) = "
    "N^2 / tau and K^2 tau / 3), SI; not multiplied by the root of the rate.",
    (programs.WHITE, "gyroscope_noise_density", "accelerometer_noise_density"),
    (programs.WALK, "gyroscope_random_walk", "accelerometer_random_walk"),
    positive=True,
    layout="{head}{lines}rostopic: {topic}  # of sensor_msgs/Imu\nupdate_rate: {rate}  # Hz\n",
)
"""Kalibr itself multiplies N by sqrt(update_rate).

Sources: ethz-asl/kalibr, wiki page "IMU Noise Model" (E[n n'] = sigma^2 delta, sigma_d = sigma /
sqrt(dt)), and aslam_offline_calibration/kalibr/python/kalibr_common/ConfigReader.py, class
ImuParameters (names, checks, conversion).
"""


def _format_matrix(name: str, size: int, diagonal: float = 1.0) -> str:
    rows = [[diagonal if i == j else 0.0 for j in range(size)] for i in range(size)]
    return f"  {name}:\n" + "".join(f"    - {row}\n" for row in rows)


OPENVINS = replace(
    KALIBR,
    name="openvins",
    title="OpenVINS",
    file_name="kalibr_imu_chain.yaml",
    source=_HUB + "rpng/open_vins/blob/HEAD/ov_msckf/src/utils/NoiseManager.h",
    line="  " + programs.YAML,
    layout="%YAML:1.0\n\n{head}imu0:\n"
    + _format_matrix("T_i_b", 4)
    + "{lines}"
    + "  rostopic: {topic}  # of sensor_msgs/Imu\n"
    + "  time_offset: 0.0  # s\n"
    + "  update_rate: {rate}  # Hz\n"
    + '  model: "kalibr"  # of the intrinsics\n'
    + "".join(_format_matrix(name, 3) for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC"))
    + _format_matrix("Tg", 3, diagonal=0.0),
)
"""The identity for extrinsics and intrinsics.

The propagation takes sigma^2 / dt for the white noise and sigma^2 dt for the biases.

Sources: rpng/open_vins, config/euroc_mav/kalibr_imu_chain.yaml (form and names),
ov_msckf/src/utils/NoiseManager.h (units), ov_msckf/src/state/Propagator.cpp (discretisation).
"""

VINS_FUSION = programs.declare(
    "vins-fusion",
    "VINS-Fusion, VINS-Mono",
    "vins_imu.yaml",
    _HUB + "HKUST-Aerial-Robotics/VINS-Fusion/blob/HEAD/vins_estimator/src/factor/"
    "integration_base.h",
    "acc_n, gyr_n = N sqrt(2 rate) and acc_w, gyr_w = K sqrt(rate): discrete in time, for samples "
    "at {rate:g} Hz only. What the midpoint propagation makes of them is N^2 and K^2 times the "
    "time; N and K are two-sided densities. These lines replace the lines of the same name in the "
    "configuration.",
    (programs.MIDPOINT, "gyr_n", "acc_n"),
    (programs.STEP, "gyr_w", "acc_w"),
    layout="%YAML:1.0\n\n{head}imu: 1  # use it\nimu_topic: {topic}  # of sensor_msgs/Imu\n"
    "{lines}g_norm: {gravity}  # gravity, m/s^2\n",
)
"""The configuration calls ``acc_n``, ``gyr_n``, ``acc_w`` and ``gyr_w`` standard deviations and
gives no unit. The propagation takes them per sample, discrete in time: a step of dt adds
(dt / 2)^2 (n_k^2 + n_(k+1)^2) to the variance of angle and velocity, where the noises of both
samples are independent and equal ``*_n``, and (dt ``*_w``)^2 to the variance of the bias. The true
increments are N^2 dt and K^2 dt, so

    acc_n = N sqrt(2 rate),   acc_w = K sqrt(rate).

A sample has the standard deviation N sqrt(rate). The factor sqrt(2) compensates for the midpoint
rule: each sample enters two steps with half the weight, and the propagation treats it as two
independent samples. With N sqrt(rate) the covariance would be half of the true one.

Sources: HKUST-Aerial-Robotics/VINS-Fusion, vins_estimator/src/factor/integration_base.h
(``noise``, ``V`` of the midpoint integration), vins_estimator/src/estimator/parameters.cpp and
config/euroc/euroc_mono_imu_config.yaml (names).
"""

ORB_SLAM3 = programs.declare(
    "orb-slam3",
    "ORB-SLAM3",
    "orb_slam3_imu.yaml",
    _HUB + "UZ-SLAMLab/ORB_SLAM3/blob/HEAD/src/Tracking.cc",
    "N as IMU.Noise* and K as IMU.*Walk: continuous in time, two-sided, SI; the program itself "
    "multiplies by the root of IMU.Frequency, or divides by it. These lines go into the settings "
    "of the camera, beside IMU.T_b_c1.",
    (programs.WHITE, "IMU.NoiseGyro", "IMU.NoiseAcc"),
    (programs.WALK, "IMU.GyroWalk", "IMU.AccWalk"),
    positive=True,
    layout="%YAML:1.0\n\n{head}{lines}IMU.Frequency: {rate}  # Hz\n",
)
"""The tracking multiplies N by sqrt(IMU.Frequency) and divides K by it. Each value must be written
as a real number, the frequency too, or the program ends.

Sources: UZ-SLAMLab/ORB_SLAM3, src/Settings.cc (readIMU, readParameter<float>), src/Tracking.cc
(``IMU::Calib(Tbc, Ng*sf, Na*sf, Ngw/sf, Naw/sf)`` and the units it prints), src/ImuTypes.cc
(the propagation).
"""

LIO_SAM = programs.declare(
    "lio-sam",
    "LIO-SAM",
    "lio_sam_imu.yaml",
    _HUB + "TixiaoShan/LIO-SAM/blob/HEAD/src/imuPreintegration.cpp",
    "imu*Noise is N and imu*BiasN is K: continuous in time, two-sided, SI; not multiplied by the "
    "root of the rate. These lines replace the lines of the same name in params.yaml.",
    (programs.WHITE, "imuGyrNoise", "imuAccNoise"),
    (programs.WALK, "imuGyrBiasN", "imuAccBiasN"),
    positive=True,
    line="  " + programs.YAML,
    layout="{head}lio_sam:\n{lines}  imuGravity: {gravity}  # m/s^2\n",
)
"""The squares are the continuous covariances of GTSAM's PreintegrationParams, which divides them by
the interval of the samples. Between two key frames the bias may change by BiasN times the root of
the time between them: BiasN is K. The lines are for ROS 1; the branch ``ros2`` has the same names
below ``ros__parameters``.

Sources: TixiaoShan/LIO-SAM, include/utility.h (names), src/imuPreintegration.cpp
(``accelerometerCovariance``, ``noiseModelBetweenBias`` times the root of ``deltaTij``);
borglab/gtsam, gtsam/navigation/ImuFactor.cpp (``aCov / dt``).
"""

FAST_LIO = programs.declare(
    "fast-lio",
    "FAST-LIO, FAST-LIVO2",
    "fast_lio_imu.yaml",
    _HUB + "hku-mars/FAST_LIO/blob/HEAD/src/IMU_Processing.hpp",
    "*_cov are variances of a sample, discrete in time, for samples at {rate:g} Hz only: N^2 rate, "
    "and K^2 rate for b_*_cov; N and K are two-sided densities, SI. FAST-LIO reads them from "
    "mapping, FAST-LIVO2 from imu, where it ignores b_*_cov and takes 1e-4. These lines replace "
    "the lines of the same name in the configuration.",
    (programs.SAMPLE_VARIANCE, "gyr_cov", "acc_cov"),
    (programs.STEP_VARIANCE, "b_gyr_cov", "b_acc_cov"),
    line="  " + programs.YAML,
    layout="{head}mapping:\n{lines}imu:\n{lines}",
)
"""Over the interval dt of two samples, the prediction adds dt^2 ``gyr_cov`` to the variance of the
angle, dt^2 ``acc_cov`` to the one of the velocity, and dt^2 ``b_*_cov`` to the one of the bias. The
true increments are N^2 dt and K^2 dt, so the covariances are N^2 rate and K^2 rate. The reading of
a step is the mean of two samples, each of which belongs to two steps; their sum has the same
variance.

Sources: hku-mars/FAST_LIO, src/laserMapping.cpp (names), src/IMU_Processing.hpp (``Q``, set anew
after the initialisation), include/IKFoM_toolkit/esekfom/esekfom.hpp (``predict``);
hku-mars/FAST-LIVO2, src/LIVMapper.cpp (names, and 0.0001 for the biases), src/IMU_Processing.cpp
(``cov_w``).
"""


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
    numbers = {entry.name: programs.compute_values(entry, imu, mapped) for entry in BASALT.entries}
    content = {
        "about": programs.describe(imu, BASALT, mapped),
        "value0": {"imu_update_rate": imu.rate, **numbers},
    }
    return json.dumps(content, indent=4) + "\n"


BASALT = programs.declare(
    "basalt",
    "Basalt",
    "calibration_imu.json",
    "https://gitlab.com/VladyslavUsenko/basalt-headers/-/blob/HEAD/include/basalt/calibration/"
    "calibration.hpp",
    "*_noise_std is N (rad/s/sqrt(Hz), m/s^2/sqrt(Hz)) and *_bias_std is K (rad/s^2/sqrt(Hz), "
    "m/s^3/sqrt(Hz)), continuous in time and two-sided, of x, y and z.",
    (programs.WHITE, "gyro_noise_std", "accel_noise_std"),
    (programs.WALK, "gyro_bias_std", "accel_bias_std"),
    each=True,
    positive=True,
    writer=write_basalt,
)
