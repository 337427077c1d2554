"""Simulated logs of known truth for `silent_errors`: clean ones, and what users' logs are like.

Every log of a case has parameters of its own, drawn from the ranges that its function states. No
code of the package makes them.

Truths
------
N is that before any low-pass, without rounding noise or with it, without outliers or with them;
where it changes, what it is at any time. Where noise is sampled without an anti-aliasing filter
(`decimated_without_filter`), N is that of the log, with what folds. B is that of the process; of
several, from the lowest B to the bias instability of the curve (B_curve), which is the highest
Allan deviation of all of them together over 0.664, up to a ninth of the log or beyond. Flicker
noise up to Nyquist and Kasdin's differ there: N is known as well as that. Telegraph noise is a
Gauss-Markov process of the same covariance. Steps, drift and cycles are no random walk: K is 0
unless there is one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

import simulators as sim

Array = NDArray[np.float64]
Rng = np.random.Generator


@dataclass(frozen=True)
class Truth:
    """What a parameter is.

    Attributes
    ----------
    low, high : float
        SI. A value between them is right; both 0: there is no such term.
    loose : bool
        The parameter is not that of the process, so that an interval says little: a value within a
        factor of two is right.
    """

    low: float
    high: float
    loose: bool = False

    @property
    def nothing(self) -> bool:
        """There is no such term."""
        return self.high == 0.0


NOTHING = Truth(0.0, 0.0)


def exactly(value: float) -> Truth:
    """Return the truth that is one value."""
    return Truth(value, value)


@dataclass(frozen=True)
class Log:
    """A simulated log.

    Attributes
    ----------
    samples : ndarray, shape (L,)
        rad/s or m/s^2.
    rate : float
        Hz.
    truth : dict of str to Truth
        Of N, B, B_curve, T_B, K, Q, R, and ``cutoff``; what is not there is not judged.
    quantity : str
        ``gyro`` or ``accel``.
    stamps : ndarray, shape (L,), optional
        s; None: the log has none, and its rate is stated.
    bounds : dict of str to float
        How well the log can tell its parameters at most, relative standard errors, of clean logs.
    """

    samples: Array
    rate: float
    truth: dict[str, Truth]
    quantity: str = "gyro"
    stamps: Array | None = None
    bounds: dict[str, float] = field(default_factory=dict)


Case = Callable[[Rng], Log]
Make = Callable[[int, float], Array]


@dataclass(frozen=True)
class Noise:
    """The noise of a sensor: parameters as in the truth, SI."""

    N: float
    quantity: str
    B: float = 0.0
    T_B: float = 0.0
    K: float = 0.0

    def make(self, rng: Rng) -> Make:
        """Return what gives a log of a number of samples at a rate."""

        def made(samples: int, rate: float) -> Array:
            log = sim.white(samples, rate, self.N, rng) + self.offset(rng)
            if self.B:
                log += sim.gauss_markov(samples, rate, self.B, self.T_B, rng)
            return log + sim.random_walk(samples, rate, self.K, rng) if self.K else log

        return made

    def behind_analogue(
        self, samples: int, rate: float, cutoff: float, order: int, rng: Rng
    ) -> Array:
        """Return the samples of it behind an analogue Butterworth low-pass."""
        slow = replace(self, N=0.0).make(rng)
        return sim.analogue(slow, self.N, samples, rate, cutoff, order, rng)

    def log(self, samples: int, rate: float, rng: Rng) -> Log:
        """Return a log."""
        made = self.make(rng)(samples, rate)
        return Log(made, rate, self.truth(), self.quantity, bounds=self.bounds(samples, rate))

    def bounds(self, samples: int, rate: float) -> dict[str, float]:
        """Return how well a log can tell its parameters at most, relative standard errors."""
        there = {"N": self.N, "B": self.B, "T_B": self.T_B, "K": self.K}
        known = {name: value for name, value in there.items() if value > 0.0}
        found = sim.bounds(samples, rate, partial(_density, rate=rate), known)
        return found | ({"B_curve": found["B"]} if "B" in found else {})

    def truth(self, **others: Truth) -> dict[str, Truth]:
        """Return what its parameters are, and others.

        A process faster than a second is broadband noise: it may count into N, and is no bias
        instability.
        """
        own = {"N": exactly(self.N), "B": exactly(self.B), "K": exactly(self.K)}
        own |= {"B_curve": own["B"], "T_B": exactly(self.T_B)}
        if 0.0 < self.T_B < 1.0:
            own = {"N": Truth(self.N, math.sqrt(self.level())), "K": own["K"]}
        return own | {"Q": NOTHING, "R": NOTHING, "cutoff": NOTHING} | others

    def behind(self, cutoff: Truth, gain: float = 1.0, step: float = 0.0) -> dict[str, Truth]:
        """Return the truth of a log behind a low-pass.

        ``gain``: density of white noise in the log, far below the cut-off, over that before the
        filter; ``step``: density that a register adds at most, SI^2/Hz.
        """
        truth = self.truth(cutoff=cutoff, N_sensor=exactly(self.N))
        N, root = truth["N"], math.sqrt(gain)
        return truth | {"N": Truth(N.low * root, math.hypot(N.high * root, math.sqrt(step)))}

    def offset(self, rng: Rng) -> float:
        """Return a bias, or gravity and a bias."""
        small = 0.01 * float(rng.standard_normal())
        return small if self.quantity == "gyro" else small + float(rng.choice([0.0, 9.8]))

    @property
    def sigma(self) -> float:
        """Standard deviation of the Gauss-Markov process."""
        return math.sqrt(sim.VARIANCE) * self.B

    def level(self) -> float:
        """Return the density of all but the walk at low frequencies."""
        return self.N**2 + 2.0 * self.sigma**2 * self.T_B

    def with_process(self, times: float, T_B: float) -> Noise:
        """Return it with a Gauss-Markov process of so many times the density of the white noise."""
        B = self.N * math.sqrt(times / (2.0 * sim.VARIANCE * T_B))
        return replace(self, B=B, T_B=T_B)

    def with_walk(self, cycles: float, duration: float) -> Noise:
        """Return it with a walk that is the stronger below so many cycles in the log."""
        return replace(self, K=2.0 * math.pi * cycles / duration * math.sqrt(self.level()))


def _density(frequency: Array, of: Mapping[str, float], *, rate: float) -> Array:
    """Return the density of N, of two processes or flicker noise (F), and of K."""
    total = sim.white_density(frequency, rate, of.get("N", 0.0))
    for number in ("", " 2"):
        if f"B{number}" in of:
            process = of[f"B{number}"], of[f"T_B{number}"]
            total = total + sim.gauss_markov_density(frequency, rate, *process)
    if "F" in of:
        total = total + sim.flicker_density(frequency, rate, of["F"])
    if "K" in of:
        total = total + sim.random_walk_density(frequency, rate, of["K"])
    return total


def between(rng: Rng, low: float, high: float) -> float:
    """Return a number, its logarithm uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def any_white(rng: Rng) -> Noise:
    """Return white noise of a gyro (3e-5 to 1e-3) or an accelerometer (3e-4 to 5e-3), SI."""
    if rng.random() < 0.5:
        return Noise(between(rng, 3e-5, 1e-3), "gyro")
    return Noise(between(rng, 3e-4, 5e-3), "accel")


