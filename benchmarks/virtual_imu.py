"""Closed form of a virtual IMU against simulated boards of 2 to 8 sensors.

    python benchmarks/virtual_imu.py [--logs 20] [--hours 1]

A line a board and way of fusing: the predicted Allan deviation over the measured one (mean of the
logs) at some tau, and how often the 95 % limits of the measured curve hold the prediction.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import allan_variance, cluster_sizes
from imubench_pipeline.extensions.fusion.board import Board, Shared
from imubench_pipeline.extensions.fusion.prediction import fused_allan
from imubench_pipeline.extensions.fusion.weights import best_weights, fuse
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE = 100.0
SHOWN = (0.01, 0.1, 1.0, 10.0, 100.0)
SMOOTH = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
FLICKER = NoiseModel(N=2e-4, B=3e-5, K=2e-6)
ROUGH = NoiseModel(Q=1e-6, N=1e-4, B=5e-5, T_B=30.0, K=3e-6)
TEMPERATURE = NoiseModel(N=0.02, K=0.01)


def boards() -> Iterator[tuple[str, Board]]:
    """Yield boards with their names."""
    for number in (2, 4, 8):
        yield f"{number} alike", Board.alike(SMOOTH, number, RATE)
    for number in range(2, 9):
        models = [(SMOOTH, FLICKER, ROUGH)[i % 3] for i in range(number)]
        yield f"{number} mixed", Board(models, [RATE] * number)
    yield "3 rates", Board([SMOOTH, FLICKER, ROUGH], [RATE, 2 * RATE, 5 * RATE])
    gains = [1e-4, -2e-4, 3e-4, 1e-4]
    models = [SMOOTH, FLICKER, ROUGH, SMOOTH]
    yield "4, temperature", Board(models, [RATE] * 4, [Shared(TEMPERATURE, gains)])
    yield "8, a floor", Board.alike(FLICKER, 8, RATE, {"N": 0.05, "B": 0.2, "K": 0.5})


def logs_of(board: Board, samples: int, seed: int) -> list[NDArray[np.float64]]:
    """Return simulated logs of the sensors of a board."""
    streams = np.random.default_rng(seed).spawn(board.sensors + len(board.shared))
    own = zip(board.models, board.rates, board.blocks, streams, strict=False)
    found = [simulate(model, rate, samples * size, rng) for model, rate, size, rng in own]
    for one, rng in zip(board.shared, streams[board.sensors :], strict=True):
        common = simulate(one.model, board.rate, samples, rng)
        for log, size, gain in zip(found, board.blocks, one.sensitivity, strict=True):
            log += gain * np.repeat(common, size)
    return found


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--logs", type=int, default=20)
    parser.add_argument("--hours", type=float, default=1.0)
    given = parser.parse_args()
    samples = round(given.hours * 3600 * RATE)
    sizes = cluster_sizes(samples, per_decade=3, longest=1 / 9)
    shown = np.array([np.argmin(np.abs(np.log(sizes / RATE / tau))) for tau in SHOWN])
    tau = "  ".join(f"{size / RATE:8.3g}" for size in sizes[shown])
    print(f"{'predicted / measured at tau of, s':34s} {tau}   inside  common at the end")
    hits, points = 0.0, 0
    for name, board in boards():
        equal = np.full(board.sensors, 1.0 / board.sensors)
        ways = {"equal": equal, "10 s": best_weights(board, 10.0)}
        variances = {way: np.zeros(len(sizes)) for way in ways}
        inside = {way: np.zeros(len(sizes)) for way in ways}
        predicted = {way: fused_allan(board, how, sizes / RATE) for way, how in ways.items()}
        for seed in range(given.logs):
            logs = logs_of(board, samples, seed)
            for way, how in ways.items():
                curve = allan_variance(fuse(board, how, logs), RATE, cluster_sizes=sizes)
                lower, upper = curve.limits(0.95)
                expected = predicted[way].deviation
                inside[way] += (lower < expected) & (expected < upper)
                variances[way] += curve.variance
        for way in ways:
            ratio = predicted[way].deviation / np.sqrt(variances[way] / given.logs)
            text = "  ".join(f"{value:8.4f}" for value in ratio[shown])
            held = inside[way].mean() / given.logs
            hits, points = hits + inside[way].sum(), points + given.logs * len(sizes)
            end = predicted[way].common_share[-1]
            print(f"{name:18s} {way:15s} {text}   {held:6.1%}  {end:6.1%}")
    print(f"\nall: {hits / points:.1%} of {points} points of curves hold the prediction (95 %)")


if __name__ == "__main__":
    main()
