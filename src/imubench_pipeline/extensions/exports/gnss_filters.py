"""Filters that combine an inertial sensor with GNSS or odometry, and have their own noise models.

KF-GINS, OB_GINS and NaveGo model a bias as a Gauss-Markov process, and pyins as a random walk. The
filter of robot_localization has no bias.
"""

from dataclasses import replace

from imubench_pipeline.extensions.exports import comments, programs
from imubench_pipeline.extensions.exports.imu import Imu

_HUB = "https://github.com/"
KF_GINS = programs.declare(
    "KF-GINS",
    _HUB + "i2Nav-WHU/KF-GINS/blob/HEAD/src/kf-gins/gi_engine.cpp",
    "arw and vrw are N (two-sided) per root hour; gbstd and abstd are the standard deviation of a "
    "first-order Gauss-Markov process (1.076 B), and corrtime its T_B, one for gyro and "
    "accelerometer. The lines replace the lines of the same name in the configuration.",
    (programs.WHITE, "arw", "vrw", "deg/sqrt(h)", "m/s/sqrt(h)"),
    (programs.PROCESS, "gbstd", "abstd", "deg/h", "mGal"),
    (programs.TIME, "corrtime", None, "h"),
    each=True,
    positive=True,
    one_time=True,
    family="N+GM",
)
OB_GINS = replace(
    KF_GINS,
    name="OB_GINS",
    source=_HUB + "i2Nav-WHU/OB_GINS/blob/HEAD/src/preintegration/preintegration_normal.cc",
    each=False,
)
NAVEGO = programs.declare(
    "NaveGo",
    _HUB + "rodralez/NaveGo/blob/HEAD/ins-gnss/ins_gnss.m",
    "In SI, as ins_gnss takes it: do not pass it through imu_si_errors, whose gb_psd is smaller by "
    "sqrt(2). arw and vrw are N, and *b_psd the root of the density that drives a Gauss-Markov "
    "process: continuous in time, two-sided. *_std is of a sample at {rate:g} Hz, and *b_dyn the "
    "standard deviation of the process.",
    (programs.WHITE, "arw", "vrw"),
    (programs.SAMPLE, "g_std", "a_std"),
    (programs.PROCESS, "gb_dyn", "ab_dyn"),
    (programs.TIME, "gb_corr", "ab_corr"),
    (programs.DRIVE, "gb_psd", "ab_psd"),
    each=True,
    positive=True,
    family="N+GM",
)
PYINS = programs.declare(
    "pyins",
    _HUB + "nmayorov/pyins/blob/HEAD/pyins/inertial_sensor.py",
    "noise is N and bias_walk is K: continuous in time, two-sided, SI. bias_sd is the standard "
    "deviation of the first bias, if the mean reading over the horizon before was subtracted; "
    "otherwise take the turn-on bias of the sensor.",
    (programs.AVERAGED, "bias_sd", "bias_sd"),
    (programs.WHITE, "noise", "noise"),
    (programs.WALK, "bias_walk", "bias_walk"),
    each=True,
)
ROS = programs.declare(
    "ROS (sensor_msgs/Imu)",
    _HUB + "ros2/common_interfaces/blob/HEAD/sensor_msgs/msg/Imu.msg",
    "Variances of a reading at {rate:g} Hz, SI: N^2 rate (N two-sided), and the variance of the "
    "bias over the next horizon, if the mean reading over the horizon before was subtracted. The "
    "filter of robot_localization estimates no bias: subtract that mean, at rest.",
    (programs.READING, "angular_velocity_covariance", "linear_acceleration_covariance"),
    each=True,
)


def write_kf_gins(imu: Imu) -> str:
    """Return the lines ``imunoise`` of the configuration of KF-GINS, with x, y and z.

    The bias decays with 1 / corrtime and gets white noise of density 2 gbstd^2 / corrtime: the
    driving density of a process with the stationary deviation gbstd. All biases have one corrtime,
    which is fitted to all axes together. ``gsstd`` and ``asstd``, of the scale factors, are left
    out, as a static log does not show them.

    Sources: i2Nav-WHU/KF-GINS, src/kf_gins.cpp (loadConfig: names and units), config/kf-gins.yaml,
    src/kf-gins/gi_engine.cpp (``Qc_``, ``F``, ``Qd``).
    """
    mapped = programs.map_models(imu, KF_GINS)
    about = [
        *programs.describe(imu, KF_GINS, mapped),
        "gsstd and asstd (ppm), of the scale factors, are not included, as a static log does not "
        "show them. KF-GINS needs both: keep your own below imunoise.",
    ]
    lines = "".join(
        programs.format_entries(KF_GINS, imu, mapped, "  {name}: [{xyz}]  # {about}", name)
        for name in ("gyro", "accel")
    )
    time = programs.format_entries(KF_GINS, imu, mapped, "  " + programs.YAML, "both")
    return comments.format_comments(about) + "imunoise:\n" + lines + time


