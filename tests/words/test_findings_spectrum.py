import pytest

from imubench_pipeline.words.findings import spectrum
from imubench_pipeline.words.findings.base import FindingData
from imubench_pipeline.words.findings.spectrum import (
    BacktestContradicts,
    BandLimit,
    Filtered,
    Lines,
    MethodsDiffer,
    SlowNoiseMissing,
    StrongLine,
    TooManyLines,
)
from tests.words.sentences import check_sentences, declared

TEXTS: list[tuple[FindingData, list[str]]] = [
    (MethodsDiffer("N", 1.73), ["N of gyro z", "1.73 times", "do not overlap", "use it"]),
    (Lines(1, 0, 0.5691, 2.43), ["has 1 spectral line at 0.5691 Hz, 2.43 times the noise floor"]),
    (Lines(2, 1, 17.0, 1e4), ["2 spectral lines and 1 noise band. The strongest is at 17 Hz"]),
    (StrongLine(0.567, 0.576), ["at 0.567 Hz adds 0.576 times the white-noise error over 1 s"]),
    (
        TooManyLines(363, 16, 0.0123, 1e-3),
        ["363 sinusoids", "16 strongest", "The other 347", "1.23 %", "0.0573 °/s rms"],
    ),
    (Filtered(9.8), ["filtered above 9.8 Hz", "N is the value before"]),
    (BandLimit(5.0), ["bends above 5 Hz", "state the bandwidth"]),
    (SlowNoiseMissing(0.1, 0.31), ["Up to 0.1 Hz", "0.31 times", "Switch off automatic zeroing"]),
]


@pytest.mark.parametrize(("data", "parts"), TEXTS)
def test_spectral_finding_states_its_numbers(data: FindingData, parts: list[str]) -> None:
    text = check_sentences(data, "gyro_z")
    assert all(part in text for part in parts), text


def test_every_spectral_finding_has_a_text() -> None:
    tested = {type(data) for data, _ in TEXTS}
    assert tested | {BacktestContradicts} == declared(spectrum)


def test_units_follow_the_channel() -> None:
    assert "102 mg rms" in TooManyLines(40, 16, 0.1, 1.0).text("accel_x")
