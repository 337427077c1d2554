"""Rows of the estimates of a recording: curves, spectra, parameters and models."""

from typing import Annotated

import pyarrow as pa

from imubench_pipeline.model.states import BacktestVerdict, GoodnessVerdict
from imubench_pipeline.model.table import (
    CHANNEL_KEY,
    ChannelRow,
    Estimate,
    EstimateReason,
    EstimateStatus,
    EstimateUnit,
    FittedValue,
    LowerLimit,
    OfRecordingRow,
    SourceColumn,
    SourceFrequency,
    SourceQuantity,
    SourceThrough,
    SourceTime,
    Unit,
    UpperLimit,
    table,
)

_Degrees = Annotated[float | None, "equivalent degrees of freedom of the Allan variance"]
_UpperDegrees = Annotated[
    float | None, "degrees of freedom of the upper 95 % limit: more where few clusters remain"
]
_DegreesSource = Annotated[
    str, "basis of the degrees of freedom: fitted spectrum, or power law at this tau"
]


@table("allan", key=(*CHANNEL_KEY, "tau"))
class AllanRow(ChannelRow):
    tau: Annotated[float, "cluster length, cluster_size / rate", "s"]
    cluster_size: Annotated[int, "samples in a cluster"]
    adev: Annotated[float, "Allan deviation", "rad/s or m/s^2"]
    lower: Annotated[float | None, "lower 95 % limit", "rad/s or m/s^2"] = None
    upper: Annotated[float | None, "upper 95 % limit", "rad/s or m/s^2"] = None
    edf: _Degrees = None
    edf_upper: _UpperDegrees = None
    edf_source: _DegreesSource
    averaged: Annotated[
        float | None,
        "average number of samples present in a cluster, below its size if samples are missing",
    ] = None
    exponent: Annotated[
        int | None, "noise type: 0 white, -1 flicker, -2 random walk, 1 and 2 phase noise"
    ] = None
    share: Annotated[
        float | None, "fraction of the differences that is left by missing samples"
    ] = None


@table("parameters", key=(*CHANNEL_KEY, "method", "parameter", "component"))
class ParameterRow(ChannelRow):
    method: Annotated[str, "estimation method"]
    recommended: Annotated[bool, "the method to use for this channel"]
    model: Annotated[str, "the terms of the model, such as N+GM+K"]
    component: Annotated[int, "number of a repeated term, from 1"]
    parameter: Annotated[
        str,
        "Q, N, B, T_B, K, R; N_sensor (white density before a low-pass or an interpolation "
        "that shows); amplitude and frequency of a line; of the curve of the model: B_curve "
        "(bias instability of the curve: highest Allan deviation of all F and GM terms over "
        "0.664), sigma_min and tau_min (lowest point up to 1/6 of the log by robust, else 1/9)",
    ]
    value: Estimate = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: EstimateUnit
    status: EstimateStatus
    reason: EstimateReason = None
    duration_needed: Annotated[
        float | None, "length of a log that determines the value to 10 %", "s"
    ] = None
    fitted: FittedValue = None


@table("models", key=(*CHANNEL_KEY, "model"))
class ModelRow(ChannelRow):
    model: Annotated[str, "the terms: Q, N, F (flicker), GM, K, R"]
    chosen: Annotated[bool, "the model of method likelihood: the lowest BIC"]
    free: Annotated[int, "free parameters"]
    log_likelihood: Annotated[float, "up to a constant of the channel"]
    bic: Annotated[float, "-2 log likelihood + free log(bins); + 4: GM for K, + 6: Q, R"]
    aic: Annotated[float, "-2 log likelihood + 2 free"]
    weight: Annotated[float, "information weight of the model among the candidates, by BIC"]
    deviance: Annotated[float | None, "mean deviance of a bin; about 1 for a correct model"] = None
    chance: Annotated[float | None, "probability of so poor a fit for a correct model"] = None
    verdict: Annotated[GoodnessVerdict, "whether the model explains the spectrum"]
    note: Annotated[str | None, "frequency of the largest deviation"] = None
    bins: Annotated[int, "bins of the spectrum used"]
    band: Annotated[float | None, "highest frequency used", "Hz"] = None
    band_source: Annotated[str | None, "method of detection"] = None


