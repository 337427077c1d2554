"""Pages computed in several processes are the same, in order, and their failures are kept."""

import os
import sys

import pytest

from imubench_pipeline.report.processes import compute_in_order


def _describe(place: int) -> tuple[int, int]:
    return place * place, os.getpid()


def test_results_are_in_order_and_of_other_processes() -> None:
    made = list(compute_in_order(_describe, 50, 2))
    assert [square for square, _ in made] == [place * place for place in range(50)]
    if sys.platform == "linux":
        assert {process for _, process in made}.isdisjoint({os.getpid()})


def test_short_lists_need_no_other_process() -> None:
    assert {process for _, process in compute_in_order(_describe, 5, 2)} == {os.getpid()}


def _fail(place: int) -> int:
    if place == 30:
        raise OSError(28, "No space left on device")
    return place


@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_stops_the_list_where_it_occurs(processes: int) -> None:
    made = compute_in_order(_fail, 50, processes)
    assert [next(made) for _ in range(30)] == list(range(30))
    with pytest.raises(OSError, match="No space left"):
        next(made)
