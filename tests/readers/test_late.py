"""Records that were written late are sorted; all else keeps its order."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.readers.batch import Batch, LogFile
from imubench_pipeline.readers.late import MAX_LATE_RECORDS, sort_late_records
from imubench_pipeline.settings.sensor import LogFormat

ROWS = 12_000
STEP = 0.01
LOG = LogFormat.model_validate(
    {"rate": "100 Hz", "channels": {"gyro_x": {"column": "wx", "unit": "rad/s"}}}
)


class Given(LogFile):
    """A file of given stamps, whose samples are the numbers of its records."""

    def batches(self) -> Iterator[Batch]:
        numbers = np.arange(len(self.stamps), dtype=float)
        for start in range(0, len(numbers), self.size):
            part = slice(start, start + self.size)
            yield Batch(self.stamps[part], {"gyro_x": numbers[part]})


def sort(stamps: np.ndarray, size: int = 700) -> tuple[np.ndarray, np.ndarray, Given]:
    file = Given(Path("a.bag"), LOG, LOG.channels)
    file.stamps, file.size = stamps, size
    batches = list(sort_late_records(file))
    assert all(len(batch) for batch in batches)
    times = [batch.time for batch in batches if batch.time is not None]
    return np.concatenate(times), np.concatenate([b.columns["gyro_x"] for b in batches]), file


def delayed(late: dict[int, int]) -> np.ndarray:
    """Stamps of records, of which some were written some records later."""
    order = [n for n in range(ROWS) if n not in late]
    for number, records in sorted(late.items()):
        order.insert(number + records, number)
    return np.array(order) * STEP


@pytest.mark.parametrize("size", [1, 13, 700, 1001, ROWS])
def test_late_records_are_sorted_and_counted(size: int) -> None:
    late = {50: 3, 699: 1, 700: 1, 1405: 40, 5000: 900, 11_990: 5}
    stamps = delayed(late)
    time, samples, file = sort(stamps, size)
    np.testing.assert_array_equal(time, np.arange(ROWS) * STEP)
    np.testing.assert_array_equal(stamps[samples.astype(int)], time)
    (finding,) = file.findings
    assert (finding.finding, finding.severity, finding.value) == ("late_records", "note", len(late))
    assert "6 records are written after later ones, by up to 9 s" in finding.detail


def test_neighbours_that_are_often_exchanged_are_sorted(rng: np.random.Generator) -> None:
    order = np.arange(ROWS)
    for place in range(1, ROWS - 1, 12):
        order[place], order[place + 1] = place + 1, place
    time, _, file = sort(order * STEP + 1e-4 * rng.standard_normal(ROWS))
    assert (np.diff(time) > 0).all()
    assert file.findings[0].value == len(range(1, ROWS - 1, 12))


def test_a_record_beyond_the_window_stays() -> None:
    stamps = delayed({5000: MAX_LATE_RECORDS + 5})
    time, samples, file = sort(stamps)
    np.testing.assert_array_equal(time, stamps)
    np.testing.assert_array_equal(samples, np.arange(ROWS))
    assert file.findings == []


def unchanged() -> Iterator[object]:
    grid = np.arange(ROWS) * STEP
    rng = np.random.default_rng(5)
    yield pytest.param(grid, id="in order")
    for sigma in (0.3, 0.5, 2.0):
        scattered = grid + sigma * STEP * rng.standard_normal(ROWS)
        yield pytest.param(scattered, id=f"stamps that scatter by {sigma:g} steps")
    yield pytest.param(np.concatenate((grid[:6000], grid[6000:] - 0.8)), id="a clock set back")
    yield pytest.param(np.concatenate((grid[:6000], grid[6000:] - 0.805)), id="between the stamps")
    yield pytest.param(np.concatenate((grid[:6000], grid[:6000])), id="a restart")
    yield pytest.param(np.concatenate((grid[:6000], grid[5900:])), id="records written twice")
    yield pytest.param(np.floor(grid * 10) / 10, id="coarse stamps")
    wrong = grid.copy()
    wrong[[300, 4000]] = 0.0, 1e9
    yield pytest.param(wrong, id="wrong stamps")
    missing = grid.copy()
    missing[::7] = np.nan
    yield pytest.param(missing, id="missing stamps")
    yield pytest.param(np.full(ROWS, np.nan), id="no stamps")
    yield pytest.param(grid[::-1].copy(), id="backwards")


@pytest.mark.parametrize("stamps", list(unchanged()))
def test_all_else_keeps_its_order(stamps: np.ndarray) -> None:
    time, samples, file = sort(stamps)
    np.testing.assert_array_equal(time, stamps)
    np.testing.assert_array_equal(samples, np.arange(len(stamps)))
    assert file.findings == []
