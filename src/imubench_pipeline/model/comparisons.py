"""Sensors compared: with their datasheets, over time, with each other and with requirements."""

from typing import Annotated

from imubench_pipeline.model import states
from imubench_pipeline.model.table import (
    CHANNEL_KEY,
    ChannelRow,
    LowerLimit,
    OfRecordingRow,
    SensorRow,
    SourceColumn,
    SourceFrequency,
    SourceQuantity,
    SourceThrough,
    SourceTime,
    TableRow,
    Unit,
    UpperLimit,
    table,
)
from imubench_pipeline.model.verdicts import Condition, DoubtMark, Share, Shortfall, UnitFactor

DoubtCodes = Annotated[tuple[str, ...], "codes of doubts about the recording (see table doubts)"]


@table("drift", key=(*CHANNEL_KEY, "parameter"))
class DriftRow(SensorRow):
    device: Annotated[str, "device with the compared recordings"]
    channel: Annotated[str, "channel, gyro_x to accel_z"]
    parameter: Annotated[str, "N, B_curve, sigma_min, K, B, T_B, Q, R, or bias: the fixed bias"]
    recording: Annotated[str, "name of the recording"]
    position: Annotated[int, "place in the order of the device's recordings, from 1"]
    started: Annotated[str | None, "date and time of the first sample, if known"] = None
    value: Annotated[float | None, "estimate of this recording", "as in unit"] = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: Unit
    expected: Annotated[
        float | None, "value expected from the earlier recordings", "as in unit"
    ] = None
    expected_lower: Annotated[
        float | None, "lower 95 % limit of the estimate expected", "as in unit"
    ] = None
    expected_upper: Annotated[
        float | None, "upper 95 % limit of the estimate expected", "as in unit"
    ] = None
    change: Annotated[float | None, "value / expected - 1; null for a bias"] = None
    p_value: Annotated[float | None, "probability of such a difference for an unchanged device"] = (
        None
    )
    verdict: Annotated[states.DriftVerdict | None, "null: cannot be judged"] = None
    reasons: Annotated[tuple[str, ...], "in words"] = ()


@table("pooled")
class PooledRow(SensorRow):
    device: Annotated[str | None, "null: all recordings of the sensor"] = None
    channel: Annotated[str, "channel, gyro_x to accel_z"]
    parameter: Annotated[str, "N, B_curve, sigma_min, K, B, T_B, Q, R, or bias: the fixed bias"]
    recordings: Annotated[int, "recordings pooled"]
    left_out: Annotated[int, "number of recordings without a value"]
    value: Annotated[float | None, "pooled estimate", "as in unit"] = None
    lower: Annotated[
        float | None, "lower 95 % limit, including the spread between recordings", "as in unit"
    ] = None
    upper: UpperLimit = None
    unit: Unit
    spread: Annotated[float | None, "standard deviation between recordings", "as in unit"] = None
    spread_lower: Annotated[float | None, "lower 95 % limit of the spread", "as in unit"] = None
    spread_upper: Annotated[float | None, "upper 95 % limit of the spread", "as in unit"] = None
    p_value: Annotated[float | None, "probability of such differences if the recordings agree"] = (
        None
    )
    verdict: Annotated[states.PoolVerdict | None, "at a level of 1 %"] = None
    reasons: Annotated[tuple[str, ...], "in words"] = ()
    doubts: Annotated[tuple[DoubtMark, ...], "methods of the pooled recordings"] = ()


