"""Growth of the noise of one sensor axis through one, two or three integrations.

The error of a channel at a time t after the start is

    e = integral of (t - s)^m / m! z(s) over s from 0 to t, less c times the estimated bias,

with c = t^(m+1) / (m+1)! and m = 0 for the attitude from a gyro and the velocity from an
accelerometer, 1 for the next integrals, 2 for the position from a gyro. The estimated bias is the
mean over a static window of length W that ends at the start. sigma^2 is the integral of S(f)
|H(f)|^2 over all f, with H the Fourier transform of the weights of z: the weights of integration on
0..t and -c/W on -W..0. H(0) = 0, so that it is finite also for flicker noise (1/f) and a random
walk (1/f^2). Each term has it in closed form (`Term.growth`), with t the time, W the window and A
the time since switch-on, from the densities of IEEE Std 952-2020.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Calibrated:
    """The bias of a sensor is estimated as its mean over a static window before the motion.

    The mean of a gyro is its bias plus the Earth's rate, and the mean of an accelerometer its bias
    plus gravity times the tilt; both are removed. The sensor is assumed to have been on for some
    time. The error is 4 % smaller if flicker noise starts with a window as long as the motion, and
    0.3 % smaller if it starts this time earlier.
    """

    window: float  # W, s


@dataclass(frozen=True, kw_only=True)
class Uncalibrated:
    """The bias of a sensor is not estimated: turn-on bias and the noise since switch-on remain.

    Flicker noise, random walk and ramp are 0 at switch-on. Gauss-Markov processes are stationary.
    """

    bias: float | None
    """Turn-on bias, 1 sigma, rad/s or m/s^2; None: from the data of the sensor (`in_use`)."""
    on_time: float  # time from switch-on to the start, s


SensorStart = Calibrated | Uncalibrated


def of_constant(order: int, time: float) -> float:
    """Return c = t^(m+1) / (m+1)!, the integrated constant error of 1; m is ``order``."""
    return time ** (order + 1) / math.factorial(order + 1)


def of_white(order: int, time: float) -> float:
    """Return t^(2m+1) / ((2m+1) m!^2), the variance of integrated white noise; m is ``order``."""
    return time ** (2 * order + 1) / ((2 * order + 1) * math.factorial(order) ** 2)


def of_white_mean(order: int, time: float, start: SensorStart) -> float:
    """Return c^2 / W: variance due to the mean of white noise, N = 1, in a window of W s; or 0.

    c is from `of_constant`. It is 0 if ``start`` has no window.
    """
    if isinstance(start, Uncalibrated):
        return 0.0
    return of_constant(order, time) ** 2 / start.window
