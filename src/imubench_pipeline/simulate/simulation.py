"""Simulate the log of a sensor axis block by block, with exact discretisation.

True motion and temperature are given at the sampling times and are linear in between (first-order
hold); a step is a ramp over one sampling interval. For this input, filter and thermal lag are
exact, as is the linear part of the temperature drift through both. The quadratic part of the drift
is interpolated linearly between samples.

The initial state is stationary: the filter and the lag are at rest, the ramp has always been
rising, and Gauss-Markov processes and the filter noise have their stationary distribution. The
random walk is 0 at the first sample, and the filter state is consistent with its past. The
recursion of one axis is compiled (`run`).
"""

import math
from collections.abc import Callable, Iterator

import numpy as np
from numba import njit
from scipy.linalg import expm

from imubench_pipeline.noise import Term
from imubench_pipeline.noise.terms.base import drives_of
from imubench_pipeline.simulate.discretisation import (
    compute_stationary_distribution,
    compute_white_factor,
    discretise_held_input,
    discretise_slow_sources,
)
from imubench_pipeline.simulate.model import (
    MAX_FREQUENCY_RATIO,
    SensorModel,
    fit_density_bank,
)
from imubench_pipeline.typing import Array

STARTED, INPUT, TEMPERATURE, LAG = range(4)
"""Indices in the memory of the recursion: whether it has begun, and values of the last sample."""

SAMPLES_PER_CHUNK = 1 << 14
"""Samples per call of the recursion, for any block size: the last digit of a sample must not depend
on the block size."""

Signal = Callable[[int, int], Array]
"""Returns the values at samples ``start`` to ``stop``."""


# Reordered sums are allowed: with many slow states this is twice as fast.
@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def run(
    log: Array,
    entering: Array,
    temperature: Array,
    normal: Array,
    memory: Array,
    x: Array,
    e: Array,
    decay: Array,
    own: Array,
    coupling: Array,
    shared: Array,
    transition: Array,
    factor: Array,
    output: Array,
    white: float,
    step: Array,
    lag: Array,
    lag_coupling: Array,
    lagged_step: Array,
    drift: Array,
) -> None:
    """Write samples to a log, and update the states to the last sample.

    ``log``, shape (L,), is the output of the filter; ``entering`` and ``temperature``, shape (L,),
    the input at the samples without noise and drift, and °C (empty: no drift), linear in between;
    ``normal``, shape (L, n + max(m, 1)), normal deviates, whose first row the states do not use at
    the first sample of the log. ``memory``, ``x`` and ``e``, shapes (4,), (n,) and (m,), are the
    states, changed in place; ``decay``, ``own``, ``coupling`` and ``shared``, shapes (n,), (n,),
    (m, n) and (m, n), the matrices of the slow states; ``transition``, ``factor`` and ``output``,
    shapes (m, m), (m, m) and (m,), the matrices of the filter; its own noise is normal @ factor.
    ``white`` is the standard deviation of white noise per sample, if there is no filter; ``step``,
    ``lag``, ``lag_coupling`` and ``lagged_step``, shapes (m,), (2,), (m,) and (m,), are from
    `HeldInput`; ``drift``, shape (3,), is sensitivity, SI/K, quadratic, SI/K², and reference, °C.
    """
    n, m = x.size, e.size
    before = np.empty(m)
    for i in range(log.size):
        u = entering[i]
        present = 0.0
        change_of_temperature = 0.0
        if temperature.size:
            present = temperature[i]
            if memory[STARTED] > 0.0:
                change_of_temperature = present - memory[TEMPERATURE]
        behind = memory[LAG]
        ahead = lag[0] * behind + lag[1] * change_of_temperature
        lagged = present + ahead - drift[2]
        if temperature.size:
            u += drift[1] * lagged * lagged
        if memory[STARTED] > 0.0:
            change = u - memory[INPUT]
            for a in range(m):
                gained = step[a] * change + drift[0] * (
                    lag_coupling[a] * behind + lagged_step[a] * change_of_temperature
                )
                for j in range(n):
                    gained += coupling[a, j] * x[j] + shared[a, j] * normal[i, j]
                for b in range(m):
                    gained += transition[a, b] * e[b] + factor[b, a] * normal[i, n + b]
                before[a] = gained
            for j in range(n):
                x[j] = decay[j] * x[j] + own[j] * normal[i, j]
            for a in range(m):
                e[a] = before[a]
        memory[LAG] = ahead
        memory[INPUT] = u
        memory[TEMPERATURE] = present
        memory[STARTED] = 1.0
        total = u
        if temperature.size:
            total += drift[0] * lagged
        for j in range(n):
            total += x[j]
        for a in range(m):
            total += output[a] * e[a]
        if m == 0:
            total += white * normal[i, n]
        log[i] = total


