from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.recordings.ingest import Ingested, ingest
from imubench_pipeline.recordings.recording import (
    LogNames,
    list_log_files,
    open_channel_logs,
    read_metadata,
)
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat, RecordingNotes

XY = {"gyro_x": {"column": "wx", "unit": "rad/s"}, "gyro_y": {"column": "wy", "unit": "rad/s"}}
TIME = {"column": "t", "unit": "s"}


def write_csv(path: Path, **columns: np.ndarray) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = np.column_stack(list(columns.values()))
    lines = [
        ",".join(f"{value:.17g}" if np.isfinite(value) else str(value) for value in row)
        for row in rows
    ]
    path.write_text(",".join(columns) + "\n" + "\n".join(lines) + "\n")
    return path


def kept(
    source: Path, folder: Path, channels: dict[str, Any] | None = None, **keys: Any
) -> tuple[Ingested, dict[str, np.ndarray]]:
    notes = RecordingNotes.model_validate({"use": keys.pop("use", {})})
    rate = {} if "time" in keys else {"rate": "100 Hz"}
    log = LogFormat.model_validate({"channels": channels or XY} | rate | keys)
    result = ingest(source, log, notes, QualitySettings(short=0), folder, LogNames())
    values = {
        name: np.concatenate(list(found.blocks()))
        for name, found in open_channel_logs(folder).items()
    }
    return result, values


def test_samples_come_back_as_written(tmp_path: Path, rng: np.random.Generator) -> None:
    wx, wy = 1e-3 * rng.standard_normal((2, 3000))
    source = write_csv(tmp_path / "a.csv", wx=wx, wy=wy)
    result, values = kept(source, tmp_path / "out")
    np.testing.assert_array_equal(values["gyro_x"], wx)
    np.testing.assert_array_equal(values["gyro_y"], wy)
    assert result.row.samples == 3000
    assert result.row.duration == 30.0
    assert result.findings == []
    assert pq.read_schema(tmp_path / "out/log.parquet").names == ["gyro_x", "gyro_y"]
    metadata = read_metadata(tmp_path / "out/log.parquet")
    assert metadata.sources[0].name == "a.csv"
    assert metadata.sources[0].size == source.stat().st_size
    assert len(metadata.sources[0].sha256 or "") == 64
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["log.parquet"]


