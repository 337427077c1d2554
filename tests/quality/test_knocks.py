from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.ingest import ingest
from imubench_pipeline.recordings.quality.knocks import find_knocks, find_outlier_blocks
from imubench_pipeline.recordings.quality.levels import detect_quantisation
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.recordings.recording import LogNames, open_channel_logs
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import LogFormat, RecordingNotes
from tests.quality.real import adis16405

RATE = 50.0
MODEL = NoiseModel(N=1.1e-3, B=2e-3, T_B=30.0, K=2e-4)
SIGMA = MODEL.N * np.sqrt(RATE)


def found_in(log: np.ndarray, sigmas: float = 10.0) -> list[tuple[int, int]]:
    column = ColumnSummary()
    column.add(log)
    pieces = np.array_split(log, 5)
    steps = detect_quantisation(column)
    step = steps.step if steps else None
    return [(k.first, k.last) for k in find_knocks(pieces, column.blocks(), sigmas, 25, step)]


def test_knocks_are_found_where_they_are(rng: np.random.Generator) -> None:
    log = 9.81 + simulate(MODEL, RATE, 200_000, rng)
    places = np.sort(rng.choice(np.arange(200, 199_800, 97), 40, replace=False))
    for place in places:
        # A knock rings down in a few samples.
        log[place : place + 6] += 30 * SIGMA * np.array([1, -0.7, 0.5, -0.3, 0.2, -0.1])
    found = found_in(log)
    assert len(found) == 40
    for place, (first, last) in zip(places, found, strict=True):
        assert first <= place - 5
        assert place + 4 <= last <= place + 30


def test_single_samples_of_any_sign_and_at_the_ends(rng: np.random.Generator) -> None:
    log = simulate(MODEL, RATE, 5000, rng)
    for place, size in ((0, 20), (255, -15), (256, 15), (2000, -500), (4999, 12)):
        log[place] += size * SIGMA
    assert len(found_in(log)) == 5


def test_quiet_logs_have_none(rng: np.random.Generator) -> None:
    for model in (MODEL, NoiseModel(N=1e-3, K=1e-2), NoiseModel(N=1e-3, B=1e-2)):
        assert found_in(simulate(model, RATE, 300_000, rng)) == []
    assert found_in(np.full(3000, np.nan)) == []


@pytest.mark.parametrize("often", [0.005, 0.02, 0.3])
def test_one_step_of_a_coarse_register_is_no_knock(rng: np.random.Generator, often: float) -> None:
    """A register that is mostly at one value: its noise is a small part of a step."""
    step = 0.05
    log = 9.8 + step * (rng.random(100_000) < often)
    log[::17_000] -= step
    column = ColumnSummary()
    column.add(log)
    if often < 0.01:  # a knock by the noise alone
        assert len(find_outlier_blocks(column.blocks(), 10.0)[0]) > 10
    assert found_in(log) == []
    log[50_000] += 12 * step
    ((first, last),) = found_in(log)
    assert first <= 50_000 < last


@pytest.mark.release
def test_steps_of_a_real_log_are_no_knocks(shared: Path) -> None:
    """Its accelerations in steps so wide that nearly all samples are the same."""
    excused = 0
    for name, values in adis16405(shared).items():
        for step in (0.1, 0.14, 0.18) if name in ("accel_x", "accel_y") else ():
            coarse = np.round(values / step) * step
            column = ColumnSummary()
            column.add(coarse)
            found = found_in(coarse)
            excused += len(find_outlier_blocks(column.blocks(), 10.0)[0]) - len(found)
            for first, last in found:
                away = np.abs(coarse[first:last] - np.median(coarse))
                assert away.max() > 1.9 * step
    assert excused > 20


def kept(tmp_path: Path, log: np.ndarray) -> tuple[list[str], np.ndarray]:
    path = tmp_path / "a.csv"
    path.write_text("ax\n" + "\n".join(f"{value:.9g}" for value in log) + "\n")
    channels = {"accel_x": {"column": "ax", "unit": "m/s^2"}}
    layout = LogFormat.model_validate({"rate": "50 Hz", "channels": channels})
    out = ingest(
        path, layout, RecordingNotes(), QualitySettings(short=0), tmp_path / "out", LogNames()
    )
    values = np.concatenate(list(open_channel_logs(tmp_path / "out")["accel_x"].blocks()))
    assert open_channel_logs(tmp_path / "out")["accel_x"].holes
    counts = out.channels["accel_x"]
    assert counts.present == counts.used + counts.knocks
    assert counts.knocks == np.isnan(values).sum() - np.isnan(log).sum()
    return [finding.finding for finding in out.findings], values


def knocked_log(samples: int, number: int, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    log = simulate(MODEL, RATE, samples, rng)
    knocked = log.copy()
    for place in rng.choice(np.arange(500, samples - 500), number, replace=False):
        knocked[place : place + 4] += rng.choice([-1, 1]) * 40 * SIGMA * 0.5 ** np.arange(4)
    return log, knocked


def test_what_is_left_beside_knocks_is_the_log_as_it_was(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    log, knocked = knocked_log(70_000, 21, rng)
    names, values = kept(tmp_path, knocked)
    assert names == ["knocks"]
    there = np.isfinite(values)
    assert np.mean(there) > 0.97
    np.testing.assert_allclose(values[there], log[there], atol=4.2 * SIGMA)
    assert np.diff(knocked).std() > 1.1 * np.diff(log).std()
    assert np.nanstd(np.diff(values)) == pytest.approx(np.diff(log).std(), rel=0.01)


@pytest.mark.release  # every day the log itself is held to what it was, above
def test_knocks_leave_the_parameters_unharmed(tmp_path: Path, rng: np.random.Generator) -> None:
    log, knocked = knocked_log(200_000, 60, rng)
    clean = fit(log, RATE).estimates[1].parameters
    spoilt = fit(knocked, RATE).estimates[1].parameters
    assert spoilt["N"].value > 1.1 * MODEL.N
    _, values = kept(tmp_path, knocked)
    mended = fit(values, RATE).estimates[1].parameters
    for name in ("N", "B", "T_B", "K"):
        truth = getattr(MODEL, name)
        assert mended[name].lower <= truth * 1.02
        assert mended[name].upper >= truth * 0.98
        width = clean[name].upper - clean[name].lower
        assert mended[name].value == pytest.approx(clean[name].value, abs=0.25 * width)


def test_samples_that_are_missing_stay_missing(tmp_path: Path, rng: np.random.Generator) -> None:
    log = simulate(MODEL, RATE, 20_000, rng)
    log[5000] = 50 * SIGMA
    log[[4990, 10_000]] = np.nan
    names, values = kept(tmp_path, log)
    assert set(names) == {"knocks", "empty_cells"}
    assert np.isnan(values[[4990, 10_000, 5000]]).all()
