"""Simulate sensor readings of a run, with the full model of each axis, and GNSS fixes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from imubench_pipeline.extensions.aided.trajectories import Trajectory, compute_headings
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.simulation import Signal, simulate
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Spreads:
    """Standard deviations of run-to-run errors of gyros and accelerometers."""

    gyro_bias: float
    accel_bias: float
    gyro_scale: float = 0.0
    accel_scale: float = 0.0

    def bias(self, channel: str) -> float:
        """Return the standard deviation of the bias of a channel, rad/s or m/s^2."""
        return self.gyro_bias if channel.startswith("gyro") else self.accel_bias

    def scale(self, channel: str) -> float:
        """Return the standard deviation of its relative scale-factor error."""
        return self.gyro_scale if channel.startswith("gyro") else self.accel_scale


@dataclass(frozen=True)
class Signals:
    """Input of a filter in a run, and the known truth."""

    rate: Array  # (L, 3); rad/s
    force: Array  # (L, 3); m/s^2
    fixes: Array  # (E, 7); position, velocity and heading of GNSS, m, m/s and rad
    bias: Array  # (E, 6); error of each axis at the fixes, without white noise; NaN if unknown
    start: Array  # (9,); initial errors in standard deviations


def simulate_signals(
    trajectory: Trajectory,
    axes: Mapping[str, SensorModel],
    spreads: Spreads,
    every: int,
    seed: int,
    names: tuple[str, ...],
    *,
    block: int = 1,
    temperature: Signal | None = None,
    added: Mapping[str, Array] | None = None,
) -> Signals:
    """Simulate a run on all six axes, with ``every`` samples between two fixes.

    ``names``, such as sensor, trajectory and number of the run, set all random numbers with the
    seed. A sample of the trajectory is the mean of ``block`` samples of the sensor. ``temperature``
    is in °C, as in `simulate.simulation.simulate_blocks`. ``added``, shapes (L,), are errors of
    channels that replace simulated noise: pieces of a log at rest.
    """
    L, rate = len(trajectory.rate), trajectory.sampling * block
    at = np.arange(every, L + 1, every)
    measured, bias = np.empty((6, L)), np.full((6, len(at)), np.nan)
    true = np.concatenate([trajectory.rate.T, trajectory.force.T])
    for i, channel in enumerate(CHANNELS):
        rng = channel_rng(seed, *names, channel)
        turned_on = spreads.bias(channel) * rng.standard_normal()
        scale = spreads.scale(channel) * rng.standard_normal()
        model = replace(axes[channel], bias=axes[channel].bias + turned_on, scale_error=scale)
        behind = (model.low_pass, model.drift, model.full_scale)
        if added is not None and channel in added:
            measured[i] = (1.0 + scale) * true[i] + turned_on + added[channel]
        elif model.resolution == 0.0 and behind == (None, None, None):
            # The log is the sum of motion and noise: the slow errors are known.
            slow_model = replace(model, noise=replace(model.noise, N=0.0), scale_error=0.0)
            slow = simulate(slow_model, rate, L * block, rng)
            white = model.noise.N * np.sqrt(trajectory.sampling) * rng.standard_normal(L)
            measured[i] = (1.0 + scale) * true[i] + _average_blocks(slow, block) + white
            bias[i] = slow[at * block - 1]
        else:
            course = np.repeat(true[i], block)
            motion = partial(_slice_course, course)
            log = simulate(model, rate, L * block, rng, true=motion, temperature=temperature)
            measured[i] = _average_blocks(log, block)
    rng = channel_rng(seed, *names, "gnss")
    heading = compute_headings(trajectory.attitude[at])[:, None]
    exact = np.concatenate([trajectory.position[at], trajectory.velocity[at], heading], axis=1)
    given = np.isfinite(spread := trajectory.gnss.spread)
    fixes = exact + np.where(given, spread, 0.0) * rng.standard_normal(exact.shape)
    start = channel_rng(seed, *names, "start").standard_normal(9)
    return Signals(measured[:3].T.copy(), measured[3:].T.copy(), fixes, bias.T.copy(), start)


def _slice_course(course: Array, start: int, stop: int) -> Array:
    return course[start:stop]


def _average_blocks(log: Array, block: int) -> Array:
    return log if block == 1 else np.asarray(log.reshape(-1, block).mean(axis=1))
