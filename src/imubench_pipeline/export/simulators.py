"""Programs that simulate a sensor: gnss-ins-sim and MATLAB."""

import math
from collections.abc import Sequence

from imubench_pipeline.export import comments
from imubench_pipeline.export.imu import AXES, AxisNoise, Imu, TemperatureEffect
from imubench_pipeline.export.mapping import Mapped, as_process
from imubench_pipeline.noise import NoiseModel, compute_driving_density
from imubench_pipeline.words.numbers import number_text
from imubench_pipeline.words.reasons import exports as texts

_GNSS_INS_SIM_CONVENTION = (
    "*_arw and *_vrw are N (two-sided) an hour; *_b_stability is the standard deviation of a "
    "first-order Gauss-Markov process (1.076 B), *_b_corr its T_B in s. Fixed biases are 0."
)
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
    imu.require_both()
    mapped = {name: as_process(a.model, imu.horizon, imu.rate) for name, a in imu.axes.items()}
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    about = comments.describe_model(imu, "gnss-ins-sim", _GNSS_INS_SIM_CONVENTION, mapped)
    for name, process in mapped.items():
        if process.model.T_B is not None and process.model.T_B * imu.rate < _MIN_SAMPLES_IN_T_B:
            about.append(
                f"{name}: T_B is {number_text(process.model.T_B * imu.rate, 3)} samples, and the "
                "discretisation of the program is inaccurate for so short a process."
            )
    degrees = math.degrees(1.0)
    entries = [
        ("gyro_b", 0.0, "deg/h, fixed bias"),
        ("gyro_arw", gyro.N * degrees * 60.0, "deg/sqrt(h), N"),
        ("gyro_b_stability", _stationary_deviation(gyro) * degrees * 3600.0, "deg/h, 1 sigma"),
        ("gyro_b_corr", gyro.T_B or imu.horizon, "s, T_B"),
        ("accel_b", 0.0, "m/s^2, fixed bias"),
        ("accel_vrw", accel.N * 60.0, "m/s/sqrt(h), N"),
        ("accel_b_stability", _stationary_deviation(accel), "m/s^2, 1 sigma"),
        ("accel_b_corr", accel.T_B or imu.horizon, "s, T_B"),
    ]
    lines = [
        f'    "{key}": np.full(3, {float(f"{value:.9g}")!r}),  # {comment}\n'
        for key, value, comment in entries
    ]
    text = "import numpy as np\n\nimu_err = {\n" + "".join(lines) + "}\n"
    return comments.format_python_comments(about) + text


def _stationary_deviation(model: NoiseModel) -> float:
    if model.T_B is None or model.B == 0.0:
        return 0.0
    return math.sqrt(compute_driving_density(model.B, model.T_B) * model.T_B / 2.0)


_MATLAB_CONVENTION = (
    "NoiseDensity is N and RandomWalk is K in the two-sided convention, which this program calls "
    "single-sided; BiasInstability drives the filter of BiasInstabilityCoefficients, made for "
    "SampleRate = {rate:g} Hz. R2023b or newer."
)
_MAX_POLES = 2000
_REFERENCE_TEMPERATURE = 25.0  # temperature at which TemperatureBias adds nothing, degC
_MAX_SAMPLES_PER_POLE = 5.0
"""Max. samples per pole; up to them the Allan deviation of flicker noise is within 11 %."""


_Parameters = tuple[float, float, float, str]  # N, K, the drive and the filter coefficients


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
    parameters: dict[str, _Parameters] = {}
    for name, axis in imu.axes.items():
        mapped[name], parameters[name] = _map_parameters(axis, imu)
    convention = _MATLAB_CONVENTION.format(rate=imu.rate)
    about = comments.describe_model(imu, "MATLAB imuSensor", convention, mapped, temperature=True)
    biases = {name: _map_temperature(imu.temperature.get(name)) for name in parameters}
    about += [f"{name} and temperature: {words}." for name in biases for words in biases[name][1]]
    text = comments.format_comments(about, "%") + "IMU = imuSensor('accel-gyro');\n"
    text += f"IMU.SampleRate = {imu.rate:.9g};  % Hz\n"
    members = {
        "gyro": ("Gyroscope", "gyroparams", "rad/s"),
        "accel": ("Accelerometer", "accelparams", "m/s^2"),
    }
    for name, figures in parameters.items():
        member, maker, unit = members[name]
        N, K, drive, coefficients = figures
        lines = [
            ("'NoiseType'", "'single-sided'", "two-sided density, see above"),
            ("'NoiseDensity'", _format_vector([N] * 3), f"N, {unit}/sqrt(Hz)"),
            ("'RandomWalk'", _format_vector([K] * 3), f"K, {unit} sqrt(Hz)"),
            ("'BiasInstability'", _format_vector([drive] * 3), f"of the drive, {unit}"),
            *biases[name][0],
            ("'BiasInstabilityCoefficients'", coefficients, "of the filter"),
        ]
        text += f"IMU.{member} = {maker}( ...\n"
        for i, (key, value, comment) in enumerate(lines):
            end = "); " if i == len(lines) - 1 else ", ..."
            text += f"    {key}, {value}{end} % {comment}\n"
    effects = [imu.temperature[name] for name in biases if biases[name][0]]
    if effects:
        low, high = max(effect.low for effect in effects), min(effect.high for effect in effects)
        text += (
            f"IMU.Temperature = {effects[0].reference:.9g};  % degC; between {low:.9g} and "
            f"{high:.9g} the biases follow it\n"
        )
    return text


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
        ("'ConstantBias'", _format_vector(at_25), "at 25 degC, so that it is 0 at T_0"),
        ("'TemperatureBias'", _format_vector(slopes), "a kelvin"),
    ], words


def _map_parameters(axis: AxisNoise, imu: Imu) -> tuple[Mapped, _Parameters]:
    model = axis.model
    samples = imu.horizon * imu.rate
    flickers = model.B > 0 and model.T_B is None and not model.further
    if flickers and not model.R and samples <= _MAX_SAMPLES_PER_POLE * _MAX_POLES:
        poles = min(math.ceil(2.0 * samples), _MAX_POLES)
        words = (
            f"flicker noise B = {model.B:.3e} is generated by {poles} poles. Its Allan deviation "
            f"is within 11 % up to {number_text(_MAX_SAMPLES_PER_POLE * poles / imu.rate)} s"
        )
        rest = NoiseModel(Q=model.Q, N=model.N, K=model.K, sinusoids=model.sinusoids)
        with_walk = as_process(rest, imu.horizon, imu.rate, walk=True)
        flicker = NoiseModel(N=model.N, B=model.B, K=model.K)
        mapped = Mapped(flicker, [words, *with_walk.words])
        return mapped, (model.N, model.K, model.B, f"fractalcoef({poles})")
    mapped = as_process(model, imu.horizon, imu.rate, walk=True)
    process = mapped.model
    if process.T_B is None or process.B == 0.0:
        return mapped, (process.N, process.K, 0.0, "fractalcoef(1)")
    p = math.exp(-1.0 / (imu.rate * process.T_B))
    stationary = compute_driving_density(process.B, process.T_B) * process.T_B / 2.0
    drive = math.sqrt(-stationary * math.expm1(-2.0 / (imu.rate * process.T_B)))
    coefficients = f"struct('Numerator', 1, 'Denominator', [1, {-p:.17g}])"
    return mapped, (process.N, process.K, drive, coefficients)


def _format_vector(values: Sequence[float]) -> str:
    return f"[{', '.join(f'{value:.9g}' for value in values)}]"
