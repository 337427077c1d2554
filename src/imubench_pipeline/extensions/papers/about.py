"""The papers, and the terms of their claims, for the display of the table ``published``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Basis = Literal["come back", "simulated", "computed", "checked"]
"""Basis of a result; `BASES` describes it."""

BASES: dict[Basis, str] = {
    "come back": "the log is simulated from this very figure: it comes back, which says that the "
    "estimate works, and nothing of the sensor",
    "simulated": "found in logs that are simulated from other figures of the paper",
    "computed": "follows from printed figures alone: by a formula, or by many simulated draws of "
    "them, but without the log of a run",
    "checked": "an equation, held against independent truth",
}

Verdict = Literal[
    "agrees", "differs", "possible", "refuted", "misprint", "done here", "not to be had"
]

VERDICTS: dict[Verdict, str] = {
    "agrees": "within the tolerance of the line, which the table published has, or inside the "
    "interval of what is found; of words, they say the same",
    "differs": "what is found is another number, or says another thing, for the reason beside it",
    "possible": "may be so: what is printed neither proves it nor rules it out",
    "refuted": "cannot be so, by what is printed or what follows from it",
    "misprint": "as printed it cannot be right, and what is meant is known",
    "done here": "left for later there: what is found here has nothing to be held against",
    "not to be had": "it takes the authors' own logs, or a run with the demonstration",
}


@dataclass(frozen=True)
class Drawn:
    """A curve that corresponds to figures of a paper."""

    figures: str  # of the paper
    sensor: str
    recording: str
    channel: str
    methods: str  # methods with a curve, in addition to the curve of the log


@dataclass(frozen=True, kw_only=True)
class About:
    """A paper."""

    key: str  # "maia"
    name: str  # "Maia et al."
    title: str  # subject of the paper
    # sensor and recording of the logs that stand for its own; a run that has none leaves it out
    logs: tuple[tuple[str, str], ...]
    # sentences: what is assumed, whose input comes back, what is typed by hand
    declared: tuple[str, ...]
    drawn: tuple[Drawn, ...] = ()


MAIA = About(
    key="maia",
    name="Maia et al.",
    title="the Allan variance of an MTi-7 and a C102-F9R",
    logs=(("mti_7", "sim_published"), ("c102_f9r", "sim_published")),
    declared=(
        "The length of the logs is not printed: 10 h are assumed, the least that the paper "
        "recommends.",
        "The logs are simulated from Table 2, so the ratios to Table 2 say how well an estimate "
        "finds what was put in, and nothing of the sensors.",
        "At which τ Table 3 compares two curves is not printed. Two grids are shown: nine τ a "
        "decade up to half of the log, as the program that the paper names plots them, and every n "
        "of its equation 10.",
        "Tables 1, 3 and 4 are typed from the paper; the curves of its figures are not in its "
        "text, so that figures are compared by the curves of the printed parameters.",
    ),
    drawn=tuple(
        Drawn(figures, sensor, "sim_published", channel, "authors paper")
        for figures, sensor, channel in (
            ("Figure 2", "c102_f9r", "accel_x"),
            ("Figures 3 and 8", "mti_7", "accel_x"),
            ("Figure 4", "c102_f9r", "gyro_x"),
            ("Figures 5 and 9", "mti_7", "gyro_x"),
        )
    ),
)

SILVA = About(
    key="silva",
    name="Silva et al.",
    title="a SiRRS01-03, and the Earth’s rotation",
    logs=(
        ("sirrs01_03", "sim_published"),
        *(("sirrs01_03", f"sim_run_{number}") for number in (1, 2, 3, 4)),
        ("sirrs01_03_triad", "sim_aligned"),
    ),
    declared=(
        "The latitude is not printed, nor how long a turn takes, nor the bias: −23.3° (Londrina, "
        "where the authors work), 2 s of each 30 s and 0.05 °/s are assumed.",
        "The log at rest was a week long; here 48 h at the full rate are simulated, and, where the "
        "length is what matters (K, T_B by reading), 20 weeks at 1 Hz.",
        "All logs are simulated from the four numbers of section 5.1: what is found of N, B, K and "
        "T_B is the input come back. The estimates of section 6 are typed from the paper, and held "
        "against what the noise of those four numbers allows.",
        "The curves of the figures are not in the text: figures are compared by what is said of "
        "them.",
    ),
)

ENGERS = About(
    key="engers",
    name="Engers",
    title="three MEMS gyros on one board",
    logs=tuple((sensor, "sim_engers") for sensor in ("scc2130", "mpu9250", "bno055")),
    declared=(
        "He published no log: all are simulated from his Tables 2 to 7, so the ratios to these are "
        "the simulator’s own input come back. T_B, K, the temperature and the noise of the BNO055 "
        "that he could not simulate are assumed; so are the sensitivities, as in datasheets.",
        "The tables are typed from the text, in which the figures are not: figures are compared by "
        "what is said of them, and by their counterparts here.",
        "Before the fit is what the curve of the simulated log reads, where he put his tables into "
        "his simulator; after it, the estimate, where he turned gains by hand until the curves "
        "looked alike.",
        "That N is 60 times what Tables 5 to 7 print under PSD is a reading of section 3.8.1, with "
        "a line for and against it for each axis.",
    ),
)

PAPERS = (MAIA, SILVA, ENGERS)
"""In the order in which they are shown."""
