"""The fixed bias of a device from one turn-on to the next, against the printed repeatability."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict

from imubench_pipeline.datasheets.comparable import repeatability_comparables
from imubench_pipeline.datasheets.deltas import compare
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.navigation.pooled import turn_on_bias
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.typing import Row

_OF_REPEATABILITY = (
    *("printed", "unit", "kind", "condition", "comparable"),
    *("measured", "lower", "upper", "delta", "verdict", "reason"),
)


def repeatability_rows(
    biases: Iterable[Row],
    recordings: Iterable[Row],
    sensors: Mapping[str, Sensor],
    tolerance: float,
) -> Iterator[Row]:
    """Yield the rows of the table ``repeatability``: biases of a device against what is printed.

    A printed repeatability is the spread of the bias from one turn-on to the next. A recording
    before which the power stayed on is of the turn-on of the one before, and does not count; nor do
    rows of the table ``recordings`` that do not decide. The biases are rows of ``fixed_bias``; the
    tolerance is the relative difference that still counts as printed.
    """
    about = {(row["sensor"], row["recording"]): row for row in recordings if row["decides"]}
    by_channel: dict[tuple[str, str, str], list[tuple[Row, float]]] = {}
    for bias in biases:
        row = about.get((bias["sensor"], bias["recording"]))
        if row is not None and row.get("power_cycled") is not False:
            key = (bias["sensor"], row["device"], bias["channel"])
            by_channel.setdefault(key, []).append((row, bias["value"]))
    for (sensor, device, channel), several in by_channel.items():
        if sensor not in sensors or len(several) < 2:
            continue
        # The first recording of a device has none before it.
        unknown = sum(row.get("power_cycled") is None for row, _ in several) > 1
        spread = _spread(channel, [value for _, value in several], unknown)
        for entry in repeatability_comparables(sensors[sensor].datasheet, channel):
            delta = asdict(compare(entry, spread, tolerance))
            if delta["delta"] is None and spread.reason and entry.value is not None:
                delta["reason"] = spread.reason
            yield {name: delta[name] for name in _OF_REPEATABILITY} | {
                "sensor": sensor,
                "device": device,
                "channel": channel,
                "recordings": len(several),
                "power_cycled": "unknown" if unknown else "yes",
            }


def _spread(channel: str, values: Sequence[float], unknown: bool) -> Parameter:
    """Return the standard deviation between turn-ons, with its conditions."""
    if channel.startswith("accel"):
        reason = "gravity is in the mean: how the sensor lay each time would be in the spread"
        return Parameter(None, "not_shown", reason)
    conditions = [
        "the sensor pointed the same way each time, and the Earth's rate is no part of it"
    ]
    if unknown:
        conditions.insert(
            0,
            "the power was off between the recordings, which is not known (power_cycled beside "
            "the log)",
        )
    bias = turn_on_bias(values)
    return Parameter(
        bias.deviation,
        "ok",
        f"on condition that {', and that '.join(conditions)}",
        bias.deviation_lower,
        bias.deviation_upper,
    )
