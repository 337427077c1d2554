"""True motion of a robot, a car, a drone and a vehicle at rest, and sensor readings of it.

Speed, course and climb are smoothed sequences of stretches. A wheeled vehicle rolls and pitches
with the ground, a drone banks in turns. The inverse mechanisation gives the ideal samples.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from imubench_pipeline.earth import EARTH_RATE, STANDARD_GRAVITY
from imubench_pipeline.extensions.aided.strapdown import invert_mechanisation
from imubench_pipeline.extensions.calibration.alignment.attitude import euler_angles, matrix
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.simulation import Signal, simulate
from imubench_pipeline.typing import Array

DEFAULT_LATITUDE = math.radians(45.0)


@dataclass(frozen=True)
class Gnss:
    """Standard deviations of the white errors of a GNSS receiver."""

    position: float  # of one axis, m
    velocity: float  # of one axis, m/s
    heading: float = math.inf  # rad; infinite for one antenna

    @property
    def spread(self) -> Array:
        """Standard deviations of position, velocity and heading, shape (7,)."""
        return np.array([*[self.position] * 3, *[self.velocity] * 3, self.heading])


@dataclass(frozen=True)
class Trajectory:
    """True motion, and the samples of ideal sensors."""

    position: Array  # (L + 1, 3); north, east, down; m
    velocity: Array  # (L + 1, 3); m/s
    attitude: Array  # (L + 1, 3, 3); from sensor axes (ahead, right, down) to north, east, down
    rate: Array  # (L, 3); rad/s: means over the intervals between
    force: Array  # (L, 3); m/s^2, the same
    sampling: float  # Hz
    earth: Array  # (3,); the Earth's rate, rad/s
    gnss: Gnss


_RTK_RECEIVER = Gnss(0.02, 0.03)
_STANDALONE_RECEIVER = Gnss(1.5, 0.1)
_TWO_ANTENNA_RECEIVER = Gnss(1.5, 0.1, math.radians(0.5))
"""Receiver for a vehicle at rest, where the heading is not observable otherwise. Without it, a
filter that is linearised about its estimate mistakes the drift of its heading for a turn, which
would separate biases from tilt: it becomes overconfident."""


@dataclass(frozen=True)
class _Motion:
    """Speed, course, climb, roll and pitch at each sample."""

    speed: Array
    course: Array
    climb: Array
    roll: Array
    pitch: Array


def _build_sequence(
    time: Array, stretches: Sequence[tuple[float, float]], window: float, sampling: float
) -> Array:
    """Return a repeated sequence of values, each for its time, s, smoothed by a window, s."""
    ends = np.cumsum([length for length, _ in stretches])
    values = np.array([value for _, value in stretches])
    held = values[np.minimum(np.searchsorted(ends, time % ends[-1], "right"), len(values) - 1)]
    shape = np.hanning(max(round(window * sampling), 1) + 2)[1:-1]
    padded = np.concatenate([np.full(len(shape), held[0]), held, np.full(len(shape), held[-1])])
    return np.convolve(padded, shape / shape.sum(), "same")[len(shape) : -len(shape)]


def _simulate_ground(time: Array, size: float, moving: Array) -> tuple[Array, Array]:
    """Return roll and pitch on rough ground, rad, scaled by the motion of the vehicle."""
    roll = np.sin(2.0 * math.pi * 0.37 * time) + 0.6 * np.sin(2.0 * math.pi * 0.83 * time + 1.0)
    pitch = np.sin(2.0 * math.pi * 0.29 * time + 2.0) + 0.6 * np.sin(2.0 * math.pi * 0.71 * time)
    return size * moving * roll, size * moving * pitch


def _simulate_field(time: Array, sampling: float) -> _Motion:
    """Return a field: 1.5 m/s along rows of 45 m, half turns of 2 m radius, left and right."""
    turn = math.pi / 6.0
    turns = [(30.0, 0.0), (6.0, turn), (30.0, 0.0), (6.0, -turn)]
    rate = _build_sequence(time, turns, 2.0, sampling)
    speed = _build_sequence(time, [(29.0, 1.5), (8.0, 1.0), (28.0, 1.5), (7.0, 1.0)], 2.0, sampling)
    rolled, pitched = _simulate_ground(time, math.radians(1.5), speed / 1.5)
    return _Motion(speed, np.cumsum(rate) / sampling, np.zeros_like(time), rolled, pitched)


def _simulate_car(time: Array, sampling: float) -> _Motion:
    """Return a drive in streets: up to 14 m/s, turns by 90 degrees, stops at lights."""
    quarter = math.pi / 2.0 / 5.0
    speeds = [(18.0, 12.0), (7.0, 5.0), (22.0, 14.0), (8.0, 0.0), (20.0, 13.0), (7.0, 5.0)]
    speed = _build_sequence(time, [*speeds, (10.0, 9.0)], 4.0, sampling)
    turns = [(19.0, 0.0), (5.0, quarter), (45.0, 0.0), (6.5, 0.0), (5.0, -quarter), (11.5, 0.0)]
    rate = _build_sequence(time, turns, 2.0, sampling) * np.minimum(speed / 4.0, 1.0)
    rolled, pitched = _simulate_ground(time, math.radians(0.4), np.minimum(speed / 5.0, 1.0))
    return _Motion(speed, np.cumsum(rate) / sampling, np.zeros_like(time), rolled, pitched)


def _simulate_drone(time: Array, sampling: float) -> _Motion:
    """Return figures of eight at 8 m/s with climbs and descents, banked in turns."""
    speed = _build_sequence(time, [(40.0, 8.0), (10.0, 4.0)], 4.0, sampling)
    rate = _build_sequence(time, [(12.0, 0.5), (5.0, 0.0), (12.0, -0.5), (5.0, 0.0)], 3.0, sampling)
    climbs = [(20.0, 0.0), (8.0, 1.5), (20.0, 0.0), (8.0, -1.5)]
    climb = _build_sequence(time, climbs, 3.0, sampling)
    roll = np.arctan(speed * rate / STANDARD_GRAVITY)
    pitch = -np.arctan(np.gradient(speed, 1.0 / sampling) / STANDARD_GRAVITY)
    return _Motion(speed, np.cumsum(rate) / sampling, climb, roll, pitch)


_MOTIONS: Mapping[str, tuple[Callable[[Array, float], _Motion], Gnss]] = {
    "field": (_simulate_field, _RTK_RECEIVER),
    "car": (_simulate_car, _STANDALONE_RECEIVER),
    "drone": (_simulate_drone, _STANDALONE_RECEIVER),
    "rest": (lambda time, _: _Motion(*np.zeros((5, len(time)))), _TWO_ANTENNA_RECEIVER),
}

TRAJECTORY_NAMES = tuple(_MOTIONS)


def simulate_trajectory(name: str, duration: float, sampling: float) -> Trajectory:
    """Return a trajectory of `TRAJECTORY_NAMES`; ``duration`` in s, ``sampling`` in Hz."""
    moves, gnss = _MOTIONS[name]
    motion = moves(np.arange(round(duration * sampling) + 1) / sampling, sampling)
    velocity = np.column_stack(
        [motion.speed * np.cos(motion.course), motion.speed * np.sin(motion.course), -motion.climb]
    )
    attitude = matrix(motion.roll, motion.pitch, motion.course)
    earth = EARTH_RATE * np.array([math.cos(DEFAULT_LATITUDE), 0.0, -math.sin(DEFAULT_LATITUDE)])
    position, rate, force = invert_mechanisation(
        np.zeros(3), velocity, attitude, 1.0 / sampling, earth
    )
    return Trajectory(position, velocity, attitude, rate, force, sampling, earth, gnss)


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
        """Return the standard deviation of the relative scale-factor error of a channel."""
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

    ``seed`` and ``names`` set the random numbers. A sample of the trajectory is the mean of
    ``block`` samples of the sensor; ``temperature`` is in °C. ``added``, shapes (L,), are errors of
    channels that replace simulated noise.
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
            motion = partial(_slice_course, np.repeat(true[i], block))
            log = simulate(model, rate, L * block, rng, true=motion, temperature=temperature)
            measured[i] = _average_blocks(log, block)
    rng = channel_rng(seed, *names, "gnss")
    heading = euler_angles(trajectory.attitude[at])[:, 2:]
    exact = np.concatenate([trajectory.position[at], trajectory.velocity[at], heading], axis=1)
    given = np.isfinite(spread := trajectory.gnss.spread)
    fixes = exact + np.where(given, spread, 0.0) * rng.standard_normal(exact.shape)
    start = channel_rng(seed, *names, "start").standard_normal(9)
    return Signals(measured[:3].T.copy(), measured[3:].T.copy(), fixes, bias.T.copy(), start)


def _slice_course(course: Array, start: int, stop: int) -> Array:
    return course[start:stop]


def _average_blocks(log: Array, block: int) -> Array:
    return log if block == 1 else np.asarray(log.reshape(-1, block).mean(axis=1))
