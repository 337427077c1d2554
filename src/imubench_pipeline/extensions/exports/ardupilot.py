"""ArduPilot: parameters of its estimator EKF3, and of its correction of the temperature.

``EK3_GYRO_P_NSE`` and ``EK3_ACC_P_NSE`` are standard deviations per filter step: a step of dt adds
(dt noise)^2 to the variance of angle and velocity. The states of the biases are increments over a
step, and get (dt^2 b_noise)^2 from ``EK3_GBIAS_P_NSE`` or ``EK3_ABIAS_P_NSE``, so a bias gets
(dt b_noise)^2. These must equal N^2 dt and K^2 dt, with dt about 12 ms (EKF_TARGET_DT). Values
outside the ranges of the parameters are clipped, and the file notes this.

``INS_TCAL1_*`` has the effect of temperature if the log determines it: 1e6 times the coefficients
of a polynomial about 35 degC, which is subtracted from a reading between TMIN and TMAX.

Sources: ArduPilot/ardupilot, libraries/AP_NavEKF3/AP_NavEKF3.cpp (names, units, ranges),
AP_NavEKF3_core.cpp (CovariancePrediction), AP_NavEKF3_core.h (EKF_TARGET_DT),
libraries/AP_InertialSensor/AP_InertialSensor_tempcal.cpp (TEMP_REFERENCE, SCALE_FACTOR,
correct_sensor); ArduPilot/pymavlink, mavparm.py (``load``).
"""

from imubench_pipeline.extensions.exports import programs
from imubench_pipeline.extensions.exports.imu import AXES, Imu, TemperatureEffect
from imubench_pipeline.extensions.exports.px4 import clip_values

STEP = 0.012  # EKF_TARGET_DT, s

_PARAMETER_RANGES = {
    "EK3_GYRO_P_NSE": (1e-4, 0.1),
    "EK3_ACC_P_NSE": (0.01, 1.0),
    "EK3_GBIAS_P_NSE": (1e-5, 1e-3),
    "EK3_ABIAS_P_NSE": (1e-5, 0.02),
}
_TEMPERATURE_REFERENCE = 35.0  # TEMP_REFERENCE, degC
_COEFFICIENT_SCALE = 1e6  # SCALE_FACTOR


def write(imu: Imu) -> str:
    """Return lines ``NAME,value``; ExportError if gyro or accelerometer has no estimate."""
    mapped = programs.map_models(imu, ARDUPILOT)
    about = programs.describe(imu, ARDUPILOT, mapped, temperature=True)
    values, remarks = clip_values(ARDUPILOT, _PARAMETER_RANGES, mapped, STEP)
    about += remarks
    if any(effect.slope for effect in imu.temperature.values()):
        values |= _list_corrections(imu)
        about.append(
            "INS_TCAL1_*: x, y and z of the log are taken as the axes of the first IMU. An axis "
            "without an effect has 0. ArduPilot corrects nothing until INS_TCAL1_ENABLE is 1; "
            "calibrate the accelerometer after that. The noise above includes the effect of "
            "temperature; --method compensated leaves it out."
        )
    # Not every program that loads the file reads exponents.
    rows = [f"{name},{programs.format_decimal(value)}\n" for name, value in values.items()]
    return programs.format_comments(about) + "".join(rows)


def _list_corrections(imu: Imu) -> dict[str, float]:
    """Return the polynomials about 35 degC, within the range of all effects."""
    effects = {name: effect for name, effect in imu.temperature.items() if effect.slope}
    values = {
        "TMIN": max(effect.low for effect in effects.values()),
        "TMAX": min(effect.high for effect in effects.values()),
    }
    for quantity, word in (("accel", "ACC"), ("gyro", "GYR")):
        effect = effects.get(quantity, TemperatureEffect())
        for axis in AXES:
            square = effect.square.get(axis, 0.0)
            change = 2.0 * square * (_TEMPERATURE_REFERENCE - effect.reference)
            slope = effect.slope.get(axis, 0.0) + change
            for order, value in enumerate((slope, square, 0.0), start=1):
                values[f"{word}{order}_{axis.upper()}"] = _COEFFICIENT_SCALE * value
    return {f"INS_TCAL1_{name}": value for name, value in values.items()}


ARDUPILOT = programs.declare(
    "ardupilot",
    "ArduPilot (EKF3)",
    "ekf3.param",
    "https://github.com/ArduPilot/ardupilot/blob/HEAD/libraries/AP_NavEKF3/AP_NavEKF3_core.cpp",
    "Noise per step of the filter of about 12 ms: N / sqrt(dt) and K / sqrt(dt), dt = 12 ms; N "
    "and K are two-sided densities, SI. Vibration in flight adds to the noise at rest, and the "
    "defaults of ArduPilot allow for it.",
    (programs.FILTER_SAMPLE, "EK3_GYRO_P_NSE", "EK3_ACC_P_NSE"),
    (programs.FILTER_STEP, "EK3_GBIAS_P_NSE", "EK3_ABIAS_P_NSE"),
    writer=write,
)