def any_length(rng: Rng) -> tuple[int, float]:
    """Return 50,000 to 300,000 samples at 5 to 200 Hz, a quarter of an hour at least.

    A shorter recording has a note that it shows white noise alone.
    """
    rate = float(rng.choice([5.0, 10.0, 20.0, 50.0, 100.0, 200.0]))
    return round(between(rng, max(5e4, 1000.0 * rate), 3e5)), rate


def any_process(rng: Rng, samples: int, rate: float) -> Noise:
    """Return white noise and a strong process: 20 to 300 times its density, 100 to 800 T_B long.

    T_B is 200 sampling intervals at least.
    """
    duration = samples / rate
    T_B = between(rng, max(200.0 / rate, duration / 800.0), max(220.0 / rate, duration / 100.0))
    return any_white(rng).with_process(between(rng, 20.0, 300.0), T_B)


def of_four(rng: Rng, samples: int, rate: float) -> Noise:
    """Return N, B, T_B and a walk that is the stronger below 5 to 20 cycles in the log."""
    return any_process(rng, samples, rate).with_walk(between(rng, 5.0, 20.0), samples / rate)


# Clean logs


def white(rng: Rng) -> Log:
    """White noise."""
    samples, rate = any_length(rng)
    return any_white(rng).log(samples, rate, rng)


def white_walk(rng: Rng) -> Log:
    """White noise, and a walk that is the stronger below 5 to 100 cycles."""
    samples, rate = any_length(rng)
    noise = any_white(rng).with_walk(between(rng, 5.0, 100.0), samples / rate)
    return noise.log(samples, rate, rng)


def white_process(rng: Rng) -> Log:
    """White noise and a strong Gauss-Markov process."""
    samples, rate = any_length(rng)
    return any_process(rng, samples, rate).log(samples, rate, rng)


def papers_four(rng: Rng) -> Log:
    """N, B, T_B and K."""
    samples, rate = any_length(rng)
    return of_four(rng, samples, rate).log(samples, rate, rng)


def mti_7_gyro(rng: Rng) -> Log:
    """The gyro of an MTi-7, 10 h at 100 Hz (Maia et al., Table 2)."""
    noise = Noise(8.4e-5, "gyro", 6.7e-5, 89.5, 8.2e-7)
    return noise.log(3_600_000, 100.0, rng)


def mti_7_accelerometer(rng: Rng) -> Log:
    """Its accelerometer, 10 h at 20 Hz."""
    return Noise(9.6e-4, "accel", 3.4e-4, 38.3, 1.7e-5).log(720_000, 20.0, rng)


def c102_accelerometer(rng: Rng) -> Log:
    """The accelerometer of a C102-F9R, 10 h at 50 Hz."""
    return Noise(1.1e-3, "accel", 7.2e-4, 148.9, 2.0e-5).log(1_800_000, 50.0, rng)


def slow_log(rng: Rng) -> Log:
    """N, B, T_B and K at 1 Hz, 12 to 48 h."""
    samples = round(3600.0 * rng.uniform(12.0, 48.0))
    return of_four(rng, samples, 1.0).log(samples, 1.0, rng)


def fast_log(rng: Rng) -> Log:
    """N, B, T_B and K at 200 Hz, 20 to 40 min."""
    samples = round(200.0 * 60.0 * rng.uniform(20.0, 40.0))
    return of_four(rng, samples, 200.0).log(samples, 200.0, rng)


def _flicker(rng: Rng, *, fractional: bool, walk: bool) -> Log:
    """Return flicker noise, stronger than the white below 100 to 3,000 cycles in the log.

    A walk is the stronger below 4 to 15.
    """
    samples, rate = any_length(rng)
    noise = any_white(rng)
    corner = min(between(rng, 100.0, 3000.0) * rate / samples, 0.05 * rate)
    B = noise.N * math.sqrt(2.0 * math.pi * corner)
    K = B * math.sqrt(2.0 * math.pi * between(rng, 4.0, 15.0) * rate / samples) if walk else 0.0
    log = sim.white(samples, rate, noise.N, rng) + noise.offset(rng)
    if fractional:
        log += sim.fractional_flicker(samples, B, rng)
    else:
        log += sim.flicker(samples, rate, B, rng)
    if walk:
        log += sim.random_walk(samples, rate, K, rng)
    differs = (0.5 - 1.0 / np.pi) * B**2 / rate  # of the two at Nyquist
    known = Truth(math.sqrt(max(noise.N**2 - differs, 0.0)), math.sqrt(noise.N**2 + differs))
    truth = noise.truth(N=known, B=exactly(B), B_curve=exactly(B), K=exactly(K))
    truth.pop("T_B")  # there is none; of a process that stands for it, anything
    there = {"N": noise.N, "F": B} | ({"K": K} if walk else {})
    bounds = sim.bounds(samples, rate, partial(_density, rate=rate), there)
    bounds |= {"B": bounds["F"], "B_curve": bounds["F"]}
    return Log(log, rate, truth, noise.quantity, bounds=bounds)


def white_flicker(rng: Rng) -> Log:
    """White and flicker noise, B^2 / (2 pi f) up to Nyquist."""
    return _flicker(rng, fractional=False, walk=False)


def white_flicker_walk(rng: Rng) -> Log:
    """White and flicker noise, and a walk."""
    return _flicker(rng, fractional=False, walk=True)


def fractional_flicker(rng: Rng) -> Log:
    """White noise, and flicker noise by fractional integration."""
    return _flicker(rng, fractional=True, walk=False)


def fractional_flicker_walk(rng: Rng) -> Log:
    """The same, and a walk."""
    return _flicker(rng, fractional=True, walk=True)


