"""Codes of states and verdicts: each is one of a few values, which mypy checks.

Tables keep the codes; `imubench_pipeline.words` has the words that people read.
"""

from typing import Literal, get_args

Severity = Literal["note", "warning", "fatal"]
"""Severity of a finding; after a fatal one, the channel or recording is not analysed."""

RecordingStatus = Literal["ok", "rejected", "failed"]
FileStatus = Literal["analysed", "rejected", "failed", "skipped"]
FailureCause = Literal["error", "killed", "time"]

Fitness = Literal["fit", "fit with doubts", "unfit"]
"""Whether a recording is used in comparisons: ``unfit`` is left out."""

Status = Literal[
    "ok", "doubtful", "not_shown", "at_bound", "not_identified", "absent", "does_not_decide"
]
"""Status of an estimate; ``does_not_decide``: masked for comparisons, in no table."""

GoodnessVerdict = Literal["explained", "not explained"]
"""Whether a model explains the spectrum."""

BandSource = Literal["set", "whole", "filtered", "attenuated"]
"""Reason for the highest fitted frequency of a spectrum.

The user; nothing, the spectrum is fitted up to Nyquist, without a filter or with one; or the
attenuation by a filter.
"""

Verdict = Literal[
    "meets",
    "likely_meets",
    "meets_if",
    "not_enough_data",
    "likely_fails",
    "fails",
    "cannot_meet",
    "excluded",
]
"""Verdict on a sensor and a requirement, or on one limit of it.

A figure that is not known counts as the worst of its class. ``meets_if``: it fails so, and meets
the limit on the conditions beside it; ``cannot_meet``: it fails even with the best of its class, by
its datasheet. ``excluded``: it lacks a property that the requirement demands.
"""

SURE_PROBABILITY = 0.975
"""Minimum probability of ``meets``; 1 minus this is the maximum of ``fails``."""

Evidence = Literal["strong", "weak"]

SpreadOf = Literal["specimens", "recordings", "other sensors"]

Action = Literal[
    "check_unit", "find_figures", "add_channels", "record_again", "log_longer", "add_specimens"
]
"""Next steps, the cheapest first."""

Measured = Literal["gyro", "accel"]
"""Quantity that a sensor measures."""

MEASURED: tuple[Measured, ...] = get_args(Measured)

NoiseSource = Literal["Q", "N", "flicker", "GM", "K", "R", "line"]
"""Source of an error that is a term of the noise model (`Term.word`)."""

Cause = Literal[
    "turn_on_bias",
    "temperature",
    "temperature_squared",
    "scale_factor",
    "scale_factor_temperature",
    "nonlinearity",
    "misalignment",
    "g_sensitivity",
    "vibration_rectification",
]
"""Source of an error that is a figure of the sensor, which a static log does not show."""

SourceCode = Literal["total", NoiseSource, Cause, "initial_tilt", "initial_heading"]
"""Source of an error: noise, a figure, a stated angle, or the total of all sources."""

SourcePath = Literal["static_window", "initial_tilt", "turn"]
"""Way of a source into an error, if it is not by the motion along one axis.

White noise in the static window; levelling by the accelerometers; or a turn at speed.
"""

Origin = Literal["measured", "datasheet", "class limit", "requirement"]
"""Origin of a figure in an error budget."""

BacktestVerdict = Literal["as predicted", "more than predicted", "less than predicted"]
PoolVerdict = Literal["agree", "differ"]
DriftVerdict = Literal["changed", "as before"]
RatioVerdict = Literal["lower", "higher", "not significant", "not determined"]

FigureState = Literal["published", "derived", "not published", "not looked up"]
"""A figure of a sensor file; ``derived``: computed from another one that is published."""

Basis = Literal["printed", "logs", "simulated logs"]
"""Origin of the noise behind a verdict."""
