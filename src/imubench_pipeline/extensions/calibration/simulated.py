"""Readings of ideal gyros and accelerometers on a rate table, in positions, and at rest."""

import math

import numpy as np

from imubench_pipeline.extensions.calibration.alignment.attitude import matrix
from imubench_pipeline.extensions.calibration.alignment.triad import Site
from imubench_pipeline.extensions.calibration.settings import (
    SimulatedPositions,
    SimulatedRest,
    SimulatedTable,
)
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.simulate.profiles import Profile, make_constant, make_sampled
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_quantity


def simulate_rest(recording: SimulatedRecording, rate: float) -> dict[str, Profile]:
    """Return the part of the Earth's rate that a gyro at rest senses."""
    rest = recording.block(SimulatedRest)
    assert rest is not None
    return {str(recording.moved_gyro): make_constant(rest.true.rate)}


def simulate_rate_table(recording: SimulatedRecording, rate: float) -> dict[str, Profile]:
    """Return the readings of a gyro on a table that ramps linearly from rate to rate."""
    table = recording.block(SimulatedTable)
    assert table is not None
    times = [time for step in table.steps for time in step.seconds]
    rates = np.repeat([parse_quantity(step.rate, "angular_rate") for step in table.steps], 2)
    true = np.interp(np.arange(recording.samples) / rate, times, rates)
    earth = 0.0 if table.axis is None else table.axis.pointing.rate
    return {str(recording.moved_gyro): make_sampled(table.scale_factor * (true + earth), rate)}


def simulate_positions(recording: SimulatedRecording, rate: float) -> dict[str, Profile]:
    """Return the readings of a triad that turns at a steady rate between its positions."""
    positions, samples = recording.block(SimulatedPositions), recording.samples
    assert positions is not None
    dwell, turning = positions.seconds("dwell"), positions.seconds("turning")
    number = math.ceil(samples / rate / dwell) + 1
    # Where it stands, and where it begins to turn; without a turn it is moved between two samples.
    times = np.repeat(np.arange(number) * dwell, 2)
    times[1::2] += dwell - max(turning, 0.5 / rate)
    angles = np.repeat([positions.angle(k) for k in range(number)], 2)
    at = np.arange(samples) / rate
    angle = np.interp(at, times, angles)
    turned = np.diff(np.interp(at[0] + (np.arange(samples + 1) - 0.5) / rate, times, angles)) * rate
    attitude = matrix(**positions.true_angles)
    true = compute_readings(Site(latitude=positions.latitude_si), attitude, angle, turned)
    return {name: make_sampled(true[:, k], rate) for k, name in enumerate(CHANNELS)}


def compute_readings(site: Site, attitude: Array, angle: Array, turning: Array) -> Array:
    """Return rate and specific force in the body frame, rad/s and m/s^2, shape (n, 6).

    ``attitude``, shape (3, 3), is the attitude in the first position. ``angle``, rad, is the angle
    turned about z since then, and ``turning``, rad/s, its rate, shape (n,) each. Turns cause no
    acceleration of the accelerometers.
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    columns = []
    for vector in (site.earth_rate, site.specific_force):
        x, y, z = attitude.T @ vector
        columns += [cosine * x + sine * y, cosine * y - sine * x, np.full(len(angle), z)]
    columns[2] = columns[2] + turning
    return np.stack(columns, axis=1)
