"""What a curve must show for a value to be read off, at the edge of each rule."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.curve import read
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.noise import FLOOR, PEAK_TAU

TAU = 10.0 ** (np.arange(31) / 10.0)
"""Three decades, ten points each: an octave holds three."""

Array = np.ndarray


def reading(deviation: Callable[[Array], Array], edf: float | Array = 1e6) -> dict[str, Parameter]:
    n = np.rint(1000.0 * TAU).astype(np.int64)
    variance = deviation(TAU) ** 2
    of_each = np.broadcast_to(np.asarray(edf, dtype=float), TAU.shape)
    return dict(read(AllanCurve(TAU, n, variance, of_each, 10 * int(n[-1]))).parameters)


def power(slope: float) -> Callable[[Array], Array]:
    return lambda tau: 2.0 * tau**slope


@pytest.mark.parametrize(
    ("slope", "shown"), [(-0.45, True), (-0.55, True), (-0.43, False), (-0.57, False)]
)
def test_white_noise_has_a_slope_of_a_half_to_six_hundredths(slope: float, shown: bool) -> None:
    N = reading(power(slope))["N"]
    assert (N.value is not None) is shown
    if N.value is not None:
        # A line of slope -1/2 through the middle of the points, at 1 s.
        assert N.value == pytest.approx(2.0 * 10.0 ** (1.5 * (slope + 0.5)), rel=1e-6)


@pytest.mark.parametrize(
    ("slope", "shown"), [(0.45, True), (0.55, True), (0.43, False), (0.57, False)]
)
def test_a_walk_has_a_slope_of_a_half_at_the_end(slope: float, shown: bool) -> None:
    def deviation(tau: Array) -> Array:
        return np.where(tau < 10.0, 2.0 * (tau / 10.0) ** -1.0, 2.0 * (tau / 10.0) ** slope)

    K = reading(deviation)["K"]
    assert (K.value is not None) is shown
    if K.value is not None:
        # The longest stretch after the lowest point: from the 11th of a decade to the end.
        middle = np.mean(np.log10(TAU[11:]))
        expected = (
            2.0 * 10.0 ** (slope * (middle - 1.0)) * 10.0 ** (0.5 * (math.log10(3.0) - middle))
        )
        assert K.value == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("slope", "edf", "shown"), [(0.66, 12.0, True), (0.66, 2000.0, False), (0.72, 8.0, False)]
)
def test_a_slope_that_is_known_badly_may_be_further_off(
    slope: float, edf: float, shown: bool
) -> None:
    K = reading(lambda tau: np.where(tau < 10.0, 20.0 / tau, 2.0 * (tau / 10.0) ** slope), edf)["K"]
    assert (K.value is not None) is shown


def test_the_error_of_a_slope_counts_what_is_independent() -> None:
    # Over half a decade at the beginning: six points of 0.1, of which an octave has one.
    for error, shown in ((0.24, True), (0.26, False)):
        at = np.arange(-5, 6) * 0.1 / 2.0
        inside = np.arange(-2, 3) * 0.1
        single = error / math.sqrt(math.log10(2.0) / 0.1 / np.sum(inside**2))
        edf = 1.0 / (2.0 * (math.log(10.0) * single) ** 2)
        N = reading(power(-0.5), edf)["N"]
        assert (N.value is not None) is shown, at


def test_a_minimum_must_stand_out_on_both_sides() -> None:
    def bowl(fall: float, rise: float) -> Callable[[Array], Array]:
        return lambda tau: np.exp(
            np.where(
                tau < 30.0,
                fall * (1.0 - np.log(tau) / np.log(30.0)),
                rise * np.log(tau / 30.0) / np.log(1000.0 / 30.0),
            )
        )

    # The standard error of a deviation is 1 / sqrt(2 nu): of a difference of two sqrt(2) times.
    edf = 200.0
    three = 3.0 * math.sqrt(2.0) / math.sqrt(2.0 * edf)
    for fall, rise, shown in ((1.1, 1.1, True), (0.9, 2.0, False), (2.0, 0.9, False)):
        found = reading(bowl(fall * three, rise * three), edf)
        assert (found["B"].value is not None) is shown
    B, T_B = (reading(bowl(1.0, 1.0), edf)[name].value for name in ("B", "T_B"))
    lowest = TAU[15]
    assert T_B == pytest.approx(lowest / PEAK_TAU)
    depth = math.log(lowest / 30.0) / math.log(1000.0 / 30.0)
    assert B == pytest.approx(math.exp(depth) / FLOOR, rel=1e-6)


def test_the_figures_of_the_curve_are_those_of_its_minimum() -> None:
    n = np.rint(1000.0 * TAU).astype(np.int64)
    variance = 1.0 / TAU + TAU / 900.0
    found = read(AllanCurve(TAU, n, variance, np.full(31, 1e4), 10 * int(n[-1]))).curve
    assert found["sigma_min"].value == pytest.approx(math.sqrt(variance.min()))
    assert found["tau_min"].value == pytest.approx(TAU[variance.argmin()])


def test_where_samples_are_missing_white_noise_is_that_of_fewer() -> None:
    n = np.rint(1000.0 * TAU).astype(np.int64)
    curve = AllanCurve(TAU, n, 4.0 / TAU, np.full(31, 1e6), 10 * int(n[-1]), averaged=n / 2.25)
    assert read(curve).parameters["N"].value == pytest.approx(2.0 / 1.5)


def test_a_curve_of_three_points_shows_nothing() -> None:
    n = np.array([1, 2, 4, 8, 9])
    for samples, shown in ((72, True), (71, False)):
        curve = AllanCurve(n / 1.0, n, 1.0 / n, np.full(5, 1e6), samples)
        statuses = {one.status for one in read(curve).parameters.values()}
        few = "of the 4 points that are needed" in (read(curve).parameters["N"].reason or "")
        assert few is not shown and statuses
