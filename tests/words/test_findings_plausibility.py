import math

import pytest

from imubench_pipeline.recordings.fitness import derive_doubts, judge_fitness
from imubench_pipeline.tables.findings import find
from imubench_pipeline.words.findings import plausibility
from imubench_pipeline.words.findings.base import ALL, FindingData
from imubench_pipeline.words.findings.plausibility import (
    AxisUnlike,
    GravityNorm,
    ImpossibleNoise,
    NoiseUnlikeDatasheet,
    RateImplausible,
    SlowSampling,
    SuspiciousUnit,
    Turning,
    UnusualFigure,
)
from tests.words.sentences import check_sentences, declared

DEG = math.radians(1.0)
USUAL = (0.0005 * DEG, 0.06 * DEG)
FROM_RAD = math.degrees(1.0)

TEXTS: list[tuple[FindingData, list[str]]] = [
    (
        RateImplausible(1e5, 1.05, 1e4, 1e3, statable=False),
        ["is 100000 Hz; expected 1.05 to 10000 Hz", "1000 times as long, the rate is 100 Hz"],
    ),
    (
        RateImplausible(0.125, 1.05, 1e4, 1e-3, statable=True),
        ["1000 times as short, the rate is 125 Hz", "state it there: 'rate: 0.125 Hz'"],
    ),
    (
        RateImplausible(1e-7, 1.05, 1e4, 1e-9, statable=False),
        ["is 1×10⁻⁷ Hz", "1×10⁹ times as short, the rate is 100 Hz"],
    ),
    (
        SuspiciousUnit("rad/s", "deg/s", DEG, noise=0.0042, usual=USUAL),
        [
            "noise is 0.241 °/s/√Hz; expected 0.0005 to 0.06 for a MEMS gyro",
            "this is 0.0042 °/s/√Hz",
        ],
    ),
    (
        SuspiciousUnit("rad/s", "deg/s", DEG, noise=0.0042, usual=USUAL, printed=True),
        ["expected 0.0005 to 0.06 by its datasheet", "in deg/s, and not rad/s"],
    ),
    (
        SuspiciousUnit("g", "m/s^2", 1.0 / 9.80665, gravity=96.17),
        ["mean acceleration is 96.17 m/s²; expected 9.807", "this is 9.807 m/s²", "correct 'unit'"],
    ),
    (SlowSampling(1.0), ["sampled at 1 Hz", "folded into N"]),
    (ImpossibleNoise(1e-11, 4e-4, 22), ["5.73×10⁻¹⁰ °/s/√Hz, 4×10⁷ times below", "dead"]),
    (GravityNorm(12.31, removed=False), ["12.31 m/s²; expected 9.807", "Check unit, scale"]),
    (GravityNorm(0.1, removed=True), ["subtracted already", "raw data"]),
    (
        NoiseUnlikeDatasheet("gyro_x", 0.05 * DEG, 0.004 * DEG, None),
        ["noise of gyro x is 0.05 °/s/√Hz, 12.5 times the 0.004", "Check scale, range and column"],
    ),
    (
        NoiseUnlikeDatasheet("gyro_x", 0.05 * DEG, 0.004 * DEG, 100.0),
        ["Check the sampling rate (100 Hz is stated), scale"],
    ),
    (
        AxisUnlike(("gyro_x", "gyro_y"), 57.3, 0.3 * DEG, "deg/s", "rad/s"),
        ["57.3 times that of gyro x and gyro y: 0.3 °/s/√Hz", "rad/s instead of deg/s"],
    ),
    (AxisUnlike(("gyro_x", "gyro_y"), 6.0, 0.3 * DEG, "deg/s", None), ["differ so much. Check"]),
    (
        Turning(-31.0 * DEG, largest=30.0 * DEG),
        ["gyro z, −31 °/s, is beyond", "of any gyro (30 °/s)"],
    ),
    (
        Turning(-6.4 * DEG, largest=4.5 * DEG, offset_of="datasheet"),
        [
            "gyro z, −6.4 °/s, is beyond the largest plausible offset by its datasheet (4.5 °/s)",
            "unit is wrong",
        ],
    ),
    (
        Turning(6.4 * DEG, largest=2.0 * DEG, offset_of="tactical"),
        ["of price class tactical (2 °/s)"],
    ),
    (
        Turning(0.02 * DEG, swept=12.0 * DEG, gyro_rate=0.021 * DEG),
        ["Gravity turns relative to the sensor by 12°", "at 0.02 °/s", "gyros show 0.021 °/s"],
    ),
    (Turning(0.02 * DEG, swept=12.0 * DEG), ["°/s. The sensor is turning or tilting"]),
    (
        UnusualFigure("gyro", "N", 0.327 * DEG, 0.005 * DEG, 9, DEG),
        [
            "N of gyro z is 0.327 °/s/√Hz, 65.4 times the median of 9 sensors (0.005 °/s/√Hz)",
            "in degrees, and not rad, the value is 0.00571 °/s/√Hz",
        ],
    ),
    (
        UnusualFigure("gyro", "B", 1e-3 * DEG / 3600, 1.0 * DEG / 3600, 9, None, estimated=True),
        ["σ_min of gyro z is 0.001 °/h, 1000 times below the least", "Check whether its unit"],
    ),
]


