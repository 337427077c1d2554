"""Specimens of one sensor on a board, fused to one log: the aim of Engers (2021, section 1).

The noise of each specimen is independent, and its N, B and K scatter. The weights minimise the
white noise (N^-2, `weights.best_weights`). T_B and the low-pass are the same for all specimens,
and for the fused log.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.extensions.fusion.board import Board
from imubench_pipeline.extensions.fusion.settings import Specimens
from imubench_pipeline.extensions.fusion.weights import best_weights, fuse
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.sensor import TEMPERATURE
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.simulate.imu import ImuModel, simulate_imu
from imubench_pipeline.simulate.models import Simulation, make_imu_model
from imubench_pipeline.simulate.profiles import Profile
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_quantity

_SPREAD_PARAMETERS = ("N", "B", "K")  # which differ between specimens


def make_specimens(recording: SimulatedRecording) -> list[ImuModel]:
    """Return the models of the specimens of a recording; one if none is declared."""
    whole = make_imu_model(recording.channels, recording)
    stated = recording.block(Specimens)
    if stated is None:
        return [whole]
    made = []
    for number in range(1, stated.number + 1):
        axes = {}
        for channel, model in whole.axes.items():
            names = (recording.sensor, recording.recording, channel, f"specimen {number}")
            rng = channel_rng(recording.seed, *names)
            factors = np.exp(stated.spread * rng.standard_normal(len(_SPREAD_PARAMETERS)))
            axes[channel] = replace(model, noise=_scale_model(model.noise, factors))
        made.append(replace(whole, axes=axes))
    return made


def make_board(models: Sequence[NoiseModel], rate: float) -> tuple[Board, Array]:
    """Return the board of noise models at one rate, Hz, and the weights that fuse them."""
    board = Board(list(models), [rate] * len(models))
    return board, best_weights(board)


def fuse_models(models: Sequence[NoiseModel], weights: Array) -> NoiseModel:
    """Return the noise of fused specimens; a parameter p becomes the root of sum(w^2 p^2)."""
    ratios = [
        np.linalg.norm(weights * [getattr(model, name) for model in models])
        / (getattr(models[0], name) or 1.0)
        for name in _SPREAD_PARAMETERS
    ]
    return _scale_model(models[0], np.array(ratios))


def _scale_model(model: NoiseModel, factors: Array) -> NoiseModel:
    """Return a model with N, B and K multiplied by factors."""
    n, b, k = map(float, factors)
    return replace(model, N=n * model.N, B=b * model.B, K=k * model.K)


def simulate_fused_blocks(
    recording: SimulatedRecording, motion: Mapping[str, Profile], temperature: Profile | None
) -> Iterator[dict[str, Array]]:
    """Yield the blocks of a log of fused specimens, SI, and of their temperature, if any, °C."""
    rate = parse_quantity(recording.rate, "frequency")
    models = make_specimens(recording)
    fusing = {
        channel: make_board([model.axes[channel].noise for model in models], rate)
        for channel in models[0].axes
    }
    logs = [
        simulate_imu(
            model,
            rate,
            recording.samples,
            recording.seed,
            (recording.sensor, recording.recording, f"specimen {number}"),
            motion=motion,
            temperature=temperature,
        )
        for number, model in enumerate(models, start=1)
    ]
    for parts in zip(*logs, strict=True):
        blocks = {
            channel: fuse(board, weights, [part[channel] for part in parts])
            for channel, (board, weights) in fusing.items()
        }
        if TEMPERATURE in parts[0]:
            blocks[TEMPERATURE] = parts[0][TEMPERATURE]
        yield blocks


def compute_fusion_factors(recording: SimulatedRecording, channel: str) -> dict[str, float]:
    """Return the ratio of the noise of fused specimens to the noise of one, by parameter."""
    models = [model.axes[channel].noise for model in make_specimens(recording)]
    of_kind = make_imu_model(recording.channels, recording).axes[channel].noise
    _, weights = make_board(models, parse_quantity(recording.rate, "frequency"))
    fused = fuse_models(models, weights)
    return {
        name: getattr(fused, name) / getattr(of_kind, name)
        for name in _SPREAD_PARAMETERS
        if getattr(of_kind, name)
    }


SPECIMENS = Simulation(simulate_fused_blocks, compute_fusion_factors)
