"""White noise as vendors and papers state it -> N.

Everything is SI: N is in rad/√s or m/s^1.5. It is two-sided, S(f) = N² at positive and negative
frequencies, so that σ²(τ) = N²/τ; the angle or velocity random walk that vendors print is N. A
one-sided density has all the power at positive frequencies, √2 N.

IEEE Std 952 and Engers (2021, eq. 6-8) give the angle random walk in °/√h as 1/60 of a figure in
°/h and Hz. The 60 is nothing but the change of units: 1 °/h/√Hz is 1/60 °/√h. What the equations
do not say is the side: they hold for a two-sided spectrum. With what vendors print, which is
one-sided, and with an analyser that shows positive frequencies only, all three give √2 times N.
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


def noise_of_density(density: float, sidedness: Sidedness) -> float:
    """Return N of an amplitude density in rad/s/√Hz or m/s²/√Hz.

    N = density, or density / √2 where it is one-sided. (Engers, eq. 7, for the ordinate of an
    FFT; as printed it holds for a two-sided one. His section 3 divides a datasheet's density by
    √500 to have the noise of a sample: it is multiplied, σ = N √rate.)
    """
    return density / math.sqrt(2.0) if sidedness == "one-sided" else density


def noise_of_power_density(density: float, sidedness: Sidedness) -> float:
    """Return N of a power spectral density in (rad/s)²/Hz or (m/s²)²/Hz.

    N = √S, or √(S/2) where it is one-sided (Engers, eq. 6, as printed for a two-sided one; the
    columns that he heads "PSD" hold amplitudes).

    Raises
    ------
    ValueError
        If the density is negative.
    """
    if density < 0:
        raise ValueError(f"a power density of {density:g}; expected 0 or more")
    return noise_of_density(math.sqrt(density), sidedness)


def noise_of_rms(rms: float, bandwidth: float, sidedness: Sidedness = "one-sided") -> float:
    """Return N of a standard deviation, rad/s or m/s², over a noise bandwidth, Hz.

    N = rms / √(2 bandwidth): a band from 0 to its end, as vendors count it, holds the power of
    both signs of frequency, rms² = 2 N² bandwidth. Engers' eq. 8 prints rms / √bandwidth, which is
    the one-sided density; it is N where the bandwidth counts both signs (``two-sided``).

    Raises
    ------
    ValueError
        If the bandwidth is not above 0.
    """
    if bandwidth <= 0:
        raise ValueError(f"a noise bandwidth of {bandwidth:g} Hz; expected one above 0")
    return noise_of_density(rms / math.sqrt(bandwidth), sidedness)


def noise_bandwidth(cut_off: float, filter_: Filter = "stated") -> float:
    """Return the noise bandwidth of a low-pass filter by its -3 dB frequency, both in Hz.

    That of the ideal filter which lets the same power of white noise through: π/2 = 1.571 times
    the -3 dB cut-off with one pole, π/(2√2) = 1.111 times with a Butterworth filter of second
    order. Bosch and TDK compute with the stated bandwidth itself, ST with half the output rate:
    ``stated``.
    """
    return cut_off * _NOISE_OVER_CUT_OFF[filter_]
