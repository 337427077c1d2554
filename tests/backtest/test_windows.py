import math

import numpy as np
import pytest

from imubench_pipeline.navigation.backtest.windows import (
    Window,
    average_blocks,
    choose_window,
    compute_window_errors,
)

RATE = 10.0


def means_of(
    log: np.ndarray, block: float, segments: list[tuple[int, int]] | None = None
) -> list[np.ndarray]:
    # In parts that have nothing to do with blocks.
    parts = np.split(log, [700, 701, 1999])
    return average_blocks(parts, segments or [(0, len(log))], RATE, [block, 1.7])[block]


@pytest.mark.parametrize("order", [0, 1, 2])
def test_a_ramp_grows_to_what_calculus_says(order: int) -> None:
    rest, time, slope = 8.0, 24.0, 3e-4
    log = 9.81 + slope * np.arange(4000) / RATE
    cut = choose_window(rest, time, RATE)
    assert cut is not None and (cut.rest, cut.time) == (rest, time)
    found = compute_window_errors(means_of(log, cut.block), cut.weights(order), 5)
    # The integral of the ramp from the middle of the window at rest on.
    constant = time ** (order + 1) / math.factorial(order + 1)
    exact = slope * (time ** (order + 2) / math.factorial(order + 2) + constant * rest / 2.0)
    # Weights level over blocks of a 24th of the motion, a double integration of them.
    assert math.sqrt(found.mean_square) == pytest.approx(exact, rel=1e-9 if order == 0 else 2e-3)


def test_every_window_is_the_integral_less_the_mean() -> None:
    rng = np.random.default_rng(1)
    log = rng.standard_normal(4000).cumsum()
    cut = Window(block=2.0, resting=8, moving=12)
    found = compute_window_errors(means_of(log, 2.0), cut.weights(0), 3)
    rest, moving = 160, 240
    begins = range(0, len(log) - rest - moving + 1, 20)
    by_hand = [
        log[i + rest : i + rest + moving].sum() / 10.0 - log[i : i + rest].mean() * 24.0
        for i in begins
    ]
    assert found.count == len(by_hand)
    assert found.mean_square == pytest.approx(np.mean(np.square(by_hand)), rel=1e-9)
    assert found.pairs.tolist() == [len(by_hand), len(by_hand) - 1, len(by_hand) - 2]


def test_windows_with_a_gap_are_left_out_and_none_spans_two_segments() -> None:
    log = np.random.default_rng(2).standard_normal(3000)
    cut = Window(block=1.0, resting=8, moving=16)
    whole = compute_window_errors(means_of(log, 1.0), cut.weights(0), 4)
    assert whole.count == 300 - 24 + 1
    holed = log.copy()
    holed[1500:1502] = np.nan  # a fifth of block 150
    holed[2000] = np.nan  # a tenth of block 200: that one is there
    found = compute_window_errors(means_of(holed, 1.0), cut.weights(0), 4)
    assert found.count == whole.count - 24
    # On either side of the gap: 127 and 126 windows.
    assert found.pairs.tolist() == [253, 251, 249, 247]
    divided = compute_window_errors(
        means_of(log, 1.0, [(0, 1200), (1200, 3000)]), cut.weights(0), 4
    )
    assert divided.count == (120 - 24 + 1) + (180 - 24 + 1)


def test_blocks_divide_both_parts_or_nearly_so() -> None:
    for rest, time, rate in ((30.0, 600.0, 100.0), (5.0, 10.0, 99.3), (7.0, 10.0, 50.0)):
        cut = choose_window(rest, time, rate)
        assert cut is not None
        assert (cut.rest, cut.time) == pytest.approx((rest, time), rel=1e-9)
        assert min(cut.resting, cut.moving) >= 8
    cut = choose_window(math.pi, 10.0, 100.0)
    assert cut is not None and cut.rest == pytest.approx(math.pi)
    assert cut.time == pytest.approx(10.0, rel=0.02)
    for rate in (1.0, 0.9998):
        assert choose_window(5.0, 10.0, rate) == Window(1.0, 5, 10)
    assert choose_window(0.5, 10.0, 1.0) is None
