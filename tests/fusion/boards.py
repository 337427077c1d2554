"""Boards for tests, and logs of theirs with all that the sensors share."""

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.extensions.fusion.board import Board
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

SMOOTH = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
FLICKER = NoiseModel(N=2e-4, B=3e-5, K=2e-6)
ROUGH = NoiseModel(Q=1e-6, N=1e-4, B=5e-5, T_B=30.0, K=3e-6)


def logs(board: Board, samples: int, seed: int) -> list[NDArray[np.float64]]:
    """Return the logs of a board's sensors; ``samples`` at the fused rate."""
    streams = np.random.default_rng(seed).spawn(board.sensors + len(board.shared))
    found = [
        simulate(model, rate, samples * size, stream)
        for model, rate, size, stream in zip(
            board.models, board.rates, board.blocks, streams, strict=False
        )
    ]
    for one, stream in zip(board.shared, streams[board.sensors :], strict=True):
        common = simulate(one.model, board.rate, samples, stream)
        for log, size, sensitivity in zip(found, board.blocks, one.sensitivity, strict=True):
            log += sensitivity * np.repeat(common, size)
    return found
