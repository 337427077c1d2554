"""White noise as vendors and papers state it -> N; what a quantisation step makes of it.

Everything is SI. N is two-sided, S(f) = N² at positive and negative frequencies, so that
σ²(τ) = N²/τ; the angle or velocity random walk that vendors print is N. A one-sided density has
all the power at positive frequencies, √2 N.

IEEE Std 952 and Engers (2021, eq. 6-8) give the angle random walk in °/√h as 1/60 of a figure in
°/h and Hz. The 60 is nothing but the change of units: 1 °/h/√Hz is 1/60 °/√h. What the equations
do not say is the side: they hold for a two-sided spectrum. With what vendors print, which is
one-sided, and with an analyser that shows positive frequencies only, all three give √2 times N.
"""

from __future__ import annotations

import math
from typing import Literal

from imubench_pipeline.units import dimension_of, to_si

Sidedness = Literal["one-sided", "two-sided"]
Filter = Literal["stated", "first-order", "second-order"]

_NOISE_OVER_CUT_OFF: dict[Filter, float] = {
    "stated": 1.0,
    "first-order": math.pi / 2.0,
    "second-order": math.pi / (2.0 * math.sqrt(2.0)),
}
_AGREEMENT = 0.05
"""Relative difference of two printed figures that rounding explains."""


def noise_of_density(density: float, sidedness: Sidedness) -> float:
    """Return N of an amplitude density.

    N = density, or density / √2 where it is one-sided. (Engers, eq. 7, for the ordinate of an
    FFT; as printed it holds for a two-sided one. His section 3 divides a datasheet's density by
    √500 to have the noise of a sample: it is multiplied, see `noise_of_a_sample`.)

    Parameters
    ----------
    density : float
        rad/s/√Hz or m/s²/√Hz.
    sidedness : str
        ``one-sided`` or ``two-sided``.

    Returns
    -------
    float
        N, rad/√s or m/s^1.5.
    """
    return density / math.sqrt(2.0) if sidedness == "one-sided" else density


def noise_of_power_density(density: float, sidedness: Sidedness) -> float:
    """Return N of a power spectral density.

    N = √S, or √(S/2) where it is one-sided (Engers, eq. 6, as printed for a two-sided one; the
    columns that he heads "PSD" hold amplitudes).

    Parameters
    ----------
    density : float
        (rad/s)²/Hz or (m/s²)²/Hz.
    sidedness : str
        ``one-sided`` or ``two-sided``.

    Returns
    -------
    float
        N, rad/√s or m/s^1.5.

    Raises
    ------
    ValueError
        If the density is negative.
    """
    if density < 0:
        raise ValueError(f"a power density of {density:g}; expected 0 or more")
    return noise_of_density(math.sqrt(density), sidedness)


def noise_of_rms(rms: float, bandwidth: float, sidedness: Sidedness = "one-sided") -> float:
    """Return N of a standard deviation over a noise bandwidth.

    N = rms / √(2 bandwidth): a band from 0 to its end holds the power of both signs of
    frequency, rms² = 2 N² bandwidth. Engers' eq. 8 prints rms / √bandwidth, which is the
    one-sided density; it is N where the bandwidth counts both signs (``two-sided``).

    Parameters
    ----------
    rms : float
        rad/s or m/s².
    bandwidth : float
        Noise bandwidth, Hz (see `noise_bandwidth`).
    sidedness : str
        ``one-sided``: the bandwidth is counted from 0, as vendors do.

    Returns
    -------
    float
        N, rad/√s or m/s^1.5.

    Raises
    ------
    ValueError
        If the bandwidth is not above 0.
    """
    if bandwidth <= 0:
        raise ValueError(f"a noise bandwidth of {bandwidth:g} Hz; expected one above 0")
    return noise_of_density(rms / math.sqrt(bandwidth), sidedness)


def rms_of_noise(N: float, bandwidth: float) -> float:
    """Return the standard deviation of white noise over a noise bandwidth from 0, in Hz."""
    return N * math.sqrt(2.0 * bandwidth)


