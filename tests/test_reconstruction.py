import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.readers.arrays.arrow import METADATA
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.config import AllanSettings, ReconstructionSettings
from imubench_pipeline.steps.allan import yield_allan_rows
from imubench_pipeline.steps.estimate import estimate_recording
from imubench_pipeline.steps.reconstruct import reconstruct, reconstruct_recording
from imubench_pipeline.tables.files import build, write
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
    metadata = pq.read_metadata(tmp_path / "s.parquet").metadata
    assert json.loads(metadata[METADATA])["simulated"] is True


def test_it_depends_on_the_seed_and_the_channel_only(rng, tmp_path: Path) -> None:
    curve = allan_variance(simulate(MODEL, 10.0, 5000, rng), 10.0)

    def scores(key: Key, seed: int) -> object:
        settings = ReconstructionSettings(seed=seed, members=20)
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


@pytest.mark.release
def test_the_square_root_of_the_mean_of_members(rng, tmp_path: Path) -> None:
    curve = allan_variance(simulate(NoiseModel(N=1.0), 1.0, 4000, rng), 1.0)
    model = estimate(NoiseModel(N=1.0))

    def at_long_tau(members: int) -> float:
        settings = ReconstructionSettings(members=members)
        rows = reconstruct(KEY, model, curve, 1.0, settings, tmp_path).curve_rows
        return float(rows[-3]["reconstructed"])

    expected = 1.0 / np.sqrt(curve.tau[-3])
    assert at_long_tau(200) == pytest.approx(expected, rel=0.15)


def test_what_authors_read_is_reconstructed_and_scored_beside_the_methods(rng, tmp_path) -> None:
    (tmp_path / "logs/s").mkdir(parents=True)
    (tmp_path / "sensors").mkdir()
    log = simulate(NoiseModel(N=1e-3), 10.0, 5000, rng)
    np.savetxt(tmp_path / "logs/s/r.csv", log, header="gx", comments="")
    (tmp_path / "sensors/s.yaml").write_text(
        "{vendor: V, model: S, log: {rate: 10 Hz, channels: {gyro_x: {column: gx, unit: rad/s}}}}"
    )
    plan = Plan(
        {"logs": str(tmp_path / "logs"), "sensors": str(tmp_path / "sensors"), "simulated": None,
         "results": str(tmp_path / "results"), "requirements": None,
         "estimate": {"methods": ["curve"]}}
    )  # fmt: skip
    folder, names = tmp_path / "kept", ("s", "r")
    folder.mkdir()
    settings = plan.ingest_settings(*names)
    ingest_as_planned(plan.recordings[names].path, settings, *names, folder).write(
        folder / "quality.json"
    )
    write("allan", yield_allan_rows(folder, *names, AllanSettings()), folder / "curve.parquet")
    # Twice the noise that the log has, and no B: what the source does not print is no value.
    asked = json.loads(plan.estimate_settings(*names)) | {"authors": {"gyro_x": {"N": 2e-3}}}
    into = estimate_recording(folder, *names, json.dumps(asked))
    read = {row["parameter"]: row for row in into.parameters if row["method"] == "authors"}
    assert read["N"]["value"] == 2e-3 and read["B"]["status"] == "not_shown"
    assert not any(row["recommended"] for row in read.values())
    for table in ("allan", "parameters", "allan_compensated"):
        write(table, getattr(into, table), folder / f"{table}.parquet")
    rows = reconstruct_recording(folder, ReconstructionSettings())
    scores = {row["method"]: row for row in rows.scores}
    assert scores["authors"]["rms_log10"] == pytest.approx(np.log10(2.0), abs=0.02)
    assert scores["curve"]["rms_log10"] < 0.05
    assert scores["authors"]["beats"] < 0.01
    assert scores["curve"]["beats"] == pytest.approx(0.5, abs=0.01)
