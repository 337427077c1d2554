"""Spectrum and Allan variance of sampled noise after a low-pass filter, in closed form.

Both follow from the exact discrete state space of the process and its filter. Flicker noise is a
sum of Gauss-Markov processes; it is truncated at correlation times with a negligible contribution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.simulate.discretisation import (
    compute_filter_transition,
    compute_stationary_distribution,
    compute_white_factor,
    discretise_slow_sources,
)
from imubench_pipeline.typing import Array

_FREQUENCIES_PER_CHUNK = 2048  # frequencies per block of the computation
_MIN_TIME_RATIO = 1e-5
"""Shortest correlation time of flicker noise, over the time constant of the filter or the sampling
interval, whichever is shorter."""

_MAX_TIME_RATIO = 1e5  # longest correlation time of flicker noise, over the longest requested time


@dataclass(frozen=True)
class Sources:
    """Noise at the input of a filter."""

    white: float  # N^2
    flicker: float  # B^2 of flicker noise
    # times, densities: shape (n,); correlation time, s, and driving density of Gauss-Markov
    # processes; an infinite time: a random walk
    times: Array
    densities: Array

    def realised(self, low_pass: LowPass, interval: float, longest: float) -> tuple[Array, Array]:
        """Return times and densities, (n,), with the processes that approximate flicker noise.

        The sampling interval and the longest requested time are in s.
        """
        if self.flicker == 0.0:
            return self.times, self.densities
        # Log-spaced processes, five per decade, sum to flicker noise with a ripple below 1e-8.
        shortest = _MIN_TIME_RATIO * min(1.0 / low_pass.angular_cutoff, interval)
        longest *= _MAX_TIME_RATIO
        count = 2 + math.ceil(5.0 * math.log10(longest / shortest))
        times = np.geomspace(shortest, longest, count)
        variance = math.log(times[1] / times[0]) / math.pi
        densities = self.flicker * 2.0 * variance / times
        return np.concatenate([self.times, times]), np.concatenate([self.densities, densities])


def compute_sampled_spectrum(
    sources: Sources, low_pass: LowPass, omega: Array, rate: float
) -> Array:
    """Return the spectrum of the samples, SI^2, in the shape of omega, rad/sample, not 0.

    The rate is in Hz.
    """
    interval = 1.0 / rate
    flat = np.ravel(omega)
    lowest = float(np.abs(flat).min(initial=math.pi))
    times, densities = sources.realised(low_pass, interval, interval / lowest)
    slow = discretise_slow_sources(times, interval, low_pass)
    transition = compute_filter_transition(low_pass, interval)
    white = compute_white_factor(low_pass, interval)
    spectrum = np.empty_like(flat)
    for begin in range(0, len(flat), _FREQUENCIES_PER_CHUNK):
        w = flat[begin : begin + _FREQUENCIES_PER_CHUNK]
        turn = np.exp(1j * w)[:, None, None] * np.eye(low_pass.order)
        # g = c (z - A)^-1, shape (frequencies, m)
        g = np.linalg.solve(
            (turn - transition).swapaxes(1, 2),
            np.broadcast_to(low_pass.output[:, None], (len(w), low_pass.order, 1)).astype(complex),
        )[..., 0]
        power = sources.white * (np.abs(g @ white.T) ** 2).sum(axis=1)
        if len(times):
            # z - e^(-interval/T), without cancellation where both are close to 1
            gap = (-2.0 * np.sin(w / 2.0) ** 2 + 1j * np.sin(w))[:, None] + slow.lost
            through = (1.0 + g @ slow.coupling.T) / gap
            first = np.abs(through * slow.own + g @ slow.shared.T) ** 2
            rest = (np.abs(np.einsum("wm,nkm->wnk", g, slow.residual)) ** 2).sum(axis=2)
            power += (first + rest) @ densities
        spectrum[begin : begin + _FREQUENCIES_PER_CHUNK] = power
    return spectrum.reshape(np.shape(omega))


def compute_allan_variance(sources: Sources, low_pass: LowPass, n: Array, rate: float) -> Array:
    """Return the Allan variance of the samples, SI^2, in the shape of n, samples per cluster.

    The difference of the sums over two adjacent clusters is a linear function of the state before
    them and of the noise in them. Both contributions are computed by doubling, as sums of positive
    terms, at a cost proportional to log n. The rate is in Hz.
    """
    interval = 1.0 / rate
    sizes = np.ravel(n).astype(np.int64)
    longest = interval * int(sizes.max(initial=1))
    times, densities = sources.realised(low_pass, interval, longest)
    sample, start = _make_one_sample(sources.white, times, densities, low_pass, interval)
    powers = [sample]
    for _ in range(int(sizes.max(initial=1)).bit_length() - 1):
        powers.append(powers[-1].then(powers[-1]))
    variance = np.empty(len(sizes))
    for i, size in enumerate(sizes):
        chosen = [powers[bit] for bit in range(int(size).bit_length()) if size >> bit & 1]
        cluster = chosen[0]
        for part in chosen[1:]:
            cluster = cluster.then(part)
        variance[i] = cluster.difference(start) / (2.0 * float(size) ** 2)
    return variance.reshape(np.shape(n))


@dataclass(frozen=True)
class _Cluster:
    """State transition and sum of consecutive samples of independent systems z = (x, e)."""

    # shape (n, k, k); transition of the state over the samples, and identity minus transition
    transition: Array
    lost: Array
    sums: Array  # shape (n, k); gain from the state before the samples to their sum
    # state, both, total: shapes (n, k, k), (n, k), (n,); covariance of the noise contributions to
    # the state after the samples and to their sum: state, state with sum, sum
    state: Array
    both: Array
    total: Array

    def then(self, later: _Cluster) -> _Cluster:
        """Return the concatenation of this cluster and the next one."""
        after = later.transition
        carried = np.einsum("nij,nj->ni", self.state, later.sums)
        return _Cluster(
            after @ self.transition,
            self.lost + self.transition @ later.lost,
            self.sums + np.einsum("nj,njk->nk", later.sums, self.transition),
            after @ self.state @ after.swapaxes(1, 2) + later.state,
            np.einsum("nij,nj->ni", after, self.both + carried) + later.both,
            self.total
            + 2.0 * np.einsum("ni,ni->n", later.sums, self.both)
            + np.einsum("ni,ni->n", later.sums, carried)
            + later.total,
        )

    def difference(self, start: Array) -> float:
        """Return the variance of the difference between the sums of the next and this cluster."""
        change = np.einsum("nj,njk->nk", self.sums, self.lost)
        before = np.einsum("ni,nij,nj->n", change, start, change)
        inside = (
            np.einsum("ni,nij,nj->n", self.sums, self.state, self.sums)
            - 2.0 * np.einsum("ni,ni->n", self.sums, self.both)
            + self.total
        )
        return float((before + inside + self.total).sum())


def _make_one_sample(
    white: float, times: Array, densities: Array, low_pass: LowPass, interval: float
) -> tuple[_Cluster, Array]:
    """Return one sample of every source, white noise last, and the stationary covariance."""
    n, m = len(times), low_pass.order
    slow = discretise_slow_sources(times, interval, low_pass)
    A = compute_filter_transition(low_pass, interval)
    transition = np.zeros((n + 1, 1 + m, 1 + m))
    transition[:, 1:, 1:] = A
    transition[:n, 0, 0] = slow.decay
    transition[:n, 1:, 0] = slow.coupling
    lost = np.eye(1 + m) - transition
    lost[:n, 0, 0] = slow.lost
    factor = np.zeros((n + 1, 1 + m, 1 + m))
    factor[:n, 0, 0] = slow.own
    factor[:n, 0, 1:] = slow.shared
    factor[:n, 1:, 1:] = slow.residual
    factor[:n] *= np.sqrt(densities)[:, None, None]
    factor[n, 1:, 1:] = math.sqrt(white) * compute_white_factor(low_pass, interval)
    sums = np.zeros((n + 1, 1 + m))
    sums[:n, 0] = 1.0
    sums[:, 1:] = low_pass.output
    state, both = factor.swapaxes(1, 2) @ factor, np.zeros((n + 1, 1 + m))
    sample = _Cluster(transition, lost, sums, state, both, np.zeros(n + 1))
    start = np.zeros((n + 1, 1 + m, 1 + m))
    for i in range(n):
        # The initial value of a random walk does not matter: it cancels in the difference.
        alone = (times[i : i + 1], densities[i : i + 1])
        mean, covariance = compute_stationary_distribution(*alone, 0.0, low_pass)
        variance = 0.0 if math.isinf(times[i]) else densities[i] * times[i] / 2.0
        start[i, 0, 0] = variance
        start[i, 0, 1:] = start[i, 1:, 0] = variance * mean[0]
        start[i, 1:, 1:] = covariance + variance * np.outer(mean[0], mean[0])
    start[n, 1:, 1:] = compute_stationary_distribution(times[:0], densities[:0], white, low_pass)[1]
    return sample, start
