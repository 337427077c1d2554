import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.readers.stamps import WrapState, format_date, unwrap


@given(
    st.integers(1, 40),
    st.integers(0, 2**40),
    st.lists(st.integers(-100, 30_000), min_size=1, max_size=200),
    st.sampled_from([np.int64, np.uint32, np.float64]),
)
def test_any_blocks_of_a_counter_of_16_bits_go_on(
    size: int, start: int, steps: list[int], kind: type
) -> None:
    truth = start + np.cumsum(np.array(steps))
    written = (truth % 65536).astype(kind)
    state = WrapState()
    found = np.concatenate(
        [unwrap(written[i : i + size], 65536, state) for i in range(0, len(written), size)]
    )
    assert found.dtype == (np.float64 if kind is np.float64 else np.int64)
    np.testing.assert_array_equal(found - found[0], truth - truth[0])


def test_no_digit_is_lost() -> None:
    written = np.array([2**62 - 1, 0, 1, 2**62 - 1, 5])
    found = unwrap(written, 2**62, WrapState())
    assert (found - found[0]).tolist() == [0, 1, 2, 0, 6]


def test_missing_stamps_stay_missing() -> None:
    state = WrapState()
    first = unwrap(np.array([np.nan, 90.0, np.nan, 10.0]), 100, state)
    np.testing.assert_array_equal(first, [np.nan, 90, np.nan, 110])
    np.testing.assert_array_equal(unwrap(np.array([np.nan]), 100, state), [np.nan])
    np.testing.assert_array_equal(unwrap(np.array([5.5, 45.0]), 100, state), [105.5, 145])
    assert len(unwrap(np.array([]), 100, state)) == 0


def test_a_damaged_stamp_harms_itself_alone() -> None:
    found = unwrap(np.array([10, 11, 90, 13, 14]), 100, WrapState())
    assert found[[0, 1, 3, 4]].tolist() == [10, 11, 13, 14]


@pytest.mark.parametrize(
    ("nanoseconds", "date"),
    [
        (1_700_000_000 * 10**9 + 123_456_789, "2023-11-14T22:13:20.123"),
        (5 * 10**9, None),
        (-1, None),
        (2**70, None),
    ],
)
def test_dates(nanoseconds: int, date: str | None) -> None:
    assert format_date(nanoseconds) == date
