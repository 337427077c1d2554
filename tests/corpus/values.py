"""Samples: what a sensor or its logger does to them, in logs that can be read."""

from __future__ import annotations

import numpy as np

from tests.corpus.entry import Entry, Rejected, file, kept
from tests.corpus.signals import GRAVITY, LONG, ROWS, STAMPED, Array, log, rest, text

LONGEST = 60_000
NOISE = rest(LONG)["wx"]


def gyro(values: Array) -> str:
    """Return the log with another gyro."""
    return log(len(values), wx=values)


def from_middle(values: Array) -> Array:
    """Return the gyro with these added from the middle of the log on."""
    changed = NOISE.copy()
    changed[LONG // 2 : LONG // 2 + len(values)] += values
    return changed


def three(scale: float) -> dict[str, Array]:
    """Return the log of an accelerometer of three axes."""
    columns = rest()
    noise = np.random.default_rng(1).standard_normal((2, ROWS))
    for axis, values in zip("xy", noise, strict=True):
        columns[f"a{axis}"] = np.round(scale * 1e-2 * values, 7)
    columns["az"] = np.round(scale * columns["az"], 7)
    return columns


AXES = {f"accel_{axis}": {"column": f"a{axis}", "unit": "m/s^2"} for axis in "xyz"}

ENTRIES = [
    Entry(
        "axis that is stuck",
        file(lambda: log(wx=np.full(ROWS, 0.25))),
        STAMPED,
        kept(ROWS, "stuck"),
    ),
    Entry(
        "every axis stuck",
        file(lambda: log(wx=np.zeros(ROWS), az=np.ones(ROWS))),
        STAMPED,
        Rejected("no channel can be used: gyro x never changes.*accel z never changes"),
    ),
    Entry(
        "axis that is stuck for a while",
        file(lambda: gyro(from_middle(-NOISE[LONG // 2 : LONG // 2 + 500]))),
        STAMPED,
        kept(LONG, "stuck_for_a_while"),
    ),
    Entry(
        "axis without a number",
        file(lambda: log(wx=np.full(ROWS, np.nan))),
        STAMPED,
        kept(ROWS, "no_samples", "empty_cells"),
    ),
    Entry(
        "axis that is saturated",
        file(lambda: gyro(np.clip(NOISE, -1, 1.5e-3))),
        STAMPED,
        kept(LONG, "saturated"),
    ),
    Entry(
        "axis in coarse steps",
        file(lambda: gyro(np.round(NOISE / 2e-3) * 2e-3)),
        STAMPED,
        kept(LONG, "coarse"),
    ),
    Entry(
        "axis in steps of one sigma",
        file(lambda: gyro(np.round(NOISE / 1e-3) * 1e-3)),
        STAMPED,
        kept(LONG, "quantised"),
    ),
    Entry(
        "axis in visible steps",
        file(lambda: gyro(np.round(NOISE / 1e-4) * 1e-4)),
        STAMPED,
        kept(LONG, "quantised"),
    ),
    Entry(
        "axis that is repeated",
        file(lambda: gyro(np.repeat(NOISE[::2], 2))),
        STAMPED,
        kept(LONG, "repeated_samples"),
    ),
    Entry(
        "log with knocks",
        file(lambda: gyro(from_middle(np.array([0.1, -0.2, 0.1])))),
        STAMPED,
        kept(LONG, "knocks"),
    ),
    Entry(
        "log with a billion in a cell",
        file(lambda: gyro(from_middle(np.array([1e9])))),
        STAMPED,
        kept(LONG, "knocks"),
    ),
    Entry(
        "log with 1e300 in a cell",
        file(lambda: gyro(from_middle(np.array([1e300])))),
        STAMPED,
        kept(LONG, "not_finite"),
    ),
    Entry(
        "log with 1e25 and -1e25 in cells",
        file(lambda: gyro(from_middle(np.array([1e25, -1e25])))),
        STAMPED,
        kept(LONG, "knocks"),
    ),
    Entry(
        "log of a sensor that was moved",
        file(lambda: gyro(from_middle(np.full(LONG // 2, 0.05)))),
        STAMPED,
        kept(LONG, "step"),
    ),
    Entry(
        "log of a sensor that was shaken",
        file(lambda: gyro(from_middle(0.02 * np.sin(np.arange(1500.0))))),
        STAMPED,
        kept(LONG, "motion"),
    ),
    Entry(
        "log of a sensor that warms up",
        file(lambda: gyro(rest(LONGEST)["wx"] + 4e-3 * np.exp(-np.arange(LONGEST) / 8000))),
        STAMPED,
        kept(LONGEST, "warm_up"),
    ),
    Entry(
        "log that becomes noisy",
        file(lambda: gyro(rest(LONGEST)["wx"] * np.linspace(1, 3, LONGEST))),
        STAMPED,
        kept(LONGEST, "not_stationary"),
    ),
    Entry(
        "acceleration in g that is said to be m s-2",
        file(lambda: text(three(1 / GRAVITY))),
        STAMPED | {"channels": AXES},
        kept(ROWS, "suspicious_unit"),
    ),
    Entry(
        "acceleration without gravity",
        file(lambda: text(three(1.0) | {"az": three(1.0)["ax"][::-1]})),
        STAMPED | {"channels": AXES},
        kept(ROWS, "gravity_norm"),
    ),
    Entry(
        "gyro in degrees that is said to be radians",
        file(lambda: gyro(np.degrees(NOISE) * 3)),
        STAMPED,
        kept(LONG, "suspicious_unit"),
    ),
    Entry("gyro that turns", file(lambda: gyro(NOISE + 2)), STAMPED, kept(LONG, "turning")),
    Entry(
        "log of 99 samples",
        file(lambda: log(99)),
        STAMPED,
        Rejected("gyro x has 99 samples; at least 100 are required"),
    ),
]
