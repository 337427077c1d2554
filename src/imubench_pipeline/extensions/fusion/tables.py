"""Rows about several sensors together, and about the printed figures of a board."""

from typing import Annotated

from imubench_pipeline.model.comparisons import DoubtCodes
from imubench_pipeline.model.table import ChannelRow, LowerLimit, TableRow, UpperLimit, table


@table("published_figures")
class PublishedFigureRow(ChannelRow):
    place: Annotated[str, "table of the source"]
    figure: Annotated[str, "its name there"]
    printed: Annotated[str, "as printed, with its unit"]
    of: Annotated[str, "subject of the printed value: log or datasheet"]
    parameter: Annotated[str, "N, B, bias or sensitivity"]
    means: Annotated[float, "value in the convention of this parameter", "as in unit"]
    unit: Annotated[str, "SI unit of the numbers"]
    truth: Annotated[float | None, "of the simulation", "as in unit"] = None
    curve: Annotated[float | None, "read from the curve; bias: mean", "as in unit"] = None
    value: Annotated[float | None, "by the recommended method", "as in unit"] = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    datasheet: Annotated[float | None, "of the sensor file, as N or B", "as in unit"] = None
    datasheet_upper: Annotated[float | None, "largest of several", "as in unit"] = None
    reason: Annotated[str | None, "reason for the difference from the printed value"] = None


@table("fusion")
class FusionRow(TableRow):
    quantity: Annotated[str, "gyro or accel"]
    tau: Annotated[float, "averaging time at which they are compared", "s"]
    sensor: Annotated[str, "sensor; several of it are averaged"]
    recording: Annotated[str | None, "recording that represents it: of its median channel"] = None
    channel: Annotated[str | None, "that answers"] = None
    simulated: Annotated[bool | None, "that recording is simulated"] = None
    adev: Annotated[float | None, "of one of them, by its model", "rad/s or m/s^2"] = None
    floor: Annotated[float | None, "common part: not reduced by n", "rad/s or m/s^2"] = None
    common_share: Annotated[float | None, "the same as a fraction of the variance"] = None
    temperature_share: Annotated[float | None, "part of the variance by temperature"] = None
    other: Annotated[str, "sensor to be matched"]
    other_recording: Annotated[str | None, "recording that represents it"] = None
    other_channel: Annotated[str | None, "that answers"] = None
    other_simulated: Annotated[bool | None, "whether this recording is simulated"] = None
    other_adev: Annotated[float | None, "its Allan deviation", "rad/s or m/s^2"] = None
    n: Annotated[float | None, "number that equals it; below 1: one is better"] = None
    lower: Annotated[float | None, "lower 95 % limit of n; null: none is enough"] = None
    upper: Annotated[float | None, "upper 95 % limit of n; null: maybe none"] = None
    reachable: Annotated[bool | None, "some number is enough"] = None
    reasons: Annotated[tuple[str, ...], "why there is no n or no limit"] = ()
    doubts: DoubtCodes = ()


@table("grades")
class GradeRow(TableRow):
    quantity: Annotated[str, "gyro or accel"]
    sensor: Annotated[str, "sensor; several of it are averaged"]
    recording: Annotated[str, "recording that represents it: of its median channel"]
    channel: Annotated[str, "that answers"]
    simulated: Annotated[bool, "whether this recording is simulated"]
    grade: Annotated[str, "sensor of the target class, by its datasheet"]
    grade_name: Annotated[str, "its vendor and model"]
    option: Annotated[str | None, "of that one"] = None
    statistic: Annotated[str, "N, or sigma_min: the lowest point of the curve"]
    value: Annotated[float | None, "value of one sensor", "SI"] = None
    lower: Annotated[float | None, "lower 95 % limit", "SI"] = None
    upper: Annotated[float | None, "upper 95 % limit", "SI"] = None
    printed: Annotated[float | None, "value of the target sensor, in the same convention", "SI"] = (
        None
    )
    n: Annotated[float | None, "number that equals it, if independent"] = None
    n_lower: Annotated[float | None, "number for the lower limit"] = None
    n_upper: Annotated[float | None, "number for the upper limit"] = None
    reason: Annotated[str | None, "reason for a missing n"] = None


RECORDINGS_OF_A_PAIR = (("sensor", "recording"), ("other", "other_recording"))
"""The columns of ``fusion`` that name recordings."""