def _two_processes(rng: Rng, *, walk: bool) -> Log:
    """Return two processes, T_B 10 to 50 times apart, the slower one 10 to 50 times as dense."""
    samples, rate = any_length(rng)
    duration = samples / rate
    slow = between(rng, duration / 300.0, duration / 100.0)
    fast = slow / between(rng, 10.0, 50.0)
    noise = any_white(rng).with_process(between(rng, 5.0, 50.0), fast)
    second = replace(noise, B=0.0, T_B=0.0, N=math.sqrt(noise.level()))
    second = second.with_process(between(rng, 10.0, 50.0), slow)
    log = noise.make(rng)(samples, rate)
    log += sim.gauss_markov(samples, rate, second.B, slow, rng)
    K = 0.0
    if walk:
        K = second.with_walk(between(rng, 5.0, 10.0), duration).K
        log += sim.random_walk(samples, rate, K, rng)
    highest = sim.instability_of_curve([(noise.sigma, fast), (second.sigma, slow)], duration / 9.0)
    B = Truth(min(noise.B, second.B), max(noise.B, second.B, highest))
    truth = noise.truth(B=B, B_curve=exactly(highest), T_B=Truth(fast, slow), K=exactly(K))
    there = {"N": noise.N, "B": noise.B, "T_B": fast, "B 2": second.B, "T_B 2": slow}
    bounds = sim.bounds(
        samples, rate, partial(_density, rate=rate), there | ({"K": K} if walk else {})
    )
    for name in ("B", "T_B"):
        bounds[name] = max(bounds[name], bounds[f"{name} 2"])
    return Log(log, rate, truth, noise.quantity, bounds=bounds | {"B_curve": bounds["B"]})


def two_processes(rng: Rng) -> Log:
    """Two Gauss-Markov processes."""
    return _two_processes(rng, walk=False)


def two_processes_walk(rng: Rng) -> Log:
    """Two Gauss-Markov processes and a walk."""
    return _two_processes(rng, walk=True)


# Clean, but weak, or of another shape


def weak_process(rng: Rng) -> Log:
    """A process of 0.02 to 2 times the density of the white noise."""
    samples, rate = any_length(rng)
    T_B = between(rng, 50.0 / rate, samples / rate / 50.0)
    return any_white(rng).with_process(between(rng, 0.02, 2.0), T_B).log(samples, rate, rng)


def weak_walk(rng: Rng) -> Log:
    """A walk that is the stronger below 0.2 to 3 cycles, beside white noise or a process."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate) if rng.random() < 0.5 else any_white(rng)
    return noise.with_walk(between(rng, 0.2, 3.0), samples / rate).log(samples, rate, rng)


def second_order_process(rng: Rng) -> Log:
    """A second-order Gauss-Markov process, 20 to 300 times as dense as the white noise."""
    samples, rate = any_length(rng)
    noise = any_white(rng)
    time = between(rng, 50.0 / rate, samples / rate / 200.0)
    sigma = noise.N * math.sqrt(between(rng, 20.0, 300.0) / (4.0 * time))
    log = noise.make(rng)(samples, rate) + sim.second_order(samples, rate, sigma, time, rng)
    B = sigma * sim.second_order_instability()
    truth = noise.truth(B=Truth(B, B, loose=True), B_curve=exactly(B))
    truth.pop("T_B")
    return Log(log, rate, truth, noise.quantity)


def fast_process(rng: Rng) -> Log:
    """A process of T_B from 5 to 80 sampling intervals, 3 to 100 times as dense."""
    samples, rate = any_length(rng)
    noise = any_white(rng).with_process(between(rng, 3.0, 100.0), between(rng, 5.0, 80.0) / rate)
    return noise.log(samples, rate, rng)


def fast_process_walk(rng: Rng) -> Log:
    """The same, and a walk that is the stronger below 5 to 50 cycles."""
    samples, rate = any_length(rng)
    noise = any_white(rng).with_process(between(rng, 3.0, 100.0), between(rng, 5.0, 80.0) / rate)
    return noise.with_walk(between(rng, 5.0, 50.0), samples / rate).log(samples, rate, rng)


def process_of_five_seconds(rng: Rng) -> Log:
    """N = 1e-4, B = 3e-4, T_B = 5 s, K = 2e-6, 4 h at 10 Hz."""
    return Noise(1e-4, "gyro", 3e-4, 5.0, 2e-6).log(144_000, 10.0, rng)


def strong_process(rng: Rng) -> Log:
    """A process that is 0.1 to 0.8 of the white noise at Nyquist still, T_B 100 to 1,000 T."""
    samples, rate = any_length(rng)
    T_B = between(rng, 100.0, 1000.0) / rate
    return _up_to_nyquist(rng, T_B, rate, 0.1, 0.8).log(samples, rate, rng)


def strong_process_walk(rng: Rng) -> Log:
    """The same, and a walk that is the stronger below 5 to 20 cycles."""
    samples, rate = any_length(rng)
    T_B = between(rng, 100.0, 1000.0) / rate
    noise = _up_to_nyquist(rng, T_B, rate, 0.1, 0.8)
    return noise.with_walk(between(rng, 5.0, 20.0), samples / rate).log(samples, rate, rng)


def process_over_all(rng: Rng) -> Log:
    """A process that is 10 to 100 times the white noise up to Nyquist: N is not to be seen."""
    samples, rate = any_length(rng)
    T_B = between(rng, 100.0, 1000.0) / rate
    return _up_to_nyquist(rng, T_B, rate, 10.0, 100.0).log(samples, rate, rng)


def _up_to_nyquist(rng: Rng, T_B: float, rate: float, low: float, high: float) -> Noise:
    at_nyquist = between(rng, low, high)
    phi = math.exp(-1.0 / (rate * T_B))
    # Sampled: (1 - phi^2) / (1 - 2 phi cos w + phi^2) sigma^2 / rate at w = pi, over that at 0.
    falls = ((1.0 - phi) / (1.0 + phi)) ** 2
    return any_white(rng).with_process(at_nyquist / falls, T_B)


def slow_process(rng: Rng) -> Log:
    """A process of T_B from a sixtieth to a fifteenth of the log, 30 to 3,000 times as dense."""
    samples, rate = any_length(rng)
    T_B = samples / rate / between(rng, 15.0, 60.0)
    noise = any_white(rng).with_process(between(rng, 30.0, 3000.0), T_B)
    shown = sim.instability_of_curve([(noise.sigma, T_B)], samples / rate / 9.0)
    log = noise.log(samples, rate, rng)
    return replace(log, truth=log.truth | {"B_curve": Truth(min(shown, noise.B), noise.B)})


def walk_hides_white(rng: Rng) -> Log:
    """A walk that is the stronger below 0.1 Hz to a third of Nyquist."""
    samples, rate = any_length(rng)
    corner = between(rng, min(0.1, 0.1 * rate), rate / 6.0)
    noise = any_white(rng)
    return replace(noise, K=2.0 * math.pi * corner * noise.N).log(samples, rate, rng)


def walk_over_all(rng: Rng) -> Log:
    """A walk that is 5 to 50 times as dense as the white noise up to Nyquist."""
    samples, rate = any_length(rng)
    noise = any_white(rng)
    K = 2.0 * rate * noise.N * math.sqrt(between(rng, 5.0, 50.0))
    return replace(noise, K=K).log(samples, rate, rng)


def flicker_and_process(rng: Rng) -> Log:
    """White and flicker noise, and a process of 5 to 50 times their density at 1 / (2 pi T_B)."""
    log = _flicker(rng, fractional=False, walk=False)
    samples, duration = len(log.samples), len(log.samples) / log.rate
    T_B = between(rng, duration / 500.0, duration / 100.0)
    N, F = log.truth["N"], log.truth["B"].high
    level = N.high**2 + F**2 * T_B
    sigma = math.sqrt(between(rng, 5.0, 50.0) * level / (2.0 * T_B))
    made = log.samples + sim.gauss_markov(
        samples, log.rate, sigma / math.sqrt(sim.VARIANCE), T_B, rng
    )
    B = sigma / math.sqrt(sim.VARIANCE)
    curve = exactly(math.hypot(F, B))
    T = exactly(T_B)
    truth = log.truth | {"B": Truth(min(F, B), curve.high), "B_curve": curve, "T_B": T}
    return replace(log, samples=made, truth=truth)


def few_samples(rng: Rng) -> Log:
    """20 to 60 min at 1 to 5 Hz: white noise, with a process or a walk in half of the logs each."""
    rate = float(rng.choice([1.0, 2.0, 5.0]))
    duration = 60.0 * rng.uniform(20.0, 60.0)
    noise = any_white(rng)
    if rng.random() < 0.5:
        T_B = between(rng, duration / 200.0, duration / 50.0)
        noise = noise.with_process(between(rng, 10.0, 100.0), T_B)
    if rng.random() < 0.5:
        noise = noise.with_walk(between(rng, 2.0, 10.0), duration)
    return noise.log(round(duration * rate), rate, rng)


def angle_quantisation(rng: Rng) -> Log:
    """The increments of an angle that is rounded: Q is the stronger above 0.05 to 0.5 Nyquist."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    corner = rng.uniform(0.05, 0.5) * 0.5 * rate
    Q = noise.N / (2.0 * math.sqrt(rate) * math.sin(math.pi * corner / rate))
    log = noise.log(samples, rate, rng)
    # With noise of one step added, the errors are white, of twice the variance of rounding.
    step = math.sqrt(6.0) * Q
    angle = np.concatenate(([0.0], np.cumsum(log.samples / rate)))
    made = np.diff(sim.rounded(angle + step * rng.uniform(-0.5, 0.5, samples + 1), step)) * rate
    return replace(log, samples=made, truth=log.truth | {"Q": exactly(Q)})


