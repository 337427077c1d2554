"""Simulate logs from a noise model, or only the Allan variances of an ensemble of logs.

A full-length log is simulated with the discrete state-space model, block by block. The Allan
variances of an ensemble do not need full-length logs. At long tau they follow from sums over blocks
of samples, which are drawn jointly with the state (exact). At short tau, with a thousand clusters
or more, they are drawn from their covariance.
"""

import hashlib
import math
from collections.abc import Iterator

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.allan import of_phase
from imubench_pipeline.allan.phase import integrate
from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.noise.state_space import factor_covariance
from imubench_pipeline.noise.variance_covariance import compute_variance_covariance
from imubench_pipeline.typing import Array

_BLOCK_SAMPLES = 1 << 16  # fits the cache: a quarter faster than a million
_MAX_BLOCK_SUMS = 1 << 12  # largest number of blocks of a member of the ensemble
_MIN_BLOCKS_IN_CLUSTER = 16  # for shorter clusters the covariance is used


def channel_rng(seed: int, *names: str) -> np.random.Generator:
    """Return the random generator of a channel, which depends on the seed and the names only.

    The names of a simulated log identify its channel. For results from a log they are texts that
    depend on its samples (such as ``repr`` of a model), so that copies of a log have equal limits.
    """
    digest = hashlib.sha256("/".join(names).encode()).digest()
    words = [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]
    return np.random.default_rng([seed, *words])


def simulate(model: NoiseModel, rate: float, samples: int, rng: np.random.Generator) -> Array:
    """Return a simulated log, shape (samples,), rad/s or m/s², at a rate in Hz.

    Stationary processes start in their stationary distribution, the random walk and the ramp at 0,
    sinusoids at a random phase; flicker noise is a bank of Gauss-Markov processes up to the length
    of the log.
    """
    blocks = list(simulate_blocks(model, rate, samples, rng))
    return np.concatenate(blocks) if blocks else np.empty(0)


def simulate_blocks(
    model: NoiseModel,
    rate: float,
    samples: int,
    rng: np.random.Generator,
    block: int = _BLOCK_SAMPLES,
) -> Iterator[Array]:
    """Yield a simulated log in blocks; the log does not depend on their size (see `simulate`)."""
    interval = 1.0 / rate
    terms = model.realised(interval, max(samples, 2) * interval)
    white, *streams = rng.spawn(1 + len(terms))
    spaces = [term.state_space(interval) for term in terms]
    states = [term.start(stream, interval) for term, stream in zip(terms, streams, strict=True)]
    spread = math.sqrt(sum(space.measurement_noise for space in spaces))
    for start in range(0, samples, block):
        size = min(block, samples - start)
        log = white.standard_normal(size) * spread
        for space, state, stream in zip(spaces, states, streams, strict=True):
            if len(state):
                driven = np.flatnonzero(np.diag(space.process_noise))
                root = factor_covariance(space.process_noise)[np.ix_(driven, driven)]
                drive = stream.standard_normal((size, len(driven)))
                if len(driven) == 1:  # a matrix product takes four times as long
                    drive *= root[0, 0]
                else:
                    drive = drive @ root.T
                _add_states(log, state, space.transition, driven, drive, space.output)
        yield log


@njit(cache=True, nogil=True)
def _add_states(
    log: Array,
    state: Array,
    transition: Array,
    driven: NDArray[np.int64],
    drive: Array,
    output: Array,
) -> None:
    """Add the output of states to a log; the states advance to the end of the log in place."""
    if state.size == 1 and driven.size == 1:
        x, phi, h = state[0], transition[0, 0], output[0]
        for i in range(log.size):
            log[i] += h * x
            x = phi * x + drive[i, 0]
        state[0] = x
        return
    before = np.empty_like(state)
    for i in range(log.size):
        for a in range(state.size):
            log[i] += output[a] * state[a]
            before[a] = state[a]
        for a in range(state.size):
            state[a] = 0.0
            for b in range(state.size):
                state[a] += transition[a, b] * before[b]
        for j in range(driven.size):
            state[driven[j]] += drive[i, j]


def reconstructed_variance(
    model: NoiseModel, rate: float, samples: int, sizes: NDArray[np.int64], rng: np.random.Generator
) -> Array:
    """Return the Allan variance of one full-length simulated log at ``sizes``, shape (m,).

    The arguments are as in `ensemble`.
    """
    phase = integrate(simulate_blocks(model, rate, samples, rng), samples, holes=False)
    return of_phase(phase, rate, sizes).variance


def ensemble(
    model: NoiseModel,
    rate: float,
    samples: int,
    sizes: NDArray[np.int64],
    members: int,
    rng: np.random.Generator,
) -> Array:
    """Return the Allan variances of an ensemble of simulated logs, shape (members, m).

    They are in (rad/s)² or (m/s²)². ``sizes``, shape (m,), are the cluster sizes in samples; each
    log has ``samples`` samples at a rate in Hz.
    """
    width = max(1, -(-samples // _MAX_BLOCK_SUMS))
    long = sizes >= (_MIN_BLOCKS_IN_CLUSTER * width if width > 1 else 1)
    result = np.empty((members, len(sizes)))
    for_short, for_long = rng.spawn(2)
    if not long.all():
        short = sizes[~long]
        mean = model.allan_variance(short / rate, rate)
        relative = compute_variance_covariance(model, rate, samples, short) / np.outer(mean, mean)
        # Wilson and Hilferty (1931): the cube root of a chi-squared variate is nearly normal.
        spread = np.sqrt(np.diag(relative))
        values, vectors = np.linalg.eigh(relative / np.outer(spread, spread))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        normal = for_short.standard_normal((members, len(short))) @ root.T
        ninth = spread**2 / 9.0  # 2 / (9 edf) with spread^2 = 2 / edf
        result[:, ~long] = mean * (1.0 - ninth + np.sqrt(ninth) * normal) ** 3
    if long.any():
        blocks = samples // width
        in_blocks = np.maximum(1, np.rint(sizes[long] / width).astype(np.int64))
        in_blocks = np.minimum(in_blocks, blocks // 2)
        # A cluster of complete blocks differs from the requested one by a few per cent.
        wanted = model.allan_variance(sizes[long] / rate, rate)
        scale = wanted / model.allan_variance(in_blocks * width / rate, rate)
        distinct, place = np.unique(in_blocks, return_inverse=True)
        for member in range(members):
            sums = block_sums(model, rate, blocks, width, for_long)
            theta = integrate([sums / width], blocks, holes=False).theta
            result[member, long] = _sum_variances(theta, distinct)[place] * scale
    return result


@njit(cache=True, nogil=True)
def _sum_variances(theta: Array, sizes: NDArray[np.int64]) -> Array:
    """Return Allan variances without limits, for the members of an ensemble."""
    variances = np.empty(sizes.size)
    for j in range(sizes.size):
        n = sizes[j]
        total = 0.0
        terms = theta.size - 2 * n
        for i in range(terms):
            difference = theta[i + 2 * n] - 2.0 * theta[i + n] + theta[i]
            total += difference * difference
        variances[j] = total / (2.0 * n * n * terms)
    return variances


def block_sums(
    model: NoiseModel, rate: float, blocks: int, width: int, rng: np.random.Generator
) -> Array:
    """Draw the sums of a log over blocks of ``width`` samples, exact in distribution, (blocks,)."""
    interval = 1.0 / rate
    sums = np.zeros(blocks)
    for term in model.realised(interval, max(blocks * width, 2) * interval):
        sums += term.block_sums(blocks, width, rate, rng)
    return sums
