from imubench_pipeline.words.findings import spectrum
from imubench_pipeline.words.findings.spectrum import BacktestContradicts
from tests.words.sentences import check_sentences, declared


def contradicts(window: float | None, *removed: str) -> BacktestContradicts:
    return BacktestContradicts(
        "heading", 600.0, window, 1.734, 0.967, 1.04, 74, 20.31, removed=removed
    )


def test_contradicted_budget_states_ratio_range_and_windows() -> None:
    text = check_sentences(contradicts(30.0), "gyro_z")
    assert text.startswith("gyro z drifts 1.73 times as much as predicted: heading after 600 s (")
    assert "(bias from 30 s at rest)" in text
    assert "In 95 % of logs a correct model gives 0.967 to 1.04 times" in text
    assert "74 windows, equivalent to 20.3 independent ones" in text
    assert "such as drift with temperature" in text


def test_contradicted_budget_names_what_is_not_in_the_model() -> None:
    text = check_sentences(contradicts(None, "periodic_drift", "bias_step"), "gyro_z")
    assert "600 s. In 95 %" in text
    assert "the log contains periodic drift and bias step, which is removed" in text
    assert BacktestContradicts in declared(spectrum)