@table("lines")
class LineRow(ChannelRow):
    kind: Annotated[str, "sinusoid; band of noise; alias of a faster line in block means"]
    frequency: Annotated[float, "of the line", "Hz"]
    frequency_lower: Annotated[float | None, "lower 95 % limit", "Hz"] = None
    frequency_upper: Annotated[float | None, "upper 95 % limit", "Hz"] = None
    amplitude: Annotated[float, "of the sinusoid", "rad/s or m/s^2"]
    amplitude_lower: Annotated[float | None, "lower 95 % limit", "rad/s or m/s^2"] = None
    amplitude_upper: Annotated[float | None, "upper 95 % limit", "rad/s or m/s^2"] = None
    ratio: Annotated[float | None, "ratio of the highest density to the noise"] = None
    false_alarm: Annotated[
        float | None, "probability of such a line in a channel without lines"
    ] = None
    width: Annotated[float | None, "width of the line", "Hz"] = None


@table("envelope")
class EnvelopeRow(ChannelRow):
    start: Annotated[float, "start of a part of the log, from the first sample", "s"]
    end: Annotated[float, "its end", "s"]
    low: Annotated[float | None, "least sample; degC for temperature", "SI"] = None
    high: Annotated[float | None, "largest sample", "SI"] = None
    mean: Annotated[float | None, "mean of the samples", "SI"] = None
    samples: Annotated[int, "samples present"]


@table("samples_of_models")
class ModelSampleRow(ChannelRow):
    of: Annotated[str, "log; before: model read from the curve; after: model of the estimate"]
    what: Annotated[str, "deviation of all samples; stretch: each sample; envelope: over time"]
    start: Annotated[float, "from the first sample", "s"]
    end: Annotated[float, "its end", "s"]
    low: Annotated[float | None, "of an envelope: least sample", "SI"] = None
    high: Annotated[float | None, "largest sample", "SI"] = None
    mean: Annotated[float | None, "mean of the samples, the sample, or the deviation", "SI"] = None


@table("histogram")
class HistogramRow(ChannelRow):
    lower: Annotated[float, "lower edge of the bin", "SI"]
    upper: Annotated[float, "upper edge of the bin", "SI"]
    count: Annotated[int, "samples in it"]


@table("spectrum", key=(*CHANNEL_KEY, "frequency"))
class SpectrumRow(ChannelRow):
    frequency: Annotated[float, "mean of the bin", "Hz"]
    lower: Annotated[float, "lower end of the bin", "Hz"]
    upper: Annotated[float, "upper end of the bin", "Hz"]
    ordinates: Annotated[float, "degrees of freedom of the bin"]
    density: Annotated[float, "measured, two-sided", "(rad/s)^2/Hz or (m/s^2)^2/Hz"]
    fitted: Annotated[float | None, "of the chosen model", "(rad/s)^2/Hz or (m/s^2)^2/Hz"] = None
    used: Annotated[bool, "whether the bin is in the fitted band and without lines"]


@table("fixed_bias", key=CHANNEL_KEY)
class FixedBiasRow(ChannelRow):
    value: Annotated[float, "mean of the samples", "as in unit"]
    unit: Annotated[str, "SI unit of value"]


@table("temperature", key=(*CHANNEL_KEY, "parameter"))
class TemperatureRow(ChannelRow):
    compensated: Annotated[
        bool, "whether the effect is removed from the noise (method compensated)"
    ]
    parameter: Annotated[str, "T_0 (mean temperature), sensitivity, quadratic, lag, bias (at T_0)"]
    value: Estimate = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: EstimateUnit
    status: EstimateStatus
    reason: EstimateReason = None
    fitted: FittedValue = None


@table("allan_compensated", key=(*CHANNEL_KEY, "tau"))
class CompensatedAllanRow(ChannelRow):
    tau: Annotated[float, "cluster length", "s"]
    adev: Annotated[
        float, "Allan deviation of the log without the temperature effect", "rad/s or m/s^2"
    ]
    lower: Annotated[float | None, "lower 95 % limit", "rad/s or m/s^2"] = None
    upper: Annotated[float | None, "upper 95 % limit", "rad/s or m/s^2"] = None
    edf: _Degrees = None
    edf_upper: _UpperDegrees = None
    edf_source: _DegreesSource
    temperature: Annotated[float, "Allan deviation of the temperature effect", "rad/s or m/s^2"]


