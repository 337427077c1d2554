"""Tables of gyros turned between north and south, and of predictions for sensors at rest."""

from typing import Annotated

from imubench_pipeline.model.table import (
    Column,
    Estimate,
    EstimateUnit,
    LowerLimit,
    OfRecordingRow,
    UpperLimit,
    table,
)

TurnedGyro = Annotated[str, Column("the gyro that was turned")]
Part = Annotated[str, Column("part: part: whole, or the last minutes of the recording")]
Method = Annotated[
    str,
    Column(
        "pairs, triples, filter, smoother; known_rate (input: the true rate) starts with 0.1 "
        "(deg/s)^2, known_rate_radians with 0.1 (rad/s)^2"
    ),
]


@table("earth_rate")
class EarthRateRow(OfRecordingRow):
    """A row of the table ``earth_rate``."""

    channel: TurnedGyro
    part: Part
    method: Method
    parameter: Annotated[str, Column("earth_rate")]
    value: Estimate = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: EstimateUnit
    status: Annotated[
        str, Column("ok; ambiguous (sign); given (input); no_turns, no_model, too_short, not_shown")
    ]
    reasons: Annotated[tuple[str, ...], Column("why there is no plain value")] = ()
    sigma: Annotated[float | None, Column("standard deviation by the noise model", "rad/s")] = None
    sigma_lower: Annotated[float | None, Column("lower 95 % limit of sigma", "rad/s")] = None
    sigma_upper: Annotated[float | None, Column("upper 95 % limit of sigma", "rad/s")] = None
    white: Annotated[float | None, Column("lower limit, N/sqrt(T)/cos(latitude)", "rad/s")] = None
    truth: Annotated[float, Column("the Earth's rate", "rad/s")]
    off_sigma: Annotated[float | None, Column("value less truth, in sigma")] = None
    settled: Annotated[float | None, Column("time to within 10 % of the given rate", "s")] = None
    dwells: Annotated[int | None, Column("used")] = None
    turns: Annotated[int | None, Column("between them")] = None
    samples: Annotated[int | None, Column("used")] = None
    missing: Annotated[int | None, Column("samples of dwells missing, or left out as knocks")] = (
        None
    )
    duration: Annotated[float | None, Column("of all dwells and the turns between", "s")] = None
    latitude: Annotated[float, Column("latitude, as stated with the log", "rad")]
    block: Annotated[float | None, Column("largest length of an averaged block", "s")] = None
    model: Annotated[str | None, Column("terms of the noise model")] = None
    model_from: Annotated[str | None, Column("source of the noise model")] = None


@table("earth_rate_series")
class EarthRateSeriesRow(OfRecordingRow):
    """A row of the table ``earth_rate_series``."""

    channel: TurnedGyro
    part: Part
    method: Method
    quantity: Annotated[str, Column("rate: the Earth's rate; drift: slow error of the gyro")]
    time: Annotated[float, Column("from the first sample of the recording", "s")]
    value: Annotated[float, Column("from the data so far; smoother: from all the data", "rad/s")]
    sigma: Annotated[float | None, Column("its standard deviation", "rad/s")] = None


@table("turning")
class TurningRow(OfRecordingRow):
    """A row of the table ``turning``."""

    channel: TurnedGyro
    what: Annotated[str, Column("dwell, turn, knock, or a doubt about the whole log log")]
    number: Annotated[int | None, Column("in order, from 1")] = None
    start: Annotated[float | None, Column("from the first sample of the recording", "s")] = None
    stop: Annotated[float | None, Column("its end; of a turn: end of the time left out", "s")] = (
        None
    )
    time: Annotated[float | None, Column("for a turn: its middle", "s")] = None
    sense: Annotated[int | None, Column("for a dwell: 1 if the axis points north, -1 if south")] = (
        None
    )
    found_by: Annotated[
        str | None, Column("source of a turn: column, transient, step or schedule")
    ] = None
    peak: Annotated[float | None, Column("of a turn: largest rate or step", "rad/s")] = None
    mean: Annotated[float | None, Column("of a dwell", "rad/s")] = None
    doubts: Annotated[tuple[str, ...], Column("in words")] = ()