# Filters


def _for_filter(rng: Rng) -> tuple[int, float, Noise, float]:
    """Return 20 to 50 min at 50 or 100 Hz, N, B, T_B, K, and 0.05 to 0.8 Nyquist."""
    rate = float(rng.choice([50.0, 100.0]))
    samples = round(between(rng, 1200.0, 3000.0) * rate)
    noise = any_white(rng)
    if rng.random() < 0.8:
        duration = samples / rate
        noise = noise.with_process(
            between(rng, 10.0, 100.0), between(rng, 0.0015, 0.006) * duration
        )
        noise = noise.with_walk(between(rng, 5.0, 15.0), duration)
    return samples, rate, noise, between(rng, 0.05, 0.8) * 0.5 * rate


def _analogue(rng: Rng, order: int) -> Log:
    samples, rate, noise, cutoff = _for_filter(rng)
    log = noise.behind_analogue(samples, rate, cutoff, order, rng)
    truth = noise.behind(exactly(cutoff), _folded(cutoff, rate, order))
    return Log(log, rate, truth, noise.quantity)


def _folded(cutoff: float, rate: float, order: int) -> float:
    """Return the density of white noise in a log far below the cut-off, over that before it."""
    return float(sim.folded(np.zeros(1), rate, cutoff, order)[0])


def _digital(rng: Rng, order: int) -> Log:
    samples, rate, noise, cutoff = _for_filter(rng)
    log = sim.digital(noise.make(rng), samples, rate, cutoff, order)
    return Log(log, rate, noise.behind(exactly(cutoff)), noise.quantity)


def analogue_1(rng: Rng) -> Log:
    """An analogue low-pass of first order, at 0.05 to 0.8 Nyquist."""
    return _analogue(rng, 1)


def analogue_2(rng: Rng) -> Log:
    """An analogue low-pass of second order."""
    return _analogue(rng, 2)


def analogue_steep(rng: Rng) -> Log:
    """An analogue low-pass of third or fourth order."""
    return _analogue(rng, int(rng.integers(3, 5)))


def digital_1(rng: Rng) -> Log:
    """A digital (bilinear) low-pass of first order."""
    return _digital(rng, 1)


def digital_2(rng: Rng) -> Log:
    """A digital low-pass of second order."""
    return _digital(rng, 2)


def digital_steep(rng: Rng) -> Log:
    """A digital low-pass of third or fourth order."""
    return _digital(rng, int(rng.integers(3, 5)))


def moving_mean(rng: Rng) -> Log:
    """Running means over 2 to 16 samples."""
    samples, rate, noise, _ = _for_filter(rng)
    taps = int(rng.integers(2, 17))
    log = sim.moving_mean(noise.make(rng), samples, rate, taps)
    cutoff = exactly(sim.moving_mean_cutoff(rate, taps))
    return Log(log, rate, noise.behind(cutoff), noise.quantity)


def filtered_and_rounded(rng: Rng) -> Log:
    """An analogue low-pass of any order, then a register of 0.3 to 1.5 sigma of what is left."""
    samples, rate, noise, cutoff = _for_filter(rng)
    order = int(rng.integers(1, 5))
    log = noise.behind_analogue(samples, rate, cutoff, order, rng)
    step = between(rng, 0.3, 1.5) * float(np.std(np.diff(log))) / math.sqrt(2.0)
    gain = _folded(cutoff, rate, order)
    truth = noise.behind(exactly(cutoff), gain, step**2 / (12.0 * rate))
    return Log(sim.rounded(log, step), rate, truth, noise.quantity)


def filtered_fast_process(rng: Rng) -> Log:
    """A low-pass of second order at 0.1 to 0.5 Nyquist, and a process of T_B 20 to 80 T."""
    rate = float(rng.choice([20.0, 50.0, 100.0]))
    samples = round(between(rng, 1e5, 2e5))
    noise = any_white(rng).with_process(between(rng, 10.0, 100.0), between(rng, 20.0, 80.0) / rate)
    cutoff = between(rng, 0.1, 0.5) * 0.5 * rate
    log = sim.digital(noise.make(rng), samples, rate, cutoff, 2)
    return Log(log, rate, noise.behind(exactly(cutoff)), noise.quantity)


