from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from imubench_pipeline.recordings import overview as module
from imubench_pipeline.recordings.ingest import ingest
from imubench_pipeline.recordings.overview import MOST_BINS, Overview, bin_edges, overview
from imubench_pipeline.recordings.recording import ROW_GROUP, LogNames, LogWriter, list_log_files
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat, RecordingNotes
from tests.conftest import few

RATE = 50.0
Columns = Mapping[str, np.ndarray]


def keep(
    folder: Path,
    columns: Columns,
    name: str = "log.parquet",
    rate: float = RATE,
    points: np.ndarray | None = None,
    unusable: tuple[str, ...] = (),
) -> Path:
    """Write a log as the ingest does; ``points`` are the grid points of the rows."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = len(next(iter(columns.values())))
    kinds = {"sample": pa.int64()} if points is not None else {}
    data = {"sample": points, **columns} if points is not None else columns
    with LogWriter(folder / name, kinds | dict.fromkeys(columns, pa.float64())) as writer:
        writer.write(data)
        grid = rows if points is None else int(points[-1]) + 1
        writer.finish(
            {
                "rate": rate,
                "grid": grid,
                "segments": [[0, grid]],
                "holes": {
                    name: points is not None or bool(np.isnan(values).any())
                    for name, values in columns.items()
                },
                "unusable": list(unusable),
            }
        )
    return folder


def looked_at(folder: Path, columns: Columns, buckets: int = 600, **how: Any) -> Overview:
    return overview(keep(folder, columns, **how), "sensor", "log_1", buckets)


def of(rows: list[Any], channel: str) -> dict[str, np.ndarray]:
    """The rows of a channel as columns; NaN for null."""
    here = [row for row in rows if row["channel"] == channel]
    assert {(row["sensor"], row["recording"]) for row in here} <= {("sensor", "log_1")}
    names = [name for name in here[0] if name not in ("sensor", "recording", "channel")]
    return {
        name: np.array([np.nan if row[name] is None else row[name] for row in here])
        for name in names
    }


def slices(values: np.ndarray, drawn: dict[str, np.ndarray], rate: float) -> Iterator[np.ndarray]:
    """The samples present of each bucket, from its times."""
    time = np.arange(len(values)) / rate
    for start, end in zip(drawn["start"], drawn["end"], strict=True):
        part = values[(time >= start - 0.1 / rate) & (time < end - 0.1 / rate)]
        yield part[np.isfinite(part)]


def agree(values: np.ndarray, found: Overview, channel: str, buckets: int, rate: float) -> None:
    """Compare an envelope with what numpy says of the same slices."""
    drawn = of(found.envelope, channel)
    assert len(drawn["start"]) == min(buckets, len(values))
    assert drawn["start"][0] == 0.0
    np.testing.assert_array_equal(drawn["start"][1:], drawn["end"][:-1])
    assert drawn["end"][-1] == pytest.approx(len(values) / rate, rel=1e-15)
    points = (drawn["end"] - drawn["start"]) * rate
    assert points.min() > 0.9 and np.ptp(points) < 1.1
    parts = list(slices(values, drawn, rate))
    np.testing.assert_array_equal(drawn["samples"], [len(part) for part in parts])
    for i, part in enumerate(parts):
        if len(part) == 0:
            assert np.isnan([drawn[name][i] for name in ("low", "high", "mean")]).all()
            continue
        assert (drawn["low"][i], drawn["high"][i]) == (np.min(part), np.max(part))
        assert drawn["low"][i] <= drawn["mean"][i] <= drawn["high"][i]
        largest = float(np.abs(part).max())
        assert drawn["mean"][i] == pytest.approx(np.mean(part), rel=1e-12, abs=1e-12 * largest)


def counted(values: np.ndarray, found: Overview, channel: str) -> tuple[np.ndarray, np.ndarray]:
    """Compare a histogram with numpy's; return edges and counts."""
    bins = of(found.histogram, channel)
    np.testing.assert_array_equal(bins["lower"][1:], bins["upper"][:-1])
    edges = np.append(bins["lower"], bins["upper"][-1])
    there = values[np.isfinite(values)]
    assert bins["count"].sum() == len(there)
    assert edges[0] <= there.min() and there.max() <= edges[-1]
    if len(edges) > 2:
        assert (np.diff(edges) > 0).all()
        np.testing.assert_array_equal(bins["count"], np.histogram(there, edges)[0])
    assert len(bins["count"]) <= MOST_BINS
    return edges, bins["count"]


