"""Programs that simulate a sensor: gnss-ins-sim, MATLAB and Gazebo; each axis has its own noise."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from imubench_pipeline.extensions.exports import programs
from imubench_pipeline.extensions.exports import reasons as texts
from imubench_pipeline.extensions.exports.imu import (
    AXES,
    AxisNoise,
    Imu,
    TemperatureEffect,
    split_axes,
)
from imubench_pipeline.extensions.exports.mapping import Mapped, as_process, find_common_time
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.words.numbers import number_text

_MIN_SAMPLES_IN_T_B = 20.0
"""With fewer samples in T_B, the program's discretisation is off by more than 3 %."""


def write_gnss_ins_sim(imu: Imu) -> str:
    """Return Python that defines ``imu_err``, for ``imu_model.IMU(accuracy=imu_err)``.

    ``gyro_arw`` in deg/sqrt(h) and ``accel_vrw`` in m/s/sqrt(h) are N, two-sided (a sample gets N /
    sqrt(dt)). ``*_b_stability`` with ``*_b_corr`` is the standard deviation of a first-order
    Gauss-Markov process, deg/h and m/s^2; it is not the bias instability B of IEEE Std 952:

        stability = sqrt(S_B T_B / 2) = 1.076 B.

    The process is discretised as x' = (1 - dt / T_B) x + w, accurate where T_B is many samples, and
    starts at 0. Without ``*_b_corr`` (or inf) the program draws white noise, so it is always given.
    There is no random walk.

    Source: Aceinna/gnss-ins-sim, gnss_ins_sim/sim/imu_model.py (names and units),
    gnss_ins_sim/pathgen/pathgen.py (acc_gen, gyro_gen, bias_drift).
    """

    def warn_of_short_processes(mapped: Mapping[str, Mapped]) -> list[str]:
        samples = {name: imu.rate * (one.model.T_B or math.inf) for name, one in mapped.items()}
        return [
            f"{name}: T_B is {number_text(number, 3)} samples, and the discretisation of the "
            "program is inaccurate for so short a process."
            for name, number in samples.items()
            if number < _MIN_SAMPLES_IN_T_B
        ]

    return programs.fill_layout(imu, GNSS_INS_SIM, warn_of_short_processes)


GNSS_INS_SIM = programs.declare(
    "gnss-ins-sim",
    "gnss-ins-sim",
    "imu_err.py",
    "https://github.com/Aceinna/gnss-ins-sim/blob/HEAD/gnss_ins_sim/pathgen/pathgen.py",
    "*_arw and *_vrw are N (two-sided) per root hour; *_b_stability is the standard deviation of a "
    "first-order Gauss-Markov process (1.076 B), *_b_corr its T_B in s. Fixed biases are 0.",
    (programs.WHITE, "gyro_arw", "accel_vrw", "deg/sqrt(h)", "m/s/sqrt(h)"),
    (programs.PROCESS, "gyro_b_stability", "accel_b_stability", "deg/h", "m/s^2"),
    (programs.TIME, "gyro_b_corr", "accel_b_corr"),
    each=True,
    family="N+GM",
    line='    "{name}": np.array([{xyz}]),  # {about}',
    layout=programs.PYTHON_HEAD + "import numpy as np\n\nimu_err = {{\n{lines}"
    '    "gyro_b": np.zeros(3),  # deg/h, fixed bias\n'
    '    "accel_b": np.zeros(3),  # m/s^2, fixed bias\n}}\n',
    writer=write_gnss_ins_sim,
)

_MAX_POLES = 2000
_REFERENCE_TEMPERATURE = 25.0  # temperature at which TemperatureBias adds nothing, degC
_MAX_SAMPLES_PER_POLE = 5.0
"""Max. samples per pole; up to them the Allan deviation of flicker noise is within 11 %."""


def _compute_drive(model: NoiseModel, rate: float, horizon: float) -> float:
    """Return the deviation of the white samples that drive the filter; of flicker noise it is B."""
    if model.T_B is None:
        return model.B
    poles = -math.expm1(-2.0 / (rate * model.T_B))  # 1 - p^2
    return programs.compute_process_deviation(model) * math.sqrt(poles)


_FILTER_DRIVE = programs.Form(
    "sigma_B sqrt(1 - p^2)",
    "{x}",
    "per sample, standard deviation; p = exp(-1 / (rate T_B)); B, of flicker noise",
    _compute_drive,
)