@table("datasheet")
class DatasheetRow(ChannelRow):
    method: Annotated[
        str, "method of the estimate; mean: of the log; temperature: of the thermal fit"
    ]
    quantity: Annotated[str, "N, bias_instability, K, T_B, allan_deviation, offset, ..."]
    statistic: Annotated[
        str, "compared quantity: N, adev_minimum, plateau (0.664 B), K, T_B, mean, sensitivity"
    ]
    printed: Annotated[float | None, "printed value; null: see the verdict", "as in unit"] = None
    unit: Annotated[str | None, "unit as printed"] = None
    kind: Annotated[str | None, "typ, max, min, range, 1sigma or derived"] = None
    condition: Annotated[str | None, "as printed"] = None
    sidedness: Annotated[str | None, "sidedness of a noise density, as assumed in this row"] = None
    comparable: Annotated[float | None, "printed value in the convention of measured", "SI"] = None
    comparable_lower: Annotated[float | None, "smallest printed value, such as typ", "SI"] = None
    comparable_upper: Annotated[float | None, "largest printed value, such as max", "SI"] = None
    measured: Annotated[float | None, "estimate of the same quantity", "SI"] = None
    lower: Annotated[float | None, "lower 95 % limit of measured", "SI"] = None
    upper: Annotated[float | None, "upper 95 % limit of measured", "SI"] = None
    delta: Annotated[float | None, "measured / comparable - 1"] = None
    delta_lower: Annotated[float | None, "lower limit by both intervals"] = None
    delta_upper: Annotated[float | None, "upper limit by both intervals"] = None
    verdict: Annotated[str, "better than typ, as printed, worse than typ, not sure, ..."]
    reasons: Annotated[tuple[str, ...], "in words"] = ()
    doubts: DoubtCodes = ()


@table("repeatability", key=("sensor", "device", "channel"))
class RepeatabilityRow(SensorRow):
    device: Annotated[str, "device with the compared recordings"]
    channel: Annotated[str, "channel, gyro_x to accel_z"]
    recordings: Annotated[int, "number of turn-ons"]
    power_cycled: Annotated[str, "power cycle between all of them: yes or unknown"]
    printed: Annotated[float | None, "bias repeatability as printed", "as in unit"] = None
    unit: Annotated[str | None, "unit as printed"] = None
    kind: Annotated[str | None, "typ, max, min, range, 1sigma or derived"] = None
    condition: Annotated[str | None, "as printed"] = None
    comparable: Annotated[float | None, "the printed figure", "SI"] = None
    measured: Annotated[
        float | None, "standard deviation of the fixed bias between recordings", "SI"
    ] = None
    lower: Annotated[float | None, "lower 95 % limit of measured", "SI"] = None
    upper: Annotated[float | None, "upper 95 % limit of measured", "SI"] = None
    delta: Annotated[float | None, "measured / comparable - 1"] = None
    verdict: Annotated[str, "verdict, as in the table datasheet"]
    reasons: Annotated[tuple[str, ...], "explanation with the conditions"] = ()


@table("datasheet_curve")
class DatasheetCurveRow(ChannelRow):
    sidedness: Annotated[str | None, "of the noise density, as assumed in this row"] = None
    N: Annotated[
        float | None, "line N / sqrt(tau) of the datasheet", "rad/s or m/s^2 times sqrt(s)"
    ] = None
    floor: Annotated[float | None, "bias instability of the datasheet", "rad/s or m/s^2"] = None
    rms: Annotated[
        float | None, "RMS over tau of measured Allan deviation minus the lines", "rad/s or m/s^2"
    ] = None
    rms_log10: Annotated[float | None, "RMS over tau of the difference of log10", "decades"] = None


