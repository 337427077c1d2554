"""Collect the properties of recordings, other than their errors, that verdicts depend on."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.estimates import BacktestRow, ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, RecordingRow
from imubench_pipeline.model.table import OfRecordingRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.recordings.fitness import list_excluded
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.keys import group_rows

Key = tuple[str, str]  # sensor, recording


@dataclass(frozen=True)
class Basis:
    """The properties of the recordings of a run, by sensor and name."""

    recordings: Mapping[Key, RecordingRow] = field(default_factory=dict)
    doubts: Mapping[Key, Sequence[DoubtRow]] = field(default_factory=dict)
    # analysed channels, and whether any noise parameter has a value
    channels: Mapping[Key, Mapping[str, bool]] = field(default_factory=dict)
    # recordings that are not used in comparisons, with their doubts
    apart: Mapping[Key, tuple[DoubtMark, ...]] = field(default_factory=dict)
    # back-tests by requirement, sensor, recording, channel, error and time
    backtests: Mapping[tuple[Any, ...], BacktestRow] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        recordings: Iterable[RecordingRow] = (),
        doubts: Iterable[DoubtRow] = (),
        parameters: Iterable[ParameterRow] = (),
        backtests: Iterable[BacktestRow] = (),
    ) -> "Basis":
        """Return the basis from the rows of a run; only recommended parameters are used."""
        about = {_make_key(row): row for row in recordings}
        doubted = group_rows(doubts, _make_key)
        channels: dict[Key, dict[str, bool]] = {}
        for row in parameters:
            if row.recommended:
                of_log = channels.setdefault(_make_key(row), {})
                of_log[row.channel] = of_log.get(row.channel, False) or row.value is not None
        shown = {
            _make_backtest_key(test, test.requirement, test.channel): test for test in backtests
        }
        return cls(about, doubted, channels, list_excluded(about.values()), shown)

    def backtest(
        self, of: ErrorBudgetRow, requirement: str, channel: str | None
    ) -> BacktestRow | None:
        """Return the back-test of a channel for an error of a requirement, or None."""
        return self.backtests.get(_make_backtest_key(of, requirement, channel))

    def device(self, key: Key) -> str:
        """Return the specimen of a recording; by default each recording is its own specimen."""
        return self.recordings[key].device if key in self.recordings else key[1]

    def duration(self, key: Key) -> float | None:
        """Return the length of a recording, s; None if it is not known."""
        return self.recordings[key].duration if key in self.recordings else None

    def longest(self, rows: Iterable[OfRecordingRow]) -> float | None:
        """Return the length of the longest recording of rows, s; None if none is known."""
        durations = (self.duration(_make_key(row)) for row in rows)
        return max((duration for duration in durations if duration is not None), default=None)

    def doubted(self, key: Key) -> tuple[DoubtMark, ...]:
        """Return the doubts about a recording."""
        return self.recordings[key].doubts if key in self.recordings else ()

    def axes(self, key: Key, quantity: str) -> int | None:
        """Return the number of axes of a quantity with known noise; None without an analysis."""
        channels = self.channels.get(key)
        if channels is None:
            return None
        return sum(
            quantity_of(channel) == quantity
            for channel, with_noise in channels.items()
            if with_noise
        )

    def lacks(self, key: Key, quantity: str) -> bool:
        """Return whether an analysed recording has no axis of a quantity."""
        channels = self.channels.get(key)
        return channels is not None and quantity not in map(quantity_of, channels)

    def factors(self, key: Key) -> dict[str, float]:
        """Return the factor that corrects each quantity with a doubtful unit, on all axes."""
        factors: dict[str, float] = {}
        for row in self.doubts.get(key, ()):
            if row.factor is not None:
                # Gravity is checked over all axes together: its doubt names no channel.
                quantity = quantity_of(row.channel) if row.channel else "accel"
                factors.setdefault(quantity, row.factor)
        return factors


def _make_backtest_key(
    of: ErrorBudgetRow | BacktestRow, requirement: str, channel: str | None
) -> tuple[Any, ...]:
    return requirement, of.sensor, of.recording, channel, of.error, of.time


def _make_key(row: OfRecordingRow | RecordingRow) -> Key:
    return row.sensor, row.recording
