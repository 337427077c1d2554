"""The covariance of single samples, and what follows from it by matrices alone."""

import numpy as np

from imubench_pipeline.noise import (
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    WhiteNoise,
)


def of_samples(model, samples, rate, longest=1e5):
    """Return the covariance of samples 0, 1, 2 ...; the walk is 0 at the first."""
    i = np.arange(samples)
    lag = np.abs(np.subtract.outer(i, i))
    total = np.zeros((samples, samples))
    for term in model.realised(1.0 / rate, longest):
        match term:
            case WhiteNoise(N):
                total += np.eye(samples) * N**2 * rate
            case GaussMarkov():
                total += term.density * term.T_B / 2.0 * np.exp(-lag / rate / term.T_B)
            case RandomWalk(K):
                total += K**2 / rate * np.minimum.outer(i, i)
            case Quantization(Q):
                total += (Q * rate) ** 2 * (2.0 * (lag == 0) - 1.0 * (lag == 1))
            case Ramp(R):
                total += (R / rate) ** 2 * np.outer(i, i)
            case Sinusoid(amplitude, frequency):
                total += 0.5 * amplitude**2 * np.cos(2.0 * np.pi * frequency * lag / rate)
            case _:
                raise TypeError(term)
    return total


def averaging(blocks):
    """Return the matrix that makes block means of the samples from the first block on."""
    first = blocks.start[0]
    matrix = np.zeros((len(blocks), blocks.stop[-1] - first))
    for row, start, stop in zip(matrix, blocks.start, blocks.stop, strict=True):
        row[start - first : stop - first] = 1.0 / (stop - start)
    return matrix


def of_blocks(model, blocks):
    """Return the covariance of complete block means."""
    matrix = averaging(blocks)
    longest = max(blocks.duration, 2.0 / blocks.rate)
    return matrix @ of_samples(model, matrix.shape[1], blocks.rate, longest) @ matrix.T


MODELS = {
    "N": NoiseModel(N=0.1),
    "N+GM+K": NoiseModel(N=0.1, B=0.05, T_B=7.0, K=0.01),
    "N+GM+GM": NoiseModel(N=0.1, B=0.2, T_B=0.4, further=(GaussMarkov(0.05, 40.0),)),
    "N+F+K": NoiseModel(N=0.1, B=0.05, K=0.01),
    "Q+N+K": NoiseModel(Q=0.05, N=0.1, K=0.01),
    "N+R+S": NoiseModel(N=0.1, R=0.01, sinusoids=(Sinusoid(0.2, 0.13),)),
}
