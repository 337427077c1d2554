from imubench_pipeline.model.estimates import FixedBiasRow, ModelRow
from imubench_pipeline.model.table import R
from imubench_pipeline.recordings.quality.copies import find_copied_recordings
from imubench_pipeline.words.findings.base import FINDINGS
from tests.rows import typed


def rows(of: type[R], *figures: float, **also: bool) -> list[R]:
    column = "log_likelihood" if of is ModelRow else "value"
    place = {"sensor": "mine", "channel": "gyro_x"} | also
    runs = zip(("run_1", "run_2", "run_3"), figures, strict=True)
    return typed(of, [place | {"recording": name, column: figure} for name, figure in runs])


def likelihoods(*figures: float) -> list[ModelRow]:
    return rows(ModelRow, *figures, chosen=True)


def test_a_log_that_lies_in_the_folder_twice_is_found() -> None:
    models = likelihoods(-51255.770919, -51255.7709190001, -51255.771)
    (found,) = find_copied_recordings(models, rows(FixedBiasRow, 0.01, 0.01, 0.01))
    assert (found.finding, found.recording) == ("recording_twice", "run_2")
    assert "run_2 has the samples of run_1 (gyro x)" in found.detail
    assert FINDINGS[found.finding].unfit


def test_logs_that_share_one_figure_are_two() -> None:
    models = likelihoods(-51255.770919, -51255.770919, -60000.0)
    assert list(find_copied_recordings(models, rows(FixedBiasRow, 0.01, 0.02, 0.01))) == []
    assert list(find_copied_recordings([], [])) == []
