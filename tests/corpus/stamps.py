"""Time: stamps that repeat, jump, run backwards, are rounded or in another unit."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from tests.corpus.entry import Entry, Rejected, file, kept
from tests.corpus.signals import (
    EPOCH,
    RATE,
    ROWS,
    STAMPED,
    TIME,
    TWO,
    UNSTAMPED,
    Array,
    log,
    rest,
    text,
)

T = rest()["t"]
COUNTER = {"column": "t", "unit": "samples", "wraps": 65536}
ISO = {"column": "t", "format": "iso8601"}


def timed(**time: Any) -> dict[str, Any]:
    """Return a log format with another time."""
    return {"channels": TWO, "time": TIME | time}


def written(stamps: list[str]) -> str:
    """Return the log with these stamps."""
    lines = text({name: rest()[name] for name in ("wx", "az")}).splitlines()
    return "".join(f"{t},{line}\n" for t, line in zip(["t", *stamps], lines, strict=True))


def iso(row: int) -> str:
    return (
        datetime(2024, 2, 28, 23, 59, 55, tzinfo=UTC) + timedelta(seconds=row / RATE)
    ).isoformat(timespec="milliseconds")


def without(*rows: int) -> str:
    """Return the log without some records."""
    return text({name: np.delete(column, rows) for name, column in rest().items()})


def with_stamps(places: Array | slice, stamps: Array | float) -> str:
    """Return the log with other stamps at some records."""
    t = T.copy()
    t[places] = stamps
    return log(t=t)


ENTRIES = [
    Entry(
        "time of the epoch in ms",
        file(lambda: log(t=1e3 * EPOCH + 10 * np.arange(ROWS))),
        timed(unit="ms"),
        kept(ROWS),
    ),
    Entry(
        "time in ISO 8601",
        file(lambda: written([iso(row) for row in range(ROWS)])),
        STAMPED | {"time": ISO},
        kept(ROWS),
    ),
    Entry(
        "time in ns of the epoch",
        file(lambda: written([str(EPOCH * 10**9 + 10**7 * row) for row in range(ROWS)])),
        timed(unit="ns"),
        kept(ROWS),
    ),
    Entry(
        "time in another unit than stated",
        file(lambda: log(t=1e3 * T)),
        STAMPED | {"rate": "100 Hz"},
        Rejected("the rate is 0.1 Hz by the stamps, but 100 Hz as stated"),
    ),
    Entry(
        "time at another rate than stated",
        file(log),
        STAMPED | {"rate": "104 Hz"},
        kept(ROWS, "rate_contradicts_stamps"),
    ),
    Entry(
        "time that is reversed", file(lambda: log(t=T[::-1])), STAMPED, Rejected("do not advance")
    ),
    Entry(
        "time that stands still",
        file(lambda: log(t=np.full(ROWS, 7.0))),
        STAMPED,
        Rejected("do not advance"),
    ),
    Entry(
        "time with missing records",
        file(lambda: without(*range(300, 310), 700)),
        STAMPED,
        kept(ROWS - 11, "missing_samples"),
    ),
    Entry(
        "time with a long gap",
        file(lambda: with_stamps(slice(600, None), T[600:] + 7200)),
        STAMPED,
        kept(ROWS, "segments"),
    ),
    Entry(
        "time that jumps back",
        file(lambda: with_stamps(slice(600, None), T[600:] - 5)),
        STAMPED,
        kept(ROWS, "segments"),
    ),
    Entry(
        "time that jumps by decades",
        file(lambda: with_stamps(slice(600, None), T[600:] + EPOCH)),
        STAMPED,
        kept(ROWS, "segments"),
    ),
    Entry(
        "time with one stamp astray",
        file(lambda: with_stamps(slice(600, 601), 1e9)),
        STAMPED,
        kept(ROWS, "missing_stamps"),
    ),
    Entry(
        "time with a stamp of 1e300",
        file(lambda: with_stamps(slice(600, 601), 1e300)),
        STAMPED,
        kept(ROWS, "missing_stamps"),
    ),
    Entry(
        "time with repeated stamps",
        file(lambda: with_stamps(slice(600, 605), T[600])),
        STAMPED,
        kept(ROWS - 4, "repeated_stamps", "missing_samples"),
    ),
    Entry(
        "time with repeated records",
        file(
            lambda: "".join(
                line * (1 + (n == 600)) for n, line in enumerate(log().splitlines(True))
            )
        ),
        STAMPED,
        kept(ROWS, "repeated_stamps"),
    ),
    Entry(
        "time in whole seconds",
        file(lambda: log(t=np.floor(T))),
        STAMPED,
        kept(ROWS, "jittered_stamps"),
    ),
    Entry(
        "time with jitter",
        file(lambda: log(t=T + 2e-2 * np.random.default_rng(2).random(ROWS))),
        STAMPED,
        kept(ROWS, "jittered_stamps"),
    ),
    Entry(
        "time without some stamps",
        file(lambda: with_stamps(slice(600, 603), np.nan)),
        STAMPED,
        kept(ROWS, "missing_stamps"),
    ),
    Entry(
        "time without stamps",
        file(lambda: with_stamps(slice(None), np.nan)),
        STAMPED,
        Rejected("no time stamp in the first 1000 records"),
    ),
    Entry(
        "counter that wraps",
        file(lambda: log(t=(np.arange(ROWS) + 65_000.0) % 65_536)),
        UNSTAMPED | {"time": COUNTER},
        kept(ROWS),
    ),
    Entry(
        "counter that wraps unsaid",
        file(lambda: log(t=(np.arange(ROWS) + 65_000.0) % 65_536)),
        UNSTAMPED | {"time": {"column": "t", "unit": "samples"}},
        kept(ROWS, "segments"),
    ),
    Entry(
        "counter that wraps with losses",
        file(
            lambda: text(
                {
                    name: np.delete(column, range(500, 540))
                    for name, column in (
                        rest() | {"t": (np.arange(ROWS) + 65_000.0) % 65_536}
                    ).items()
                }
            )
        ),
        UNSTAMPED | {"time": COUNTER},
        kept(ROWS - 40, "missing_samples"),
    ),
    Entry(
        "time of day over midnight",
        file(lambda: written([iso(row)[11:23] for row in range(ROWS)])),
        timed(unit=None, format="%H:%M:%S.%f"),
        kept(ROWS),
    ),
    Entry(
        "time of a day that is none",
        file(lambda: written(["2024-02-30T10:00:00"] * ROWS)),
        STAMPED | {"time": ISO},
        Rejected(r"log\.csv, line 2, column 't': found '2024-02-30T10:00:00'"),
    ),
]