def test_gaussian_samples(tmp_path: Path, rng: np.random.Generator) -> None:
    columns = {
        "gyro_x": 1e-3 * rng.standard_normal(20_011),
        "accel_z": 9.81 + 2e-3 * rng.standard_normal(20_011),
    }
    found = looked_at(tmp_path, columns)
    for channel, values in columns.items():
        agree(values, found, channel, 600, RATE)
        edges, counts = counted(values, found, channel)
        assert 60 <= len(counts) <= 120
        np.testing.assert_allclose(np.diff(edges), np.ptp(values) / len(counts), rtol=1e-9)
        assert (edges[0], edges[-1]) == (values.min(), values.max())


def test_a_log_of_several_row_groups(tmp_path: Path, rng: np.random.Generator) -> None:
    values = rng.standard_normal(2 * ROW_GROUP + 777)
    found = looked_at(tmp_path, {"gyro_x": values})
    starts = [len(values) * i // 600 for i in range(600)]
    drawn = of(found.envelope, "gyro_x")
    np.testing.assert_allclose(drawn["start"], np.array(starts) / RATE, rtol=1e-15)
    np.testing.assert_array_equal(drawn["low"], np.minimum.reduceat(values, starts))
    np.testing.assert_array_equal(drawn["high"], np.maximum.reduceat(values, starts))
    np.testing.assert_array_equal(drawn["samples"], np.diff([*starts, len(values)]))
    means = np.add.reduceat(values, starts) / drawn["samples"]
    np.testing.assert_allclose(drawn["mean"], means, atol=1e-14)
    edges, counts = counted(values, found, "gyro_x")
    assert np.diff(edges)[1:-1].max() < 0.15  # of 1, the noise
    assert counts[[0, -1]].max() < 20


@pytest.mark.release
@given(
    values=arrays(
        np.float64,
        st.integers(1, 300),
        elements=st.one_of(
            st.just(np.nan),
            st.floats(-1e30, 1e30),
            st.floats(-1.0, 1.0),
            st.integers(-3, 3).map(float),
        ),
    ),
    buckets=st.integers(1, 50),
    rate=st.floats(0.01, 1e5),
)
def test_whatever_the_samples(
    tmp_path_factory: pytest.TempPathFactory, values: np.ndarray, buckets: int, rate: float
) -> None:
    folder = tmp_path_factory.mktemp("recording")
    found = looked_at(folder, {"gyro_x": values}, buckets, rate=rate)
    if np.isnan(values).all():
        assert found == Overview([], [])
        return
    agree(values, found, "gyro_x", buckets, rate)
    counted(values, found, "gyro_x")


@given(
    points=st.sets(st.integers(0, 400), min_size=1, max_size=100).map(sorted),
    buckets=st.integers(1, 50),
)
def test_missing_records_keep_their_place(
    tmp_path_factory: pytest.TempPathFactory, points: list[int], buckets: int
) -> None:
    at = np.array(points) - points[0]
    there = np.sin(1.0 + at)
    there[3::7] = np.nan
    folder = tmp_path_factory.mktemp("recording")
    found = looked_at(folder, {"gyro_x": there}, buckets, points=at)
    values = np.full(at[-1] + 1, np.nan)
    values[at] = there
    agree(values, found, "gyro_x", buckets, RATE)
    counted(values, found, "gyro_x")


def test_a_hole_of_many_row_groups(tmp_path: Path, rng: np.random.Generator) -> None:
    points = np.concatenate([np.arange(3000), 5 * ROW_GROUP + np.arange(1000)])
    values = rng.standard_normal(4000)
    found = looked_at(tmp_path, {"gyro_x": values}, 10, points=points)
    drawn = of(found.envelope, "gyro_x")
    assert drawn["samples"].tolist() == [3000, *[0] * 8, 1000]
    assert np.isnan(drawn["mean"][1:-1]).all()
    assert drawn["high"][-1] == values[3000:].max()
    assert drawn["end"][-1] == (5 * ROW_GROUP + 1000) / RATE
    counted(values, found, "gyro_x")


@pytest.mark.parametrize("noise", few([0.3, 13.3, 200.0], [2.0, 9.7, 40.0]))
@pytest.mark.parametrize("step", few([0.0012345], [1.0, 9.80665 / 16384]))
def test_no_comb_is_drawn_of_steps(
    tmp_path: Path, rng: np.random.Generator, noise: float, step: float
) -> None:
    levels = np.rint(17_000.4 + noise * rng.standard_normal(200_000)).astype(int)
    found = looked_at(tmp_path, {"accel_z": step * levels})
    edges, counts = counted(step * levels, found, "accel_z")
    wide = np.diff(edges)[1:-1] / step
    assert wide == pytest.approx(np.full(len(wide), np.rint(wide[0])), rel=1e-6)
    np.testing.assert_allclose(edges[1:-1] / step % 1.0, 0.5, atol=1e-4)
    held = np.histogram(np.arange(levels.min() - 1, levels.max() + 2), edges / step)[0]
    assert (held[1:-1] == round(wide[0])).all()
    smooth(counts)
    if np.ptp(levels) > MOST_BINS:
        assert len(counts) >= 60


def smooth(counts: np.ndarray) -> None:
    """A bin must have what its neighbours let expect, but for chance."""
    expected = np.sqrt(counts[:-2].astype(float) * counts[2:])
    many = expected > 2000
    ratio = np.log(counts[1:-1][many] / expected[many])
    # Second differences of the logarithm of a Gaussian are one constant.
    assert np.abs(ratio - np.median(ratio)).max(initial=0.0) < 0.15


@pytest.mark.parametrize("noise", few([3.0, 30.0], [12.0]))
@pytest.mark.parametrize(
    ("lsb", "digits"),
    few(
        [(0.0609756, 2), (1.4, 0), (9.80665 / 16384, 5)],
        [(0.0609756, 3), (1.2, 0), (0.25, 6)],
    ),
)
def test_no_comb_of_steps_that_were_printed_in_few_digits(
    tmp_path: Path, rng: np.random.Generator, noise: float, lsb: float, digits: int
) -> None:
    levels = np.rint(noise * rng.standard_normal(300_000))
    found = looked_at(tmp_path, {"gyro_x": np.round(lsb * levels, digits)})
    edges, counts = counted(np.round(lsb * levels, digits), found, "gyro_x")
    inside = edges[np.abs(edges) < 3 * noise * lsb]
    printed = np.round(lsb * np.arange(-6 * noise, 6 * noise), digits)
    assert np.ptp(np.histogram(printed, inside)[0]) == 0
    smooth(counts)


def test_steps_kept_in_single_precision(tmp_path: Path, rng: np.random.Generator) -> None:
    levels = np.rint(4096 + 60 * rng.standard_normal(300_000))
    values = (9.80665 / 4096 * levels).astype(np.float32).astype(np.float64)
    found = looked_at(tmp_path, {"accel_z": values})
    smooth(counted(values, found, "accel_z")[1])


def test_levels_that_were_written_in_two_ways(tmp_path: Path, rng: np.random.Generator) -> None:
    # As in a log of an animal-borne tag: -0.112527478 and -0.112527479.
    values = 0.002394201 * np.rint(-47.0 + 17.0 * rng.standard_normal(100_000))
    values[rng.random(100_000) < 0.1] -= 1e-9
    edges, counts = counted(values, looked_at(tmp_path, {"accel_x": values}), "accel_x")
    wide = np.diff(edges)[1:-1] / 0.002394201
    np.testing.assert_allclose(wide, np.rint(wide[0]), rtol=1e-5)
    smooth(counts)


@pytest.mark.release
def test_samples_that_are_repeated_are_not_taken_for_steps(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    values = np.repeat(rng.standard_normal(5000), 4)
    _, counts = counted(values, looked_at(tmp_path, {"gyro_x": values}), "gyro_x")
    assert len(counts) == 100


@pytest.mark.parametrize("step", [0.0, 0.05])
@pytest.mark.parametrize("samples", [40, 100, 5000])
def test_an_outlier_does_not_squeeze_the_others(
    tmp_path: Path, rng: np.random.Generator, samples: int, step: float
) -> None:
    values = rng.standard_normal(samples)
    values = step * np.rint(values / step) if step else values
    values[samples // 3] = 1e9
    found = looked_at(tmp_path, {"gyro_x": values})
    edges, counts = counted(values, found, "gyro_x")
    assert edges[-1] == 1e9 and counts[-1] == 1
    assert edges[-2] < 12.0
    assert (counts > 0).sum() > 15


def test_a_few_levels_are_a_bin_each(tmp_path: Path, rng: np.random.Generator) -> None:
    values = np.where(rng.random(5000) < 0.004, 0.5, 0.0)
    edges, counts = counted(values, looked_at(tmp_path, {"gyro_x": values}), "gyro_x")
    np.testing.assert_allclose(edges, [-0.25, 0.25, 0.75])
    assert counts.tolist() == [(values == 0).sum(), (values == 0.5).sum()]


def test_all_levels_are_shown_where_there_are_few(tmp_path: Path, rng: np.random.Generator) -> None:
    levels = np.rint(1.5 * rng.standard_normal(5000))
    levels[17] = 100.0
    found = looked_at(tmp_path, {"gyro_x": 0.05 * levels})
    edges, counts = counted(0.05 * levels, found, "gyro_x")
    np.testing.assert_allclose(edges, 0.05 * np.arange(levels.min() - 0.5, 101.0), atol=1e-12)
    assert counts[-1] == 1


def test_steps_of_which_many_never_occur(tmp_path: Path, rng: np.random.Generator) -> None:
    levels = np.rint(60 * rng.standard_normal(1500))
    assert 100 < len(np.unique(levels)) < 0.9 * np.ptp(levels)
    found = looked_at(tmp_path, {"gyro_x": 0.01 * levels})
    edges, _ = counted(0.01 * levels, found, "gyro_x")
    wide = np.diff(edges)[1:-1] / 0.01
    np.testing.assert_allclose(wide, np.rint(wide[0]), rtol=1e-9)
    np.testing.assert_allclose(edges[1:-1] / 0.01 % 1.0, 0.5, atol=1e-6)


def test_samples_on_the_edges_of_bins(tmp_path: Path) -> None:
    values = np.linspace(0.0, 100.0, 101) / 7.0
    _, counts = counted(values, looked_at(tmp_path, {"gyro_x": values}), "gyro_x")
    assert len(counts) == 100


@pytest.mark.parametrize("levels", [2, 5])
def test_steps_as_fine_as_float64_has_them(tmp_path: Path, levels: int) -> None:
    values = 1.0 + np.finfo(float).eps * (np.arange(300) % levels)
    _, counts = counted(values, looked_at(tmp_path, {"gyro_x": values}), "gyro_x")
    assert counts.sum() == 300


def test_a_channel_that_never_changes_is_one_bin(tmp_path: Path) -> None:
    found = looked_at(tmp_path, {"gyro_x": np.full(1000, 0.1)}, 7)
    assert found.histogram == [
        {"sensor": "sensor", "recording": "log_1", "channel": "gyro_x"}
        | {"lower": 0.1, "upper": 0.1, "count": 1000}
    ]
    assert {(row["low"], row["mean"], row["high"]) for row in found.envelope} == {(0.1, 0.1, 0.1)}


@given(st.permutations(range(40)))
def test_bins_do_not_depend_on_the_order(order: list[int]) -> None:
    values = np.sin(np.arange(40.0)).round(1)
    low, high = values.min(), values.max()
    np.testing.assert_array_equal(bin_edges(values[order], low, high), bin_edges(values, low, high))


def test_what_is_drawn_of_an_oscillation_has_all_its_phases(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_DRAWN", 2000)
    values = np.sin(2 * np.pi * np.arange(100_000) / 50.0)  # one of 50 samples is drawn
    edges, counts = counted(values, looked_at(tmp_path, {"gyro_x": values}), "gyro_x")
    assert (edges[0], edges[-1]) == (values.min(), values.max())
    assert np.ptp(np.diff(edges)) < 1e-6
    assert counts.max() < 0.1 * len(values)


def test_each_clock_has_its_own_time(tmp_path: Path, rng: np.random.Generator) -> None:
    gyro, accel = rng.standard_normal(7000), 9.81 + rng.standard_normal(900)
    warm = np.linspace(25.0, 31.0, 70)
    keep(tmp_path, {"gyro_x": gyro}, "log.gyro.parquet", 100.0)
    keep(tmp_path, {"accel_x": accel}, "log.accel.parquet", 12.5)
    keep(tmp_path, {"temperature": warm}, "log.temperature.parquet", 1.0)
    found = overview(tmp_path, "sensor", "log_1", 64)
    agree(gyro, found, "gyro_x", 64, 100.0)
    agree(accel, found, "accel_x", 64, 12.5)
    agree(warm, found, "temperature", 64, 1.0)
    assert list(dict.fromkeys(row["channel"] for row in found.envelope)) == [
        "gyro_x",
        "accel_x",
        "temperature",
    ]
    assert {row["channel"] for row in found.histogram} == {"gyro_x", "accel_x"}


def test_a_temperature_that_is_read_now_and_then(tmp_path: Path, rng: np.random.Generator) -> None:
    warm = np.where(np.arange(3000) % 97 == 0, 25.0 + 1e-3 * np.arange(3000), np.nan)
    columns = {"gyro_y": rng.standard_normal(3000), "temperature": warm}
    found = looked_at(tmp_path, columns, 100)
    agree(warm, found, "temperature", 100, RATE)
    assert of(found.envelope, "temperature")["samples"].sum() == 31


def test_what_cannot_be_used_is_left_out(tmp_path: Path, rng: np.random.Generator) -> None:
    columns = {
        "gyro_x": rng.standard_normal(500),
        "gyro_y": np.zeros(500),
        "temperature": np.full(500, np.nan),
    }
    found = looked_at(tmp_path, columns, unusable=("gyro_y",))
    for rows in (found.envelope, found.histogram):
        assert {row["channel"] for row in rows} == {"gyro_x"}


def test_a_recording_that_was_rejected_has_no_rows(tmp_path: Path) -> None:
    assert overview(tmp_path, "sensor", "log_1") == Overview([], [])


def test_a_recording_as_the_ingest_keeps_it(tmp_path: Path, rng: np.random.Generator) -> None:
    time = np.arange(5000) / 100.0
    present = rng.random(5000) > 0.02
    present[[0, -1]] = True
    values = 1e-3 * rng.standard_normal(5000)
    lines = [
        f"{t:.17g},{w:.17g},{20.0 + t:.17g}"
        for t, w in zip(3.0 + time[present], values[present], strict=True)
    ]
    (tmp_path / "a.csv").write_text("t,w,T\n" + "\n".join(lines) + "\n")
    log = LogFormat.model_validate(
        {
            "time": {"column": "t", "unit": "s"},
            "channels": {"gyro_x": {"column": "w", "unit": "rad/s"}},
            "temperature": {"column": "T", "unit": "degC"},
        }
    )
    folder = tmp_path / "out"
    ingest(tmp_path / "a.csv", log, RecordingNotes(), QualitySettings(short=0), folder, LogNames())
    assert len(list_log_files(folder)) == 1
    found = overview(folder, "sensor", "log_1", 200)
    placed = np.where(present, values, np.nan)
    drawn = of(found.envelope, "gyro_x")
    at = np.arange(0, 5001, 25)
    np.testing.assert_allclose(drawn["start"], at[:-1] / 100.0, rtol=1e-6)
    np.testing.assert_array_equal(drawn["low"], np.fmin.reduceat(placed, at[:-1]))
    np.testing.assert_array_equal(drawn["high"], np.fmax.reduceat(placed, at[:-1]))
    np.testing.assert_array_equal(drawn["samples"], np.add.reduceat(present, at[:-1], dtype=int))
    counted(placed, found, "gyro_x")
    warm = of(found.envelope, "temperature")
    np.testing.assert_allclose(warm["low"], 23.0 + drawn["start"], atol=0.05)