@pytest.mark.parametrize(("data", "parts"), TEXTS)
def test_implausible_data_state_their_numbers(data: FindingData, parts: list[str]) -> None:
    text = check_sentences(data, "gyro_z")
    assert all(part in text for part in parts), text


def test_every_finding_on_implausible_data_has_a_text() -> None:
    assert {type(data) for data, _ in TEXTS} == declared(plausibility)


def test_a_finding_on_the_whole_recording_names_the_channel_that_shows_it() -> None:
    data = NoiseUnlikeDatasheet("gyro_x", 0.05 * DEG, 0.004 * DEG, 100.0)
    assert check_sentences(data, "") == check_sentences(data, "gyro_y")


def test_a_printed_figure_is_one_of_the_quantity() -> None:
    text = check_sentences(UnusualFigure("accel", "B", 1.0, 1e-3, 9, None), "")
    assert text.startswith("B of accelerometer is 102000 µg, 1000 times the median of 9 sensors")


@pytest.mark.parametrize(
    ("data", "factor", "expected"),
    [
        (
            RateImplausible(1e-4, 1.05, 1e4, 1e-6, statable=False),
            1e-6,
            {"N": 1e-3, "Q": 1e-6, "T_B": 1e-6, "tau_min": 1e-6, "K": 1e3, "R": 1e6},
        ),
        (
            SuspiciousUnit("g", "m/s^2", 0.102, gravity=96.17),
            0.102,
            dict.fromkeys(("N", "Q", "B", "B_curve", "sigma_min", "K", "R", "bias"), 0.102),
        ),
        (
            Turning(-31.0 * DEG, largest=30.0 * DEG),
            -31.0 * DEG,
            dict.fromkeys(sorted(ALL)),
        ),
    ],
)
def test_a_recording_that_may_not_be_at_rest_in_its_unit_is_not_used(
    data: FindingData, factor: float, expected: dict[str, float | None]
) -> None:
    row = find(data, "warning", factor, "gyro_x").row("s", "r")
    found = list(derive_doubts([row], [], []))
    assert judge_fitness(found) == "unfit"
    by_name = {name: doubt.factor for doubt in found for name in doubt.parameters}
    assert by_name == {
        name: value if value is None else pytest.approx(value) for name, value in expected.items()
    }


def test_other_implausible_data_leave_a_recording_in_use() -> None:
    data = AxisUnlike(("gyro_x", "gyro_y"), 6.0, 0.3 * DEG, "deg/s", None)
    (doubt,) = derive_doubts([find(data, "warning", 6.0, "gyro_z").row("s", "r")], [], [])
    assert judge_fitness([doubt]) == "fit with doubts"
    assert set(doubt.parameters) == ALL
