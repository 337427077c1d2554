"""Tables of gyros and accelerometers with known rates or directions."""

from typing import Annotated

from imubench_pipeline.model.table import (
    Estimate,
    EstimateReason,
    EstimateUnit,
    LowerLimit,
    OfRecordingRow,
    UpperLimit,
    table,
)


@table("calibration")
class CalibrationRow(OfRecordingRow):
    channel: Annotated[str, "the gyro that was calibrated"]
    run: Annotated[str, "rate_table; at_rest (direction stated); positions of a triad"]
    parameter: Annotated[
        str,
        "bias at the first sample used; present_bias: at the end; scale_factor (indicated "
        "over true rate), quadratic, asymmetry (of the scale factors of both senses, over "
        "their mean), linearity (largest deviation from the line over the largest rate); "
        "earth_rate, heading",
    ]
    value: Estimate = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: EstimateUnit
    status: Annotated[str, "ok, not_observable, no_model, too_short or not_shown"]
    reason: EstimateReason = None
    sigma: Annotated[float | None, "standard error: noise, direction", "as in unit"] = None
    sigma_noise: Annotated[float | None, "part by the noise model", "as in unit"] = None
    chance: Annotated[float | None, "p-value of quadratic, asymmetry or linearity"] = None
    half_width: Annotated[float | None, "half the open range of the bias", "rad/s"] = None
    earth_rate: Annotated[float | None, "along the axis, if subtracted", "rad/s"] = None
    earth_rate_sigma: Annotated[float | None, "its sigma by the direction", "rad/s"] = None
    truth: Annotated[float | None, "of a simulation", "as in unit"] = None
    scatter: Annotated[float | None, "p-value of the scatter, by the noise model"] = None
    latitude: Annotated[float | None, "as stated", "rad"] = None
    heading: Annotated[float | None, "of the axis, from north towards east", "rad"] = None
    elevation: Annotated[float | None, "of the axis above the horizon", "rad"] = None
    duration: Annotated[float | None, "from the first to the last sample used", "s"] = None
    samples: Annotated[int | None, "used"] = None
    rates: Annotated[int | None, "number of steady rates of the table"] = None
    model: Annotated[str | None, "terms of the noise model"] = None
    model_from: Annotated[str | None, "source of the noise model"] = None


@table("calibration_points")
class CalibrationPointRow(OfRecordingRow):
    channel: Annotated[str, "the gyro that was calibrated"]
    number: Annotated[int, "number of the steady rate, in order, from 1"]
    start: Annotated[float, "from the first sample of the recording, without settling", "s"]
    stop: Annotated[float, "its end", "s"]
    table_rate: Annotated[float, "of the table", "rad/s"]
    earth_rate: Annotated[float, "along the axis; 0 if unknown", "rad/s"]
    mean: Annotated[float, "mean reading", "rad/s"]
    line: Annotated[float, "value of the fitted line at this rate", "rad/s"]
    residual: Annotated[float, "mean less line", "rad/s"]
    sigma: Annotated[float, "standard deviation of the residual by the noise", "rad/s"]


CALIBRATED = ("calibration", "calibration_points")
"""The tables of gyros on a rate table, or at rest where it is known how they point."""
