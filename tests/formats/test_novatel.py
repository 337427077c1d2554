"""Raw IMU logs of NovAtel in ASCII."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.extensions.formats.novatel import compute_crc
from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.readers.inspection import inspect
from imubench_pipeline.settings.sensor import LogFormat

# What a receiver with an HG1700 AG58 wrote, as published.
PUBLISHED = (
    b"%RAWIMUSXA,1692,484620.664;00,11,1692,484620.664389000,00801503,43110635,-817242,-202184,"
    b"-215194,-41188,-9895*a5db8c7b"
)
NAMES = [f"{quantity}_{axis}" for quantity in ("gyro", "accel") for axis in "xyz"]
TIME = {"column": "gnss_time", "unit": "ns"}


def crc_by_bits(text: bytes) -> int:
    """The CRC as the manual's program computes it, bit by bit."""
    value = 0
    for byte in text:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xEDB88320 if value & 1 else 0)
    return value


def checked(start: bytes, text: bytes) -> bytes:
    return start + text + b"*%08x" % crc_by_bits(text)


def rawimus(counts: np.ndarray, rate: float, kind: str = "RAWIMUSA", imu: int = 8) -> list[bytes]:
    """Lines of a log; ``counts``: gyro x, y, z, accel x, y, z of each record."""
    lines = []
    for row, (gx, gy, gz, ax, ay, az) in enumerate(counts.tolist()):
        over, microseconds = divmod(604_790_000_000 + round(row * 1e6 / rate), 604_800_000_000)
        week, seconds = 1815 + over, microseconds / 1e6
        start, head = b"%", f"{kind},{week},{seconds:.3f};"
        if "S" not in kind:
            start = b"#"
            head = f"{kind},COM1,0,68.5,FINESTEERING,{week},{seconds:.3f},024c0040,6125,30019;"
        head += f"00,{imu}," if "X" in kind else ""
        text = f"{head}{week},{seconds:.9f},00000077,{az},{-ay},{ax},{gz},{-gy},{gx}"
        lines.append(checked(start, text.encode()))
    return lines


def log_format(scale: float = 1.0, **keys: object) -> LogFormat:
    units = {"gyro": "rad/s", "accel": "m/s^2"}
    channels = {name: {"column": name, "unit": units[name[:-2]], "scale": scale} for name in NAMES}
    return LogFormat.model_validate({"channels": channels} | (keys or {"time": TIME}))


def columns(path: Path, log: LogFormat) -> tuple[np.ndarray, np.ndarray | None, LogFile]:
    (file,) = read(path, log)
    batches = list(file.batches())
    table = np.column_stack([np.concatenate([b.columns[n] for b in batches]) for n in NAMES])
    times = [batch.time for batch in batches if batch.time is not None]
    return table, np.concatenate(times) if times else None, file


def written(tmp_path: Path, lines: list[bytes]) -> Path:
    path = tmp_path / "a.asc"
    path.write_bytes(b"".join(line + b"\r\n" for line in lines))
    return path


@pytest.fixture
def counts() -> np.ndarray:
    found = np.random.default_rng(3).integers(-900, 900, (400, 6))
    found[:, 3:] //= 10
    found[:, 5] += round(9.80665 * 2**14 / 100)
    return found


def test_the_checksum_of_a_log_that_a_receiver_wrote() -> None:
    text, _, check = PUBLISHED[1:].partition(b"*")
    assert crc_by_bits(text) == compute_crc(text) == int(check, 16)


@pytest.mark.parametrize("kind", ["RAWIMUA", "RAWIMUSA", "RAWIMUXA", "RAWIMUSXA"])
def test_axes_signs_and_time_over_the_end_of_a_week(
    tmp_path: Path, counts: np.ndarray, kind: str
) -> None:
    counts = np.tile(counts, (4, 1))
    found, time, file = columns(written(tmp_path, rawimus(counts, 100, kind)), log_format())
    np.testing.assert_array_equal(found, counts)
    assert time is not None
    np.testing.assert_allclose(time, np.arange(len(counts)) / 100, atol=1e-9)
    assert file.findings == []