@table("error_budget")
class ErrorBudgetRow(OfRecordingRow):
    requirement: Annotated[str | None, "requirement; null: the times of the settings"] = None
    axis: Annotated[str, "worst or median axis of the sensor"]
    gyro: Annotated[str | None, "channel that answers"] = None
    accel: Annotated[str | None, "channel that answers"] = None
    error: Annotated[
        str, "error: attitude, heading, velocity, position; north: heading found at rest"
    ]
    time: Annotated[float, "time of dead reckoning; for north: time at rest", "s"]
    source: SourceColumn
    quantity: SourceQuantity = None
    through: SourceThrough = None
    T_B: SourceTime = None
    frequency: SourceFrequency = None
    sigma: Annotated[float | None, "standard deviation; null: see reasons", "as in unit"] = None
    lower: Annotated[float | None, "lower 95 % limit of a total", "as in unit"] = None
    upper: Annotated[float | None, "upper 95 % limit of a total", "as in unit"] = None
    drawn: Annotated[str | None, "whether the limits use joint draws of the parameters"] = None
    within: Annotated[float | None, "probability that the total is within the limit"] = None
    limit: Annotated[float | None, "largest permitted standard deviation", "as in unit"] = None
    unit: Unit
    reached_after: Annotated[
        float | None, "time after which the limit is reached; null: never", "s"
    ] = None
    noise: Annotated[float | None, "of a total: from noise alone", "as in unit"] = None
    likely: Annotated[
        float | None, "of a total: with the median of the class for figures not known", "as in unit"
    ] = None
    best: Annotated[
        float | None, "of a total: with the best of the class for figures not known", "as in unit"
    ] = None
    origin: Annotated[
        states.Origin | None, "origin of a source; class limit: worst figure of its class"
    ] = None
    largest: Annotated[
        float | None,
        "largest 1 sigma of a figure within the limit, SI, if its class limit is too large",
    ] = None
    reasons: Annotated[tuple[str, ...], "unknown figures"] = ()
    doubts: DoubtCodes = ()


@table("ranking")
class RankingRow(TableRow):
    requirement: Annotated[str, "requirement: file in config/requirements, without .yaml"]
    sensor: Annotated[str, "name of the sensor file"]
    rank: Annotated[int | None, "1 is the best; null: not ranked"] = None
    tied_with: Annotated[tuple[str, ...], "sensors with overlapping intervals"] = ()
    verdict: Annotated[states.Verdict, "verdict, subject to the column conditions"]
    decides: Annotated[bool, "the limit with the least margin"]
    recording: Annotated[
        str | None, "representative recording: with the error nearest to sigma"
    ] = None
    error: Annotated[str, "as in error_budget"]
    time: Annotated[float, "error as in error_budget; for an outage with trajectory", "s"]
    trajectory: Annotated[str | None, "trajectory of a GNSS outage; null: an error budget"] = None
    at_most: Annotated[float | None, "the limit as stated in the requirement", "as in unit"] = None
    confidence: Annotated[float | None, "required probability of an error within the limit"] = None
    limit: Annotated[float | None, "the limit as a standard deviation", "as in unit"] = None
    sigma: Annotated[
        float | None, "standard deviation of the error of the next unit", "as in unit"
    ] = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: Unit
    margin: Annotated[float | None, "in use: limit over sigma"] = None
    noise_margin: Annotated[float | None, "limit over the error from noise alone"] = None
    likely_margin: Annotated[
        float | None, "margin in use with the median of the class for unknown figures"
    ] = None
    chance: Annotated[
        float | None, "probability that sigma is within the limit, given logs and units"
    ] = None
    limit_verdict: Annotated[states.Verdict, "verdict on this limit alone"]
    source: Annotated[states.SourceCode | None, "the largest contribution: see parts"] = None
    share: Annotated[float | None, "share of this source in the variance"] = None
    reached_after: Annotated[float | None, "time after which the limit is reached", "s"] = None
    conditions: Annotated[
        tuple[Condition, ...], "unknown figures and properties; largest: permitted 1 sigma, SI"
    ] = ()
    shortfalls: Annotated[
        tuple[Shortfall, ...], "required properties that it lacks; has: its own value, SI"
    ] = ()
    parts: Annotated[tuple[Share, ...], "every source of 1 % of the variance or more"] = ()
    reasons: Annotated[tuple[str, ...], "unknown figures"] = ()
    doubts: Annotated[tuple[DoubtMark, ...], "doubts about the used recordings"] = ()
    left_out: Annotated[
        tuple[DoubtMark, ...], "recordings of the sensor that are not used, with reasons"
    ] = ()
    specimens: Annotated[int | None, "number of devices with data"] = None
    recordings: Annotated[int | None, "number of recordings with data"] = None
    longest_log: Annotated[float | None, "duration of the longest of these recordings", "s"] = None
    spread: Annotated[
        float | None, "standard deviation of ln sigma between specimens; null: unknown"
    ] = None
    spread_of: Annotated[states.SpreadOf | None, "compared units or recordings"] = None
    evidence: Annotated[
        states.Evidence | None, "strength of the evidence for this limit; null: there is no figure"
    ] = None
    evidence_reasons: Annotated[
        tuple[str, ...],
        "one_specimen, short_log, wide_interval, few_axes, or codes of the table doubts",
    ] = ()
    corrected_units: Annotated[tuple[UnitFactor, ...], "factors that correct doubtful units"] = ()
    corrected_verdict: Annotated[states.Verdict | None, "with these factors"] = None
    corrected_margin: Annotated[float | None, "with these factors"] = None
    corrected_reasons: Annotated[tuple[str, ...], "reason without a verdict for these factors"] = ()
    logged_verdict: Annotated[
        states.Verdict | None, "verdict with unused recordings, as logged"
    ] = None
    logged_margin: Annotated[float | None, "verdict with unused recordings, as logged"] = None
    backtest_channel: Annotated[
        str | None, "channel with the largest part of the error; null: not tested"
    ] = None
    backtest_ratio: Annotated[float | None, "observed over predicted error of this channel"] = None
    backtest_ratio_lower: Annotated[float | None, "lower end of the range for 95 % of logs"] = None
    backtest_ratio_upper: Annotated[float | None, "upper end"] = None
    backtest_windows: Annotated[int | None, "number of overlapping windows of the log"] = None


