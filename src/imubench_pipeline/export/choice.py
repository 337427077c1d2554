"""Choose the axis that represents a sensor: the worst, the median, or the worst of a device."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.rows import estimate_of
from imubench_pipeline.export.imu import AxisNoise, ExportError
from imubench_pipeline.export.temperature import AXES
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.words.estimates import STATUS_WORDS

Key = tuple[str, str]  # recording, channel
_Estimated = tuple[str, str, str]  # and method

WORST, MEDIAN = "worst", "median"

_MAX_NAMED_RECORDINGS = 40  # max. recordings that are named for a reason; further ones are counted


@dataclass(frozen=True)
class Choice:
    """The chosen axis, of `of` axes, and the Allan deviation of its model at the horizon, SI."""

    recording: str
    channel: str
    method: str
    axis: AxisNoise
    deviation: float
    of: int


def choose(
    rows: Iterable[ParameterRow],
    quantity: str,
    *,
    axis: str = WORST,
    horizon: float = 60.0,
    devices: Mapping[str, str] | None = None,
    method: str | None = None,
) -> Choice:
    """Choose the axis whose noise represents a quantity of a sensor.

    Axes are ordered by the Allan deviation of their model at the horizon h. Times sqrt(2) h, it is
    the standard deviation of the angle or velocity after h without a measurement, with a bias that
    was averaged over the preceding h. All parameters come from one axis.

    Parameters
    ----------
    rows : iterable of ParameterRow
        Of one sensor.
    quantity : {"gyro", "accel"}
    axis : str
        ``worst``, ``median`` (the upper median of an even number), or the name of a device or
        recording, whose worst axis is chosen.
    horizon : float
        s.
    devices : mapping of str to str, optional
        The device of each recording.
    method : str, optional
        Estimation method; the recommended one by default.

    Raises
    ------
    ExportError
        If there is no estimate of the quantity, or of the device.
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
    ranked = _rank_axes(estimated, horizon)
    if not ranked:
        raise ExportError(f"no estimate of a {quantity} with white noise")
    place = len(ranked) // 2 if axis == MEDIAN else len(ranked) - 1
    deviation, (recording, channel, used), estimate = ranked[place]
    which = f"the {MEDIAN if axis == MEDIAN else WORST} of {len(ranked)} axes"
    if len(ranked) == 1:
        which = "the only axis"
    whose = "" if axis in (WORST, MEDIAN) else f" of {axis}"
    unit = {"gyro": "rad", "accel": "m/s"}[quantity]
    error = math.sqrt(2.0) * horizon * deviation
    origin = (
        f"{channel} of recording {recording} by method {used}, {which}{whose} at {horizon:g} s "
        f"({error:.3g} {unit} there, with a bias averaged as long before)"
    )
    others: dict[str, list[Key]] = defaultdict(list)
    for key in everywhere:
        if key not in estimated:
            others["of another device"].append(key[:2])
        elif key not in (entry[1] for entry in ranked):
            others["no white noise in the model"].append(key[:2])
        elif key != (recording, channel, used):
            why = "not the median" if axis == MEDIAN else "less noise"
            others[f"{why} at {horizon:g} s"].append(key[:2])
    notes = [*_describe_other_axes(others, channel), *parameter_notes(estimate)]
    K = estimate.parameters.get("K")
    limit_of_absent_walk = K.upper if K is not None and K.in_model is None else None
    noise = AxisNoise(estimate.model, origin, notes, limit_of_absent_walk)
    return Choice(recording, channel, used, noise, deviation, len(ranked))


def _rank_axes(
    estimated: Mapping[_Estimated, Sequence[ParameterRow]], horizon: float
) -> list[tuple[float, _Estimated, Estimate]]:
    """Return the axes with white noise, sorted by their Allan deviation at the horizon."""
    ranked = []
    for key, rows in estimated.items():
        estimate = estimate_of(key[2], rows)
        if estimate.model.N > 0.0:
            deviation = float(np.sqrt(estimate.model.allan_variance(np.array([horizon]))[0]))
            ranked.append((deviation, key, estimate))
    return sorted(ranked, key=lambda entry: entry[0])


def _describe_other_axes(others: Mapping[str, Sequence[Key]], chosen: str) -> list[str]:
    """List the axes of the same quantity that were not chosen, by reason."""
    quantity, _ = chosen.split("_")
    statements = []
    for why, keys in others.items():
        of: dict[str, list[str]] = defaultdict(list)
        for recording, channel in keys:
            of[recording].append(channel)
        named = [f"{' and '.join(channels)} of {recording}" for recording, channels in of.items()]
        more = len(named) - _MAX_NAMED_RECORDINGS
        statements.append(
            f"axes left out, {why}: {'; '.join(named[:_MAX_NAMED_RECORDINGS])}"
            + (f"; and those of {more} more recordings" if more > 0 else "")
        )
    channels = {chosen, *(channel for keys in others.values() for _, channel in keys)}
    without = [name for axis in AXES if (name := f"{quantity}_{axis}") not in channels]
    if without:
        statements.append(f"axes left out, no recording has an estimate: {' and '.join(without)}")
    return statements


def parameter_notes(estimate: Estimate) -> list[str]:
    """Describe the treatment of the parameters without a plain value."""
    notes = []
    for number, name, parameter in estimate.components():
        label = name if number == 1 else f"{name} of component {number}"
        reason = f" ({parameter.reason})" if parameter.reason else ""
        status = STATUS_WORDS[parameter.status]
        lower, upper = parameter.lower, parameter.upper
        between = ""
        if lower is not None and upper is not None:
            between = f", 95 % limits {lower:.3e} to {upper:.3e}"
        if parameter.status == "at_bound":
            value = f"{parameter.value:.4e} is used{between}"
            notes.append(f"{label} is at the end of its search{reason}: {value}")
        elif parameter.value is not None:
            continue
        elif parameter.fitted is not None:
            value = f"the fitted {parameter.fitted:.3e} is used{between}"
            notes.append(f"{label} is {status}{reason}: {value}")
        elif upper is not None:
            limit = f"0 in the model; its upper limit is {upper:.3e}"
            notes.append(f"{label} is {status}{reason}: {limit}")
    return notes
