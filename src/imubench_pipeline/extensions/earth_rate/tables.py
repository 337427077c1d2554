"""Tables of gyros turned between north and south, and of predictions for sensors at rest."""

from typing import Annotated

from imubench_pipeline.model.table import (
    Estimate,
    EstimateUnit,
    LowerLimit,
    OfRecordingRow,
    UpperLimit,
    table,
)

TurnedGyro = Annotated[str, "the gyro that was turned"]
Part = Annotated[str, "part: whole, or the last minutes of the recording"]
Method = Annotated[
    str,
    "pairs, triples, filter, smoother; known_rate (input: the true rate) starts with 0.1 "
    "(deg/s)^2, known_rate_radians with 0.1 (rad/s)^2",
]


@table("earth_rate")
class EarthRateRow(OfRecordingRow):
    channel: TurnedGyro
    part: Part
    method: Method
    parameter: Annotated[str, "earth_rate"]
    value: Estimate = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: EstimateUnit
    status: Annotated[
        str, "ok; ambiguous (sign); given (input); no_turns, no_model, too_short, not_shown"
    ]
    reasons: Annotated[tuple[str, ...], "why there is no plain value"] = ()
    sigma: Annotated[float | None, "standard deviation by the noise model", "rad/s"] = None
    sigma_lower: Annotated[float | None, "lower 95 % limit of sigma", "rad/s"] = None
    sigma_upper: Annotated[float | None, "upper 95 % limit of sigma", "rad/s"] = None
    white: Annotated[float | None, "lower limit, N/sqrt(T)/cos(latitude)", "rad/s"] = None
    truth: Annotated[float, "the Earth's rate", "rad/s"]
    off_sigma: Annotated[float | None, "value less truth, in sigma"] = None
    settled: Annotated[float | None, "time to within 10 % of the given rate", "s"] = None
    dwells: Annotated[int | None, "used"] = None
    turns: Annotated[int | None, "between them"] = None
    samples: Annotated[int | None, "used"] = None
    missing: Annotated[int | None, "samples of dwells missing, or left out as knocks"] = None
    duration: Annotated[float | None, "of all dwells and the turns between", "s"] = None
    latitude: Annotated[float, "latitude, as stated with the log", "rad"]
    block: Annotated[float | None, "largest length of an averaged block", "s"] = None
    model: Annotated[str | None, "terms of the noise model"] = None
    model_from: Annotated[str | None, "source of the noise model"] = None


@table("earth_rate_series")
class EarthRateSeriesRow(OfRecordingRow):
    channel: TurnedGyro
    part: Part
    method: Method
    quantity: Annotated[str, "rate: the Earth's rate; drift: slow error of the gyro"]
    time: Annotated[float, "from the first sample of the recording", "s"]
    value: Annotated[float, "from the data so far; smoother: from all the data", "rad/s"]
    sigma: Annotated[float | None, "its standard deviation", "rad/s"] = None


@table("turning")
class TurningRow(OfRecordingRow):
    channel: TurnedGyro
    what: Annotated[str, "dwell, turn, knock, or a doubt about the whole log"]
    number: Annotated[int | None, "in order, from 1"] = None
    start: Annotated[float | None, "from the first sample of the recording", "s"] = None
    stop: Annotated[float | None, "its end; of a turn: end of the time left out", "s"] = None
    time: Annotated[float | None, "for a turn: its middle", "s"] = None
    sense: Annotated[int | None, "for a dwell: 1 if the axis points north, -1 if south"] = None
    found_by: Annotated[str | None, "source of a turn: column, transient, step or schedule"] = None
    peak: Annotated[float | None, "of a turn: largest rate or step", "rad/s"] = None
    mean: Annotated[float | None, "of a dwell", "rad/s"] = None
    doubts: Annotated[tuple[str, ...], "in words"] = ()


@table("earth_rate_prediction")
class EarthRatePredictionRow(OfRecordingRow):
    channel: TurnedGyro
    of: Annotated[str, "goal: need; time: over run length; dwell: over length of a dwell"]
    latitude: Annotated[float, "where", "rad"]
    dwell: Annotated[float, "data in each dwell", "s"]
    turns: Annotated[int, "of the run"]
    time: Annotated[float, "length of the run", "s"]
    sigma: Annotated[float | None, "least standard deviation of the rate", "rad/s"] = None
    relative: Annotated[float | None, "the same as a fraction of the Earth's rate"] = None
    heading: Annotated[float | None, "standard deviation, east-west axis", "rad"] = None
    goal: Annotated[float | None, "required relative standard deviation"] = None
    best: Annotated[bool | None, "for dwell: the best one"] = None
    nearly_best: Annotated[bool | None, "for dwell: less than 1 % worse than the best"] = None


@table("earth_rate_published")
class EarthRatePublishedRow(OfRecordingRow):
    channel: TurnedGyro
    part: Part
    place: Annotated[str, "of the source"]
    printed: Annotated[str, "as printed, with its unit"]
    published: Annotated[float, "the same", "rad/s"]
    truth: Annotated[float, "the Earth's rate", "rad/s"]
    duration: Annotated[float, "duration of the run or its part", "s"]
    white: Annotated[float | None, "sigma by white noise alone", "rad/s"] = None
    sigma: Annotated[float | None, "of the mean over pairs, printed noise", "rad/s"] = None
    sigma_filter: Annotated[float | None, "the same for the filter", "rad/s"] = None
    off_sigma: Annotated[float | None, "published less truth, in sigma"] = None
    verdict: Annotated[str, "within the noise or beyond the noise"]
    simulated: Annotated[float | None, "from pairs, in a simulated log", "rad/s"] = None
    simulated_filter: Annotated[float | None, "from the filter, the same", "rad/s"] = None
    assumed: Annotated[str | None, "assumptions: not printed by the source"] = None


@table("alignment")
class AlignmentRow(OfRecordingRow):
    recording: Annotated[str, "static recording with its noise"]
    positions: Annotated[int, "number of positions: 1, or 2 (opposite about the vertical)"]
    method: Annotated[str, "coarse or fine"]
    time: Annotated[float, "time at rest, including the turn between two positions", "s"]
    roll: Annotated[float | None, "standard deviation, level, facing north", "rad"] = None
    pitch: Annotated[float | None, "the same", "rad"] = None
    heading: Annotated[float | None, "the same; null: see reason", "rad"] = None
    reason: Annotated[str | None, "reason for a missing angle"] = None
    error_roll: Annotated[float | None, "rms error of simulated triads over roll"] = None
    error_pitch: Annotated[float | None, "the same, over pitch"] = None
    error_heading: Annotated[float | None, "the same, over heading"] = None
    simulated: Annotated[int | None, "number of triads of this check; null: none"] = None
    latitude: Annotated[float, "latitude, as set (earth_rate: latitude)", "rad"]
    gyro_bias: Annotated[float, "standard deviation of the fixed biases", "rad/s"]
    gyro_bias_from: Annotated[str, "source of this figure"]
    accelerometer_bias: Annotated[float, "standard deviation of the fixed biases", "m/s^2"]
    accelerometer_bias_from: Annotated[str, "source of this figure"]
    gyros: Annotated[tuple[str, ...], "channels whose noise the axes x, y, z have"]
    accelerometers: Annotated[tuple[str, ...], "the same"]


TURNED = (
    "earth_rate",
    "earth_rate_series",
    "turning",
    "earth_rate_prediction",
    "earth_rate_published",
)
"""The tables of gyros that were turned: only such recordings have rows."""
