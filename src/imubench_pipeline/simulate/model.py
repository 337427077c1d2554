"""Model of one sensor axis, from the true rate or specific force to the logged samples.

    u(t) = (1 + scale error) true + bias + drift(temperature, lagged) + noise(t)
    y(t) = low-pass of u, in continuous time
    logged = rounding of the saturation of (y at the sampling times + quantization noise)

The low-pass filters white noise (N is its density before the filter), Gauss-Markov processes,
flicker noise, random walk, ramp, lines, bias, drift and motion. Quantization noise Q is added after
the filter: it is the error -dq/dt, over a sampling interval, of a converter that counts increments
of angle or velocity. It differs from the rounding to the resolution (LSB) of a rate register, which
is simulated as rounding to the nearest step. With noise of at least half a step, rounding adds
LSB^2 / 12 to the variance of each sample; the spectrum uses this value. A sensor seldom has both:
an estimate of N from a rounded log already contains the rounding (`in_the_log`).
"""

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.optimize import nnls

from imubench_pipeline.noise import GaussMarkov, NoiseModel, compute_bias_instability
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.noise.terms.base import Drives, drives_of
from imubench_pipeline.simulate import discretisation
from imubench_pipeline.typing import Array

_FREQUENCIES_PER_CHUNK = 2048  # frequencies per block of the computation
_MIN_TIME_RATIO = 1e-5
"""Ratio of the shortest correlation time of flicker noise to the time constant of the filter or the
sampling interval, whichever is shorter."""
_MAX_TIME_RATIO = 1e5  # ratio of the longest correlation time of flicker noise to `longest`


def _realise(
    drives: Drives, low_pass: LowPass, interval: float, longest: float
) -> tuple[Array, Array]:
    """Return times and densities, (n,), with flicker noise as processes; arguments in s."""
    if drives.flicker == 0.0:
        return drives.times, drives.densities
    # Log-spaced processes, five per decade, sum to flicker noise with a ripple below 1e-8.
    shortest = _MIN_TIME_RATIO * min(1.0 / low_pass.angular_cutoff, interval)
    longest *= _MAX_TIME_RATIO
    count = 2 + math.ceil(5.0 * math.log10(longest / shortest))
    times = np.geomspace(shortest, longest, count)
    variance = math.log(times[1] / times[0]) / math.pi
    densities = drives.flicker * 2.0 * variance / times
    return np.concatenate([drives.times, times]), np.concatenate([drives.densities, densities])


def compute_sampled_spectrum(drives: Drives, low_pass: LowPass, omega: Array, rate: float) -> Array:
    """Return the spectrum, SI^2, of filtered noise that is sampled at ``rate``, Hz.

    It has the shape of ``omega``, rad/sample, and follows from the exact discrete state space of
    each process and the filter.
    """
    interval = 1.0 / rate
    flat = np.ravel(omega)
    lowest = float(np.abs(flat).min(initial=math.pi))
    times, densities = _realise(drives, low_pass, interval, interval / lowest)
    slow = discretisation.discretise_slow_sources(times, interval, low_pass)
    transition = np.asarray(expm(low_pass.transition * interval))
    white = discretisation.compute_white_factor(low_pass, interval)
    spectrum = np.empty_like(flat)
    for begin in range(0, len(flat), _FREQUENCIES_PER_CHUNK):
        w = flat[begin : begin + _FREQUENCIES_PER_CHUNK]
        turn = np.exp(1j * w)[:, None, None] * np.eye(low_pass.order)
        # g = c (z - A)^-1, shape (frequencies, m)
        g = np.linalg.solve(
            (turn - transition).swapaxes(1, 2),
            np.broadcast_to(low_pass.output[:, None], (len(w), low_pass.order, 1)).astype(complex),
        )[..., 0]
        power = drives.white * (np.abs(g @ white.T) ** 2).sum(axis=1)
        if len(times):
            # z - e^(-interval/T), without cancellation where both are close to 1
            gap = (-2.0 * np.sin(w / 2.0) ** 2 + 1j * np.sin(w))[:, None] + slow.lost
            through = (1.0 + g @ slow.coupling.T) / gap
            first = np.abs(through * slow.own + g @ slow.shared.T) ** 2
            rest = (np.abs(np.einsum("wm,nkm->wnk", g, slow.residual)) ** 2).sum(axis=2)
            power += (first + rest) @ densities
        spectrum[begin : begin + _FREQUENCIES_PER_CHUNK] = power
    return spectrum.reshape(np.shape(omega))


_LOW_FREQUENCY = 1e-4  # frequency far below any cut-off, rad/sample


@dataclass(frozen=True, kw_only=True)
class TemperatureDrift:
    """The drift of the bias with temperature.

    drift = sensitivity (θ - reference) + quadratic (θ - reference)^2, where θ follows the
    temperature with a first-order lag: dθ/dt = (temperature - θ) / lag. There is no hysteresis.
    Raises ValueError if a figure is not finite, or the lag is below 0.
    """

    sensitivity: float  # rad/s/K or m/s^2/K
    reference: float = 25.0  # temperature of zero drift, °C
    quadratic: float = 0.0  # rad/s/K^2 or m/s^2/K^2
    lag: float = 0.0  # s; 0: none

    def __post_init__(self) -> None:
        for name in ("sensitivity", "reference", "quadratic", "lag"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} is {getattr(self, name)}, expected a finite number")
        if self.lag < 0:
            raise ValueError(f"lag is {self.lag} s, expected 0 s or more")