@table("earth_rate_prediction")
class EarthRatePredictionRow(OfRecordingRow):
    """A row of the table ``earth_rate_prediction``."""

    channel: TurnedGyro
    of: Annotated[str, Column("goal: need; time: over run length; dwell: over length of a dwell")]
    latitude: Annotated[float, Column("where", "rad")]
    dwell: Annotated[float, Column("data in each dwell", "s")]
    turns: Annotated[int, Column("of the run")]
    time: Annotated[float, Column("length of the run", "s")]
    sigma: Annotated[float | None, Column("least standard deviation of the rate", "rad/s")] = None
    relative: Annotated[float | None, Column("the same as a fraction of the Earth's rate")] = None
    heading: Annotated[float | None, Column("standard deviation, east-west axis", "rad")] = None
    goal: Annotated[float | None, Column("required relative standard deviation")] = None
    best: Annotated[bool | None, Column("for dwell: the best one")] = None
    nearly_best: Annotated[bool | None, Column("for dwell: less than 1 % worse than the best")] = (
        None
    )


@table("earth_rate_published")
class EarthRatePublishedRow(OfRecordingRow):
    """A row of the table ``earth_rate_published``."""

    channel: TurnedGyro
    part: Part
    place: Annotated[str, Column("of the source")]
    printed: Annotated[str, Column("as printed, with its unit")]
    published: Annotated[float, Column("the same", "rad/s")]
    truth: Annotated[float, Column("the Earth's rate", "rad/s")]
    duration: Annotated[float, Column("duration of the run or its part", "s")]
    white: Annotated[float | None, Column("sigma by white noise alone", "rad/s")] = None
    sigma: Annotated[float | None, Column("of the mean over pairs, printed noise", "rad/s")] = None
    sigma_filter: Annotated[float | None, Column("the same for the filter", "rad/s")] = None
    off_sigma: Annotated[float | None, Column("published less truth, in sigma")] = None
    verdict: Annotated[str, Column("within the noise or beyond the noise")]
    simulated: Annotated[float | None, Column("from pairs, in a simulated log", "rad/s")] = None
    simulated_filter: Annotated[float | None, Column("from the filter, likewise", "rad/s")] = None
    assumed: Annotated[str | None, Column("assumptions: not printed by the source")] = None


@table("alignment")
class AlignmentRow(OfRecordingRow):
    """A row of the table ``alignment``."""

    recording: Annotated[str, Column("static recording with its noise")]
    positions: Annotated[int, Column("number of positions: 1, or 2 (opposite about the vertical)")]
    method: Annotated[str, Column("coarse or fine")]
    time: Annotated[float, Column("time at rest, including the turn between two positions", "s")]
    roll: Annotated[float | None, Column("standard deviation, level, facing north", "rad")] = None
    pitch: Annotated[float | None, Column("likewise", "rad")] = None
    heading: Annotated[float | None, Column("likewise; null: see reason", "rad")] = None
    reason: Annotated[str | None, Column("reason for a missing angle")] = None
    error_roll: Annotated[float | None, Column("rms error of simulated triads over roll")] = None
    error_pitch: Annotated[float | None, Column("likewise, over pitch")] = None
    error_heading: Annotated[float | None, Column("likewise, over heading")] = None
    simulated: Annotated[int | None, Column("number of triads of this check; null: none")] = None
    latitude: Annotated[float, Column("latitude, latitude, as set (earth_rate: latitude)", "rad")]
    gyro_bias: Annotated[float, Column("standard deviation of the fixed biases", "rad/s")]
    gyro_bias_from: Annotated[str, Column("source of this figure")]
    accelerometer_bias: Annotated[float, Column("standard deviation of the fixed biases", "m/s^2")]
    accelerometer_bias_from: Annotated[str, Column("source of this figure")]
    gyros: Annotated[tuple[str, ...], Column("channels whose noise the axes x, y, z have")]
    accelerometers: Annotated[tuple[str, ...], Column("likewise")]


TURNED = (
    "earth_rate",
    "earth_rate_series",
    "turning",
    "earth_rate_prediction",
    "earth_rate_published",
)
"""The tables of gyros that were turned: only such recordings have rows."""