def test_empty_lines_of_one_column_keep_their_time(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    wx = 1e-3 * rng.standard_normal(5000)
    wx[2000:4000] = np.nan
    cells = ["" if np.isnan(value) else f"{value:.17g}" for value in wx]
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    one.write_text("wx\n" + "\n".join(cells) + "\n\n\n")
    two.write_text("wx,n\n" + "".join(f"{cell},1\n" for cell in cells))
    alone = {"gyro_x": XY["gyro_x"]}
    results = [kept(source, tmp_path / source.stem, alone) for source in (one, two)]
    for result, values in results:
        assert result.row.duration == 50.0
        assert [(one.finding, one.value) for one in result.findings] == [("empty_cells", 2000.0)]
        np.testing.assert_array_equal(values["gyro_x"], wx)


def test_row_groups_and_encoding(tmp_path: Path) -> None:
    source = tmp_path / "a.csv"
    source.write_text("wx,wy\n" + "1.5,2\n2.5,1\n" * 600_000)
    _, values = kept(source, tmp_path / "out")
    assert len(values["gyro_x"]) == 1_200_000
    file = pq.ParquetFile(tmp_path / "out/log.parquet")
    column = file.metadata.row_group(0).column(0)
    assert [file.metadata.row_group(i).num_rows for i in range(2)] == [
        1 << 20,
        1_200_000 - (1 << 20),
    ]
    assert column.compression == "ZSTD"
    assert "BYTE_STREAM_SPLIT" in column.encodings


def test_holes_are_put_on_the_grid(tmp_path: Path, rng: np.random.Generator) -> None:
    time = np.arange(5000) / 100.0
    present = rng.random(5000) > 0.02
    present[[0, -1]] = True
    wx, wy = 1e-3 * rng.standard_normal((2, 5000))
    wy[7] = np.nan
    present[7] = True
    source = write_csv(tmp_path / "a.csv", t=3.0 + time[present], wx=wx[present], wy=wy[present])
    result, values = kept(source, tmp_path / "out", time=TIME)
    np.testing.assert_array_equal(np.isfinite(values["gyro_x"]), present)
    np.testing.assert_array_equal(values["gyro_x"][present], wx[present])
    assert np.isnan(values["gyro_y"][7])
    found = {finding.finding: finding.value for finding in result.findings}
    assert found == {"missing_samples": (~present).sum(), "empty_cells": 1}
    columns = pq.read_schema(tmp_path / "out/log.parquet").names
    assert columns == ["time", "sample", "gyro_x", "gyro_y"]


def test_a_hole_beside_a_repeated_record_is_still_a_hole(tmp_path: Path) -> None:
    time = np.arange(1000) / 100.0
    time[501] = time[498]
    source = write_csv(tmp_path / "a.csv", t=time, wx=1e-3 * np.sin(np.arange(1000.0)))
    result, values = kept(source, tmp_path / "out", {"gyro_x": XY["gyro_x"]}, time=TIME)
    assert np.isnan(values["gyro_x"]).sum() == 1
    assert open_channel_logs(tmp_path / "out")["gyro_x"].holes
    assert result.row.samples == 999
    found = {finding.finding: finding.value for finding in result.findings}
    assert found == {"missing_samples": 1, "repeated_stamps": 1}


def test_a_record_that_was_written_late_is_sorted(tmp_path: Path) -> None:
    order = np.array([*range(500), *range(501, 504), 500, *range(504, 1000)])
    wx = 1e-3 * np.sin(np.arange(1000.0))
    source = write_csv(tmp_path / "a.csv", t=order / 100.0, wx=wx[order])
    result, values = kept(source, tmp_path / "out", {"gyro_x": XY["gyro_x"]}, time=TIME)
    np.testing.assert_array_equal(values["gyro_x"], wx)
    found = {finding.finding: finding.value for finding in result.findings}
    assert found == {"late_records": 1}


def test_a_uniform_time_is_not_kept(tmp_path: Path, rng: np.random.Generator) -> None:
    source = write_csv(
        tmp_path / "a.csv", t=np.arange(500) / 50, wx=1e-3 * rng.standard_normal(500)
    )
    result, _ = kept(source, tmp_path / "out", {"gyro_x": XY["gyro_x"]}, time=TIME)
    assert pq.read_schema(tmp_path / "out/log.parquet").names == ["gyro_x"]
    assert result.channels["gyro_x"].rate == pytest.approx(50.0)


PER_AXIS = {
    f"gyro_{axis}": {"file": f"{axis}.csv", "column": "w", "unit": "rad/s"} for axis in "xyz"
}


def test_files_of_one_clock_are_one_log(tmp_path: Path, rng: np.random.Generator) -> None:
    axes = 1e-3 * rng.standard_normal((3, 400))
    for axis, samples in zip("xyz", axes, strict=True):
        write_csv(tmp_path / f"r/{axis}.csv", w=samples)
    _, values = kept(tmp_path / "r", tmp_path / "out", PER_AXIS)
    assert [path.name for path in list_log_files(tmp_path / "out")] == ["log.parquet"]
    for axis, samples in zip("xyz", axes, strict=True):
        np.testing.assert_array_equal(values[f"gyro_{axis}"], samples)


def test_clocks_of_their_own_have_files_of_their_own(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    channels = {
        "gyro_x": {"file": "g.csv", "column": "w", "unit": "rad/s"},
        "accel_x": {"file": "a.csv", "column": "w", "unit": "m/s^2"},
    }
    write_csv(tmp_path / "r/g.csv", t=np.arange(1000) / 100, w=1e-3 * rng.standard_normal(1000))
    write_csv(tmp_path / "r/a.csv", t=0.3 + np.arange(600) / 64, w=1e-3 * rng.standard_normal(600))
    result, values = kept(tmp_path / "r", tmp_path / "out", channels, time=TIME)
    names = [path.name for path in list_log_files(tmp_path / "out")]
    assert names == ["log.accel.parquet", "log.gyro.parquet"]
    assert result.channels["accel_x"].rate == pytest.approx(64.0)
    assert result.channels["gyro_x"].rate == pytest.approx(100.0)
    assert (len(values["gyro_x"]), len(values["accel_x"])) == (1000, 600)


def test_an_axis_cut_short_loses_the_others_nothing(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    for axis, length in zip("xyz", (400, 400, 399), strict=True):
        write_csv(tmp_path / f"r/{axis}.csv", w=1e-3 * rng.standard_normal(length))
    result, values = kept(tmp_path / "r", tmp_path / "out", PER_AXIS)
    assert [len(values[f"gyro_{axis}"]) for axis in "xyz"] == [400, 400, 399]
    assert [(f.finding, f.value) for f in result.findings] == [("unequal_length", 1)]
    write_csv(tmp_path / "r/z.csv", w=1e-3 * rng.standard_normal(50))
    result, values = kept(tmp_path / "r", tmp_path / "out", PER_AXIS)
    assert list(values) == ["gyro_x", "gyro_y"]
    assert ("too_short", "gyro_z") in [(f.finding, f.channel) for f in result.findings]


def test_the_part_to_use(tmp_path: Path, rng: np.random.Generator) -> None:
    wx, wy = 1e-3 * rng.standard_normal((2, 1000))
    source = write_csv(tmp_path / "a.csv", wx=wx, wy=wy)
    result, values = kept(source, tmp_path / "out", use={"start": 2.0, "end": 7.99})
    np.testing.assert_array_equal(values["gyro_x"], wx[200:800])
    assert [(f.finding, f.value) for f in result.findings] == [("not_used", 400)]
    with pytest.raises(
        RecordingError, match=r"none of its 1000 samples lies in the part to use \(use: start 20"
    ):
        kept(source, tmp_path / "out", use={"start": 20.0})


def test_a_dead_axis_is_left_out_and_the_others_go_on(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    source = write_csv(tmp_path / "a.csv", wx=np.full(500, 2.5), wy=1e-3 * rng.standard_normal(500))
    result, values = kept(source, tmp_path / "out")
    assert list(values) == ["gyro_y"] == list(result.channels)
    (finding,) = result.findings
    assert (finding.finding, finding.severity, finding.channel) == ("stuck", "fatal", "gyro_x")
    source = write_csv(tmp_path / "b.csv", wx=np.full(500, np.nan), wy=np.zeros(500))
    with pytest.raises(RecordingError, match="no channel can be used: gyro x contains no number"):
        kept(source, tmp_path / "out")


def test_infinities_are_missing_samples(tmp_path: Path, rng: np.random.Generator) -> None:
    wx = 1e-3 * rng.standard_normal(500)
    wx[5] = np.inf
    source = write_csv(tmp_path / "a.csv", wx=wx, wy=1e-3 * rng.standard_normal(500))
    result, values = kept(source, tmp_path / "out")
    assert np.isnan(values["gyro_x"][5])
    assert [f.finding for f in result.findings] == ["not_finite"]


def test_too_short_a_recording_is_rejected_and_leaves_nothing(tmp_path: Path) -> None:
    source = write_csv(tmp_path / "a.csv", wx=np.arange(99.0), wy=np.arange(99.0))
    with pytest.raises(RecordingError, match="gyro x has 99 samples; at least 100 are required"):
        kept(source, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.release
def test_long_holes_are_read_in_bounded_blocks(tmp_path: Path) -> None:
    time = np.concatenate([500.0 * i + np.arange(100) / 1000.0 for i in range(20)])
    wx = 1e-3 * np.sin(np.arange(2000.0))
    source = write_csv(tmp_path / "a.csv", t=time, wx=wx)
    kept(source, tmp_path / "out", {"gyro_x": XY["gyro_x"]}, time=TIME)
    log = open_channel_logs(tmp_path / "out")["gyro_x"]
    assert log.grid > 9_000_000
    blocks = list(log.blocks())
    assert max(map(len, blocks)) < 3 << 20
    joined = np.concatenate(blocks)
    assert len(joined) == log.grid
    np.testing.assert_array_equal(joined[np.isfinite(joined)], wx)


def test_a_second_run_replaces_the_first(tmp_path: Path, rng: np.random.Generator) -> None:
    first = write_csv(
        tmp_path / "a.csv", wx=1e-3 * rng.standard_normal(500), wy=1e-3 * rng.standard_normal(500)
    )
    kept(first, tmp_path / "out")
    write_csv(tmp_path / "r/x.csv", w=1e-3 * rng.standard_normal(300))
    write_csv(tmp_path / "r/y.csv", w=1e-3 * rng.standard_normal(200))
    two = {name: PER_AXIS[name] for name in ("gyro_x", "gyro_y")}
    _, values = kept(tmp_path / "r", tmp_path / "out", two)
    assert (len(values["gyro_x"]), len(values["gyro_y"])) == (300, 200)
    assert not (tmp_path / "out/log.parquet").exists()


def test_temperature_is_kept_beside_the_channels(tmp_path: Path, rng: np.random.Generator) -> None:
    source = write_csv(
        tmp_path / "a.csv", wx=1e-3 * rng.standard_normal(500), T=np.linspace(290.0, 300.0, 500)
    )
    result, values = kept(
        source,
        tmp_path / "out",
        {"gyro_x": XY["gyro_x"]},
        temperature={"column": "T", "unit": "K"},
    )
    assert list(values) == ["gyro_x"]
    assert result.row.temperature_min == pytest.approx(16.85)
    assert result.row.temperature_max == pytest.approx(26.85)
    assert "temperature" in pq.read_schema(tmp_path / "out/log.parquet").names


@pytest.mark.parametrize(("seconds", "noted"), [(600, ["short_recording"]), (1000, [])])
def test_a_short_recording_gets_a_note(
    tmp_path: Path, rng: np.random.Generator, seconds: int, noted: list[str]
) -> None:
    log = write_csv(tmp_path / "log.csv", wx=1e-3 * rng.standard_normal(10 * seconds))
    layout = LogFormat.model_validate({"rate": "10 Hz", "channels": {"gyro_x": XY["gyro_x"]}})
    found = ingest(log, layout, RecordingNotes(), QualitySettings(), tmp_path / "out", LogNames())
    assert [finding.finding for finding in found.findings] == noted
