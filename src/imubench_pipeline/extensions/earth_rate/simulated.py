"""What an ideal gyro senses that is turned between north and south."""

from __future__ import annotations

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.earth_rate.settings import SimulatedTurns
from imubench_pipeline.extensions.earth_rate.simulation import true_rate
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.simulate.profiles import SampledProfile
from imubench_pipeline.units import quantity_to_si


def turned(recording: SimulatedRecording, rate: float) -> dict[str, SampledProfile]:
    """Return what the gyro senses that is turned by the clock; each turn is sensed otherwise."""
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
    peaks = peaks * quantity_to_si(turns.transient, "angular_rate")
    true = true_rate(design, EARTH_RATE, peaks)
    before = np.full(round(turns.seconds("start") * rate), true[0])
    after = np.full(samples, true[-1])
    sensed = np.concatenate([before, true, after])[:samples]
    return {str(recording.moved_gyro): SampledProfile(sensed, rate)}