@table("next_steps")
class NextStepRow(SensorRow):
    recording: Annotated[str | None, "name of the recording; null: a new one"] = None
    requirements: Annotated[tuple[str, ...], "requirements with verdicts that it can change"]
    action: Annotated[states.Action, "what to do"]
    quantities: Annotated[tuple[str, ...], "quantities with the unit or axes concerned"] = ()
    figures: Annotated[tuple[Condition, ...], "figures to look up in datasheets"] = ()
    doubts: Annotated[tuple[DoubtMark, ...], "doubts that it removes"] = ()
    verdicts_turned: Annotated[int, "number of verdicts that it can change or settle"]
    verdicts_strengthened: Annotated[int, "number of verdicts with stronger evidence"]
    duration: Annotated[float | None, "required length of the log", "s"] = None
    logged: Annotated[float | None, "length of the present log", "s"] = None
    specimens: Annotated[int | None, "required number of further units"] = None
    text: Annotated[str, "in words"] = ""


@table("shortlist", key=("requirement", "sensor"))
class ShortlistRow(TableRow):
    requirement: Annotated[str, "requirement: file in config/requirements, without .yaml"]
    sensor: Annotated[str, "of the catalogue"]
    price_class: Annotated[str | None, "as stated"] = None
    rank: Annotated[int | None, "by the margin in use; null: not judged"] = None
    basis: Annotated[
        states.Basis, "origin of the noise: printed, or as in the table ranking (simulated) logs"
    ] = "printed"
    margin: Annotated[
        float | None, "in use: limit over error, with the worst of the class for figures not known"
    ] = None
    noise_margin: Annotated[float | None, "limit over the error from noise alone"] = None
    likely_margin: Annotated[float | None, "margin in use with the median of the class"] = None
    best_margin: Annotated[float | None, "margin in use with the best of the class"] = None
    decides: Annotated[str | None, "the limit with the smallest margin in use"] = None
    verdict: Annotated[states.Verdict, "verdict, as in the table ranking"]
    conditions: Annotated[
        tuple[Condition, ...], "unknown figures and properties; largest: permitted 1 sigma, SI"
    ] = ()
    parts: Annotated[tuple[Share, ...], "every source of 1 % of the variance or more"] = ()
    assumed: Annotated[
        tuple[str, ...], "figures that are not printed, and the class limits in their place"
    ] = ()
    shortfalls: Annotated[
        tuple[Shortfall, ...], "required properties that it lacks; has: its own value, SI"
    ] = ()
    reasons: Annotated[tuple[str, ...], "why the sensor is not judged"] = ()


