import math

import pytest

from imubench_pipeline.words.findings import changes
from imubench_pipeline.words.findings.base import FindingData
from imubench_pipeline.words.findings.changes import (
    BiasStep,
    NoiseTrend,
    PeriodicDrift,
    TelegraphNoise,
    WarmUpDrift,
)
from tests.words.sentences import check_sentences, declared

HOUR = math.radians(1.0) / 3600.0
SIZE = (30.0 * HOUR, 28.0 * HOUR, 32.0 * HOUR)
TIME = (600.0, 520.0, 690.0)

TEXTS: list[tuple[FindingData, list[str]]] = [
    (
        BiasStep(*SIZE, 400.0, 2.0),
        ["steps by 30 °/h (95 %: 28 to 32 °/h) at 400 s (± 2 s)", "removed"],
    ),
    (
        WarmUpDrift(*SIZE, *TIME),
        [
            "starts 30 °/h (95 %: 28 to 32 °/h)",
            "time constant of 600 s (95 %: 520 to 690 s)",
            "removed",
        ],
    ),
    (
        PeriodicDrift(*SIZE, *TIME),
        [
            "amplitude of 30 °/h (95 %: 28 to 32 °/h)",
            "period is 600 s (95 %: 520 to 690 s)",
            "removed from the noise. Record at a steady",
        ],
    ),
    (
        PeriodicDrift(*SIZE, *TIME, factors={}, cycles=0.6, has_temperature=True),
        ["drifts slowly, like a part of a wave", "with little effect", "the method compensated"],
    ),
    (
        BiasStep(*SIZE, 400.0, 2.0, factors={"K": 3.2, "N": 1.01, "B_curve": 250.0, "R": 9.0}),
        ["otherwise B (curve) would be over 100 times and K would be 3.2 times as large"],
    ),
    (TelegraphNoise(12), ["at least 12 times", "B, T_B and K are doubtful"]),
    (NoiseTrend(-0.262, 0.05), ["falls by 26.2 % (± 5 %)", "N is its mean over the log"]),
    (NoiseTrend(0.262, 0.05), ["grows by 26.2 % (± 5 %)"]),
]


@pytest.mark.parametrize(("data", "parts"), TEXTS)
def test_finding_on_a_change_states_its_numbers(data: FindingData, parts: list[str]) -> None:
    text = check_sentences(data, "gyro_z")
    assert all(part in text for part in parts), text


def test_every_finding_on_a_change_has_a_text() -> None:
    assert {type(data) for data, _ in TEXTS} == declared(changes)


def test_a_step_of_an_accelerometer_is_in_micro_g() -> None:
    assert "steps by 102 µg (95 %: 91.8 to 112 µg)" in BiasStep(1e-3, 9e-4, 1.1e-3, 4.0, 1.0).text(
        "accel_x"
    )
