"""Convert white noise, as vendors and papers state it, to N.

N, SI, is two-sided: S(f) = N² at positive and negative frequencies, and σ²(τ) = N²/τ. It is the
angle or velocity random walk that vendors print. A one-sided density is √2 N. IEEE Std 952 and
Engers (2021, eq. 6-8) give the random walk in °/√h as 1/60 of a two-sided density in °/h/√Hz; the
60 only changes the unit.
"""

from __future__ import annotations

import math
from typing import Literal

Sidedness = Literal["one-sided", "two-sided"]
Filter = Literal["stated", "first-order", "second-order"]

_NOISE_OVER_CUT_OFF: dict[Filter, float] = {
    "stated": 1.0,
    "first-order": math.pi / 2.0,
    "second-order": math.pi / (2.0 * math.sqrt(2.0)),
}


def convert_density(density: float, sidedness: Sidedness) -> float:
    """Return N of an amplitude density in rad/s/√Hz or m/s²/√Hz.

    N = density, or density / √2 if it is one-sided (Engers, eq. 7, two-sided as printed).
    """
    return density / math.sqrt(2.0) if sidedness == "one-sided" else density


def convert_power_density(density: float, sidedness: Sidedness) -> float:
    """Return N of a power spectral density, 0 or more, in (rad/s)²/Hz or (m/s²)²/Hz.

    N = √S, or √(S/2) if it is one-sided (Engers, eq. 6, two-sided as printed).
    """
    if density < 0:
        raise ValueError(f"a power density of {density:g}; expected 0 or more")
    return convert_density(math.sqrt(density), sidedness)


def noise_of_rms(rms: float, bandwidth: float, sidedness: Sidedness = "one-sided") -> float:
    """Return N of a standard deviation, rad/s or m/s², over a noise bandwidth above 0, Hz.

    N = rms / √(2 bandwidth): a band from 0, as vendors count it, has the power of both signs of
    frequency. It is rms / √bandwidth (Engers, eq. 8) if the bandwidth counts both (``two-sided``).
    """
    if bandwidth <= 0:
        raise ValueError(f"a noise bandwidth of {bandwidth:g} Hz; expected one above 0")
    return convert_density(rms / math.sqrt(bandwidth), sidedness)


def compute_noise_bandwidth(cut_off: float, filter_: Filter = "stated") -> float:
    """Return the noise bandwidth of a low-pass filter by its -3 dB frequency, both in Hz.

    It is π/2 times the cut-off with one pole, π/(2√2) times with a Butterworth filter of second
    order. ``stated``: it is the bandwidth itself, as Bosch, TDK and ST compute.
    """
    return cut_off * _NOISE_OVER_CUT_OFF[filter_]