CoveredFigure = Annotated[
    str, "N, B, K, T_B, or a figure of the sensor file; cross_axis: or misalignment"
]


@table("coverage")
class CoverageRow(SensorRow):
    vendor: Annotated[str, "of the sensor"]
    model: Annotated[str, "of the sensor"]
    quantity: Annotated[str, "gyro or accel"]
    figure: CoveredFigure
    published: Annotated[str, "yes, no, other convention, not looked up"]
    as_printed: Annotated[tuple[str, ...], "all printed figures"] = ()
    document: Annotated[str | None, "with its revision"] = None
    source: Annotated[str | None, "primary or secondary"] = None


@table("coverage_by_vendor")
class VendorCoverageRow(TableRow):
    vendor: Annotated[str, "of the sensors"]
    quantity: Annotated[str, "gyro or accel"]
    figure: CoveredFigure
    sensors: Annotated[int, "number of sensors of the vendor that are sold"]
    yes: Annotated[int, "number with a published figure"]
    other_convention: Annotated[int, "number with a figure in another convention"]
    no: Annotated[int, "number that were looked up, and have no such figure"]
    not_looked_up: Annotated[int, "number that were not looked up"]


@table("catalogue")
class CatalogueRow(SensorRow):
    """A row of the table ``catalogue``: a number of a datasheet, or the lack of a figure."""

    vendor: Annotated[str, "of the sensor"]
    model: Annotated[str, "of the sensor"]
    aliases: Annotated[tuple[str, ...], "products that contain it, other names"] = ()
    grade: Annotated[str | None, "consumer, industrial, tactical or navigation"] = None
    technology: Annotated[tuple[str, ...], "of gyro and accelerometer"] = ()
    quantity: Annotated[str, "gyro or accel"]
    figure: Annotated[str, "key of the sensor file, such as noise_density"]
    state: Annotated[states.FigureState, "published or not, or not looked up"]
    value: Annotated[
        float | None, "as printed; one of a choice; the lower end of a range", "as in unit"
    ] = None
    value_to: Annotated[float | None, "upper end of a range", "as in unit"] = None
    unit: Annotated[str | None, "as printed"] = None
    value_si: Annotated[float | None, "value; a density keeps its sidedness", "as in unit_si"] = (
        None
    )
    value_to_si: Annotated[float | None, "value_to", "as in unit_si"] = None
    unit_si: Annotated[str | None, "SI unit of value_si and value_to_si"] = None
    kind: Annotated[
        str | None, "typ, max, min, range, 1sigma, derived; choices: can be selected"
    ] = None
    axes: Annotated[str | None, "such as xy; null: all axes"] = None
    sidedness: Annotated[str | None, "of a noise density"] = None
    bandwidth: Annotated[str | None, "of an rms"] = None
    tau: Annotated[str | None, "averaging time of an Allan deviation"] = None
    option: Annotated[str | None, "grade, range or mode with this figure"] = None
    condition: Annotated[str | None, "as printed"] = None
    document: Annotated[str | None, "datasheet of the sensor"] = None
    revision: Annotated[str | None, "of the document"] = None
    place: Annotated[str | None, "where it was read, or sought, in the document"] = None
    evidence: Annotated[str | None, "source of the figure or of its sidedness"] = None
    source: Annotated[str | None, "primary: read in the document; or secondary"] = None
    as_printed: Annotated[str | None, "the whole figure, as a text"] = None
