from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.recording import read_metadata
from imubench_pipeline.settings.config import ReconstructionSettings
from imubench_pipeline.steps.reconstruct import reconstruct
from imubench_pipeline.tables import build
from imubench_pipeline.tables.keys import Key

MODEL = NoiseModel(N=1e-3, B=2e-3, T_B=10.0, K=1e-4)
KEY = Key("s", "r", "gyro_x")


def estimate(model: NoiseModel) -> Estimate:
    return Estimate("weighted", {name: Parameter(value) for name, value in asdict(model).items()})


def test_a_reconstruction_of_the_truth_scores_well(rng, tmp_path: Path) -> None:
    curve = allan_variance(simulate(MODEL, 10.0, 100_000, rng), 10.0)
    settings = ReconstructionSettings(keep_series=True, members=2)
    found = reconstruct(KEY, estimate(MODEL), curve, 10.0, settings, tmp_path / "s.parquet")
    assert found.score_row["inside_band"] > 0.6
    assert found.score_row["rms_log10"] < 0.2
    table = build("reconstruction", found.curve_rows).to_pydict()
    assert len(table["tau"]) == len(curve.tau)
    for low, middle, high in zip(table["lower"], table["adev"], table["upper"], strict=True):
        assert low < middle < high
    series = pq.read_table(tmp_path / "s.parquet")["simulated"].to_numpy()
    assert len(series) == 100_000
    assert read_metadata(tmp_path / "s.parquet")["simulated"] is True


def test_it_depends_on_the_seed_and_the_channel_only(rng, tmp_path: Path) -> None:
    curve = allan_variance(simulate(MODEL, 10.0, 5000, rng), 10.0)

    def scores(key: Key, seed: int) -> object:
        settings = ReconstructionSettings(seed=seed)
        return reconstruct(key, estimate(MODEL), curve, 10.0, settings, tmp_path).score_row["drawn"]

    assert scores(KEY, 1) == scores(KEY, 1)
    assert scores(KEY, 1) != scores(KEY, 2)
    assert scores(KEY, 1) != scores(Key("s", "r", "gyro_y"), 1)


def test_a_wrong_model_lies_outside_its_band(rng, tmp_path: Path) -> None:
    curve = allan_variance(simulate(MODEL, 10.0, 100_000, rng), 10.0)
    wrong = NoiseModel(N=3e-3)
    found = reconstruct(KEY, estimate(wrong), curve, 10.0, ReconstructionSettings(), tmp_path)
    assert found.score_row["inside_band"] < 0.3


def test_without_a_value_there_is_a_reason_and_no_score(rng, tmp_path: Path) -> None:
    curve = allan_variance(rng.standard_normal(500), 10.0)
    nothing = Estimate("curve", {"N": Parameter(None, "not_shown", "no such slope")})
    found = reconstruct(KEY, nothing, curve, 10.0, ReconstructionSettings(), tmp_path)
    assert found.curve_rows == []
    (row,) = build("scores", [found.score_row]).to_pylist()
    assert row["rms"] is None
    assert row["reason"] == "no term has a value: no such slope"


def test_the_square_root_of_the_mean_of_members(rng, tmp_path: Path) -> None:
    curve = allan_variance(simulate(NoiseModel(N=1.0), 1.0, 4000, rng), 1.0)
    model = estimate(NoiseModel(N=1.0))

    def at_long_tau(members: int) -> float:
        settings = ReconstructionSettings(members=members)
        rows = reconstruct(KEY, model, curve, 1.0, settings, tmp_path).curve_rows
        return float(rows[-3]["reconstructed"])

    expected = 1.0 / np.sqrt(curve.tau[-3])
    assert at_long_tau(200) == pytest.approx(expected, rel=0.15)
