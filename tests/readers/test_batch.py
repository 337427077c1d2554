from imubench_pipeline.readers import RecordingError


def test_a_reason_is_bounded_and_keeps_its_ends() -> None:
    said = str(RecordingError("log.csv: found '" + "x" * 10**6 + "'; expected a name"))
    assert len(said) < 1500
    assert said.startswith("log.csv: found 'xxx") and said.endswith("xxx'; expected a name")
    assert str(RecordingError("log.csv: is empty")) == "log.csv: is empty"