def test_the_scale_of_an_imu_that_the_log_names(tmp_path: Path, counts: np.ndarray) -> None:
    path = written(tmp_path, rawimus(counts, 100, "RAWIMUSXA", 8))
    found = inspect(path)
    assert found.complete
    channels = found.draft.log()["channels"]
    # LN-200: 2^-19 rad and 2^-14 m/s per count, at 100 Hz.
    assert channels["gyro_x"]["scale"] == pytest.approx(2.0**-19 * 100, rel=1e-9)
    assert channels["accel_z"]["scale"] == pytest.approx(2.0**-14 * 100, rel=1e-9)
    assert "|accel| = 9.8" in found.proof.said
    table, _, _ = columns(path, LogFormat.model_validate(found.draft.log()))
    np.testing.assert_allclose(table[:, 3:], counts[:, 3:] * 2.0**-14 * 100, rtol=1e-9)


def test_what_a_receiver_wrote_has_the_length_of_gravity(tmp_path: Path) -> None:
    lines = [PUBLISHED]
    for row in range(1, 30):
        text = PUBLISHED[1:-9].replace(b"20.664389", b"20.%06d" % (664_389 + 10_000 * row))
        lines.append(checked(b"%", text))
    found = inspect(written(tmp_path, lines))
    assert found.complete
    assert "|accel| = 9.79 m/s^2" in found.proof.said
    assert "scale factor of HG1700 AG11/AG58" in found.block


def test_the_imu_is_asked_for_where_the_log_does_not_name_it(
    tmp_path: Path, counts: np.ndarray
) -> None:
    found = inspect(written(tmp_path, rawimus(counts, 100)))
    assert set(found.draft.unfilled()) == {f"channels.{name}.unit" for name in NAMES}
    assert "which IMU? 'scale' is its scale factor times 100 Hz" in found.block
    assert f"gravity fits LN-200: {2.0**-19 * 100:.6g}" in found.block
    assert "STIM300" not in found.block


def test_a_wrong_checksum_is_left_out_or_a_missing_sample(
    tmp_path: Path, counts: np.ndarray
) -> None:
    lines = rawimus(counts, 100)
    lines[7] = lines[7].replace(b",00000077,", b",00000078,")
    path = written(tmp_path, lines)
    found, _, file = columns(path, log_format())
    np.testing.assert_array_equal(found, np.delete(counts, 7, axis=0))
    assert [finding.finding for finding in file.findings] == ["wrong_checksum"]
    found, time, _ = columns(path, log_format(rate="100 Hz"))
    assert time is None and np.isnan(found[7]).all() and len(found) == len(counts)


def test_logs_without_any_right_checksum_are_read_with_a_warning(
    tmp_path: Path, counts: np.ndarray
) -> None:
    lines = [line[:-8] + b"2d2a4cff" for line in rawimus(counts, 100)]
    found, _, file = columns(written(tmp_path, lines), log_format())
    np.testing.assert_array_equal(found, counts)
    assert [f.finding for f in file.findings] == ["unchecked_logs"]


def test_other_logs_between_are_counted(tmp_path: Path, counts: np.ndarray) -> None:
    other = checked(b"#", b"BESTPOSA,COM1,0,78.5,FINESTEERING,1419,336148.000,0;SOL_COMPUTED")
    lines = [part for line in rawimus(counts, 100) for part in (line, other, b"")]
    found, _, file = columns(written(tmp_path, lines), log_format())
    np.testing.assert_array_equal(found, counts)
    assert {f.finding: f.value for f in file.findings} == {"not_sentences": len(counts)}


def test_a_column_that_is_not_there_is_named(tmp_path: Path, counts: np.ndarray) -> None:
    path = written(tmp_path, rawimus(counts, 100))
    log = log_format(time={"column": "week", "unit": "s"})
    with pytest.raises(RecordingError, match=r"no columns gyro_x, .*week.*expected gyro_x, "):
        columns(path, log)