@table("low_pass", key=(*CHANNEL_KEY, "parameter"))
class LowPassRow(ChannelRow):
    kind: Annotated[str | None, "analogue, bilinear or boxcar; null: none is visible"] = None
    order: Annotated[
        int | None, "order of the filter: 1, or of a Butterworth; null: no filter found"
    ] = None
    parameter: Annotated[str, "cutoff (-3 dB), floor (white noise that does not pass the filter)"]
    value: Estimate = None
    lower: LowerLimit = None
    upper: UpperLimit = None
    unit: EstimateUnit
    status: EstimateStatus
    reason: EstimateReason = None
    fitted: FittedValue = None


@table("reconstruction", key=(*CHANNEL_KEY, "method", "tau"))
class ReconstructionRow(ChannelRow):
    method: Annotated[str, "estimation method"]
    tau: Annotated[float, "cluster length", "s"]
    adev: Annotated[float, "median of the ensemble of simulated logs", "rad/s or m/s^2"]
    lower: Annotated[float, "lower 95 % limit of the ensemble", "rad/s or m/s^2"]
    upper: Annotated[float, "upper 95 % limit of the ensemble", "rad/s or m/s^2"]
    reconstructed: Annotated[
        float, "Allan deviation of the full-length simulated log", "rad/s or m/s^2"
    ]


@table("scores", key=(*CHANNEL_KEY, "method"))
class ScoreRow(ChannelRow):
    method: Annotated[str, "estimation method"]
    rms: Annotated[
        float | None,
        "RMS over tau of model minus measured Allan deviation, weighted by the precision at "
        "each tau",
        "rad/s or m/s^2",
    ] = None
    rms_log10: Annotated[float | None, "the same for the difference of log10", "decades"] = None
    drawn: Annotated[
        float | None,
        "rms of one simulated log instead of the model: median of many",
        "rad/s or m/s^2",
    ] = None
    drawn_lower: Annotated[
        float | None, "lower end of the range of 90 % of them", "rad/s or m/s^2"
    ] = None
    drawn_upper: Annotated[float | None, "upper end", "rad/s or m/s^2"] = None
    drawn_log10: Annotated[
        float | None, "rms_log10 of one simulated log: median of many", "decades"
    ] = None
    drawn_log10_lower: Annotated[
        float | None, "lower end of the range of 90 % of them", "decades"
    ] = None
    drawn_log10_upper: Annotated[float | None, "upper end", "decades"] = None
    whole: Annotated[
        float | None,
        "RMS of one simulated log with equal weights: median of many",
        "rad/s or m/s^2",
    ] = None
    whole_lower: Annotated[
        float | None, "lower end of the range of 90 % of them", "rad/s or m/s^2"
    ] = None
    whole_upper: Annotated[float | None, "upper end", "rad/s or m/s^2"] = None
    beats: Annotated[
        float | None,
        "probability that a log simulated from it has a lower RMS with equal weights than a "
        "log of the recommended method: 0.5 for the same model",
    ] = None
    inside_band: Annotated[float | None, "share of the measured curve inside the 95 % band"] = None
    reason: Annotated[str | None, "reason for a missing score"] = None


@table("simulated_truth", key=(*CHANNEL_KEY, "parameter", "component"))
class SimulatedTruthRow(ChannelRow):
    parameter: Annotated[str, "as in parameters, temperature and low_pass; bias"]
    component: Annotated[int, "number of a repeated term, from 1"]
    value: Annotated[float, "true value of the simulation", "as in unit"]
    unit: Annotated[str, "SI unit of value"]
    assumed: Annotated[bool, "assumed, not published by the source"]
    source: Annotated[str, "where the parameters are published"]


@table("backtest")
class BacktestRow(ChannelRow):
    requirement: Annotated[str, "requirement with this limit"]
    error: Annotated[str, "attitude, heading, velocity or position: the part from this channel"]
    time: Annotated[float, "of dead reckoning", "s"]
    window: Annotated[float | None, "window at rest before it, whose mean is the bias", "s"] = None
    windows: Annotated[int | None, "number of overlapping windows of the log without gaps"] = None
    independent: Annotated[float | None, "equivalent number of independent windows"] = None
    measured: Annotated[
        float | None, "rms error over the windows of the log as recorded", "as in unit"
    ] = None
    predicted: Annotated[
        float | None, "standard deviation by the noise model of the channel", "as in unit"
    ] = None
    predicted_lower: Annotated[float | None, "lower 95 % limit from drawn models", "as in unit"] = (
        None
    )
    predicted_upper: UpperLimit = None
    ratio: Annotated[float | None, "measured over predicted"] = None
    ratio_lower: Annotated[
        float | None, "lower end of the range for 95 % of logs, the model right"
    ] = None
    ratio_upper: Annotated[float | None, "upper end"] = None
    chance: Annotated[float | None, "probability of at least this ratio for a correct model"] = None
    verdict: Annotated[BacktestVerdict | None, "verdict; null: not tested"] = None
    contradicted: Annotated[
        bool | None,
        "at least 1.1 times the prediction, significant at 1 % over all rows of the recording",
    ] = None
    unit: Unit
    taken_out: Annotated[
        tuple[str, ...], "in the log, not in the model: kinds of deterministic"
    ] = ()
    duration_needed: Annotated[float | None, "length of a log that this test requires", "s"] = None
    reason: Annotated[str | None, "reason without a test"] = None


