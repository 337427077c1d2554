"""PX4: parameters of its estimator EKF2, as a file of QGroundControl or of pymavlink.

``EKF2_GYR_NOISE`` and ``EKF2_ACC_NOISE`` are standard deviations per filter step, not densities. A
step of dt adds (dt noise)^2 to the variance of the angle or velocity increment, and (dt b_noise)^2,
with b_noise ``EKF2_GYR_B_NOISE`` or ``EKF2_ACC_B_NOISE``, to the variance of the bias. These must
equal N^2 dt and K^2 dt:

    EKF2_GYR_NOISE = N / sqrt(dt),   EKF2_GYR_B_NOISE = K / sqrt(dt),

where dt is EKF2_PREDICT_US, 10 ms by default, independent of the rate of the sensor. The parameters
have ranges; values outside are clipped, and the file notes this.

If the log determines the effect of temperature on the biases, ``TC_G0_*`` and ``TC_A0_*`` contain
it. PX4 subtracts x0 + x1 dT + x2 dT^2 + x3 dT^3 from a reading, with dT = T - TREF and T clipped to
TMIN and TMAX. The parameters have no effect until the device is named and the correction is
switched on. x0 is 0: the calibration of the vehicle determines the bias at T_0, and the mean of an
accelerometer contains gravity.

Sources: PX4/PX4-Autopilot, src/modules/ekf2/EKF/covariance.cpp (predictCovariance),
src/modules/ekf2/EKF/python/ekf_derivation/derivation.py (predict_covariance),
src/modules/ekf2/module.yaml, params_gyro_bias.yaml and params_accel_bias.yaml (units, ranges,
EKF2_PREDICT_US), src/modules/temperature_compensation/TemperatureCompensation.cpp
(calc_thermal_offsets_3D, names and clipping); QGroundControl developer guide, "Parameters File
Format"; ArduPilot/pymavlink, mavparm.py (``load``).
"""

import re
from collections.abc import Mapping
from dataclasses import replace

from imubench_pipeline.extensions.exports import programs
from imubench_pipeline.extensions.exports.imu import AXES, Imu
from imubench_pipeline.extensions.exports.mapping import Mapped

_PERIOD = 10_000  # default of EKF2_PREDICT_US, us
_PARAMETER_RANGES = {
    "EKF2_ACC_NOISE": (0.01, 1.0),
    "EKF2_GYR_NOISE": (1e-4, 0.1),
    "EKF2_ACC_B_NOISE": (0.0, 0.01),
    "EKF2_GYR_B_NOISE": (0.0, 0.01),
}
_REAL32_TYPE, _INT32_TYPE = 9, 6  # MAV_PARAM_TYPE
_TEMPERATURE_PREFIXES = {"gyro": ("G", "GYRO"), "accel": ("A", "ACC")}
"""Letter after ``TC_``, and word after ``CAL_``."""


def write(imu: Imu) -> str:
    """Return a parameter file; ExportError if gyro or accelerometer has no estimate."""
    mapped = programs.map_models(imu, PX4)
    about = programs.describe(imu, PX4, mapped, temperature=True)
    values, remarks = clip_values(PX4, _PARAMETER_RANGES, mapped, 1e-6 * _PERIOD)
    about += remarks
    rows = [f"1\t1\t{name}\t{value:.9g}\t{_REAL32_TYPE}\n" for name, value in values.items()]
    rows.append(f"1\t1\tEKF2_PREDICT_US\t{_PERIOD}\t{_INT32_TYPE}\n")
    for quantity, effect in imu.temperature.items():
        if not effect.slope:
            continue
        letter, calibration = _TEMPERATURE_PREFIXES[quantity]
        corrections = {"TREF": effect.reference, "TMIN": effect.low, "TMAX": effect.high}
        for number, axis in enumerate(AXES):
            # All four, to overwrite the values of an earlier calibration.
            corrections[f"X0_{number}"] = corrections[f"X3_{number}"] = 0.0
            corrections[f"X1_{number}"] = effect.slope.get(axis, 0.0)
            corrections[f"X2_{number}"] = effect.square.get(axis, 0.0)
        rows += [
            f"1\t1\tTC_{letter}0_{key}\t{value:.9g}\t{_REAL32_TYPE}\n"
            for key, value in corrections.items()
        ]
        about.append(
            f"TC_{letter}0_*: x, y and z of the log are taken as the axes of the device, and its "
            "temperature as the temperature of the driver. PX4 corrects nothing until "
            f"TC_{letter}0_ID names the device, as CAL_{calibration}0_ID does, and "
            f"TC_{letter}_ENABLE is 1. The noise above includes the effect of "
            "temperature; --method compensated leaves it out."
        )
    head = programs.format_comments(["Onboard parameters for Vehicle 1", *about])
    return head + "# Vehicle-Id Component-Id Name Value Type\n" + "".join(rows)


def write_mavparm(imu: Imu) -> str:
    """Return the parameters of `write` as lines ``NAME,value``, which pymavlink loads."""
    return re.sub(r"(?m)^1\t1\t(\S+)\t(\S+)\t\d+$", r"\1,\2", write(imu))


PX4 = programs.declare(
    "px4",
    "PX4 (EKF2)",
    "ekf2.params",
    "https://github.com/PX4/PX4-Autopilot/blob/HEAD/src/modules/ekf2/EKF/covariance.cpp",
    "Noise per step of the filter: N / sqrt(dt) and K / sqrt(dt), where dt is EKF2_PREDICT_US; N "
    "and K are two-sided densities, SI. The values are valid for the EKF2_PREDICT_US of the file "
    "only. Vibration in flight adds to the noise at rest, and the defaults of PX4 allow for it.",
    (programs.FILTER_SAMPLE, "EKF2_GYR_NOISE", "EKF2_ACC_NOISE"),
    (programs.FILTER_STEP, "EKF2_GYR_B_NOISE", "EKF2_ACC_B_NOISE"),
    writer=write,
)
MAVPARM = replace(
    PX4,
    name="px4-mavparm",
    title="PX4 (EKF2), for pymavlink",
    file_name="ekf2.parm",
    writer=write_mavparm,
)


def clip_values(
    program: programs.Program,
    ranges: Mapping[str, tuple[float, float]],
    mapped: Mapping[str, Mapped],
    step: float,
) -> tuple[dict[str, float], list[str]]:
    """Return a filter's parameters, clipped to ``ranges``, and a remark on each; ``step`` in s."""
    values: dict[str, float] = {}
    about = []
    for entry in program.entries:
        value = entry.compute(mapped[entry.quantity].model, 1.0 / step, 0.0)
        low, high = ranges[entry.name]
        values[entry.name] = clipped = min(max(value, low), high)
        if clipped != value:
            about.append(
                f"{entry.name}: {value:.4g} is outside the range of {low:g} to {high:g}, and "
                f"{clipped:g} is used."
            )
        about.append(f"{entry.name} = {clipped:.6g}: {entry.form.formula}, {entry.unit}.")
    return values, about
