"""What the noise of one sensor axis has grown to after one, two or three integrations.

The error of a channel at a time t after the start is

    e = integral of (t - s)^m / m! z(s) over s from 0 to t, less c times the estimated bias,

with m = 0 for the attitude from a gyro and the velocity from an accelerometer, m = 1 for the
velocity from a gyro and the position from an accelerometer, m = 2 for the position from a gyro,
and c = t^(m+1) / (m+1)!, what a constant error grows to. The estimated bias is the mean over a
static window of length W that ends at the start. So e weights the process by a kernel h(s): the
weights of the integration on 0..t and -c/W on -W..0, and

    sigma^2 = integral of S(f) |H(f)|^2 df over all f,

H the Fourier transform of h. The window and the motion see one process: what both see alike
cancels, and H(0) = 0. Flicker noise (1/f) and a random walk (1/f^2) have no variance, but this
integral of theirs is finite. Each term has it in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from imubench_pipeline.noise.exponentials import decay, phi, squared_response
from imubench_pipeline.noise.flicker_growth import after_window, since_switch_on
from imubench_pipeline.noise.model import (
    Flicker,
    GaussMarkov,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    Term,
    WhiteNoise,
)


@dataclass(frozen=True)
class Calibrated:
    """The bias of a sensor is its mean over a static window that ends when the motion begins.

    A gyro's mean is its bias and the Earth's rate, both of which go. An accelerometer's is its
    bias and gravity times the tilt: the two cannot be told apart at rest, and both go, be the
    mean taken for a bias or the attitude be levelled by it. The sensor has been on for some time:
    flicker noise that began with a window as long as the motion grows to 4 % less, and to 0.3 %
    less if it began as long again before.

    Parameters
    ----------
    window : float
        W, s.

    Raises
    ------
    ValueError
        If the window is not above 0.
    """

    window: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.window) and self.window > 0):
            raise ValueError(f"window is {self.window}, expected a time above 0")


@dataclass(frozen=True, kw_only=True)
class Uncalibrated:
    """The bias of a sensor is not estimated: it is the turn-on bias, and what came after it.

    Flicker noise, random walk and ramp have no level of their own; they count from switch-on,
    where they are 0. What the sensor had before is the turn-on bias. Gauss-Markov processes are
    stationary.

    Parameters
    ----------
    bias : float or None
        Turn-on bias, 1 sigma, rad/s or m/s^2; None: it is a figure of the sensor (`in_use`).
    on_time : float
        Time from switch-on to the start, s.

    Raises
    ------
    ValueError
        If one is negative or not finite.
    """

    bias: float | None
    on_time: float

    def __post_init__(self) -> None:
        for name in ("bias", "on_time"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value}, expected a number from 0")


SensorStart = Calibrated | Uncalibrated


def of_constant(order: int, time: float) -> float:
    """Return c = t^(m+1) / (m+1)!, what a constant error of 1 grows to."""
    return time ** (order + 1) / math.factorial(order + 1)


def of_white(order: int, time: float) -> float:
    """Return t^(2m+1) / ((2m+1) m!^2), the variance that white noise of N = 1 grows to."""
    return time ** (2 * order + 1) / ((2 * order + 1) * math.factorial(order) ** 2)


def of_white_mean(order: int, time: float, start: SensorStart) -> float:
    """Return c^2 / W, the variance that the mean of white noise of N = 1 grows to."""
    if isinstance(start, Uncalibrated):
        return 0.0
    return of_constant(order, time) ** 2 / start.window


def of_walk(order: int, time: float) -> float:
    """Return t^(2m+3) / ((2m+3) (m+1)!^2), the variance of a walk of K = 1 that begins at 0."""
    return of_white(order + 1, time)


def variance(term: Term, order: int, time: float, start: SensorStart) -> float:
    """Return the variance of the error that a term has grown to; the turn-on bias is apart.

    With c of `of_constant`, t the time, W the window, A the time since switch-on, and x = t/T_B,
    y = W/T_B, E_k(x) = x^k phi_k(-x) (`exponentials.phi`):

    - N: N^2 (t^(2m+1) / ((2m+1) m!^2) + c^2 / W), without the last where not calibrated;
    - Q: Q^2 ([m = 0] + (t^m/m! + c/W)^2 + (c/W)^2), without c/W where not calibrated. The
      roundings between the ends are left out: for m > 0 they add a part of about one over the
      number of samples;
    - Gauss-Markov: S_B (T_B^(2m+3) P_m(x) + c^2 T_B (P_0(y) / y^2 + (d_x - d_y)^2 / 2)), with
      P_m(x) the integral of E_{m+1}^2 from 0 to x, and d_x = (m+1)! x phi_{m+2}(-x) and
      d_y = y phi_2(-y) what is lost of the state at the start, forward and backward; where not
      calibrated S_B (T_B^(2m+3) P_m(x) + c^2 T_B (1 - d_x)^2 / 2);
    - flicker: `flicker_growth`;
    - K: K^2 (t^(2m+3) / ((2m+3) (m+1)!^2) + c^2 W/3), A in the place of W/3 where not calibrated;
    - R: R^2 (t^(m+2) / (m+2)! + c W/2)^2, A in the place of W/2; deterministic, its square;
    - a line, at a random phase: A^2 c^2 |(m+1)! phi_{m+1}(i w t) - phi_1(-i w W)|^2 / 2 with
      w = 2 pi f_0.

    Parameters
    ----------
    term : Term
    order : int
        m, 0 to 2: integrations but one.
    time : float
        t, s, above 0.
    start : Calibrated or Uncalibrated

    Returns
    -------
    float
        SI: (rad/s)^2 or (m/s^2)^2 times s^(2m+2).

    Raises
    ------
    TypeError
        If the kind of term is not known.

    References
    ----------
    IEEE Std 952-2020, for the densities. N: P. D. Groves, "Principles of GNSS, Inertial,
    and Multisensor Integrated Navigation Systems", 2nd ed., 2013. The others follow
    from S(f) |H(f)|^2, Parseval's theorem and the state equation of each process.
    """
    match term:
        case WhiteNoise(N):
            return N**2 * (of_white(order, time) + of_white_mean(order, time, start))
        case Quantization(Q):
            return Q**2 * _of_roundings(order, time, start)
        case GaussMarkov():
            return term.density * _of_gauss_markov(order, time, term.T_B, start)
        case Flicker(B):
            scale = B**2 * time ** (2 * order + 2)
            if isinstance(start, Calibrated):
                return scale * after_window(order, start.window / time)
            return scale * since_switch_on(order, start.on_time / time)
        case RandomWalk(K):
            lag = start.window / 3.0 if isinstance(start, Calibrated) else start.on_time
            return K**2 * (of_walk(order, time) + of_constant(order, time) ** 2 * lag)
        case Ramp(R):
            lag = start.window / 2.0 if isinstance(start, Calibrated) else start.on_time
            rise = of_constant(order + 1, time) + of_constant(order, time) * lag
            return (R * rise) ** 2
        case Sinusoid(amplitude, frequency):
            gain = _of_line(order, time, 2.0 * math.pi * frequency, start)
            return 0.5 * (amplitude * gain) ** 2
    raise TypeError(f"the growth of {term} is not known")


def mean_variance(term: Term, time: float, on_time: float) -> float:
    """Return the variance of the mean of a term over a window.

    Parameters
    ----------
    term : Term
    time : float
        Length of the window, s.
    on_time : float
        Time from switch-on to the beginning of the window, s (see `Uncalibrated`).

    Returns
    -------
    float
        (rad/s)^2 or (m/s^2)^2.
    """
    return variance(term, 0, time, Uncalibrated(bias=0.0, on_time=on_time)) / time**2


def _of_roundings(order: int, time: float, start: SensorStart) -> float:
    """Return the variance of the roundings at the ends of window and motion, for Q = 1."""
    # The rounding at the start ends the window and begins the motion.
    first = time**order / math.factorial(order)
    last = 1.0 if order == 0 else 0.0
    mean = of_constant(order, time) / start.window if isinstance(start, Calibrated) else 0.0
    return last + (first + mean) ** 2 + mean**2


def _of_gauss_markov(order: int, time: float, T_B: float, start: SensorStart) -> float:
    x = time / T_B
    constant = of_constant(order, time)
    driven = time ** (2 * order + 3) * squared_response(order, x)
    if isinstance(start, Uncalibrated):
        kept = math.factorial(order + 1) * decay(order + 1, x)
        return driven + (constant * kept) ** 2 * T_B / 2.0
    y = start.window / T_B
    # Differences from 1 of what is kept: the difference of the two itself would cancel for
    # long T_B.
    lost = math.factorial(order + 1) * x * decay(order + 2, x) - y * decay(2, y)
    in_window = start.window * squared_response(0, y)
    return driven + constant**2 * (in_window + T_B * lost**2 / 2.0)


def _of_line(order: int, time: float, omega: float, start: SensorStart) -> float:
    constant, x = of_constant(order, time), omega * time
    factorial = math.factorial(order + 1)
    if isinstance(start, Uncalibrated):
        return constant * abs(factorial * phi(order + 1, 1j * x))
    y = omega * start.window
    # Both less 1, see `_of_gauss_markov`.
    return constant * abs(factorial * 1j * x * phi(order + 2, 1j * x) + 1j * y * phi(2, -1j * y))
