"""gnss-ins-sim: the dictionary of errors of an IMU.

``gyro_arw`` in deg/sqrt(h) and ``accel_vrw`` in m/s/sqrt(h) are N, two-sided (a sample gets
N / sqrt(dt)). ``*_b_stability`` with ``*_b_corr`` is the standard deviation of a first-order
Gauss-Markov process, deg/h and m/s^2; it is not the bias instability B of IEEE Std 952:

    stability = sqrt(S_B T_B / 2) = 1.076 B.

The process is discretised as x' = (1 - dt / T_B) x + w, accurate where T_B is many samples, and
starts at 0. Without ``*_b_corr`` (or inf) the program draws white noise, so it is always given.
There is no random walk.

Source: Aceinna/gnss-ins-sim, gnss_ins_sim/sim/imu_model.py (names and units),
gnss_ins_sim/pathgen/pathgen.py (acc_gen, gyro_gen, bias_drift).
"""

from __future__ import annotations

import math

from imubench_pipeline.export.comments import describe_model, format_python_comments
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.mapping import as_process
from imubench_pipeline.noise import NoiseModel, compute_driving_density
from imubench_pipeline.words.reasons import exports as texts

_CONVENTION = (
    "*_arw and *_vrw are N (two-sided) an hour; *_b_stability is the standard deviation of a "
    "first-order Gauss-Markov process (1.076 B), *_b_corr its T_B in s. Fixed biases are 0."
)
_MIN_SAMPLES_IN_T_B = 20.0
"""With fewer samples in T_B, the program's discretisation is off by more than 3 %."""


def write(imu: Imu) -> str:
    """Return Python that defines ``imu_err``, for ``imu_model.IMU(accuracy=imu_err)``."""
    imu.require_both()
    mapped = {name: as_process(a.model, imu.horizon, imu.rate) for name, a in imu.axes.items()}
    gyro, accel = mapped["gyro"].model, mapped["accel"].model
    about = describe_model(imu, "gnss-ins-sim", _CONVENTION, mapped)
    for name, process in mapped.items():
        if process.model.T_B is not None and process.model.T_B * imu.rate < _MIN_SAMPLES_IN_T_B:
            about.append(f"{name}: {texts.short_process(process.model.T_B * imu.rate)}.")
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
    return (
        format_python_comments(about)
        + "import numpy as np\n\nimu_err = {\n"
        + "".join(lines)
        + "}\n"
    )


def _stationary_deviation(model: NoiseModel) -> float:
    if model.T_B is None or model.B == 0.0:
        return 0.0
    return math.sqrt(compute_driving_density(model.B, model.T_B) * model.T_B / 2.0)
