import numpy as np
import pytest
from allantools.ci import edf_greenhall

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.allan.confidence import deviation_limits, equivalent_degrees, noise_exponent
from tests.conftest import few


@pytest.mark.parametrize("exponent", [2, 1, 0, -1, -2])
@pytest.mark.parametrize("samples", [1000, 100_000])
@pytest.mark.parametrize("part", [0.05, 0.1, 0.3])
def test_agrees_with_greenhall_and_riley(exponent: int, samples: int, part: float) -> None:
    n = int(part * samples)
    if exponent == 2 and part == 0.3:
        return  # their closed form for white phase noise needs longer logs
    published = edf_greenhall(exponent, 2, n, samples + 1, overlapping=True, modified=False)
    assert equivalent_degrees(exponent, n, samples - 2 * n + 1) == pytest.approx(
        published, rel=0.04
    )


@pytest.mark.parametrize(
    ("n", "logs", "known"), few([(7, 1000, 0.14)], [(n, 3000, 0.08) for n in (1, 7, 64)])
)
def test_white_noise_by_the_scatter_of_many_logs(
    rng: np.random.Generator, n: int, logs: int, known: float
) -> None:
    variances = [
        allan_variance(rng.standard_normal(512), 1.0, cluster_sizes=[n]).variance[0]
        for _ in range(logs)
    ]
    edf = 2 * np.mean(variances) ** 2 / np.var(variances)
    assert equivalent_degrees(0, n, 512 - 2 * n + 1) == pytest.approx(edf, rel=known)


@pytest.mark.parametrize(("logs", "known"), few([(1000, 0.14)], [(3000, 0.08)]))
def test_random_walk_by_the_scatter_of_many_logs(
    rng: np.random.Generator, logs: int, known: float
) -> None:
    variances = [
        allan_variance(rng.standard_normal(512).cumsum(), 1.0, cluster_sizes=[32]).variance[0]
        for _ in range(logs)
    ]
    edf = 2 * np.mean(variances) ** 2 / np.var(variances)
    assert equivalent_degrees(-2, 32, 512 - 64 + 1) == pytest.approx(edf, rel=known)


def test_long_and_short_sums_meet() -> None:
    below, above = (equivalent_degrees(-1, n, 100_000) for n in (682, 683))
    assert above == pytest.approx(below, rel=0.005)


@pytest.mark.parametrize(
    ("make", "exponent", "loss"),
    [
        (lambda noise: np.diff(noise, prepend=0.0), 2, 0.0),
        (lambda noise: noise, 0, 0.0),
        (lambda noise: noise, 0, 0.02),
        (lambda noise: np.cumsum(noise), -2, 0.0),
        (lambda noise: np.cumsum(noise), -2, 0.02),
    ],
)
def test_noise_types_are_told(rng: np.random.Generator, make, exponent: int, loss: float) -> None:
    log = 9.81 + make(rng.standard_normal(100_000))
    log[rng.random(100_000) < loss] = np.nan
    curve = allan_variance(log, 1.0, cluster_sizes=[1, 4, 32, 256])
    assert curve.exponent.tolist() == [exponent] * 4


def test_flicker_is_told(rng: np.random.Generator) -> None:
    spectrum = np.fft.rfft(rng.standard_normal(1 << 17))
    spectrum[1:] /= np.sqrt(np.arange(1, len(spectrum)))
    curve = allan_variance(np.fft.irfft(spectrum), 1.0, cluster_sizes=[4, 32, 256])
    assert curve.exponent.tolist() == [-1, -1, -1]


def test_too_few_clusters_tell_nothing() -> None:
    assert noise_exponent(np.arange(20.0), None, 1) is None


def test_limits_are_chi_squared(rng: np.random.Generator) -> None:
    edf = np.full(20_000, 7.0)
    estimates = np.sqrt(rng.chisquare(7.0, 20_000) / 7.0)
    lower, upper = deviation_limits(estimates, edf, 0.95)
    assert np.mean((lower < 1.0) & (upper > 1.0)) == pytest.approx(0.95, abs=0.005)
    assert np.mean(lower > 1.0) == pytest.approx(0.025, abs=0.004)


@pytest.mark.release
def test_limits_cover_the_truth(rng: np.random.Generator) -> None:
    sizes = [1, 10, 50, 100]
    inside = []
    for _ in range(600):
        lower, upper = allan_variance(rng.standard_normal(1000), 1.0, cluster_sizes=sizes).limits()
        truth = 1.0 / np.sqrt(sizes)
        inside.append((lower < truth) & (truth < upper))
    np.testing.assert_allclose(np.mean(inside, axis=0), 0.95, atol=0.035)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_missing_clusters_do_not_change_the_noise_type(
    rng: np.random.Generator, scale: float
) -> None:
    present = np.append(0, np.cumsum(rng.random(2000) < 0.8))
    white = np.append(0.0, np.cumsum(np.diff(present) * scale * rng.standard_normal(2000)))
    assert noise_exponent(white, present, 1) == 0


def test_clusters_of_few_samples_tell_no_noise_type(rng: np.random.Generator) -> None:
    counts = np.tile([10, 1], 40)
    present = np.append(0, np.cumsum(counts))
    white = np.append(0.0, np.cumsum(np.sqrt(counts) * rng.standard_normal(80)))
    assert noise_exponent(white[:57], present[:57], 10) is None  # 28 are whole
    # No neighbour of a whole one is whole.
    assert noise_exponent(white, present, 10) is None