def filtered_walk(rng: Rng) -> Log:
    """An analogue low-pass of any order, and a walk that hides N up to 0.02 to 0.3 of its end."""
    rate = float(rng.choice([20.0, 50.0, 100.0]))
    samples = round(between(rng, 1e5, 2e5))
    noise = any_white(rng)
    cutoff = between(rng, 0.1, 0.8) * 0.5 * rate
    noise = replace(noise, K=2.0 * math.pi * between(rng, 0.02, 0.3) * cutoff * noise.N)
    order = int(rng.integers(1, 5))
    log = noise.behind_analogue(samples, rate, cutoff, order, rng)
    truth = noise.behind(exactly(cutoff), _folded(cutoff, rate, order))
    return Log(log, rate, truth, noise.quantity)


def filtered_flicker(rng: Rng) -> Log:
    """A digital low-pass of any order, white and flicker noise."""
    rate = float(rng.choice([50.0, 100.0]))
    samples = round(between(rng, 1200.0, 3000.0) * rate)
    noise = any_white(rng)
    B = noise.N * math.sqrt(2.0 * math.pi * between(rng, 100.0, 1000.0) * rate / samples)
    cutoff = between(rng, 0.05, 0.8) * 0.5 * rate

    def make(length: int, inner: float) -> Array:
        return noise.make(rng)(length, inner) + sim.flicker(length, inner, B, rng)

    log = sim.digital(make, samples, rate, cutoff, int(rng.integers(1, 5)))
    truth = noise.behind(exactly(cutoff)) | {"B": exactly(B), "B_curve": exactly(B)}
    truth.pop("T_B")
    return Log(log, rate, truth, noise.quantity)


def sinc_cubed(rng: Rng) -> Log:
    """Running means over 2 to 8 samples, three times: the filter of a sigma-delta converter."""
    samples, rate, noise, _ = _for_filter(rng)
    taps = int(rng.integers(2, 9))
    weights = np.array([1.0])
    for _ in range(3):
        weights = np.convolve(weights, np.full(taps, 1.0 / taps))
    log = sim.weighted(noise.make(rng), samples, rate, weights)
    truth = noise.truth()
    truth.pop("cutoff")
    return Log(log, rate, truth, noise.quantity)


def resonant_low_pass(rng: Rng) -> Log:
    """An analogue low-pass of second order that rises by 1.2 to 2 at its cut-off."""
    samples, rate, noise, cutoff = _for_filter(rng)
    log = sim.resonant(noise.make(rng), samples, rate, cutoff, rng.uniform(1.2, 2.0))
    truth = noise.truth()
    truth.pop("cutoff")
    return Log(log, rate, truth, noise.quantity)


def decimated_with_filter(rng: Rng) -> Log:
    """Every 4th to 10th sample behind a steep low-pass, of linear phase, at 0.85 of Nyquist."""
    samples, rate, noise, _ = _for_filter(rng)
    log = sim.decimated(noise.make(rng), samples, rate, int(rng.integers(4, 11)))
    return Log(log, rate, noise.behind(Truth(0.4 * rate, 0.44 * rate)), noise.quantity)


def decimated_without_filter(rng: Rng) -> Log:
    """Every 4th to 10th sample: N is that of the log, with what folds."""
    samples, rate, noise, _ = _for_filter(rng)
    factor = int(rng.integers(4, 11))
    log = noise.make(rng)(samples * factor, rate * factor)[::factor]
    return Log(log, rate, noise.truth(N=exactly(noise.N * math.sqrt(factor))), noise.quantity)


def means_of_samples(rng: Rng) -> Log:
    """The means of 4 to 10 samples each: no low-pass shows, and N stays."""
    samples, rate, noise, _ = _for_filter(rng)
    factor = int(rng.integers(4, 11))
    log = noise.make(rng)(samples * factor, rate * factor).reshape(-1, factor).mean(axis=1)
    return Log(log, rate, noise.truth(), noise.quantity)


