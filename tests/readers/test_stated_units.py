"""Units that a log states, against those of the sensor file."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.readers import read
from imubench_pipeline.settings.sensor import LogFormat
from tests.formats import test_rosbag, test_ubx, test_vectornav

GYRO = {"unit": "deg/s"}


def contradicted(path: Path, gyro: dict[str, object], **log: object) -> list[tuple[str, float]]:
    """Return the places of units in the log that the sensor file contradicts, and the factors."""
    form = LogFormat.model_validate({"rate": "100 Hz", "channels": {"gyro_x": GYRO | gyro}, **log})
    (file,) = read(path, form)
    for _ in file.batches():
        pass
    return [
        (found.detail.partition(" (")[2].partition("). The sensor file")[0], found.value)
        for found in file.contradicted_units()
    ]


ROWS = "".join(f"{row / 8},{row / 4}\n" for row in range(20))
DEGREES = pytest.approx(57.29578)


@pytest.mark.parametrize(
    ("header", "column", "where", "factor"),
    [
        ("gx [rad/s],b\n", 1, "the name 'gx [rad/s]'", DEGREES),
        ("gyro_x_mrad_s,b\n", 1, "the name 'gyro_x_mrad_s'", pytest.approx(57.29578e-3)),
        ("gx (dps),b\n", 1, None, None),
        ("gx [°/s],b\n", 1, None, None),
        ("gx,b\n", 1, None, None),
        ("gx (raw),b\n", 1, None, None),
        ("gx,ax\nrad/s,m/s^2\n", "gx", "the line of units, column 1", DEGREES),
        ("gx,ax\nrad/s,m/s^2\n", 1, "the name 'rad/s'", DEGREES),
        ("gx,ax\ndeg/s,m/s^2\n", "gx", None, None),
        ("# gx,ax\n# [mdps],[g]\n", "gx", "the line of units, column 1", pytest.approx(1e-3)),
    ],
)
def test_text(
    tmp_path: Path, header: str, column: str | int, where: str | None, factor: object
) -> None:
    path = tmp_path / "a.csv"
    path.write_text(header + ROWS)
    expected = [] if where is None else [(where, factor)]
    assert contradicted(path, {"column": column}) == expected


def test_a_scale_is_part_of_the_unit(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("gx (mdps),b\n" + ROWS)
    assert contradicted(path, {"column": 1, "scale": 1e-3}) == []
    assert contradicted(path, {"column": 1, "scale": -1.02e-3}) == []  # calibrated, other way
    assert len(contradicted(path, {"column": 1, "scale": 1 / 131})) == 1


def test_metadata_of_a_column(tmp_path: Path) -> None:
    for unit, factor in (("rad/s", [DEGREES]), ("dps", []), ("counts", [])):
        field = pa.field("wx", pa.float64(), metadata={"unit": unit})
        table = pa.table([pa.array(np.arange(9.0))], schema=pa.schema([field]))
        pq.write_table(table, tmp_path / "a.parquet")
        found = contradicted(tmp_path / "a.parquet", {"column": "wx"})
        assert [value for _, value in found] == factor
        assert all(where == "an attribute of the table" for where, _ in found)


def test_formats_that_fix_the_unit(tmp_path: Path) -> None:
    rows = test_rosbag.figures(20)
    bag = test_rosbag.bag(tmp_path, "ros1", {"/imu": test_rosbag.imu_topic("ros1", rows)})
    column = {"column": "angular_velocity.x"}
    ((where, factor),) = contradicted(bag, column)
    assert where == "the type sensor_msgs/Imu of its topic" and factor == DEGREES
    assert contradicted(bag, column | {"unit": "rad/s"}) == []
    (tmp_path / "a.txt").write_bytes(test_vectornav.logged([test_vectornav.IMU] * 20))
    ((where, _),) = contradicted(tmp_path / "a.txt", {"column": "gyro_x"}, reader="vectornav")
    assert where == "the format of VectorNav"
    counts = np.ones((20, 6), int)
    samples = test_ubx.samples(counts, 1000 + np.arange(20) * 256)
    (tmp_path / "a.ubx").write_bytes(2 * test_ubx.raw(samples))
    assert contradicted(tmp_path / "a.ubx", {"column": "gyro_x"}) == []
    ((where, factor),) = contradicted(tmp_path / "a.ubx", {"column": "gyro_x", "unit": "rad/s"})
    assert where == "the format of u-blox" and factor == pytest.approx(1 / 57.29578)
