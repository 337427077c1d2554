"""Samples of a log beside those of its models, against a log that is made with numpy alone."""

import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.fusion.samples_of_models import (
    STRETCH,
    simulate_samples_of_models,
)
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.recordings.kept import Quality, identify_files
from imubench_pipeline.recordings.recording import list_log_files
from imubench_pipeline.tables.files import build, write
from imubench_pipeline.tables.keys import Key
from tests.kept import kept
from tests.rows import typed

KEY = Key("s", "sim_board", "gyro_x")
RATE, N = 100.0, 2e-4
DEVIATION = N * math.sqrt(RATE)


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> list[dict]:
    """Of a log of white noise about 0.01 rad/s, of whose N the curve reads the half."""
    folder: Path = tmp_path_factory.mktemp("s") / "sim_board"
    log = 0.01 + DEVIATION * np.random.default_rng(1).standard_normal(40_000)
    log[5] = np.nan
    kept(folder, {"gyro_x": log}, RATE, holes=True)
    about = {"sensor": KEY.sensor, "recording": KEY.recording}
    Quality(*typed(RecordingRow, [about]), [], {}, identify_files(list_log_files(folder))).write(
        folder / "quality.json"
    )
    absent = Parameter(None, "absent", "not asked for")
    parameters = []
    for method, value in (("curve", N / 2.0), ("likelihood", N)):
        estimate = Estimate(method, {"N": Parameter(value), "B": absent, "K": absent})
        parameters += make_parameter_rows(KEY, estimate, recommended=method == "likelihood")
    write("parameters", parameters, folder / "parameters.parquet")
    for table in ("low_pass", "temperature"):
        write(table, [], folder / f"{table}.parquet")
    bias = asdict(KEY) | {"value": 0.01, "unit": "rad/s"}
    write("fixed_bias", [bias], folder / "fixed_bias.parquet")
    made = simulate_samples_of_models(folder, KEY.sensor, KEY.recording, 7)
    found: list[dict] = build("samples_of_models", made).to_pylist()
    return found


def test_the_deviations_are_those_of_log_and_models(rows: list[dict]) -> None:
    deviation = {row["of"]: row["mean"] for row in rows if row["what"] == "deviation"}
    assert deviation["log"] == pytest.approx(DEVIATION, rel=0.02)
    assert deviation["before"] == pytest.approx(DEVIATION / 2.0, rel=0.02)
    assert deviation["after"] == pytest.approx(DEVIATION, rel=0.02)


def test_a_stretch_has_every_sample_and_an_envelope_all(rows: list[dict]) -> None:
    for of in ("log", "before", "after"):
        stretch = [row for row in rows if row["of"] == of and row["what"] == "stretch"]
        assert len(stretch) == round(STRETCH * RATE)
        assert stretch[5]["mean"] is None if of == "log" else stretch[5]["mean"] is not None
        envelope = [row for row in rows if row["of"] == of and row["what"] == "envelope"]
        assert envelope[0]["start"] == 0.0 and envelope[-1]["end"] == pytest.approx(400.0)
        assert all(row["low"] <= row["mean"] <= row["high"] for row in envelope)
        means = np.mean([row["mean"] for row in envelope])
        assert means == pytest.approx(0.01, abs=5.0 * DEVIATION / 200.0)