def simulate(
    model: SensorModel,
    rate: float,
    samples: int,
    rng: np.random.Generator,
    *,
    true: Signal | None = None,
    temperature: Signal | None = None,
) -> Array:
    """Return a simulated log of one axis, in memory, shape (samples,): see `simulate_blocks`."""
    blocks = simulate_blocks(model, rate, samples, rng, true=true, temperature=temperature)
    return np.concatenate([*blocks, np.empty(0)])


def simulate_blocks(
    model: SensorModel,
    rate: float,
    samples: int,
    rng: np.random.Generator,
    *,
    true: Signal | None = None,
    temperature: Signal | None = None,
    block: int = SAMPLES_PER_CHUNK,
) -> Iterator[Array]:
    """Yield a simulated log of one axis, rad/s or m/s², in blocks of shape (block,).

    The log does not depend on the size of the blocks, a multiple of `SAMPLES_PER_CHUNK`; the last
    one may be shorter. The rate is in Hz, the length of the log in samples. For ``rng`` see
    `imubench_pipeline.noise.simulate.channel_rng`. ``true`` returns the true rate or specific force
    along the axis, rad/s or m/s², for the indices of the first sample and one past the last; 0 by
    default. ``temperature`` does so in °C; by default it is the reference of the drift. Raises
    ValueError if the rate is not above 0, or a value of ``true`` or ``temperature`` is not finite.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f"the rate is {rate} Hz, expected a frequency above 0")
    axis = _Axis(model, rate, samples, rng)
    for start in range(0, samples, block):
        stop = min(start + block, samples)
        yield np.concatenate(
            [
                axis.samples(first, min(first + SAMPLES_PER_CHUNK, stop), true, temperature)
                for first in range(start, stop, SAMPLES_PER_CHUNK)
            ]
        )


class _Axis:
    def __init__(
        self, model: SensorModel, rate: float, samples: int, rng: np.random.Generator
    ) -> None:
        self._model, self._rate = model, rate
        interval = 1.0 / rate
        duration = max(samples, 2) * interval
        # Flicker noise is a bank of processes.
        terms: list[Term] = []
        banks: list[Term] = []
        for term in model.noise.terms:
            if term.drive is None or not term.drive.flicker:
                terms.append(term)
            elif model.low_pass is None:
                banks += term.realised(interval, duration)
            else:
                # Down to the frequency 1 / (2 duration)
                highest = MAX_FREQUENCY_RATIO * max(model.low_pass.cutoff, rate / 2.0)
                banks += fit_density_bank(term.drive.flicker, 0.5 / duration, highest)
        drives = drives_of([*terms, *banks])
        self._times, self._densities, self._white = drives.times, drives.densities, drives.white
        begin, self._noise, lines, self._counts = rng.spawn(4)
        self._slow, self._filter = self._discretise(interval)
        drift = model.drift
        hold = discretise_held_input(model.low_pass, drift.lag if drift else 0.0, interval)
        lag = np.array([hold.lag_decay, hold.lag_step])
        figures = (drift.sensitivity, drift.quadratic, drift.reference) if drift else (0.0,) * 3
        self._input = (hold.step, lag, hold.lag_coupling, hold.lagged_step, np.array(figures))
        # The states at the first sample.
        walk = np.isinf(self._times)
        spread = np.where(walk, 0.0, np.sqrt(self._densities * np.where(walk, 0, self._times) / 2))
        x = spread * begin.standard_normal(len(spread))
        low_pass = self._model.low_pass
        if low_pass is None:
            self._x, self._e = x, np.zeros(0)
        else:
            mean, covariance = compute_stationary_distribution(
                self._times, self._densities, self._white, low_pass
            )
            values, vectors = np.linalg.eigh(covariance)
            root = vectors * np.sqrt(np.maximum(values, 0.0))
            # For a ramp that has always been rising, e is constant: F^-1 p R.
            ramp = np.linalg.solve(low_pass.transition, low_pass.steady_state) * self._model.noise.R
            self._x, self._e = x, x @ mean + root @ begin.standard_normal(low_pass.order) + ramp
        self._memory = np.zeros(4)
        phases = (lines.uniform(0.0, 2.0 * math.pi) for _ in model.noise.sinusoids)
        self._sinusoids = list(zip(model.noise.sinusoids, phases, strict=True))
        self._counted = self._counts.standard_normal() if model.noise.Q else 0.0

    def _discretise(
        self, interval: float
    ) -> tuple[tuple[Array, Array, Array, Array], tuple[Array, Array, Array, float]]:
        """Return the arguments of `run` for slow states and filter, over one sampling interval."""
        low_pass = self._model.low_pass
        slow = discretise_slow_sources(self._times, interval, low_pass)
        scale = np.sqrt(self._densities)
        coupling, shared = (
            np.ascontiguousarray(part.T) for part in (slow.coupling, slow.shared * scale[:, None])
        )
        states = (slow.decay, slow.own * scale, coupling, shared)
        if low_pass is None:
            none = np.zeros((0, 0))
            return states, (none, none, np.zeros(0), math.sqrt(self._white / interval))
        # Noise of the filter that is independent of the noise of the slow states.
        parts = (slow.residual * scale[:, None, None]).reshape(-1, low_pass.order)
        white_part = math.sqrt(self._white) * compute_white_factor(low_pass, interval)
        factor = np.asarray(np.linalg.qr(np.concatenate([parts, white_part]), mode="r"))
        transition = np.asarray(expm(low_pass.transition * interval))
        return states, (transition, factor, low_pass.output, 0.0)

    def samples(
        self, start: int, stop: int, true: Signal | None, temperature: Signal | None
    ) -> Array:
        """Return the samples ``start`` to ``stop``, which must follow the last ones."""
        model, rate = self._model, self._rate
        size = stop - start
        entering = np.full(size, model.bias)
        if true is not None:
            entering += (1.0 + model.scale_error) * _check_signal(true(start, stop), "motion")
        if model.noise.R:
            entering += model.noise.R / rate * np.arange(start, stop)
        temperatures = np.empty(0)
        if temperature is not None and model.drift is not None:
            temperatures = _check_signal(temperature(start, stop), "temperature")
        normal = self._noise.standard_normal((size, len(self._x) + max(len(self._e), 1)))
        log = np.empty(size)
        states = (self._memory, self._x, self._e)
        run(log, entering, temperatures, normal, *states, *self._slow, *self._filter, *self._input)
        for line, phase in self._sinusoids:
            response = model.low_pass.response(line.frequency) if model.low_pass else 1.0
            # Remove whole periods first: they would cost precision after 10^9 samples.
            turns = np.arange(start, stop) * (line.frequency / rate) % 1.0
            shift = phase + np.angle(response)
            log += line.amplitude * abs(response) * np.cos(2.0 * math.pi * turns + shift)
        if model.noise.Q:
            counts = self._counts.standard_normal(size)
            log += model.noise.Q * rate * np.diff(counts, prepend=self._counted)
            self._counted = counts[-1]
        if model.full_scale is not None:
            np.clip(log, -model.full_scale, model.full_scale, out=log)
        if model.resolution > 0.0:
            log /= model.resolution
            np.rint(log, out=log)
            log *= model.resolution
        return log


def _check_signal(values: Array, what: str) -> Array:
    signal = np.ascontiguousarray(values, dtype=np.float64)
    if not np.isfinite(signal.sum()):
        raise ValueError(f"{what} has values that are not finite; expected finite numbers only")
    return signal
