from collections.abc import Iterator
from typing import Any

from imubench_pipeline.recordings.fitness import UNFIT
from imubench_pipeline.recordings.quality.copies import recorded_twice


def rows(name: str, *figures: float) -> Iterator[dict[str, Any]]:
    for recording, figure in zip(("run_1", "run_2", "run_3"), figures, strict=True):
        place = {"sensor": "mine", "recording": recording, "channel": "gyro_x"}
        yield place | {name: figure, "chosen": True}


def test_a_log_that_lies_in_the_folder_twice_is_found() -> None:
    likelihoods = list(rows("log_likelihood", -51255.770919, -51255.7709190001, -51255.771))
    (found,) = recorded_twice(likelihoods, rows("value", 0.01, 0.01, 0.01))
    assert (found["finding"], found["recording"]) == ("recording_twice", "run_2")
    assert "run_2 has the samples of run_1 (gyro_x)" in found["detail"]
    assert found["finding"] in UNFIT


def test_logs_that_share_one_figure_are_two() -> None:
    likelihoods = list(rows("log_likelihood", -51255.770919, -51255.770919, -60000.0))
    assert list(recorded_twice(likelihoods, rows("value", 0.01, 0.02, 0.01))) == []
    assert list(recorded_twice([], [])) == []
