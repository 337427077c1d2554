"""Simulated Earth-rate experiments: the block means of many runs, or a whole log.

The runs of Silva et al. (section 6) are here as designs: 120, 12, 25 and 60 minutes at 32 Hz,
turned every 30 s, with the printed parameters. The paper prints neither the latitude nor the time
of a turn; both are assumed.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Blocks, Experiment
from imubench_pipeline.extensions.calibration.states import discretise_blocks
from imubench_pipeline.extensions.earth_rate.settings import SimulatedTurns
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.profiles import Profile, make_sampled
from imubench_pipeline.simulate.simulation import simulate
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_quantity

PAPER_MODEL = NoiseModel(
    N=math.radians(0.0122), B=math.radians(0.0027), T_B=238.1, K=math.radians(6.8314e-5)
)
"""SiRRS01-03 by Silva et al., section 5.1, SI."""

PAPER_RATE = 32.0  # sampling rate of the runs, Hz (Silva et al., section 6)
PAPER_PERIOD = 30.0  # time between turns, s (Silva et al., section 6)
# Length of the runs, min (Silva et al., section 6); the last is a part of run 4
PAPER_MINUTES = {"1": 120.0, "2": 12.0, "3": 25.0, "4": 60.0, "4, last 13 min": 13.0}
# Latitude of Londrina, where the authors work, rad: the paper prints none
ASSUMED_LATITUDE = math.radians(-23.3)
ASSUMED_TURNING = 2.0  # time of a turn within each 30 s, s: the paper prints none


def design_run(
    duration: float, period: float, turning: float, rate: float, latitude: float
) -> Experiment:
    """Return the design of a run as its source describes it.

    The duration, the period from turn to turn and the time of a turn are in s, the rate in Hz, the
    latitude in rad.
    """
    return Experiment.regular(
        dwell=period - turning,
        turning=turning,
        dwells=round(duration / period),
        rate=rate,
        latitude=latitude,
    )


def design_paper_run(minutes: float) -> Experiment:
    """Return the design of a run of Silva et al.: north first, a turn every 30 s."""
    return design_run(60.0 * minutes, PAPER_PERIOD, ASSUMED_TURNING, PAPER_RATE, ASSUMED_LATITUDE)


@dataclass(frozen=True)
class Runs:
    """Simulated block means of runs, with the true errors."""

    means: Array  # shape (runs, b); block means, rad/s
    drift: Array  # shape (runs, b); mean slow error over each block, bias included, rad/s
    states: Array  # shape (runs, b, m); states after each block (`states.BlockStates`)


def simulate_runs(
    model: NoiseModel,
    blocks: Blocks,
    *,
    earth_rate: float,
    turn_on_bias: float,
    runs: int,
    rng: np.random.Generator,
) -> Runs:
    """Draw block means of runs; ``earth_rate``, and sigma ``turn_on_bias`` of biases, in rad/s."""
    block_model = discretise_blocks(model, blocks, turn_on_bias)
    m = len(block_model.initial)
    state = rng.standard_normal((runs, m)) @ block_model.initial.T
    states, drift = np.empty((runs, len(blocks), m)), np.empty((runs, len(blocks)))
    for k, which in enumerate(block_model.which):
        step = block_model.steps[which]
        after = state @ step.transition.T + rng.standard_normal((runs, m + 1)) @ step.factor.T
        state, drift[:, k] = after[:, :m], after[:, m]
        states[:, k] = state
    white = block_model.white * rng.standard_normal(drift.shape)
    return Runs(earth_rate * blocks.seen + drift + white, drift, states)


def simulate_log(
    model: SensorModel,
    experiment: Experiment,
    *,
    earth_rate: float,
    transient: ArrayLike,
    rng: np.random.Generator,
) -> Array:
    """Return a whole log of an experiment, including turns, rad/s, shape (samples,).

    During a turn, the axis senses the Earth's rate times the cosine of the angle, which changes at
    a sinusoidal speed. The turn is about a perpendicular axis: only misalignment makes it visible,
    as a pulse peak sin^2(pi t / turning). The bias of the model is the fixed bias of this run. The
    other parameters are as in `compute_true_rate`.
    """
    true = compute_true_rate(experiment, earth_rate, transient)
    return simulate(model, experiment.rate, len(true), rng, true=lambda a, b: true[a:b])


def compute_true_rate(experiment: Experiment, earth_rate: float, transient: ArrayLike) -> Array:
    """Return error-free readings, rad/s, shape (samples,); ``transient``: peak in each turn."""
    dwells = experiment.dwells
    peaks = np.broadcast_to(np.asarray(transient, dtype=np.float64), len(dwells) - 1)
    seen = earth_rate * math.cos(experiment.latitude)
    true = np.full(dwells[-1].stop, dwells[0].sense * seen)
    for i, dwell in enumerate(dwells):
        true[dwell.start : dwell.stop] = dwell.sense * seen
        if i == 0:
            continue
        before = dwells[i - 1]
        part = (np.arange(before.stop, dwell.start) - before.stop + 0.5) / max(
            dwell.start - before.stop, 1
        )
        if dwell.sense == before.sense:
            true[before.stop : dwell.start] = before.sense * seen
        else:
            angle = 0.5 * math.pi * (1.0 - np.cos(math.pi * part))
            true[before.stop : dwell.start] = before.sense * seen * np.cos(angle)
        true[before.stop : dwell.start] += peaks[i - 1] * np.sin(math.pi * part) ** 2
    return true


def simulate_turned_gyro(recording: SimulatedRecording, rate: float) -> dict[str, Profile]:
    """Return the ideal readings of a gyro that is turned by a schedule, with random transients."""
    turns, samples = recording.block(SimulatedTurns), recording.samples
    assert turns is not None
    dwell, turning = turns.seconds("dwell"), turns.seconds("turning")
    design = Experiment.regular(
        dwell=dwell - turning,
        turning=turning,
        dwells=max(round((samples / rate - turns.seconds("start")) / dwell), 1),
        rate=rate,
        latitude=turns.latitude_si,
        first=turns.first_sense or 1,
    )
    rng = channel_rng(recording.seed, recording.sensor, recording.recording, "turns")
    number = len(design.dwells) - 1
    peaks = rng.choice([-1.0, 1.0], number) * rng.uniform(0.7, 1.3, number)
    peaks = peaks * parse_quantity(turns.transient, "angular_rate")
    true = compute_true_rate(design, EARTH_RATE, peaks)
    before = np.full(round(turns.seconds("start") * rate), true[0])
    sensed = np.concatenate([before, true, np.full(samples, true[-1])])[:samples]
    return {str(recording.moved_gyro): make_sampled(sensed, rate)}