def write_ob_gins(imu: Imu) -> str:
    """Return the lines ``imumodel`` of the configuration of OB_GINS.

    Convention as of KF-GINS (`write_kf_gins`): the preintegration takes the transition
    1 - dt / corrtime and the density 2 gbstd^2 / corrtime.

    Sources: i2Nav-WHU/OB_GINS, src/ob_gins.cc (names and units), config/ob_gins.yaml,
    src/preintegration/preintegration_normal.cc (``noise_``, ``phi``, ``Qk``).
    """
    head, lines = programs.compose(imu, OB_GINS, "    " + programs.YAML)
    return f"{head}imumodel:\n{lines}"


def write_navego(imu: Imu) -> str:
    """Return a script of MATLAB or Octave that fills the fields of the noise in ``imu``.

    The filter takes arw^2, vrw^2 and *b_psd^2 as densities, and *b_dyn^2 as the first variance of
    the bias. A process with the deviation gb_dyn has the driving density 2 gb_dyn^2 / gb_corr;
    ``imu_si_errors`` takes half of it. The simulation takes *_std, and *b_dyn as that deviation.

    Sources: rodralez/NaveGo, ins-gnss/ins_gnss.m (fields, units, ``kf.Q``, ``kf.Pi``),
    ins-gnss/kf_prediction.m, conversions/imu_si_errors.m, simulation/gyro_gen.m and noise_b_dyn.m.
    """
    head, lines = programs.compose(imu, NAVEGO, "imu.{name} = [{xyz}];  % {about}", "%")
    zeros = {"gb_sta": "rad/s", "ab_sta": "m/s^2", "arrw": "rad/s^2", "vrrw": "m/s^3"}
    lines += "".join(f"imu.{name} = [0, 0, 0];  % {unit}\n" for name, unit in zeros.items())
    return f"{head}{lines}imu.freq = {imu.rate:.9g};  % Hz\n"


def write_pyins(imu: Imu) -> str:
    """Return Python with the ``EstimationModel`` of gyro and accelerometer for pyins.

    Source: nmayorov/pyins (python-ins on PyPI), pyins/inertial_sensor.py (EstimationModel: "root
    PSD", SI; ``bias_walk`` needs ``bias_sd``).
    """
    mapped = programs.map_models(imu, PYINS)
    about = programs.describe(imu, PYINS, mapped)
    text = "\nfrom pyins.inertial_sensor import EstimationModel\n"
    for name in ("gyro", "accel"):
        lines = programs.format_entries(PYINS, imu, mapped, "    {name}=[{xyz}],  # {about}", name)
        text += f"\n{name}_model = EstimationModel(\n{lines})\n"
    return comments.format_python_comments(about) + text


def write_ros(imu: Imu) -> str:
    """Return the covariances of ``sensor_msgs/Imu`` as programs.YAML of the message.

    The filter takes messages as independent, but the error of the bias hardly changes between them;
    if it is large, use a filter that estimates the bias. The first number of a missing orientation
    is -1, which robot_localization skips.

    Sources: ros2/common_interfaces, sensor_msgs/msg/Imu.msg (row-major, -1);
    cra-ros-pkg/robot_localization, src/ros_filter.cpp (imuCallback: covariances, -1).
    """
    mapped = programs.map_models(imu, ROS)
    about = programs.describe(imu, ROS, mapped)
    text = comments.format_comments(about)
    text += "orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]  # without\n"
    for entry in ROS.entries:
        x, y, z = (f"{value:.6e}" for value in programs.compute_values(entry, imu, mapped))
        text += f"{entry.name}:  # {entry.form.formula}, {entry.unit}\n"
        text += f"  [{x}, 0.0, 0.0,\n  0.0, {y}, 0.0,\n  0.0, 0.0, {z}]\n"
    return text
