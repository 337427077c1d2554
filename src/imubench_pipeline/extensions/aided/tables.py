"""Filters on simulated drives."""

from typing import Annotated

from imubench_pipeline.model.table import SensorRow, table

_LOWER = "lower 95 % limit from the scatter of the runs"
_RATIO = "rms relative to the true model on the same signals"


def _rms(where: str) -> str:
    return f"rms of the error {where}, at the end of outages or at all fixes"


@table("navigation")
class NavigationRow(SensorRow):
    recording: Annotated[str, "recording with the estimates for the tuning"]
    trajectory: Annotated[str | None, "trajectory: field, car, drone or rest"] = None
    outage: Annotated[float | None, "of GNSS; null: epochs with GNSS", "s"] = None
    tuning: Annotated[
        str,
        "method of the estimate, datasheet, datasheet_misread, times_ten, table_1, overbound,"
        " or true: the model of the simulated sensor",
    ]
    recommended: Annotated[bool | None, "the recommended estimate"] = None
    model: Annotated[str | None, "terms of gyros and accelerometers in the filter"] = None
    states: Annotated[int | None, "number, with position, velocity and attitude"] = None
    signals: Annotated[str | None, "source of the errors: truth, estimate or log"] = None
    assumed: Annotated[str | None, "from another sensor, as this log lacks it"] = None
    runs: Annotated[int | None, "number of runs"] = None
    outages: Annotated[int | None, "number of outages of this length in all runs"] = None
    position: Annotated[float | None, _rms("in the plane"), "m"] = None
    position_lower: Annotated[float | None, _LOWER, "m"] = None
    position_upper: Annotated[float | None, "upper 95 % limit", "m"] = None
    position_predicted: Annotated[float | None, "rms predicted by the filter", "m"] = None
    position_ratio: Annotated[float | None, _RATIO] = None
    position_ratio_lower: Annotated[float | None, "lower 95 % limit"] = None
    position_ratio_upper: Annotated[float | None, "upper 95 % limit"] = None
    velocity: Annotated[float | None, _rms("in the plane"), "m/s"] = None
    velocity_lower: Annotated[float | None, _LOWER, "m/s"] = None
    velocity_upper: Annotated[float | None, "upper 95 % limit", "m/s"] = None
    velocity_predicted: Annotated[float | None, "rms predicted by the filter", "m/s"] = None
    velocity_ratio: Annotated[float | None, _RATIO] = None
    velocity_ratio_lower: Annotated[float | None, "lower 95 % limit"] = None
    velocity_ratio_upper: Annotated[float | None, "upper 95 % limit"] = None
    heading: Annotated[float | None, _rms("about the vertical"), "rad"] = None
    heading_lower: Annotated[float | None, _LOWER, "rad"] = None
    heading_upper: Annotated[float | None, "upper 95 % limit", "rad"] = None
    heading_predicted: Annotated[float | None, "rms predicted by the filter", "rad"] = None
    heading_ratio: Annotated[float | None, _RATIO] = None
    heading_ratio_lower: Annotated[float | None, "lower 95 % limit"] = None
    heading_ratio_upper: Annotated[float | None, "upper 95 % limit"] = None
    nees_inside: Annotated[float | None, "share of epochs with NEES in 95 % bounds"] = None
    nees_error: Annotated[float | None, "standard error of this share"] = None
    nees_position: Annotated[float | None, "the same share for the position alone"] = None
    nees_velocity: Annotated[float | None, "of the velocity"] = None
    nees_attitude: Annotated[float | None, "of the attitude"] = None
    nees_gyro: Annotated[float | None, "of gyro biases; null: unknown or flicker"] = None
    nees_accel: Annotated[float | None, "the same share for the accelerometer biases"] = None
    consistent: Annotated[bool | None, "share and twice its error in 0.9 to 1"] = None
    smallest: Annotated[bool | None, "fewest states of the consistent tunings"] = None
    reason: Annotated[str | None, "reason if there is no consistent tuning"] = None