@dataclass(frozen=True, kw_only=True)
class SensorModel:
    """The model of one axis of a sensor.

    Raises ValueError if a figure is out of its range, or a further term has no `Term.drive`.
    """

    noise: NoiseModel = field(default_factory=NoiseModel)  # N is the density before the low-pass
    bias: float = 0.0  # fixed, rad/s or m/s^2
    drift: TemperatureDrift | None = None
    low_pass: LowPass | None = None
    scale_error: float = 0.0  # relative error of the scale factor
    resolution: float = 0.0  # step of the register (LSB), rad/s or m/s^2; 0: not rounded
    full_scale: float | None = None  # magnitude at which the output saturates, rad/s or m/s^2

    def __post_init__(self) -> None:
        for name in ("bias", "scale_error"):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} is {getattr(self, name)}, expected a finite number")
        if not (math.isfinite(self.resolution) and self.resolution >= 0):
            raise ValueError(f"resolution is {self.resolution}, expected 0 or more")
        if self.full_scale is not None and not self.full_scale > self.resolution:
            raise ValueError(
                f"full_scale is {self.full_scale}, expected more than the resolution, "
                f"{self.resolution}"
            )
        for term in self.noise.further:
            if term.drive is None:
                raise ValueError(f"{term} has no input to a filter (`Term.drive`); remove it")

    def sampled_spectrum(self, omega: ArrayLike, rate: float) -> Array:
        """Return the spectrum of the samples, with aliasing, SI^2, in the shape of omega.

        omega is in rad/sample, not 0; the rate is in Hz. The mean of the spectrum over -pi..pi is
        the variance of the samples. Rounding counts as white noise.
        """
        w = np.asarray(omega, dtype=np.float64)
        rounding = self.resolution**2 / 12.0
        if self.low_pass is None:
            return self.noise.sampled_spectrum(w, rate) + rounding
        behind = [
            term.sampled_spectrum(w, 1.0 / rate) for term in self.noise.terms if term.drive is None
        ]
        before = compute_sampled_spectrum(drives_of(self.noise.terms), self.low_pass, w, rate)
        return np.asarray(np.sum(behind, axis=0) + rounding + before)


def in_the_log(model: SensorModel, rate: float) -> float:
    """Return N at the low frequencies of a log, SI, with aliasing and rounding; rate in Hz."""
    rounding = model.resolution**2 / (12.0 * rate)
    return math.sqrt(model.noise.N**2 * folding(model, rate) + rounding)


def before_the_filter(model: SensorModel, noise: NoiseModel, rate: float) -> NoiseModel:
    """Return noise with N before filter and rounding, from noise with N of a log.

    Only filter and resolution of the model are used; the rate is the rate of the log, Hz.
    """
    left = max(noise.N**2 - model.resolution**2 / (12.0 * rate), 0.0)
    return replace(noise, N=math.sqrt(left / folding(model, rate)))


def folding(model: SensorModel, rate: float) -> float:
    """Return the density of the samples at low frequencies divided by N^2 (aliasing factor)."""
    unit = replace(model, noise=NoiseModel(N=1.0), resolution=0.0)
    return float(unit.sampled_spectrum(np.array([_LOW_FREQUENCY]), rate)[0]) / rate


MAX_FREQUENCY_RATIO = 30.0
"""Ratio of the highest frequency of the approximation to the cut-off frequency. There, a filter of
first order attenuates the power by 99.9 %."""

_MEMBERS_PER_DECADE = 2.0
_POINTS_PER_DECADE = 20
_BAND_EXTENSION = 4.0
"""Factor by which the correlation times extend the band 1 / (2 pi f) at both ends."""


def fit_density_bank(B: float, lowest: float, highest: float) -> list[GaussMarkov]:
    """Return Gauss-Markov processes whose sum has the density of flicker noise.

    `noise.terms.flicker.fit_flicker_bank` approximates the Allan variance of flicker noise that is
    sampled without a filter. At the input of a filter, whose cut-off may lie above the Nyquist
    frequency, the density B^2 / (2 pi f) itself must be approximated far beyond the cut-off.
    Processes of equal variance (ln r / pi) B^2 whose correlation times have the ratio r approximate
    this density. The relative ripple is 4 e^(-pi^2 / ln r), below 1e-3 for two per decade.

    The variances are fitted by non-negative least squares of the relative error. B is the bias
    instability, rad/s or m/s^2, whose plateau is 0.664 B; the band, ``lowest`` to ``highest``, is
    in Hz.
    """
    times, variances = _fit_unit_bank(round(math.log10(highest / lowest), 6))
    processes = []
    for time, variance in zip(times / (2.0 * math.pi * lowest), variances, strict=True):
        if variance > 0:
            density = 2.0 * B**2 * variance / time  # of the driving noise
            processes.append(GaussMarkov(compute_bias_instability(density, time), time))
    return processes


@lru_cache(maxsize=16)
def _fit_unit_bank(decades: float) -> tuple[Array, Array]:
    """Return correlation times and variances for B = 1 from 1 to 10^decades rad/s."""
    first, last = 10.0**-decades / _BAND_EXTENSION, _BAND_EXTENSION
    members = 2 + math.ceil(math.log10(last / first) * _MEMBERS_PER_DECADE)
    times = np.geomspace(first, last, members)
    omega = np.geomspace(1.0, 10.0**decades, 2 + int(decades * _POINTS_PER_DECADE))
    # Density of each process relative to 1 / omega.
    shapes = 2.0 * times * omega[:, None] / (1.0 + (omega[:, None] * times) ** 2)
    variances, _ = nnls(shapes, np.ones_like(omega))
    return times, variances