def noise_bandwidth(cut_off: float, filter_: Filter = "stated") -> float:
    """Return the noise bandwidth of a low-pass filter.

    That of the ideal filter which lets the same power of white noise through: π/2 = 1.571 times
    the -3 dB cut-off with one pole, π/(2√2) = 1.111 times with a Butterworth filter of second
    order. Bosch and TDK compute with the stated bandwidth itself, ST with half the output rate:
    ``stated``.

    Parameters
    ----------
    cut_off : float
        -3 dB frequency, Hz.
    filter_ : str
        ``stated``, ``first-order`` or ``second-order``.

    Returns
    -------
    float
        Hz.
    """
    return cut_off * _NOISE_OVER_CUT_OFF[filter_]


def noise_at(deviation: float, tau: float) -> float:
    """Return N of an ordinate of the falling line: N = σ(τ) √τ.

    Parameters
    ----------
    deviation : float
        Allan deviation on the line of slope -1/2, rad/s or m/s².
    tau : float
        Where it is read, s. Engers reads it at one hour and prints it as a density: his figures
        are N / 60.

    Returns
    -------
    float
        N, rad/√s or m/s^1.5.
    """
    return deviation * math.sqrt(tau)


def noise_of_a_sample(N: float, rate: float) -> float:
    """Return the standard deviation that white noise gives each sample: N √rate.

    Parameters
    ----------
    N : float
        rad/√s or m/s^1.5.
    rate : float
        Sampling rate, Hz; the noise is taken to be white up to half of it.

    Returns
    -------
    float
        rad/s or m/s².
    """
    return N * math.sqrt(rate)


def quantisation_step(value: float, unit: str, quantity: str) -> float:
    """Return the step of one count.

    Parameters
    ----------
    value : float
        As printed: a step (mdps/LSB), a sensitivity (LSB/g), or a plain unit that is meant by the
        count (deg/s*2^-12).
    unit : str
    quantity : str
        ``gyro`` or ``accel``.

    Returns
    -------
    float
        rad/s or m/s² by count.

    Raises
    ------
    UnitError
        If the unit is none of these.
    ValueError
        If the value is not above 0.
    """
    if value <= 0:
        raise ValueError(f"a sensitivity of {value:g} {unit}; expected one above 0")
    plain = "angular_rate" if quantity == "gyro" else "acceleration"
    sensitivity = f"{quantity}_sensitivity"
    dimension = dimension_of(unit, (f"{quantity}_step", sensitivity, plain))
    found = to_si(value, unit, dimension)
    return 1.0 / found if dimension == sensitivity else found


def noise_of_step(step: float, rate: float) -> float:
    """Return N of rounding each sample to a step, where the noise spans several steps.

    The error of a sample has the variance step²/12 and is white: N = step / √(12 rate).

    Parameters
    ----------
    step : float
        rad/s or m/s².
    rate : float
        Sampling rate, Hz.

    Returns
    -------
    float
        N, rad/√s or m/s^1.5.
    """
    return step / math.sqrt(12.0 * rate)


def quantization_of_step(step: float, rate: float) -> float:
    """Return Q of a sensor that integrates and rounds its increments: Q = step / (rate √12).

    This is the noise of slope -1 of IEEE Std 952, and not that of a register of rate or
    acceleration, whose rounding is white (`noise_of_step`).

    Parameters
    ----------
    step : float
        Of the increments, as rate or acceleration: increment times rate, rad/s or m/s².
    rate : float
        Of the increments, Hz.

    Returns
    -------
    float
        Q, rad or m/s.
    """
    return step / (rate * math.sqrt(12.0))


def sidedness_of(density: float, N: float) -> Sidedness | None:
    """Return the side of a printed density that a printed random walk, or rms, gives away.

    Parameters
    ----------
    density : float
        Amplitude density as printed, rad/s/√Hz or m/s²/√Hz.
    N : float
        Angle or velocity random walk as printed beside it, or `noise_of_rms`, in SI.

    Returns
    -------
    str or None
        None: the two fit neither reading to 5 %.
    """
    for sidedness in ("one-sided", "two-sided"):
        if abs(noise_of_density(density, sidedness) / N - 1.0) <= _AGREEMENT:
            return sidedness
    return None
