"""Choose the axis that represents a sensor: the worst, the median, or the worst of a device."""

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from imubench_pipeline.estimators.estimate import CURVE, Estimate
from imubench_pipeline.estimators.rows import make_estimate
from imubench_pipeline.extensions.exports import reasons as texts
from imubench_pipeline.extensions.exports.imu import AXES, AxisNoise, ExportError
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import join_names

_Estimated = tuple[str, str, str]  # recording, channel, method
_Ranked = tuple[float, _Estimated, Estimate]  # by the Allan deviation at the horizon

WORST, MEDIAN = "worst", "median"

_SLOW_PARAMETERS = ("B", "K", "R")
_MAX_NAMED_RECORDINGS = 40  # max. recordings that are named for a reason; further ones are counted


@dataclass(frozen=True)
class Choice:
    """The axis that represents a sensor, with its noise."""

    recording: str
    channel: str
    method: str
    axis: AxisNoise
    determined: bool = True  # whether a slow term has a value; else it is only limited from above
    each: Mapping[str, "Choice"] = field(default_factory=dict)
    """For each of x, y and z with an estimate: the choice among the estimates of this axis."""


def choose(
    rows: Iterable[ParameterRow],
    quantity: str,
    *,
    axis: str = WORST,
    horizon: float = 60.0,
    devices: Mapping[str, str] | None = None,
    method: str | None = None,
) -> Choice:
    """Choose the axis whose noise represents ``gyro`` or ``accel`` of a sensor.

    Axes are ordered by the Allan deviation of their model at the horizon h, s. Times sqrt(2) h, it
    is the standard deviation of the angle or velocity after h without a measurement, with a bias
    that was averaged over the preceding h. All parameters come from one axis. ``each`` of the
    result has x, y and z chosen in the same way, each among its own estimates.

    ``axis`` is ``worst``, ``median`` (the upper median of an even number), or the name of a device
    or recording, whose worst axis is chosen. ``devices`` has the device of each recording.
    ``method`` is an estimation method; the recommended one by default. Raises ExportError if there
    is no estimate of the quantity, or of the device.
    """
    everywhere: dict[_Estimated, list[ParameterRow]] = defaultdict(list)
    for row in rows:
        wanted = row.recommended if method is None else row.method == method
        if wanted and row.channel.startswith(f"{quantity}_"):
            everywhere[row.recording, row.channel, row.method].append(row)
    estimated = everywhere
    if axis not in (WORST, MEDIAN):
        device = {recording: recording for recording, _, _ in everywhere} | dict(devices or {})
        estimated = {
            key: part for key, part in everywhere.items() if axis in (key[0], device[key[0]])
        }
        if everywhere and not estimated:
            present = sorted({device[recording] for recording, _, _ in everywhere})
            raise ExportError(f"no {quantity} of device {axis!r}; there are: {', '.join(present)}")
    # The axes with white noise, sorted by their Allan deviation at the horizon.
    ranked: list[_Ranked] = []
    for key, part in estimated.items():
        estimate = make_estimate(key[2], part)
        if estimate.model.N > 0.0:
            deviation = float(np.sqrt(estimate.model.allan_variance(np.array([horizon]))[0]))
            ranked.append((deviation, key, estimate))
    ranked.sort(key=lambda entry: entry[0])
    if not ranked:
        raise ExportError(f"no {quantity} estimate has white noise; use another log or method")
    whose = "" if axis in (WORST, MEDIAN) else axis
    names = [f"{quantity}_{letter}" for letter in AXES]

    def take(channels: Sequence[str], noun: str) -> Choice:
        """Return the worst or median estimate of channels."""
        of = [entry for entry in ranked if entry[1][1] in channels]
        deviation, key, estimate = of[len(of) // 2 if axis == MEDIAN else -1]
        rank = texts.axis_rank(len(of), MEDIAN if axis == MEDIAN else WORST, whose, noun)
        unit = {"gyro": "rad", "accel": "m/s"}[quantity]
        error = math.sqrt(2.0) * horizon * deviation
        origin = texts.chosen_axis(key[1], key[0], key[2], rank, horizon, error, unit)
        determined = any(
            parameter.value is not None
            for _, name, parameter in estimate.components()
            if name in _SLOW_PARAMETERS
        )
        # Channels of the other estimates, by reason and recording.
        others: dict[texts.OtherAxes, dict[str, list[str]]]
        others = defaultdict(lambda: defaultdict(list))
        for other in everywhere:
            if other[1] not in channels or other == key:
                continue
            why: texts.OtherAxes = "not_median" if axis == MEDIAN else "less_noise"
            if other not in estimated:
                why = "other_device"
            elif other not in (entry[1] for entry in ranked):
                why = "no_white_noise"
            others[why][other[0]].append(other[1])
        notes = [
            texts.axes_not_used(why, horizon, of_recordings, _MAX_NAMED_RECORDINGS)
            for why, of_recordings in others.items()
        ]
        notes += parameter_notes(estimate, determined)
        return Choice(*key, AxisNoise(estimate.model, origin, notes), determined)

    each = {
        name[-1]: take([name], "estimate")
        for name in names
        if any(entry[1][1] == name for entry in ranked)
    }
    without = [channel_name(name) for name in names if all(key[1] != name for key in everywhere)]
    missing = [f"axes without an estimate: {join_names(without)}"] if without else []
    chosen = take(names, "axis")
    noise = replace(chosen.axis, notes=[*missing, *chosen.axis.notes])
    return replace(chosen, axis=noise, each=each)


def pool_recordings(
    rows: Iterable[ParameterRow], choice: Choice, method: str | None = None
) -> Choice:
    """Replace the model of the chosen channel by its mean spectrum over all recordings.

    All ``rows`` are of one device; ``method`` as for `choose`. N^2, K^2 and B^2 are averaged.
    """
    parts: dict[str, list[ParameterRow]] = defaultdict(list)
    for row in rows:
        wanted = row.recommended if method is None else row.method == method
        if wanted and row.channel == choice.channel:
            parts[row.recording].append(row)
    models = {name: make_estimate(choice.method, part).model for name, part in parts.items()}
    models = {name: model for name, model in models.items() if model.N > 0.0}
    if len(models) < 2:
        return choice
    own = models.values()
    share = 1.0 / math.sqrt(len(models))
    slow = [
        term.scaled(share) for model in own for term in model.terms if term.gauss_markov is not None
    ]
    pooled = NoiseModel(
        **{name: math.hypot(*(getattr(model, name) for model in own)) * share for name in "QNKR"},
        B=math.hypot(*(model.B for model in own if model.T_B is None)) * share,
        further=slow,
        sinusoids=choice.axis.model.sinusoids,
    )
    origin = f"{choice.axis.origin}. In its place: {texts.pooled(choice.channel, [*models])}"
    estimated = make_estimate(choice.method, parts[choice.recording])
    single = parameter_notes(estimated, choice.determined)  # values of one recording
    notes = [note for note in choice.axis.notes if note not in single]
    axis = replace(choice.axis, model=pooled, origin=origin, notes=notes)
    return replace(choice, axis=axis, determined=True)


def parameter_notes(estimate: Estimate, determined: bool = True) -> list[str]:
    """Return a note on each parameter at a bound or without a value: which value or limit is used.

    ``determined``: whether a slow term has a value; else the slow terms are not used.
    """
    notes = []
    for number, name, parameter in estimate.components():
        if name in CURVE or not (determined or name not in _SLOW_PARAMETERS):
            continue
        label = name if number == 1 else f"{name} of component {number}"
        status, reason = parameter.status, parameter.reason
        lower, upper = parameter.lower, parameter.upper
        limits = ""
        if lower is not None and upper is not None:
            limits = f", with 95 % limits of {lower:.3e} to {upper:.3e}"
        why = texts.status_reason(label, status, reason)
        if parameter.value is not None:
            if status == "at_bound":
                because = f" ({reason})" if reason else ""
                notes.append(
                    f"{label} is at the end of its search{because}. Its value of "
                    f"{parameter.value:.4e} is used{limits}"
                )
        elif parameter.fitted is not None:
            notes.append(f"{why}. The fitted {parameter.fitted:.3e} is used{limits}")
        elif upper is not None:
            notes.append(f"{why}. It is 0 in this file, and its upper limit is {upper:.3e}")
    return notes
