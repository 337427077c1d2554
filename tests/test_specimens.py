"""Specimens that are fused to one log, against the variance of means of independent samples."""

import math
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.extensions.fusion.specimens import (
    fuse_models,
    make_board,
    make_specimens,
    simulate_fused_blocks,
)
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.steps.sensor_tables import list_true_parameters

DEGREE = math.pi / 180.0
AXIS = {"N": "0.3 deg/sqrt(h)", "B": "10 deg/h", "T_B": "5 s", "K": "1 deg/h/sqrt(h)"}


def declared(number: int = 9, spread: float = 0.0, **axis: Any) -> SimulatedRecording:
    return SimulatedRecording.model_validate(
        {
            "sensor": "s", "recording": "sim_fused", "duration": "2000 s", "rate": "20 Hz",
            "seed": 3, "source": "here", "specimens": {"number": number, "spread": spread},
            "channels": {"gyro_x": {**AXIS, **axis}},
        }
    )  # fmt: skip


def test_equal_units_have_equal_weights_and_noise_reduced_by_sqrt_n() -> None:
    models = [model.axes["gyro_x"].noise for model in make_specimens(declared())]
    _, weights = make_board(models, 20.0)
    assert weights == pytest.approx(np.full(9, 1 / 9))
    fused = fuse_models(models, weights)
    for name in ("N", "B", "K"):
        assert getattr(fused, name) == pytest.approx(getattr(models[0], name) / 3.0)
    assert fused.T_B == models[0].T_B


def test_specimens_that_differ_are_weighed_by_their_white_noise() -> None:
    models = [model.axes["gyro_x"].noise for model in make_specimens(declared(spread=0.3))]
    noise = np.array([model.N for model in models])
    assert 0.1 < np.std(np.log(noise)) < 0.6
    _, weights = make_board(models, 20.0)
    assert weights == pytest.approx(noise**-2 / np.sum(noise**-2))
    assert fuse_models(models, weights).N == pytest.approx(np.sum(noise**-2) ** -0.5)


def test_the_fused_log_has_the_noise_that_is_predicted() -> None:
    recording = declared(spread=0.3)
    log = np.concatenate([block["gyro_x"] for block in simulate_fused_blocks(recording, {}, None)])
    assert len(log) == 40_000
    truth = {
        row["parameter"]: row["value"]
        for row in list_true_parameters(f"[{recording.model_dump_json()}]")
        if row["component"] == 1
    }
    # Means over 0.5 s: white noise alone, nearly, and the process at 9.45 s, its peak with N and K.
    tau = 189 / 20.0
    S_B = 2 * truth["B"] ** 2 * math.log(2) / (math.pi * 0.4365**2 * 5.0)
    e = math.exp(-tau / 5.0)
    of_process = S_B * 25.0 / tau * (1 - 5.0 / (2 * tau) * (3 - 4 * e + e**2))
    expected = truth["N"] ** 2 / tau + of_process + truth["K"] ** 2 * tau / 3
    angle = np.concatenate([[0.0], np.cumsum(log - log[0])]) / 20.0
    twice = angle[378:] - 2 * angle[189:-189] + angle[:-378]
    assert np.mean(twice**2) / (2 * tau**2) == pytest.approx(expected, rel=0.25)
    first = np.diff(log)
    assert np.var(first) == pytest.approx(2 * truth["N"] ** 2 * 20.0, rel=0.03)


def test_a_term_that_fusion_does_not_know_is_refused() -> None:
    with pytest.raises(ValueError, match="gyro_x has R in it"):
        declared(R="1 deg/h/h")
    with pytest.raises(ValueError, match="no N in it"):
        declared(N=None)
