"""Noise of known parameters, and what real logs have beside it; numpy and scipy alone.

Nothing here comes from the package, so that an error of its simulator and of its estimators cannot
be the same one. Processes are sampled as they are at the instants of the samples. Densities are
two-sided: S = N^2, B^2 / (2 pi f) for flicker noise, K^2 / (2 pi f)^2, and for a Gauss-Markov
process 2 S_v T_B / (1 + (2 pi f T_B)^2) with the variance S_v = B^2 ln 2 / (pi 0.4365^2).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

Array = NDArray[np.float64]

FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of flicker noise over its B."""

_PEAK = 0.4365
"""Highest Allan deviation of a Gauss-Markov process over sqrt(S_B T_B)."""

VARIANCE = math.log(2.0) / (math.pi * _PEAK**2)
"""Variance of a Gauss-Markov process over B^2."""

_OVERSAMPLED = 16
"""Samples of an analogue process for each that is kept."""

_FOLDS = 32
"""Folds on each side that are added one by one."""

_SETTLED = 64
"""Cut-off periods after which a filter has forgotten its start."""


def white(samples: int, rate: float, N: float, rng: np.random.Generator) -> Array:
    """Return white noise of density N."""
    return N * math.sqrt(rate) * rng.standard_normal(samples)


def gauss_markov(
    samples: int, rate: float, B: float, T_B: float, rng: np.random.Generator
) -> Array:
    """Return a first-order Gauss-Markov process, stationary from its first sample."""
    sigma = math.sqrt(VARIANCE) * B
    phi = math.exp(-1.0 / (rate * T_B))
    drive = sigma * math.sqrt(-math.expm1(-2.0 / (rate * T_B))) * rng.standard_normal(samples)
    before = sigma * rng.standard_normal(1)
    return np.asarray(signal.lfilter([1.0], [1.0, -phi], drive, zi=phi * before)[0])


def random_walk(samples: int, rate: float, K: float, rng: np.random.Generator) -> Array:
    """Return a random walk."""
    return np.cumsum(K / math.sqrt(rate) * rng.standard_normal(samples))