@table("drawn_deviations")
class DrawnDeviationRow(ChannelRow):
    tau: Annotated[float, "averaging time", "s"]
    draw: Annotated[
        int | None, "rank of a drawn noise model, the lowest first; null: the estimate itself"
    ] = None
    adev: Annotated[float, "Allan deviation of the noise model", "rad/s or m/s^2"]
    unknown: Annotated[tuple[str, ...], "parameters that matter and are not determined"] = ()


@table("deterministic")
class DeterministicRow(ChannelRow):
    kind: Annotated[str, "bias_step, warm_up_drift or periodic_drift: removed from the noise"]
    start: Annotated[float, "start of the part with the signal, from the first sample", "s"]
    end: Annotated[float, "end of this part; for a step both are its position", "s"]
    size: Annotated[float, "size of a step, of a warm-up at its start, or amplitude", "as in unit"]
    size_lower: LowerLimit = None
    size_upper: UpperLimit = None
    unit: Annotated[str, "SI unit of the sizes"]
    time: Annotated[float | None, "time constant of a warm-up, period of periodic drift", "s"] = (
        None
    )
    time_lower: Annotated[float | None, "lower 95 % limit", "s"] = None
    time_upper: Annotated[float | None, "upper 95 % limit", "s"] = None
    place_error: Annotated[
        float | None, "half width of the 95 % interval of the position of a step", "s"
    ] = None
    gain: Annotated[float | None, "twice the loss of log likelihood without it"] = None


@table("draws")
class DrawRow(ChannelRow):
    method: Annotated[str, "estimation method: robust, likelihood, likelihood_gm or compensated"]
    draw: Annotated[int, "number of the draw, from 0: a noise model that the log allows"]
    component: Annotated[int, "number of a repeated term, from 1"]
    Q: Annotated[
        float | None, "quantization noise; null: the model has none", "rad or m/s", pa.float32()
    ] = None
    N: Annotated[
        float | None,
        "white noise; null: it has none",
        "rad/s/sqrt(Hz) or m/s^2/sqrt(Hz)",
        pa.float32(),
    ] = None
    B: Annotated[
        float | None, "bias instability; null: it has none", "rad/s or m/s^2", pa.float32()
    ] = None
    T_B: Annotated[
        float | None, "correlation time; null where B is flicker noise", "s", pa.float32()
    ] = None
    K: Annotated[
        float | None,
        "random walk; null: it has none",
        "rad/s/sqrt(s) or m/s^2/sqrt(s)",
        pa.float32(),
    ] = None
    R: Annotated[float | None, "ramp; null: it has none", "rad/s^2 or m/s^3", pa.float32()] = None


@table("error_growth")
class ErrorGrowthRow(OfRecordingRow):
    axis: Annotated[str, "worst of all axes, or x, y or z alone if there are several"]
    gyro: Annotated[str, "channel that answers"]
    accel: Annotated[str | None, "channel that answers"] = None
    window: Annotated[float, "window at rest before it, for the estimation of biases and tilt", "s"]
    error: Annotated[str, "attitude, heading, velocity or position"]
    time: Annotated[float, "of dead reckoning", "s"]
    source: SourceColumn
    quantity: SourceQuantity = None
    through: SourceThrough = None
    T_B: SourceTime = None
    frequency: SourceFrequency = None
    sigma: Annotated[float, "standard deviation", "as in unit"]
    lower: Annotated[float | None, "lower 95 % limit of a total", "as in unit"] = None
    upper: Annotated[float | None, "upper 95 % limit of a total", "as in unit"] = None
    unit: Unit
