"""Axes without results say why."""

from imubench_pipeline.words.events import missing_axes_texts

GYRO = ["gyro_x", "gyro_y", "gyro_z"]
ACCEL = ["accel_x", "accel_y", "accel_z"]


def test_all_axes_need_no_sentence() -> None:
    assert missing_axes_texts([*GYRO, *ACCEL], []) == []


def test_a_sensor_that_is_not_in_the_log() -> None:
    assert missing_axes_texts(GYRO, GYRO) == ["Accelerometer: not in the log."]


def test_single_axes_with_and_without_a_finding() -> None:
    assert missing_axes_texts(["gyro_x", *ACCEL], ["gyro_z", "gyro_x"]) == [
        "Gyroscope y: not in the log.",
        "Gyroscope z: not analysed; see the findings.",
    ]