def write_matlab(imu: Imu) -> str:
    """Return a script of MATLAB that creates an ``imuSensor`` of its Navigation Toolbox.

    With ``NoiseType`` "single-sided" a sample gets NoiseDensity sqrt(SampleRate) of white noise,
    and a step of the random walk RandomWalk / sqrt(SampleRate): NoiseDensity is N and RandomWalk is
    K, in the two-sided convention of IEEE Std 952. (With the default, "double-sided", SampleRate /
    2 replaces SampleRate in both: N would have to be sqrt(2) times larger, a one-sided density as
    on datasheets, and K sqrt(2) times smaller.)

    BiasInstability is the standard deviation of white samples, which the filter
    BiasInstabilityCoefficients shapes. The first-order filter 1 / (1 - p z^-1), p = e^(-dt / T_B),
    gives the exact Gauss-Markov process with B' = sqrt(S_B T_B / 2 (1 - p^2)). ``fractalcoef``
    gives flicker noise with B' = B: its spectrum B^2 / |1 - e^(-i omega)| is cut off at low
    frequencies by the number of poles. With n poles the Allan deviation is within 7 % at n samples
    and 11 % at 2 n. The default of one pole is not flicker noise.

    TemperatureBias (T - 25) is added at the temperature T of the sensor, degC; the 25 is fixed. A
    ConstantBias of s (25 - T_0) changes this to s (T - T_0), and the script sets T to T_0.

    Sources: MathWorks, reference pages of imuSensor ("Algorithms"), gyroparams, accelparams and
    fractalcoef (R2023b); the example "Inertial Sensor Noise Analysis Using Allan Variance"; C code
    generated from fusion.simulink.imuSensor (pBandwidth, pStdDevWhiteNoise, pStdDevRandWalk,
    pStdDevBiasInst).
    """
    mapped: dict[str, Mapped] = {}
    coefficients: dict[str, str] = {}
    for name, axis in imu.axes.items():
        of_axes, coefficients[name] = _map_to_filter(split_axes({name: axis}), imu)
        mapped |= of_axes
    about = programs.describe(imu, MATLAB, mapped, temperature=True)
    biases = {name: _map_temperature(imu.temperature.get(name)) for name in coefficients}
    about += [f"{name} and temperature: {words}." for name in biases for words in biases[name][1]]
    text = programs.format_comments(about, "%") + "IMU = imuSensor('accel-gyro');\n"
    text += f"IMU.SampleRate = {imu.rate:.9g};  % Hz\n"
    members = {"gyro": ("Gyroscope", "gyroparams"), "accel": ("Accelerometer", "accelparams")}
    for name, of_filter in coefficients.items():
        member, maker = members[name]
        rows = [(key, f"[{value}]", words) for key, value, words in biases[name][0]]
        text += f"IMU.{member} = {maker}( ...\n"
        text += "    'NoiseType', 'single-sided', ...  % two-sided density, see above\n"
        text += programs.format_entries(MATLAB, imu, mapped, name)
        text += "".join(f"    {key}, {value}, ...  % {words}\n" for key, value, words in rows)
        text += f"    'BiasInstabilityCoefficients', {of_filter});  % of the filter\n"
    effects = [imu.temperature[name] for name in biases if biases[name][0]]
    if effects:
        low, high = max(effect.low for effect in effects), min(effect.high for effect in effects)
        text += (
            f"IMU.Temperature = {effects[0].reference:.9g};  % degC; between {low:.9g} and "
            f"{high:.9g} the biases follow it\n"
        )
    return text


MATLAB = programs.declare(
    "matlab",
    "MATLAB (imuSensor)",
    "imu_noise.m",
    "https://www.mathworks.com/help/nav/ref/imusensor-system-object.html",
    "NoiseDensity is N and RandomWalk is K in the two-sided convention, which this program calls "
    "single-sided; BiasInstability drives the filter of BiasInstabilityCoefficients, made for "
    "SampleRate = {rate:g} Hz, the same of all three axes. R2023b or newer.",
    (programs.WHITE, "NoiseDensity", "NoiseDensity"),
    (programs.WALK, "RandomWalk", "RandomWalk"),
    (_FILTER_DRIVE, "BiasInstability", "BiasInstability"),
    each=True,
    family="N+GM+K",
    line="    '{name}', [{xyz}], ...  % {about}",
    writer=write_matlab,
)


def _map_temperature(
    effect: TemperatureEffect | None,
) -> tuple[list[tuple[str, str, str]], list[str]]:
    """Return the settings of the effect of temperature on a bias, and remarks on omitted axes."""
    if effect is None:
        return [], []
    words = [texts.axis_not_included(axis, texts.BIAS_NOT_LINEAR) for axis in effect.square]
    slopes = [0.0 if axis in effect.square else effect.slope.get(axis, 0.0) for axis in AXES]
    if not any(slopes):
        return [], words
    at_25 = [slope * (_REFERENCE_TEMPERATURE - effect.reference) for slope in slopes]
    return [
        ("'ConstantBias'", _format_numbers(at_25), "at 25 degC, so that it is 0 at T_0"),
        ("'TemperatureBias'", _format_numbers(slopes), "a kelvin"),
    ], words


