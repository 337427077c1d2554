import numpy as np
import pytest
from scipy.stats import chi2

from imubench_pipeline.allan.confidence import find_lower_quantile, match_lower_tail, match_variance


@pytest.mark.parametrize("number", [2, 3, 8, 40])
def test_equal_weights_are_chi_squared(number: int) -> None:
    weights = np.full(number, 3.0)
    assert match_variance(weights) == pytest.approx(number)
    assert match_lower_tail(weights) == pytest.approx(number, rel=0.02)
    for chance in (0.005, 0.025, 0.16):
        found = find_lower_quantile(weights, chance)
        assert chi2.cdf(found * number, number) == pytest.approx(chance, rel=0.06)


def test_two_weights_have_a_closed_form() -> None:
    """With pairs of equal weights the sum is hypoexponential: F = 1 - sum of exponentials."""
    a, b = 0.35, 0.15  # each twice
    x = find_lower_quantile(np.array([a, a, b, b]), 0.025)
    cdf = 1.0 - (a * np.exp(-x / (2 * a)) - b * np.exp(-x / (2 * b))) / (a - b)
    assert cdf == pytest.approx(0.025, rel=0.03)


def test_unequal_weights_have_a_shorter_lower_tail_than_their_variance_says() -> None:
    weights = 0.5 ** np.arange(12)
    assert match_lower_tail(weights) > 1.3 * match_variance(weights)


def test_one_weight_is_one_degree_of_freedom() -> None:
    assert match_lower_tail(np.array([0.2])) == 1.0
    # and a second one that counts for nothing adds none: 0.965 by the saddlepoint
    assert match_lower_tail(np.array([0.2, 1e-12])) == pytest.approx(1.0, rel=0.05)
