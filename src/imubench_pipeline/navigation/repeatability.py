"""Compare the turn-on to turn-on spread of the fixed bias with the printed repeatability."""

from collections.abc import Iterable, Iterator, Mapping

from imubench_pipeline.datasheets.comparable import Comparable, PrintedAxis
from imubench_pipeline.datasheets.deltas import compare
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.model.comparisons import RepeatabilityRow
from imubench_pipeline.model.estimates import FixedBiasRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.pooled import estimate_turn_on_bias
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.words.reasons import pools as texts


def repeatability_rows(
    biases: Iterable[FixedBiasRow],
    recordings: Iterable[RecordingRow],
    sensors: Mapping[str, Sensor],
    tolerance: float,
) -> Iterator[RepeatabilityRow]:
    """Yield the rows of the table ``repeatability``: bias spread and printed repeatability.

    A recording is omitted if it is not used in comparisons, or if the power stayed on before it,
    since it belongs to the previous turn-on. ``tolerance`` is the largest relative difference that
    has the verdict ``as printed``.
    """
    about = {(row.sensor, row.recording): row for row in recordings if row.decides}
    by_channel: dict[tuple[str, str, str], list[tuple[RecordingRow, float]]] = {}
    for mean in biases:
        row = about.get((mean.sensor, mean.recording))
        if row is not None and row.power_cycled is not False:
            key = (mean.sensor, row.device, mean.channel)
            by_channel.setdefault(key, []).append((row, mean.value))
    for (sensor, device, channel), several in by_channel.items():
        if sensor not in sensors or len(several) < 2:
            continue
        # The first recording of a device has no previous one: its flag does not matter.
        unknown = sum(row.power_cycled is None for row, _ in several) > 1
        if channel.startswith("accel"):
            assumptions = [texts.GRAVITY_IN_MEAN]
            spread = Parameter(None, "not_shown")
        else:
            assumptions = [texts.SAME_HEADING_ASSUMED]
            if unknown:
                assumptions.append(texts.POWER_CYCLES_ASSUMED)
            bias = estimate_turn_on_bias(value for _, value in several)
            spread = Parameter(bias.spread, "ok", None, bias.spread_lower, bias.spread_upper)
        axis, name = PrintedAxis.of(sensors[sensor].datasheet, channel), "bias_repeatability"
        for entry in axis.read(name, Comparable(name, "spread", None), axis.si(name)):
            found = compare(entry, spread, tolerance)
            reasons = found.reasons
            if entry.value is not None:
                reasons = (*(reasons if found.delta is not None else ()), *assumptions)
            yield RepeatabilityRow.taken_from(
                found,
                sensor=sensor,
                device=device,
                channel=channel,
                recordings=len(several),
                power_cycled="unknown" if unknown else "yes",
                reasons=reasons,
            )
