"""MATLAB: a script that makes an ``imuSensor`` of the Navigation and Sensor Fusion toolboxes.

With ``NoiseType`` "single-sided" a sample gets NoiseDensity sqrt(SampleRate) of white noise, and a
step of the random walk RandomWalk / sqrt(SampleRate): NoiseDensity is N and RandomWalk is K, in the
two-sided sense of IEEE Std 952. (With the default, "double-sided", SampleRate / 2 stands in both
places: N would have to be sqrt(2) times larger, a one-sided density as on datasheets, and K sqrt(2)
times smaller.)

BiasInstability is the deviation of white samples that BiasInstabilityCoefficients filter. A first-
order filter 1 / (1 - p z^-1), p = e^(-dt / T_B), makes the Gauss-Markov process exactly, with
B' = sqrt(S_B T_B / 2 (1 - p^2)). ``fractalcoef`` makes flicker noise with B' = B: its spectrum
B^2 / |1 - e^(-i omega)| is cut off at low frequencies by the number of poles; with as many poles
as samples the Allan deviation is within 7 % at that many samples and 11 % at twice. The default
of one pole is no flicker noise.

Sources: MathWorks, reference pages of imuSensor ("Algorithms"), gyroparams, accelparams and
fractalcoef (R2023b); the example "Inertial Sensor Noise Analysis Using Allan Variance"; C code
generated from fusion.simulink.imuSensor (pBandwidth, pStdDevWhiteNoise, pStdDevRandWalk,
pStdDevBiasInst).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from imubench_pipeline.export.comments import commented, heading, mapping_words
from imubench_pipeline.export.imu import AxisNoise, Imu
from imubench_pipeline.export.mapping import Mapped, as_process_and_walk
from imubench_pipeline.noise import NoiseModel, driving_density

_CONVENTION = (
    "NoiseDensity is N and RandomWalk is K in the two-sided convention, which this program calls "
    "single-sided; BiasInstability drives the filter of BiasInstabilityCoefficients, made for "
    "SampleRate = {rate:g} Hz. R2023b or newer."
)
_MOST_POLES = 2000
_REACH = 5.0
"""Samples a pole up to which the Allan deviation of flicker noise is within 11 %."""


@dataclass(frozen=True)
class _Parameters:
    noise_density: float
    random_walk: float
    bias_instability: float
    coefficients: str


def write(imu: Imu) -> str:
    """Return the script; it leaves ``IMU``, an imuSensor.

    Parameters
    ----------
    imu : Imu
    """
    mapped: dict[str, Mapped] = {}
    parameters: dict[str, _Parameters] = {}
    for name, axis in imu.axes.items():
        mapped[name], parameters[name] = _parameters(axis, imu)
    about = heading(imu, "MATLAB imuSensor", _CONVENTION.format(rate=imu.rate))
    about += mapping_words(mapped)
    text = commented(about, "%") + "IMU = imuSensor('accel-gyro');\n"
    text += f"IMU.SampleRate = {imu.rate:.9g};  % Hz\n"
    units = {"gyro": "rad/s", "accel": "m/s^2"}
    words = {"gyro": ("Gyroscope", "gyroparams"), "accel": ("Accelerometer", "accelparams")}
    for name, one in parameters.items():
        member, maker = words[name]
        unit = units[name]
        lines = [
            ("'NoiseType'", "'single-sided'", "two-sided density, see above"),
            ("'NoiseDensity'", _vector(one.noise_density), f"N, {unit}/sqrt(Hz)"),
            ("'RandomWalk'", _vector(one.random_walk), f"K, {unit} sqrt(Hz)"),
            ("'BiasInstability'", _vector(one.bias_instability), f"of the drive, {unit}"),
            ("'BiasInstabilityCoefficients'", one.coefficients, "of the filter"),
        ]
        text += f"IMU.{member} = {maker}( ...\n"
        for i, (key, value, comment) in enumerate(lines):
            end = "); " if i == len(lines) - 1 else ", ..."
            text += f"    {key}, {value}{end} % {comment}\n"
    return text


def _parameters(axis: AxisNoise, imu: Imu) -> tuple[Mapped, _Parameters]:
    model = axis.model
    samples = imu.horizon * imu.rate
    flickers = model.B > 0 and model.T_B is None and not model.further
    if flickers and not model.R and samples <= _REACH * _MOST_POLES:
        poles = min(math.ceil(2.0 * samples), _MOST_POLES)
        words = [
            f"flicker noise B = {model.B:.3e} is made by {poles} poles; its Allan deviation is "
            f"within 11 % up to {_REACH * poles / imu.rate:.4g} s"
        ]
        rest = NoiseModel(Q=model.Q, N=model.N, K=model.K, sinusoids=model.sinusoids)
        found = as_process_and_walk(rest, imu.horizon, imu.rate)
        held = NoiseModel(N=model.N, B=model.B, K=model.K)
        mapped = Mapped(held, [*words, *found.words])
        return mapped, _Parameters(model.N, model.K, model.B, f"fractalcoef({poles})")
    mapped = as_process_and_walk(model, imu.horizon, imu.rate)
    held = mapped.model
    if held.T_B is None or held.B == 0.0:
        return mapped, _Parameters(held.N, held.K, 0.0, "fractalcoef(1)")
    p = math.exp(-1.0 / (imu.rate * held.T_B))
    stationary = driving_density(held.B, held.T_B) * held.T_B / 2.0
    drive = math.sqrt(-stationary * math.expm1(-2.0 / (imu.rate * held.T_B)))
    coefficients = f"struct('Numerator', 1, 'Denominator', [1, {-p:.17g}])"
    return mapped, _Parameters(held.N, held.K, drive, coefficients)


def _vector(value: float) -> str:
    return f"[{value:.9g}, {value:.9g}, {value:.9g}]"
