"""What is known of the recordings that a verdict stands on, beside their errors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from imubench_pipeline.recordings.fitness import left_out
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.typing import Row

Key = tuple[str, str]  # sensor, recording

_BACKTEST = ("requirement", "sensor", "recording", "channel", "error", "time")
"""What names a row of the table ``backtest``."""


@dataclass(frozen=True)
class Basis:
    """The recordings of a run, by sensor and name."""

    # the row of the table ``recordings``
    recordings: Mapping[Key, Row] = field(default_factory=dict)
    # the rows of the table ``doubts``
    doubts: Mapping[Key, Sequence[Row]] = field(default_factory=dict)
    # the channels that were analysed, and whether anything is known of their noise
    channels: Mapping[Key, Mapping[str, bool]] = field(default_factory=dict)
    # why a recording does not decide, of those that do not
    apart: Mapping[Key, str] = field(default_factory=dict)
    # what the logs themselves show, by what names the rows of the table ``backtest``
    backtests: Mapping[tuple[Any, ...], Row] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        recordings: Iterable[Row] = (),
        doubts: Iterable[Row] = (),
        parameters: Iterable[Row] = (),
        backtests: Iterable[Row] = (),
    ) -> Basis:
        """Return it from rows of these tables; of parameters the recommended ones count."""
        about = {_key(row): row for row in recordings}
        doubted: dict[Key, list[Row]] = {}
        for row in doubts:
            doubted.setdefault(_key(row), []).append(row)
        channels: dict[Key, dict[str, bool]] = {}
        for row in parameters:
            if row["recommended"]:
                of_log = channels.setdefault(_key(row), {})
                of_log[row["channel"]] = of_log.get(row["channel"], False) or (
                    row["value"] is not None
                )
        shown = {_backtested(row): row for row in backtests}
        return cls(about, doubted, channels, left_out(about.values()), shown)

    def backtest(self, of: Row) -> Row:
        """Return what the log of a channel shows of an error of a requirement; else nothing."""
        return self.backtests.get(_backtested(of), {})

    def device(self, key: Key) -> str:
        """Return the specimen: by default each recording is one of its own."""
        row = self.recordings.get(key)
        return str(row["device"]) if row else key[1]

    def duration(self, key: Key) -> float | None:
        """Return the length of a recording, s; None where it is not known."""
        row = self.recordings.get(key)
        return row["duration"] if row else None

    def longest(self, rows: Iterable[Row]) -> float | None:
        """Return the length of the longest recording of rows, s; None where none is known."""
        durations = (self.duration(_key(row)) for row in rows)
        return max((duration for duration in durations if duration is not None), default=None)

    def simulated(self, key: Key) -> bool:
        """Tell whether a recording is simulated."""
        row = self.recordings.get(key)
        return bool(row and row["simulated"])

    def doubted(self, key: Key) -> str:
        """Return the doubts of a recording in words; empty where there are none."""
        row = self.recordings.get(key)
        return (row["doubts"] or "") if row else ""

    def axes(self, key: Key, quantity: str) -> int | None:
        """Return of how many axes of a quantity the noise is known; None: nobody says."""
        channels = self.channels.get(key)
        if channels is None:
            return None
        return sum(
            quantity_of(channel) == quantity
            for channel, with_noise in channels.items()
            if with_noise
        )

    def lacks(self, key: Key, quantity: str) -> bool:
        """Tell whether a recording has no axis of a quantity."""
        channels = self.channels.get(key)
        return channels is not None and quantity not in map(quantity_of, channels)

    def factors(self, key: Key) -> dict[str, float]:
        """Return by what a unit that may be mixed up multiplies a quantity that is mended.

        A log has one unit for all axes of a quantity, so that a doubt of one axis is one of all.
        """
        factors: dict[str, float] = {}
        for row in self.doubts.get(key, ()):
            if row["factor"] is not None:
                # Gravity is told by all axes together: its doubt names no channel.
                quantity = quantity_of(row["channel"]) if row["channel"] else "accel"
                factors.setdefault(quantity, row["factor"])
        return factors


def _backtested(row: Row) -> tuple[Any, ...]:
    return tuple(row[name] for name in _BACKTEST)


def _key(row: Row) -> Key:
    return row["sensor"], row["recording"]