def _map_to_filter(axes: Mapping[str, AxisNoise], imu: Imu) -> tuple[dict[str, Mapped], str]:
    """Return models of axes with the same filter, and its coefficients."""
    horizon, rate = imu.horizon, imu.rate
    models = {name: axis.model for name, axis in axes.items()}
    flickers = all(m.B > 0 and m.T_B is None and not m.further and not m.R for m in models.values())
    if flickers and horizon * rate <= _MAX_SAMPLES_PER_POLE * _MAX_POLES:
        poles = min(math.ceil(2.0 * horizon * rate), _MAX_POLES)
        longest = number_text(_MAX_SAMPLES_PER_POLE * poles / rate)
        mapped = {}
        for name, model in models.items():
            words = (
                f"flicker noise B = {model.B:.3e} is generated by {poles} poles. Its Allan "
                f"deviation is within 11 % up to {longest} s"
            )
            rest = as_process(replace(model, B=0.0), horizon, rate, walk=True)
            mapped[name] = Mapped(NoiseModel(N=model.N, B=model.B, K=model.K), [words, *rest.words])
        return mapped, f"fractalcoef({poles})"
    time = find_common_time([*models.values()], horizon, walk=True)
    mapped = {
        name: as_process(model, horizon, rate, walk=True, time=time)
        for name, model in models.items()
    }
    if not any(one.model.B for one in mapped.values()):
        return mapped, "fractalcoef(1)"
    p = math.exp(-1.0 / (rate * time))
    return mapped, f"struct('Numerator', 1, 'Denominator', [1, {-p:.17g}])"


def _format_numbers(values: Sequence[float]) -> str:
    return ", ".join(f"{value:.9g}" for value in values)


def write_gazebo(imu: Imu) -> str:
    """Return SDF with a sensor ``imu`` in a model; copy the sensor into your own model.

    A sample gets white noise of ``stddev``. The bias starts with ``bias_stddev`` and then follows
    x' = exp(-dt / T_B) x + w, where the variance of w is -sigma_b^2 T_B / 2 expm1(-2 dt / T_B) with
    sigma_b the ``dynamic_bias_stddev``: sigma_b^2 is the density S_B of the drive. With
    ``bias_stddev`` = sqrt(S_B T_B / 2) the process is stationary from the start.

    Sources: gazebosim/gz-sensors, src/GaussianNoiseModel.cc (``Load``, ``ApplyImpl``) and
    src/ImuSensor.cc; gazebosim/sdformat, sdf/1.9/noise.sdf and sdf/1.9/imu.sdf (names).
    """
    mapped = programs.map_models(imu, GAZEBO)
    about = programs.describe(imu, GAZEBO, mapped)
    noise = ""
    for quantity, element in (("gyro", "angular_velocity"), ("accel", "linear_acceleration")):
        values = dict.fromkeys(("mean", "bias_mean"), [0.0] * 3)
        for entry in GAZEBO.entries:
            if entry.quantity == quantity:
                values[entry.name] = programs.compute_values(entry, imu, mapped)
        noise += f"          <{element}>\n"
        for place, axis in enumerate(AXES):
            noise += f'            <{axis}>\n              <noise type="gaussian">\n'
            for name, of_axes in values.items():
                noise += f"                <{name}>{of_axes[place]:.9g}</{name}>\n"
            noise += f"              </noise>\n            </{axis}>\n"
        noise += f"          </{element}>\n"
    # Two hyphens would end a comment of XML.
    words = re.sub("-(?=-)", "- ", programs.format_comments(about))
    return _SDF.format(about=words, rate=programs.format_decimal(imu.rate), noise=noise)


GAZEBO = programs.declare(
    "gazebo",
    "Gazebo (SDF)",
    "imu.sdf",
    "https://github.com/gazebosim/gz-sensors/blob/HEAD/src/GaussianNoiseModel.cc",
    "stddev is N sqrt(rate), a sample, for update_rate = {rate:g} Hz only. dynamic_bias_stddev is "
    "the root of the two-sided density that drives a Gauss-Markov process, continuous in time, and "
    "bias_stddev its stationary standard deviation. SI.",
    (programs.SAMPLE, "stddev", "stddev"),
    (programs.PROCESS, "bias_stddev", "bias_stddev"),
    (programs.DRIVE, "dynamic_bias_stddev", "dynamic_bias_stddev"),
    (programs.TIME, "dynamic_bias_correlation_time", "dynamic_bias_correlation_time"),
    each=True,
    family="N+GM",
    writer=write_gazebo,
)

_SDF = """\
<?xml version="1.0" encoding="UTF-8"?>
<!--
{about}-->
<sdf version="1.9">
  <model name="imu">
    <link name="link">
      <sensor name="imu" type="imu">
        <update_rate>{rate}</update_rate>
        <imu>
{noise}        </imu>
      </sensor>
    </link>
  </model>
</sdf>
"""
