"""Filters that combine an inertial sensor with GNSS or odometry, and have their own noise models.

KF-GINS, OB_GINS and NaveGo model a bias as a Gauss-Markov process, and pyins as a random walk. The
filter of robot_localization has no bias.
"""

from dataclasses import replace

from imubench_pipeline.extensions.exports import programs

_HUB = "https://github.com/"
OB_GINS = programs.declare(
    "ob-gins",
    "OB_GINS",
    "ob_gins_imu.yaml",
    _HUB + "i2Nav-WHU/OB_GINS/blob/HEAD/src/preintegration/preintegration_normal.cc",
    "arw and vrw are N (two-sided) per root hour; gbstd and abstd are the standard deviation of a "
    "first-order Gauss-Markov process (1.076 B), and corrtime its T_B, one for gyro and "
    "accelerometer. The lines replace the lines of the same name in the configuration.",
    (programs.WHITE, "arw", "vrw", "deg/sqrt(h)", "m/s/sqrt(h)"),
    (programs.PROCESS, "gbstd", "abstd", "deg/h", "mGal"),
    (programs.TIME, "corrtime", None, "h"),
    positive=True,
    one_time=True,
    family="N+GM",
    line="    " + programs.YAML,
    layout="{head}imumodel:\n{lines}",
)
"""Convention as of KF-GINS: the preintegration takes the transition 1 - dt / corrtime and the
density 2 gbstd^2 / corrtime.

Sources: i2Nav-WHU/OB_GINS, src/ob_gins.cc (names and units), config/ob_gins.yaml,
src/preintegration/preintegration_normal.cc (``noise_``, ``phi``, ``Qk``).
"""

KF_GINS = replace(
    OB_GINS,
    name="kf-gins",
    title="KF-GINS",
    file_name="kf_gins_imu.yaml",
    source=_HUB + "i2Nav-WHU/KF-GINS/blob/HEAD/src/kf-gins/gi_engine.cpp",
    convention=OB_GINS.convention
    + " gsstd and asstd (ppm), of the scale factors, are not included, as a static log does not "
    "show them. KF-GINS needs both: keep your own below imunoise.",
    each=True,
    line="  {name}: [{xyz}]  # {about}",
    layout="{head}imunoise:\n{gyro}{accel}{both}",
)
"""With x, y and z. The bias decays with 1 / corrtime and gets white noise of density
2 gbstd^2 / corrtime: the driving density of a process with the stationary deviation gbstd. All
biases have one corrtime, which is fitted to all axes together.

Sources: i2Nav-WHU/KF-GINS, src/kf_gins.cpp (loadConfig: names and units), config/kf-gins.yaml,
src/kf-gins/gi_engine.cpp (``Qc_``, ``F``, ``Qd``).
"""

NAVEGO = programs.declare(
    "navego",
    "NaveGo",
    "navego_imu.m",
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
    mark="%",
    line="imu.{name} = [{xyz}];  % {about}",
    layout="{head}{lines}"
    "imu.gb_sta = [0, 0, 0];  % rad/s\n"
    "imu.ab_sta = [0, 0, 0];  % m/s^2\n"
    "imu.arrw = [0, 0, 0];  % rad/s^2\n"
    "imu.vrrw = [0, 0, 0];  % m/s^3\n"
    "imu.freq = {imu.rate:.9g};  % Hz\n",
)
"""A script of MATLAB or Octave that fills the fields of the noise in ``imu``.

The filter takes arw^2, vrw^2 and *b_psd^2 as densities, and *b_dyn^2 as the first variance of the
bias. A process with the deviation gb_dyn has the driving density 2 gb_dyn^2 / gb_corr;
``imu_si_errors`` takes half of it. The simulation takes *_std, and *b_dyn as that deviation.

Sources: rodralez/NaveGo, ins-gnss/ins_gnss.m (fields, units, ``kf.Q``, ``kf.Pi``),
ins-gnss/kf_prediction.m, conversions/imu_si_errors.m, simulation/gyro_gen.m and noise_b_dyn.m.
"""

PYINS = programs.declare(
    "pyins",
    "pyins",
    "pyins_imu.py",
    _HUB + "nmayorov/pyins/blob/HEAD/pyins/inertial_sensor.py",
    "noise is N and bias_walk is K: continuous in time, two-sided, SI. bias_sd is the standard "
    "deviation of the first bias, if the mean reading over the horizon before was subtracted; "
    "otherwise take the turn-on bias of the sensor.",
    (programs.AVERAGED, "bias_sd", "bias_sd"),
    (programs.WHITE, "noise", "noise"),
    (programs.WALK, "bias_walk", "bias_walk"),
    each=True,
    line="    {name}=[{xyz}],  # {about}",
    layout=programs.PYTHON_HEAD + "\nfrom pyins.inertial_sensor import EstimationModel\n"
    "\ngyro_model = EstimationModel(\n{gyro})\n\naccel_model = EstimationModel(\n{accel})\n",
)
"""Source: nmayorov/pyins (python-ins on PyPI), pyins/inertial_sensor.py (EstimationModel: "root
PSD", SI; ``bias_walk`` needs ``bias_sd``).
"""

ROS = programs.declare(
    "ros",
    "ROS (sensor_msgs/Imu)",
    "imu_covariance.yaml",
    _HUB + "ros2/common_interfaces/blob/HEAD/sensor_msgs/msg/Imu.msg",
    "Variances of a reading at {rate:g} Hz, SI: N^2 rate (N two-sided), and the variance of the "
    "bias over the next horizon, if the mean reading over the horizon before was subtracted. The "
    "filter of robot_localization estimates no bias: subtract that mean, at rest.",
    (programs.READING, "angular_velocity_covariance", "linear_acceleration_covariance"),
    each=True,
    line="{name}:  # {about}\n  [{x}, 0.0, 0.0,\n  0.0, {y}, 0.0,\n  0.0, 0.0, {z}]",
    layout="{head}orientation_covariance: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]  "
    "# without\n{lines}",
)
"""The fields of the message as YAML.

The filter takes messages as independent, but the error of the bias hardly changes between them; if
it is large, use a filter that estimates the bias. The first number of a missing orientation is -1,
which robot_localization skips.

Sources: ros2/common_interfaces, sensor_msgs/msg/Imu.msg (row-major, -1);
cra-ros-pkg/robot_localization, src/ros_filter.cpp (imuCallback: covariances, -1).
"""
