from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.fft

from imubench_pipeline.estimators.spectrum import SINGLE, Spectrum, compute_spectra
from imubench_pipeline.estimators.whittle import Shapes
from imubench_pipeline.noise.terms.flicker import fit_flicker_bank
from tests.conftest import few

RATE = 10.0
CASES = ((1, 800), (8, 160))
"""Samples in a block, and number of blocks."""

VARIANCE = np.log(2) / (np.pi * 0.4365**2)
"""Of a Gauss-Markov process of B = 1: S_B T_B / 2."""

Covariance = Callable[[np.ndarray, np.ndarray], np.ndarray]


def spectrum_of_block_means(block: int, number: int) -> Spectrum:
    """Its densities do not matter here; only where its bins are."""
    log = np.random.default_rng(0).standard_normal(number)
    spectrum = compute_spectra([log], number, RATE / block)[0]
    return replace(spectrum, rate=RATE, block=np.full(len(spectrum.frequency), block))


def mean_squares(covariance: Covariance, block: int, number: int) -> np.ndarray:
    """Mean square of every DCT-II coefficient of block means, from the samples' covariance."""
    i = np.arange(number * block)
    of_samples = covariance(i[:, None], i[None, :])
    of_means = of_samples.reshape(number, block, number, block).mean(axis=(1, 3))
    transform = scipy.fft.dct(np.eye(number), type=2, norm="ortho", axis=0)
    return np.sum((transform @ of_means) * transform, axis=1)[1:] * block / RATE


def in_bins(spectrum: Spectrum, ordinates: np.ndarray) -> np.ndarray:
    """Average all ordinates in the bins of a spectrum."""
    first = np.concatenate(([0.0], np.cumsum(spectrum.ordinates)[:-1])).astype(int)
    assert spectrum.ordinates.sum() == len(ordinates)
    return np.add.reduceat(ordinates, first) / spectrum.ordinates


def errors(shape: np.ndarray, block: int, number: int, covariance: Covariance) -> np.ndarray:
    spectrum = spectrum_of_block_means(block, number)
    return shape / in_bins(spectrum, mean_squares(covariance, block, number)) - 1


@pytest.mark.parametrize(("block", "number"), CASES)
def test_white_noise_is_exact_in_every_bin(block: int, number: int) -> None:
    shape = Shapes(spectrum_of_block_means(block, number)).white()
    wrong = errors(shape, block, number, lambda i, j: (i == j) * RATE)
    np.testing.assert_allclose(wrong, 0.0, atol=1e-12)


@pytest.mark.parametrize(("block", "number"), CASES)
def test_a_random_walk_is_exact_in_single_ordinates_and_averaged_in_bins(
    block: int, number: int
) -> None:
    shape = Shapes(spectrum_of_block_means(block, number)).random_walk()
    wrong = errors(shape, block, number, lambda i, j: (np.minimum(i, j) + 1) / RATE)
    np.testing.assert_allclose(wrong[:SINGLE], 0.0, atol=1e-11)
    np.testing.assert_allclose(wrong, 0.0, atol=1e-4)


@pytest.mark.parametrize(("block", "number"), CASES)
@pytest.mark.parametrize("T_B", [2.0, 20.0, 240.0, 2000.0, 1e5])
def test_a_gauss_markov_process_is_exact_at_the_ends_of_the_log(
    block: int, number: int, T_B: float
) -> None:
    shape = Shapes(spectrum_of_block_means(block, number)).gauss_markov(T_B)
    wrong = errors(
        shape,
        block,
        number,
        lambda i, j: VARIANCE * np.exp(-np.abs(i - j) / RATE / T_B),
    )
    # Beyond the single ordinates the ends of the log are left out: 1 / (pi k) at most.
    np.testing.assert_allclose(wrong[:SINGLE], 0.0, atol=1e-10 if block == 1 else 5e-4)
    np.testing.assert_allclose(wrong[SINGLE:], 0.0, atol=1.0 / np.pi / SINGLE)
    assert abs(wrong[-1]) < 5e-5


@pytest.mark.parametrize(("block", "number"), CASES)
def test_a_correlation_shorter_than_a_block_is_folded(block: int, number: int) -> None:
    T_B = 0.3
    shape = Shapes(spectrum_of_block_means(block, number)).gauss_markov(T_B)
    wrong = errors(
        shape,
        block,
        number,
        lambda i, j: VARIANCE * np.exp(-np.abs(i - j) / RATE / T_B),
    )
    np.testing.assert_allclose(wrong, 0.0, atol=5e-3)
    assert abs(wrong[-1]) < 5e-5


@pytest.mark.parametrize(("block", "number"), few(CASES[1:], CASES[:1]))
def test_flicker_noise_is_that_of_its_bank_of_gauss_markov_processes(
    block: int, number: int
) -> None:
    interval = 1.0 / RATE
    expected = np.zeros(number - 1)
    for term in fit_flicker_bank(1.0, interval, 30.0 * block * number * interval):
        if term.symbol == "N":
            expected += term.N**2
            continue
        stationary = term.density * term.T_B / 2.0
        decay = np.exp(-interval / term.T_B)
        expected += stationary * mean_squares(
            lambda i, j, decay=decay: decay ** np.abs(i - j), block, number
        )
    spectrum = spectrum_of_block_means(block, number)
    wrong = Shapes(spectrum).flicker() / in_bins(spectrum, expected) - 1
    # The bank itself is good to a few 1e-4.
    np.testing.assert_allclose(wrong[:SINGLE], 0.0, atol=4e-4)
    np.testing.assert_allclose(wrong[SINGLE:], 0.0, atol=4e-3)
    assert abs(wrong[-1]) < 2e-4


@pytest.mark.parametrize(("block", "number"), CASES)
def test_quantization_away_from_the_lowest_ordinates(block: int, number: int) -> None:
    shape = Shapes(spectrum_of_block_means(block, number)).quantization()
    wrong = errors(
        shape, block, number, lambda i, j: (2.0 * (i == j) - (np.abs(i - j) == 1)) * RATE**2
    )
    # The two roundings at the ends of the log are left out: (4 / n) cos^2(omega / 2).
    edges = 4.0 / number / (2 - 2 * np.cos(np.pi * np.arange(1, number) / number))
    spectrum = spectrum_of_block_means(block, number)
    high = in_bins(spectrum, edges) < 0.01
    assert high.sum() > 10
    np.testing.assert_allclose(wrong[high], 0.0, atol=0.011)
    assert abs(wrong[-1]) < 5e-4


def test_a_segment_of_the_log_sees_the_same_densities_as_the_whole(rng) -> None:
    spectrum = compute_spectra([rng.standard_normal(300_000)], 300_000, RATE)[0]
    shapes = Shapes(spectrum)
    low, high = spectrum.block > 1, spectrum.block == 1
    assert low.any()
    assert high.any()
    f = spectrum.frequency
    flat = f < 0.3
    np.testing.assert_allclose(
        shapes.random_walk()[flat] * (2 * np.pi * f[flat]) ** 2, 1, rtol=0.02
    )
    wide = flat & (f > f[SINGLE])
    np.testing.assert_allclose(shapes.flicker()[wide] * 2 * np.pi * f[wide], 1, rtol=0.01)
    driving = 2 * VARIANCE / 50.0
    expected = driving / (1 / 50.0**2 + (2 * np.pi * f) ** 2)
    np.testing.assert_allclose(shapes.gauss_markov(50.0)[wide], expected[wide], rtol=0.01)