def of_density(
    samples: int, rate: float, density: Callable[[Array], Array], rng: np.random.Generator
) -> Array:
    """Return Gaussian noise of a two-sided density, by the FFT of a log four times as long.

    Parameters
    ----------
    samples : int
    rate : float
        Hz.
    density : callable
        Of the frequency in Hz, above 0 and up to Nyquist.
    rng : numpy.random.Generator
    """
    length = 1 << (4 * samples - 1).bit_length()
    frequency = np.arange(1, length // 2 + 1, dtype=np.float64) * (rate / length)
    spectrum = np.zeros(length // 2 + 1, dtype=np.complex128)
    parts = rng.standard_normal((2, length // 2))
    spectrum[1:] = np.sqrt(0.5 * density(frequency) * rate * length) * (parts[0] + 1j * parts[1])
    spectrum[-1] = math.sqrt(2.0) * spectrum[-1].real
    return np.asarray(np.fft.irfft(spectrum, length)[:samples])


def flicker(samples: int, rate: float, B: float, rng: np.random.Generator) -> Array:
    """Return flicker noise of the density B^2 / (2 pi f) up to Nyquist."""
    return of_density(samples, rate, lambda f: B**2 / (2.0 * np.pi * f), rng)


def fractional_flicker(samples: int, B: float, rng: np.random.Generator) -> Array:
    """Return flicker noise as white noise integrated to the power 1/2 (N. J. Kasdin, 1995).

    Its sampled spectrum is B^2 / (rate |1 - e^(-i omega)|); the filter is three times as long as
    the log.
    """
    length = 3 * samples
    k = np.arange(1, length, dtype=np.float64)
    weights = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))
    made = signal.fftconvolve(rng.standard_normal(length), weights)[:length]
    return np.asarray(B * made[-samples:])


def second_order(
    samples: int, rate: float, sigma: float, time: float, rng: np.random.Generator
) -> Array:
    """Return a second-order Gauss-Markov process, correlated as (1 + |t| / time) e^(-|t| / time).

    Parameters
    ----------
    samples : int
    rate : float
        Hz.
    sigma : float
        Its standard deviation.
    time : float
        s, many sampling intervals: what folds is left out.
    rng : numpy.random.Generator
    """
    return of_density(samples, rate, lambda f: sigma**2 * _second_order_density(f, time), rng)


def _second_order_density(frequency: Array, time: float) -> Array:
    return 4.0 * time / (1.0 + (2.0 * np.pi * frequency * time) ** 2) ** 2


def second_order_instability() -> float:
    """Return the highest Allan deviation of a second-order process of sigma 1, over 0.664."""

    def variance(tau: float) -> float:
        def density(f: float) -> float:
            weight = math.sin(math.pi * f * tau) ** 4 / (math.pi * f * tau) ** 2
            return 4.0 * float(_second_order_density(np.array(f), 1.0)) * weight

        return float(quad(density, 1e-9, 20.0, limit=2000)[0])

    highest = minimize_scalar(lambda tau: -variance(tau), bounds=(0.5, 10.0), method="bounded")
    return math.sqrt(-float(highest.fun)) / FLOOR


def process_variance(tau: float, sigma: float, T_B: float) -> float:
    """Return the Allan variance of a Gauss-Markov process of a standard deviation."""
    x = tau / T_B
    bracket = 1.0 - (3.0 - 4.0 * math.exp(-x) + math.exp(-2.0 * x)) / (2.0 * x)
    return 2.0 * sigma**2 / x * bracket


def instability_of_curve(processes: Sequence[tuple[float, float]], longest: float) -> float:
    """Return the highest Allan deviation of Gauss-Markov processes up to some tau, over 0.664.

    Parameters
    ----------
    processes : sequence of (float, float)
        Standard deviation and T_B in s of each.
    longest : float
        s.
    """
    shortest = 0.5 * min(T_B for _, T_B in processes)
    highest = max(
        sum(process_variance(float(tau), sigma, T_B) for sigma, T_B in processes)
        for tau in np.geomspace(min(shortest, longest), longest, 400)
    )
    return math.sqrt(highest) / FLOOR


def white_density(frequency: Array, rate: float, N: float) -> Array:
    """Return the sampled density of white noise."""
    return np.full(frequency.shape, N**2)


def gauss_markov_density(frequency: Array, rate: float, B: float, T_B: float) -> Array:
    """Return the sampled density of a first-order Gauss-Markov process."""
    phi = math.exp(-1.0 / (rate * T_B))
    cosine = np.cos(2.0 * np.pi * frequency / rate)
    return np.asarray(VARIANCE * B**2 / rate * (1.0 - phi**2) / (1.0 - 2.0 * phi * cosine + phi**2))


def random_walk_density(frequency: Array, rate: float, K: float) -> Array:
    """Return the sampled density of a random walk."""
    return np.asarray((K / (2.0 * rate * np.sin(np.pi * frequency / rate))) ** 2)


def flicker_density(frequency: Array, rate: float, B: float) -> Array:
    """Return the density of flicker noise."""
    return np.asarray(B**2 / (2.0 * np.pi * frequency))


def bounds(
    samples: int,
    rate: float,
    density: Callable[[Array, Mapping[str, float]], Array],
    truth: Mapping[str, float],
) -> dict[str, float]:
    """Return how well a log can tell its parameters at most: their relative standard errors.

    This is the Cramér-Rao bound for Gaussian noise whose cosine transform is independent at
    k rate / (2 samples), with one degree of freedom each (P. Whittle, 1953).

    Parameters
    ----------
    samples : int
    rate : float
        Hz.
    density : callable
        Of the frequency in Hz and the parameters.
    truth : mapping of str to float
        The parameters, above 0; each is unknown.
    """
    every = np.unique(np.geomspace(1, samples, 4000).round().astype(np.int64))
    many = np.diff(every)
    f = np.asarray(0.5 * (every[:-1] + every[1:] - 1) * rate / (2.0 * samples), dtype=np.float64)
    slopes: list[Array] = []
    for name, value in truth.items():
        low, high = (density(f, {**truth, name: value * math.exp(step)}) for step in (-1e-4, 1e-4))
        slopes.append(np.asarray(np.log(high / low) / 2e-4))
    information = np.array([[0.5 * np.sum(many * a * b) for a in slopes] for b in slopes])
    # What is not told at all leaves no inverse.
    error = np.sqrt(np.diag(np.linalg.pinv(information, hermitian=True)))
    return dict(zip(truth, error.tolist(), strict=True))


def telegraph(
    samples: int, rate: float, amplitude: float, dwell: float, rng: np.random.Generator
) -> Array:
    """Return noise that jumps between -amplitude and amplitude, after dwell s on average.

    Its covariance is that of a Gauss-Markov process of T_B = dwell / 2.
    """
    changes = rng.random(samples) < -0.5 * math.expm1(-2.0 / (rate * dwell))
    sign = np.where(np.cumsum(changes) % 2 == 0, 1.0, -1.0)
    return amplitude * float(rng.choice([-1.0, 1.0])) * sign


def analogue(
    slow: Callable[[int, float], Array],
    N: float,
    samples: int,
    rate: float,
    cutoff: float,
    order: int,
    rng: np.random.Generator,
) -> Array:
    """Return white noise and slower noise behind an analogue Butterworth low-pass, then sampled.

    The white noise has its whole folded density; of the slow noise, what lies beyond eight times
    the rate is left out.

    Parameters
    ----------
    slow : callable
        Gives the process beside the white noise for a number of samples and a rate.
    N : float
        Density of the white noise before the filter.
    samples : int
    rate : float
        Hz, after the filter.
    cutoff : float
        Hz (-3 dB).
    order : int
    rng : numpy.random.Generator
    """
    inner = _OVERSAMPLED * rate
    settled = math.ceil(_SETTLED * rate / cutoff)
    made = slow(_OVERSAMPLED * (samples + settled), inner)
    sections = signal.butter(order, cutoff, fs=inner, output="sos")
    start = signal.sosfilt_zi(sections) * made[0]
    behind = signal.sosfilt(sections, made, zi=start)[0][::_OVERSAMPLED][settled:]
    white = of_density(samples, rate, lambda f: N**2 * folded(f, rate, cutoff, order), rng)
    return np.asarray(behind + white)


def folded(frequency: Array, rate: float, cutoff: float, order: int) -> Array:
    """Return the density of white noise of N = 1 behind an analogue Butterworth filter, sampled.

    Parameters
    ----------
    frequency : ndarray
        Hz, up to Nyquist.
    rate : float
        Hz.
    cutoff : float
        Hz (-3 dB), below the rate.
    order : int
    """
    steep = 2 * order
    total = np.zeros(frequency.shape)
    for k in range(-_FOLDS, _FOLDS + 1):
        total += 1.0 / (1.0 + np.abs((frequency + k * rate) / cutoff) ** steep)
    # The others by the integral of (cutoff / f)^(2 n), from half a fold before the first of them.
    for side in (-1.0, 1.0):
        end = (_FOLDS + 0.5) * rate + side * frequency
        total += cutoff / rate / (steep - 1.0) * (cutoff / end) ** (steep - 1)
    return np.asarray(total)


def resonant(
    make: Callable[[int, float], Array], samples: int, rate: float, cutoff: float, quality: float
) -> Array:
    """Return a process behind an analogue low-pass of second order and of a quality.

    Its gain at the cut-off is the quality, and 1 far below.
    """
    inner = _OVERSAMPLED * rate
    settled = math.ceil(_SETTLED * rate / cutoff)
    made = make(_OVERSAMPLED * (samples + settled), inner)
    w = 2.0 * math.pi * cutoff
    sections = signal.tf2sos(*signal.bilinear([w**2], [1.0, w / quality, w**2], inner))
    start = signal.sosfilt_zi(sections) * made[0]
    return np.asarray(signal.sosfilt(sections, made, zi=start)[0][::_OVERSAMPLED][settled:])


def digital(
    make: Callable[[int, float], Array], samples: int, rate: float, cutoff: float, order: int
) -> Array:
    """Return a process behind a digital Butterworth low-pass (bilinear) at the rate of the log."""
    settled = math.ceil(_SETTLED * rate / cutoff)
    made = make(samples + settled, rate)
    sections = signal.butter(order, cutoff, fs=rate, output="sos")
    return np.asarray(
        signal.sosfilt(sections, made, zi=signal.sosfilt_zi(sections) * made[0])[0][settled:]
    )


def moving_mean(make: Callable[[int, float], Array], samples: int, rate: float, taps: int) -> Array:
    """Return the running means of a process over some samples."""
    return weighted(make, samples, rate, np.full(taps, 1.0 / taps))


def weighted(
    make: Callable[[int, float], Array], samples: int, rate: float, weights: Array
) -> Array:
    """Return a process behind a filter of finite length, whose weights add up to 1."""
    made = make(samples + len(weights) - 1, rate)
    return np.asarray(signal.fftconvolve(made - made[0], weights, "valid") + made[0])


def moving_mean_cutoff(rate: float, taps: int) -> float:
    """Return the frequency at which a running mean has lost 3 dB, Hz."""
    f = np.linspace(1e-6, 1.0 / taps, 20001)[:-1]
    gain = np.abs(np.sin(np.pi * f * taps) / (taps * np.sin(np.pi * f)))
    return float(f[np.argmax(gain < math.sqrt(0.5))] * rate)


def decimated(make: Callable[[int, float], Array], samples: int, rate: float, factor: int) -> Array:
    """Return a process that is sampled faster, behind a steep low-pass of linear phase.

    It has lost half of its amplitude at 0.85 of Nyquist, and keeps 1e-4 of it beyond that.
    """
    taps, shape = signal.kaiserord(80.0, 0.3 / factor)
    weights = signal.firwin(taps, 0.85 / factor, window=("kaiser", shape))
    made = make(samples * factor + taps - 1, rate * factor)
    return np.asarray(signal.fftconvolve(made - made[0], weights, "valid")[::factor] + made[0])


def rounded(log: Array, step: float) -> Array:
    """Return what a register of steps of such a size holds."""
    return np.round(log / step) * step


def lagged(log: Array, rate: float, time: float) -> Array:
    """Return a signal behind a lag of first order, that has stood at its first value before."""
    phi = math.exp(-1.0 / (rate * time))
    start = phi * log[:1]
    return np.asarray(signal.lfilter([1.0 - phi], [1.0, -phi], log, zi=start)[0], dtype=np.float64)


def on_and_off(samples: int, rate: float, period: float, rng: np.random.Generator) -> Array:
    """Return a ventilation that is on (1) and off (0), a tenth of its period irregular."""
    number = 8 + math.ceil(2.2 * samples / (rate * period))
    halves = 0.5 * period * (1.0 + 0.1 * rng.standard_normal(number))
    ends = np.cumsum(np.maximum(halves, 0.1 * period)) - rng.uniform(0.0, period)
    return np.asarray(np.searchsorted(ends, np.arange(samples) / rate) % 2, dtype=np.float64)


def resonance(
    samples: int,
    rate: float,
    sigma: float,
    frequency: float,
    quality: float,
    rng: np.random.Generator,
) -> Array:
    """Return noise of a resonance, such as of a table that vibrates."""
    b, a = signal.iirpeak(frequency, quality, fs=rate)
    settled = math.ceil(20.0 * quality * rate / frequency)
    made = np.asarray(signal.lfilter(b, a, rng.standard_normal(samples + settled))[settled:])
    return sigma * made / float(made.std())