def repeated_samples(rng: Rng) -> Log:
    """A sensor of half or a quarter the rate of the log, which holds each sample."""
    samples, rate, noise, _ = _for_filter(rng)
    held = int(rng.choice([2, 4]))
    log = np.repeat(noise.make(rng)(samples // held, rate / held), held)
    truth = noise.truth()
    truth.pop("cutoff")
    return Log(log, rate, truth, noise.quantity)


# The register


def _rounded(N: float, step: float, rate: float) -> Truth:
    return Truth(N, math.sqrt(N**2 + step**2 / (12.0 * rate)))


def fine_register(rng: Rng) -> Log:
    """N, B, T_B and K in steps of 0.05 to 1 sigma of the white noise."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    step = between(rng, 0.05, 1.0) * noise.N * math.sqrt(rate)
    log = noise.log(samples, rate, rng)
    truth = log.truth | {"N": _rounded(noise.N, step, rate)}
    return replace(log, samples=sim.rounded(log.samples, step), truth=truth)


def coarse_register(rng: Rng) -> Log:
    """The same in steps of 1.5 to 4 sigma."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    step = rng.uniform(1.5, 4.0) * noise.N * math.sqrt(rate)
    log = noise.log(samples, rate, rng)
    truth = log.truth | {"N": _rounded(noise.N, step, rate)}
    return replace(log, samples=sim.rounded(log.samples, step), truth=truth)


def clipped(rng: Rng) -> Log:
    """N, B, T_B and K, clipped at 1 to 2.5 sigma on one side or both."""
    samples, rate = any_length(rng)
    log = of_four(rng, samples, rate).log(samples, rate, rng)
    middle, sigma = log.samples.mean(), log.samples.std()
    end = rng.uniform(1.0, 2.5) * sigma
    low = middle - end if rng.random() < 0.5 else -np.inf
    return replace(log, samples=np.clip(log.samples, low, middle + end))


# What the mean does


def _with_mean(
    rng: Rng, noise: Noise, samples: int, rate: float, mean: NDArray[np.floating]
) -> Log:
    log = noise.log(samples, rate, rng)
    truth = {name: value for name, value in log.truth.items() if name != "R"}
    return replace(log, samples=log.samples + mean, truth=truth)


def _steps(rng: Rng, samples: int, sigma: float) -> Array:
    """Return 1 to 3 steps of 3 to 10 sigma."""
    mean = np.zeros(samples)
    for _ in range(rng.integers(1, 4)):
        size = float(rng.choice([-1.0, 1.0])) * rng.uniform(3.0, 10.0) * sigma
        mean[round(rng.uniform(0.1, 0.9) * samples) :] += size
    return mean


def steps(rng: Rng) -> Log:
    """White noise, a process, and 1 to 3 steps of 3 to 10 sigma of it."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    return _with_mean(rng, noise, samples, rate, _steps(rng, samples, noise.sigma))


def steps_walk(rng: Rng) -> Log:
    """The same, and a walk."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    return _with_mean(rng, noise, samples, rate, _steps(rng, samples, noise.sigma))


def steps_white(rng: Rng) -> Log:
    """White noise, and 1 to 3 steps of 3 to 10 sigma of its means over a hundredth of the log."""
    samples, rate = any_length(rng)
    noise = any_white(rng)
    sigma = noise.N / math.sqrt(0.01 * samples / rate)
    return _with_mean(rng, noise, samples, rate, _steps(rng, samples, sigma))


def telegraph(rng: Rng) -> Log:
    """Telegraph noise for the process: 20 to 300 times as dense as the white, 200 to 1,000 T_B."""
    samples, rate = any_length(rng)
    noise = any_white(rng)
    T_B = samples / rate / between(rng, 200.0, 1000.0)
    as_if = noise.with_process(between(rng, 20.0, 300.0), T_B)
    log = noise.make(rng)(samples, rate)
    log += sim.telegraph(samples, rate, as_if.sigma, 2.0 * T_B, rng)
    return Log(log, rate, as_if.truth(), noise.quantity)


def warm_up(rng: Rng) -> Log:
    """N, B, T_B, and an exponential of 3 to 30 sigma of the process over T/30 to T/5."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    time = between(rng, 1 / 30, 1 / 5) * samples
    size = float(rng.choice([-1.0, 1.0])) * between(rng, 3.0, 30.0) * noise.sigma
    return _with_mean(rng, noise, samples, rate, size * np.exp(-np.arange(samples) / time))


def day_cycle(rng: Rng) -> Log:
    """N, B, T_B at 1 to 4 Hz for 10 to 48 h, and 24 h cycles of 3 to 20 sigma of the process."""
    rate = float(rng.choice([1.0, 2.0, 4.0]))
    samples = round(3600.0 * rng.uniform(10.0, 48.0) * rate)
    noise = any_process(rng, samples, rate)
    angle = 2.0 * np.pi * (np.arange(samples) / rate / 86400.0 + rng.random())
    mean = between(rng, 3.0, 20.0) * noise.sigma * np.sin(angle)
    return _with_mean(rng, noise, samples, rate, mean)


def ventilation(rng: Rng) -> Log:
    """N, B, T_B, 4 to 10 h at 5 or 10 Hz: on and off every 10 to 30 min, 1 to 5 sigma, lagging."""
    rate = float(rng.choice([5.0, 10.0]))
    samples = round(3600.0 * rng.uniform(4.0, 10.0) * rate)
    noise = any_white(rng).with_process(between(rng, 20.0, 300.0), between(rng, 20.0, 60.0))
    period = rng.uniform(600.0, 1800.0)
    cycle = sim.lagged(
        sim.on_and_off(samples, rate, period, rng), rate, period / rng.uniform(4, 10)
    )
    return _with_mean(rng, noise, samples, rate, rng.uniform(1.0, 5.0) * noise.sigma * cycle)


def pulses(rng: Rng) -> Log:
    """N, B, T_B, and a bias that is 3 to 10 sigma off for 1 to 20 % of the log, 1 to 4 times."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    mean = np.zeros(samples)
    for _ in range(rng.integers(1, 5)):
        start, size = rng.uniform(0.0, 0.8) * samples, between(rng, 0.01, 0.2) * samples
        off = float(rng.choice([-1.0, 1.0])) * rng.uniform(3.0, 10.0) * noise.sigma
        mean[round(start) : round(start + size)] += off
    return _with_mean(rng, noise, samples, rate, mean)


def slow_line(rng: Rng) -> Log:
    """N, B, T_B, and a sinusoid of 0.5 to 5 sigma, 3 to 50 cycles, as of a heating that is kept."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    angle = 2.0 * np.pi * (between(rng, 3.0, 50.0) * np.arange(samples) / samples + rng.random())
    mean = between(rng, 0.5, 5.0) * noise.sigma * np.sin(angle)
    return _with_mean(rng, noise, samples, rate, mean)


def ramp(rng: Rng) -> Log:
    """N, B, T_B and a ramp of 3 to 30 sigma of the process; in half of the logs a walk too."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate) if rng.random() < 0.5 else any_process(rng, samples, rate)
    R = float(rng.choice([-1.0, 1.0])) * between(rng, 3.0, 30.0) * noise.sigma * rate / samples
    log = _with_mean(rng, noise, samples, rate, R / rate * np.arange(samples))
    return replace(log, truth=log.truth | {"R": Truth(abs(R), abs(R), loose=True)})


def _drifting(rng: Rng, course: Callable[[Array], NDArray[np.floating]]) -> Log:
    """Add to white noise and a process 1 to 30 sigma of it, peak to peak, of a course over 0..1."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    mean = course(np.arange(samples) / samples)
    size = between(rng, 1.0, 30.0) * noise.sigma / float(np.ptp(mean))
    return _with_mean(rng, noise, samples, rate, size * mean)


def part_of_day(rng: Rng) -> Log:
    """N, B, T_B, and 0.1 to 1 of a cycle."""
    cycles, phase = rng.uniform(0.1, 1.0), rng.uniform(0.0, 2.0 * np.pi)
    return _drifting(rng, lambda t: np.sin(2.0 * np.pi * cycles * t + phase))


def parabola(rng: Rng) -> Log:
    """N, B, T_B, and a parabola whose vertex lies in the log or up to its length from it."""
    vertex = rng.uniform(-1.0, 2.0)
    return _drifting(rng, lambda t: (t - vertex) ** 2)


def linear_pieces(rng: Rng) -> Log:
    """N, B, T_B, and a drift whose slope changes 2 to 8 times, as of weather."""
    kinks = np.concatenate(([0.0], np.sort(rng.random(rng.integers(2, 9))), [1.0]))
    values = rng.standard_normal(len(kinks))
    return _drifting(rng, lambda t: np.interp(t, kinks, values))


def smooth_drift(rng: Rng) -> Log:
    """N, B, T_B, and a smooth random course that turns a few times (a kernel of 0.1 to 0.5)."""
    centres, width = rng.uniform(-0.5, 1.5, 60), rng.uniform(0.1, 0.5)
    heights = rng.standard_normal(60)

    def course(t: Array) -> Array:
        coarse = np.linspace(0.0, 1.0, 2001)
        bells = np.exp(-0.5 * ((coarse[:, None] - centres) / width) ** 2) @ heights
        return np.asarray(np.interp(t, coarse, bells))

    return _drifting(rng, course)


def two_warm_ups(rng: Rng) -> Log:
    """N, B, T_B, and two exponentials, of T/50 to T/10 and T/5 to T."""
    fast, slow, share = between(rng, 0.02, 0.1), between(rng, 0.2, 1.0), rng.uniform(-1.0, 1.0)
    return _drifting(rng, lambda t: np.exp(-t / slow) + share * np.exp(-t / fast))


def look_up_table(rng: Rng) -> Log:
    """N, B, T_B, and the residue of a temperature table: 2 to 15 teeth of 2 to 8 sigma.

    The temperature settles, or follows a part of a day; a tooth ends where the table has an entry.
    """
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    t = np.arange(samples) / samples
    if rng.random() < 0.5:
        temperature = np.exp(-t / between(rng, 0.15, 0.6))
    else:
        temperature = np.sin(2.0 * np.pi * (rng.uniform(0.3, 1.5) * t + rng.random()))
    entries = between(rng, 2.0, 15.0) * temperature / float(np.ptp(temperature)) + rng.random()
    size = float(rng.choice([-1.0, 1.0])) * between(rng, 2.0, 8.0) * noise.sigma
    return _with_mean(rng, noise, samples, rate, size * np.mod(entries, 1.0))


def draughts(rng: Rng) -> Log:
    """N, B, T_B, and 2 to 9 draughts of 3 to 10 sigma: fast to begin, T/200 to T/20 to settle."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    settles = between(rng, 1 / 200, 1 / 20) * samples
    sign, size = float(rng.choice([-1.0, 1.0])), between(rng, 3.0, 10.0) * noise.sigma
    mean = np.zeros(samples)
    for _ in range(rng.integers(2, 10)):
        since = np.arange(samples) - rng.uniform(0.02, 0.95) * samples
        pulse = np.exp(-since / settles) - np.exp(-since / (0.1 * settles))
        mean += rng.uniform(0.3, 1.0) * np.where(since > 0.0, pulse, 0.0)
    return _with_mean(rng, noise, samples, rate, sign * size * mean)


def thermostat(rng: Rng) -> Log:
    """N, B, T_B, and 3 to 10 cycles of a heating, 1 to 5 sigma: on and off, behind a lag.

    Each half of a period differs by 10 to 30 %, so that the cycles are no line.
    """
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    period = samples / rng.uniform(3.0, 10.0)
    halves = 0.5 * period * (1.0 + rng.uniform(0.1, 0.3) * rng.standard_normal(40))
    ends = np.cumsum(np.maximum(halves, 0.1 * period)) - rng.uniform(0.0, period)
    cycle = np.asarray(np.searchsorted(ends, np.arange(samples)) % 2, dtype=np.float64)
    course = sim.lagged(cycle, 1.0, period / rng.uniform(3.0, 10.0))
    size = between(rng, 1.0, 5.0) * noise.sigma / float(np.std(course))
    return _with_mean(rng, noise, samples, rate, size * course)


# What the noise does


def growing_noise(rng: Rng) -> Log:
    """N grows 1.3 to 3 times over the log, beside a process."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    growth = rng.uniform(1.3, 3.0)
    log = noise.log(samples, rate, rng)
    more = sim.white(samples, rate, noise.N, rng)
    more *= np.sqrt(np.linspace(1.0, growth, samples) ** 2 - 1.0)
    truth = log.truth | {"N": Truth(noise.N, growth * noise.N, loose=True)}
    return replace(log, samples=log.samples + more, truth=truth)


def bursts(rng: Rng) -> Log:
    """N, B, T_B and 3 to 20 bursts of 1 to 20 s, 3 to 10 times as noisy."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    log = noise.log(samples, rate, rng)
    power = np.zeros(samples)
    for _ in range(rng.integers(3, 21)):
        size = round(rng.uniform(1.0, 20.0) * rate)
        start = rng.integers(0, samples - size)
        power[start : start + size] = rng.uniform(3.0, 10.0) ** 2 - 1.0
    more = sim.white(samples, rate, noise.N, rng) * np.sqrt(power)
    truth = log.truth | {"N": Truth(noise.N, noise.N * math.sqrt(1.0 + float(power.mean())))}
    return replace(log, samples=log.samples + more, truth=truth)


def heavy_tails(rng: Rng) -> Log:
    """White noise of Student's t with 3 to 6 degrees of freedom, a process and a walk."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    free = rng.uniform(3.0, 6.0)
    log = replace(noise, N=0.0).log(samples, rate, rng)
    tails = rng.standard_t(free, samples) * math.sqrt((free - 2.0) / free)
    made = log.samples + noise.N * math.sqrt(rate) * tails
    return replace(log, samples=made, truth=noise.truth())


def outliers(rng: Rng) -> Log:
    """N, B, T_B, K, and 1e-5 to 1e-3 of the samples 6 to 40 sigma off."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    log = noise.log(samples, rate, rng)
    off = np.flatnonzero(rng.random(samples) < between(rng, 1e-5, 1e-3))
    sigma = noise.N * math.sqrt(rate)
    size = sigma * rng.uniform(6.0, 40.0, len(off)) * rng.choice([-1.0, 1.0], len(off))
    made = log.samples.copy()
    made[off] += size
    N = Truth(noise.N, math.sqrt(noise.N**2 + float((size**2).sum()) / (samples * rate)))
    return replace(log, samples=made, truth=log.truth | {"N": N})


def zeros(rng: Rng) -> Log:
    """N, B, T_B, K of an accelerometer at 1 g, and 1e-5 to 1e-3 of the samples are 0."""
    samples, rate = any_length(rng)
    noise = replace(of_four(rng, samples, rate), quantity="accel")
    log = noise.log(samples, rate, rng)
    made = log.samples - log.samples.mean() + 9.8
    made[rng.random(samples) < between(rng, 1e-5, 1e-3)] = 0.0
    return replace(log, samples=made)


def _lines(rng: Rng, log: Log, noise: Noise, frequencies: NDArray[np.floating]) -> Log:
    """Return a log with sinusoids, 10 to 10,000 times the noise at their frequencies."""
    samples = len(log.samples)
    time = np.arange(samples) / log.rate
    made = log.samples.copy()
    for frequency in frequencies:
        ratio = between(rng, 10.0, 1e4)
        amplitude = 2.0 * noise.N * math.sqrt(ratio * log.rate / samples)
        made += amplitude * np.sin(2.0 * np.pi * (frequency * time + rng.random()))
    return replace(log, samples=made)


def lines(rng: Rng) -> Log:
    """N, B, T_B, K, and 1 to 5 sinusoids."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    frequencies = rng.uniform(0.02, 0.98, rng.integers(1, 6)) * 0.5 * rate
    return _lines(rng, noise.log(samples, rate, rng), noise, frequencies)


def comb(rng: Rng) -> Log:
    """N, B, T_B, K, and 20 to 60 harmonics."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    number = int(rng.integers(20, 61))
    frequencies = np.arange(1, number + 1) * (rng.uniform(0.7, 0.98) * 0.5 * rate / number)
    return _lines(rng, noise.log(samples, rate, rng), noise, frequencies)


def vibration(rng: Rng) -> Log:
    """N, B, T_B, K, and a resonance of quality 5 to 50 at 0.1 to 0.8 Nyquist, 0.3 to 3 sigma."""
    samples, rate = any_length(rng)
    noise = of_four(rng, samples, rate)
    log = noise.log(samples, rate, rng)
    frequency, quality = rng.uniform(0.1, 0.8) * 0.5 * rate, between(rng, 5.0, 50.0)
    sigma = between(rng, 0.3, 3.0) * noise.N * math.sqrt(rate)
    made = log.samples + sim.resonance(samples, rate, sigma, frequency, quality, rng)
    truth = {name: value for name, value in log.truth.items() if name != "cutoff"}
    return replace(log, samples=made, truth=truth)


# Time


def stamped(rng: Rng) -> Log:
    """N, B, T_B, K, with stamps on the grid."""
    samples, rate = any_length(rng)
    log = of_four(rng, samples, rate).log(samples, rate, rng)
    return replace(log, stamps=np.arange(samples) / rate)


def jitter(rng: Rng) -> Log:
    """Samples on a grid whose stamps are up to 0.01 to 0.4 intervals late."""
    log = stamped(rng)
    assert log.stamps is not None
    late = rng.uniform(0.0, between(rng, 0.01, 0.4) / log.rate, len(log.samples))
    return replace(log, stamps=log.stamps + late)


def _without(log: Log, lost: NDArray[np.bool_]) -> Log:
    assert log.stamps is not None
    return replace(log, samples=log.samples[~lost], stamps=log.stamps[~lost])


def lost_samples(rng: Rng) -> Log:
    """1e-4 to 0.1 of the samples are lost, one by one."""
    log = stamped(rng)
    return _without(log, rng.random(len(log.samples)) < between(rng, 1e-4, 0.1))


def lost_pieces(rng: Rng) -> Log:
    """Pieces of 10 to 1,000 samples are lost, 0.01 to 0.1 of the log."""
    log = stamped(rng)
    lost = np.zeros(len(log.samples), dtype=np.bool_)
    share = rng.uniform(0.01, 0.1)
    while lost.mean() < share:
        start = rng.integers(0, len(lost))
        lost[start : start + round(between(rng, 10.0, 1000.0))] = True
    return _without(log, lost)


def one_hole(rng: Rng) -> Log:
    """A piece of 0.05 to 0.3 of the log is lost."""
    log = stamped(rng)
    lost = np.zeros(len(log.samples), dtype=np.bool_)
    size = round(rng.uniform(0.05, 0.3) * len(lost))
    start = rng.integers(0, len(lost) - size)
    lost[start : start + size] = True
    return _without(log, lost)


def _with_pauses(rng: Rng, log: Log, sigma: float) -> Log:
    """Stop a logger 1 to 12 times for 5 to 300 s; the bias after each is another by sigma."""
    stamps = np.arange(len(log.samples)) / log.rate
    lost = np.zeros(len(stamps), dtype=np.bool_)
    mean = np.zeros(len(stamps))
    for _ in range(rng.integers(1, 13)):
        start, length = rng.uniform(0.05, 0.9) * stamps[-1], between(rng, 5.0, 300.0)
        length = min(length, 0.05 * stamps[-1])
        lost |= (stamps >= start) & (stamps < start + length)
        mean[stamps >= start + length] += sigma * rng.standard_normal()
    return _without(replace(log, samples=log.samples + mean, stamps=stamps), lost)


def restarts(rng: Rng) -> Log:
    """A process; 1 to 12 pauses, and the bias after each differs by 0.3 to 10 of its sigma."""
    samples, rate = any_length(rng)
    noise = any_process(rng, samples, rate)
    log = _with_mean(rng, noise, samples, rate, np.zeros(samples))
    return _with_pauses(rng, log, noise.sigma * between(rng, 0.3, 10.0))


def pauses(rng: Rng) -> Log:
    """A process and a walk; 1 to 12 pauses through which both go on."""
    samples, rate = any_length(rng)
    return _with_pauses(rng, of_four(rng, samples, rate).log(samples, rate, rng), 0.0)


CLEAN: Mapping[str, Case] = {
    case.__name__: case
    for case in (
        white,
        white_walk,
        white_process,
        papers_four,
        mti_7_gyro,
        mti_7_accelerometer,
        c102_accelerometer,
        slow_log,
        fast_log,
        white_flicker,
        white_flicker_walk,
        fractional_flicker,
        fractional_flicker_walk,
        two_processes,
        two_processes_walk,
        stamped,
    )
}
"""Logs as the models of the package are: they should be told."""

HARD: Mapping[str, Case] = {
    case.__name__: case
    for case in (
        weak_process,
        weak_walk,
        second_order_process,
        fast_process,
        fast_process_walk,
        process_of_five_seconds,
        strong_process,
        strong_process_walk,
        process_over_all,
        slow_process,
        walk_hides_white,
        walk_over_all,
        flicker_and_process,
        few_samples,
        angle_quantisation,
        analogue_1,
        analogue_2,
        analogue_steep,
        digital_1,
        digital_2,
        digital_steep,
        moving_mean,
        filtered_and_rounded,
        filtered_fast_process,
        filtered_walk,
        filtered_flicker,
        sinc_cubed,
        resonant_low_pass,
        decimated_with_filter,
        decimated_without_filter,
        means_of_samples,
        repeated_samples,
        fine_register,
        coarse_register,
        clipped,
        steps,
        steps_walk,
        steps_white,
        telegraph,
        warm_up,
        day_cycle,
        ventilation,
        pulses,
        slow_line,
        ramp,
        part_of_day,
        parabola,
        linear_pieces,
        smooth_drift,
        two_warm_ups,
        look_up_table,
        draughts,
        thermostat,
        growing_noise,
        bursts,
        heavy_tails,
        outliers,
        zeros,
        lines,
        comb,
        vibration,
        jitter,
        lost_samples,
        lost_pieces,
        one_hole,
        restarts,
        pauses,
    )
}
"""Logs that are not, or in which a parameter is hardly to be seen."""

FILTERED = (
    "analogue_1",
    "analogue_2",
    "analogue_steep",
    "digital_1",
    "digital_2",
    "digital_steep",
    "moving_mean",
)
"""Those behind a low-pass of the family that the package knows."""

CASES: dict[str, Case] = {**CLEAN, **HARD}
