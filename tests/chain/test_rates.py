"""Several rates in one table: each group of channels has a time base of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import imubench_pipeline as imu
from imubench_pipeline.library.logs import Log
from imubench_pipeline.report.terminal import render_logs
from imubench_pipeline.tables.files import build
from tests.chain.logs import Table, analysed, checked, noise, project
from tests.conftest import few

ROWS = 6000
NUMBER = np.arange(ROWS)
TIMES = NUMBER / 100.0


def read(folder: Path, table: Table) -> Log:
    table.write(folder / "log.csv")
    return imu.read_log(folder / "log.csv", table.sensor())


def table_of(there: dict[str, np.ndarray], times: np.ndarray | None = TIMES) -> Table:
    columns = {
        name: np.where(mask, noise(name, len(mask), 1), np.nan) for name, mask in there.items()
    }
    return Table(columns, 100.0, times)


def merged(*streams: tuple[float, float], jitter: float = 0.0) -> tuple[np.ndarray, list]:
    """The stamps of streams of a rate and an offset, in order, and which records each has."""
    rng = np.random.default_rng(3)
    each = [offset + np.arange(60 * rate) / rate for rate, offset in streams]
    each = [
        stamps + jitter / rate * rng.uniform(-0.5, 0.5, len(stamps))
        for stamps, (rate, _) in zip(each, streams, strict=True)
    ]
    owner = np.repeat(np.arange(len(each)), [len(stamps) for stamps in each])
    order = np.argsort(np.concatenate(each), kind="stable")
    return np.concatenate(each)[order], [owner[order] == number for number in range(len(each))]


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize(("every", "phase"), few([(2, 1), (10, 4)], [(2, 0), (3, 2)]))
def test_a_channel_in_every_nth_record_has_its_own_rate(
    tmp_path: Path, every: int, phase: int, stamped: bool
) -> None:
    table = table_of(
        {
            "gyro_z": np.ones(ROWS, bool),
            "accel_x": NUMBER % every == phase,
            "accel_z": NUMBER % every == phase,
        },
        TIMES if stamped else None,
    )
    log = read(tmp_path, table)
    assert log.rates == pytest.approx(
        {"gyro_z": 100.0, "accel_x": 100.0 / every, "accel_z": 100.0 / every}
    )
    for name in log.channels:
        wanted = table.columns[name]
        assert log[name] / log[name].mean() == pytest.approx(
            wanted[np.isfinite(wanted)] / np.nanmean(wanted), rel=1e-6
        )
    (note,) = (found for found in log.findings if found.finding == "own_rate")
    assert note.severity == "note"
    assert "accel x and accel z have numbers in" in note.detail


@pytest.mark.parametrize(
    ("offset", "jitter"),
    few(
        [(0.0, 0.0), (0.0033, 0.3), (0.005, 0.0), (0.005, 0.9), (0.0101, 0.9)],
        [(0.0, 0.3), (0.0, 0.9), (0.0033, 0.0), (0.0033, 0.9), (0.005, 0.3), (0.0101, 0.0),
         (0.0101, 0.3)],
    ),
)  # fmt: skip
def test_streams_that_share_no_stamp_have_their_own_rates(
    tmp_path: Path, offset: float, jitter: float
) -> None:
    times, (gyro, accel) = merged((100.0, 0.0), (50.0, offset), jitter=jitter)
    log = read(tmp_path, table_of({"gyro_x": gyro, "gyro_z": gyro, "accel_z": accel}, times))
    wanted = {"gyro_x": 100.0, "gyro_z": 100.0, "accel_z": 50.0}
    assert log.rates == pytest.approx(wanted, rel=1e-3)
    assert {name: len(log[name]) for name in log} == {
        "gyro_x": 6000,
        "gyro_z": 6000,
        "accel_z": 3000,
    }
    assert not any(np.isnan(log[name]).any() for name in log)


def test_three_rates_and_a_temperature_with_records_of_its_own(tmp_path: Path) -> None:
    streams = ((100.0, 0.0), (50.0, 0.002), (10.0, 0.003), (1.0, 0.0041))
    times, (gyro, accel, slow, warm) = merged(*streams)
    there = {"gyro_z": gyro, "accel_x": accel, "accel_z": slow, "temperature": warm}
    log = read(tmp_path, table_of(there, times))
    wanted = {"gyro_z": 100.0, "accel_x": 50.0, "accel_z": 10.0}
    assert log.rates == pytest.approx(wanted, rel=1e-4)
    readings = {name: [part for part in kept.temperatures()] for name, kept in log.chosen().items()}
    for parts in readings.values():
        assert np.isfinite(np.concatenate(parts)).sum() == 60


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize("lost", few([0.005, 0.45, 0.8], [0.2, 0.6]))
def test_samples_lost_at_random_stay_on_the_common_grid(
    tmp_path: Path, lost: float, stamped: bool
) -> None:
    there = np.random.default_rng(7).random(ROWS) >= lost
    table = table_of({"gyro_z": np.ones(ROWS, bool), "accel_z": there}, TIMES if stamped else None)
    log = read(tmp_path, table)
    assert log.rates == pytest.approx({"gyro_z": 100.0, "accel_z": 100.0})
    assert (np.isfinite(log["accel_z"]) == there).all()
    curves = imu.allan_variance(log)
    full, holed = curves["gyro_z"], curves["accel_z"]
    assert holed.tau[-1] == full.tau[-1]
    if lost < 0.7:  # else many gaps are as long as the shorter clusters
        assert len(holed.tau) >= len(full.tau) - 1
    severity = "warning" if lost > 0.01 else "note"
    assert ("empty_cells", severity) in {(f.finding, f.severity) for f in log.findings}


def test_samples_that_a_slower_sensor_loses_are_holes_on_its_own_grid(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    there = {
        "gyro_z": np.ones(ROWS, bool),
        "accel_x": (NUMBER % 2 == 0) & (rng.random(ROWS) > 0.1),
        "accel_z": (NUMBER % 2 == 0) & (rng.random(ROWS) > 0.1),
    }
    log = read(tmp_path, table_of(there))
    assert log.rates["accel_x"] == pytest.approx(50.0)
    for name in ("accel_x", "accel_z"):
        assert np.isfinite(log[name]).sum() == there[name].sum()


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize(
    ("every", "lost"),
    few(
        [(2, 0.9), (3, 0.7), (5, 0.5)],
        [(2, 0.5), (2, 0.7), (3, 0.5), (3, 0.9), (5, 0.7), (5, 0.9)],
    ),
)
def test_a_slower_sensor_keeps_its_rate_however_much_it_loses(
    tmp_path: Path, every: int, lost: float, stamped: bool
) -> None:
    rng = np.random.default_rng(7)
    there = (NUMBER % every == 1) & (rng.random(ROWS) > lost)
    masks = {"gyro_z": np.ones(ROWS, bool), "accel_x": there, "accel_z": there}
    log = read(tmp_path, table_of(masks, TIMES if stamped else None))
    assert log.rates == pytest.approx(
        {"gyro_z": 100.0, "accel_x": 100.0 / every, "accel_z": 100.0 / every}
    )
    assert np.isfinite(log["accel_z"]).sum() == there.sum()
    found = {(f.finding, f.severity, f.channel) for f in log.findings}
    assert ("missing_samples", "warning", "accel_z") in found


@pytest.mark.parametrize("stamped", [True, False])
def test_an_axis_that_loses_every_second_sample_keeps_the_rate_of_its_siblings(
    tmp_path: Path, stamped: bool
) -> None:
    masks = {
        "gyro_x": np.ones(ROWS, bool),
        "gyro_z": NUMBER % 2 == 0,
        "accel_x": NUMBER % 2 == 0,
        "accel_z": NUMBER % 4 == 0,
    }
    log = read(tmp_path, table_of(masks, TIMES if stamped else None))
    assert log.rates == pytest.approx(
        {"gyro_x": 100.0, "gyro_z": 100.0, "accel_x": 50.0, "accel_z": 50.0}
    )
    found = {(f.finding, f.severity, f.channel) for f in log.findings}
    assert {("empty_cells", "warning", name) for name in ("gyro_z", "accel_z")} <= found


HALF = ROWS // 2


@pytest.mark.parametrize("stamped", [True, False])
@pytest.mark.parametrize(("first", "then"), few([(1, 2), (3, 1)], [(2, 4), (2, 6)]))
def test_a_sensor_that_changes_its_rate_is_named(
    tmp_path: Path, first: int, then: int, stamped: bool
) -> None:
    there = NUMBER % np.where(NUMBER < HALF, first, then) == 0
    masks = {"gyro_z": np.ones(ROWS, bool), "accel_z": there}
    log = read(tmp_path, table_of(masks, TIMES if stamped else None))
    rate = 100.0 / min(first, then)
    assert log.rates == pytest.approx({"gyro_z": 100.0, "accel_z": rate})
    (found,) = (f for f in log.findings if f.finding == "rate_changes")
    assert (found.severity, found.channel) == ("warning", "accel_z")
    assert found.value == pytest.approx(100.0 / max(first, then))
    slow = (30.0, 60.0) if then > first else (0.0, 30.0)
    assert (found.start, found.end) == pytest.approx(slow, abs=5.0)


def test_a_log_that_changes_its_rate_is_named(tmp_path: Path) -> None:
    chosen = (NUMBER < HALF) | (NUMBER % 2 == 0)
    masks = {"gyro_z": np.ones(int(chosen.sum()), bool)}
    log = read(tmp_path, table_of(masks, TIMES[chosen]))
    assert log.rates == pytest.approx({"gyro_z": 100.0})
    (found,) = (f for f in log.findings if f.finding == "rate_changes")
    assert found.value == pytest.approx(50.0)
    assert "N is 29 % too low" in found.detail


@pytest.mark.parametrize("lost", [0.1, 0.5, 0.7])
def test_random_losses_are_no_change_of_rate(tmp_path: Path, lost: float) -> None:
    there = np.random.default_rng(5).random(ROWS) >= lost
    log = read(tmp_path, table_of({"gyro_z": np.ones(ROWS, bool), "accel_z": there}))
    assert "rate_changes" not in {found.finding for found in log.findings}


@pytest.mark.parametrize(("rate", "step"), few([(1250.0, 0.001), (125.01, 0.01)], [(125.0, 0.01)]))
@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize("round_to", [np.round, np.floor])
def test_five_samples_in_four_steps_of_the_stamps_are_all_taken(
    tmp_path: Path, rate: float, step: float, round_to: np.ufunc, stated: bool
) -> None:
    times = round_to((NUMBER / rate + 0.037 * step) / step) * step
    table = table_of({"gyro_z": np.ones(ROWS, bool)}, times)
    sensor = table.sensor()
    if stated:
        sensor["log"]["rate"] = f"{rate} Hz"
    table.write(tmp_path / "log.csv")
    log = imu.read_log(tmp_path / "log.csv", sensor)
    assert log.rates["gyro_z"] == pytest.approx(rate, rel=1e-3)
    assert len(log["gyro_z"]) == ROWS


@pytest.mark.parametrize("lost", [0.6, 0.7, 0.9])
def test_a_stated_rate_places_the_samples_that_few_are_left_of(tmp_path: Path, lost: float) -> None:
    chosen = np.random.default_rng(7).random(ROWS) > lost
    table = table_of({"gyro_z": np.ones(int(chosen.sum()), bool)}, TIMES[chosen])
    sensor = table.sensor()
    sensor["log"]["rate"] = "100 Hz"
    table.write(tmp_path / "log.csv")
    log = imu.read_log(tmp_path / "log.csv", sensor)
    assert log.rates["gyro_z"] == pytest.approx(100.0)
    assert "missing_samples" in {found.finding for found in log.findings}


@pytest.mark.parametrize("burst", [32, 100])
def test_a_stated_rate_says_that_samples_come_in_bursts(tmp_path: Path, burst: int) -> None:
    times = NUMBER // burst * (burst / 100.0) + 2e-4 * (NUMBER % burst)
    table = table_of({"gyro_z": np.ones(ROWS, bool)}, times)
    (missing,) = (f for f in read(tmp_path, table).findings if f.finding == "missing_samples")
    assert "If the samples came in bursts" in missing.detail
    sensor = table.sensor()
    sensor["log"]["rate"] = "100 Hz"
    assert imu.read_log(tmp_path / "log.csv", sensor).rates["gyro_z"] == pytest.approx(
        100, rel=0.02
    )


def test_a_clock_that_changes_its_rate_beside_another_is_not_read_at_the_rate_of_both(
    tmp_path: Path,
) -> None:
    accel_times = np.concatenate([np.arange(0, 30, 0.02), 30.0 + np.arange(1050) / 35.0])
    times = np.union1d(TIMES, accel_times)
    accel = np.isin(times, accel_times)
    log = read(tmp_path, table_of({"gyro_z": np.isin(times, TIMES), "accel_z": accel}, times))
    assert log.rates["gyro_z"] == pytest.approx(100.0)
    assert log.rates["accel_z"] == pytest.approx(accel.sum() / 60.0, rel=0.01)
    found = {(f.finding, f.severity, f.channel) for f in log.findings}
    assert ("jittered_stamps", "warning", "accel_z") in found


def test_a_stated_rate_says_that_every_fifth_sample_is_lost(tmp_path: Path) -> None:
    table = table_of({"gyro_z": np.ones(ROWS, bool), "accel_z": NUMBER % 5 != 4})
    as_rounded = read(tmp_path, table)
    assert as_rounded.rates["accel_z"] == pytest.approx(80.0, rel=1e-3)
    (coarse,) = (found for found in as_rounded.findings if found.finding == "coarse_stamps")
    assert (coarse.severity, coarse.channel) == ("warning", "accel_z")
    sensor = table.sensor()
    sensor["log"]["rate"] = "100 Hz"
    as_lost = imu.read_log(tmp_path / "log.csv", sensor)
    assert as_lost.rates["accel_z"] == pytest.approx(100.0)
    curve = imu.allan_variance(as_lost)["accel_z"]
    assert len(curve.tau) > 30
    lower, upper = curve.limits()
    white = 0.02 / np.sqrt(curve.averaged)
    assert ((lower <= white) & (white <= upper)).mean() > 0.8


def test_every_command_takes_both_sensors_at_their_rates(tmp_path: Path) -> None:
    there = {"gyro_z": np.ones(ROWS, bool), "accel_z": NUMBER % 2 == 0}
    plan = project(table_of(there), tmp_path, ["likelihood"])
    assert checked(plan)[:2] == ("ok", None)
    found = analysed(plan, pages=False)
    assert not found["failures"]
    N = {
        row["channel"]: row
        for row in found["parameters"]
        if row["recommended"] and row["parameter"] == "N"
    }
    for name, sigma, rate in (("gyro_z", np.radians(0.1), 100.0), ("accel_z", 0.02, 50.0)):
        assert N[name]["lower"] < sigma / np.sqrt(rate) < N[name]["upper"]
    tables = {name: build(name, rows) for name, rows in found.items()}
    head = str(next(iter(render_logs(tables, "practical", 200))))
    assert head == "log: 60 s at 100 and 50 Hz, 2 channels"
