"""White noise before a sensor's low-pass and rounding, and as a log shows it.

Sampling folds into the log what lies above Nyquist, and a register adds LSB^2 / 12 a sample.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate.model import SensorModel

_LOW = 1e-4
"""rad a sample, far below every cut-off."""


def in_the_log(model: SensorModel, rate: float) -> float:
    """Return N as the low frequencies of a log show it, SI.

    Parameters
    ----------
    model : SensorModel
        Its noise is that before the low-pass.
    rate : float
        Of the log, Hz.
    """
    return math.sqrt(model.noise.N**2 * folding(model, rate) + _rounding(model, rate))


def before_the_filter(model: SensorModel, noise: NoiseModel, rate: float) -> NoiseModel:
    """Return noise with N as it is before filter and rounding, from N as a log shows it.

    Parameters
    ----------
    model : SensorModel
        Of which filter and resolution are taken.
    noise : NoiseModel
        As estimated from a log.
    rate : float
        Of the log, Hz.
    """
    left = max(noise.N**2 - _rounding(model, rate), 0.0)
    return replace(noise, N=math.sqrt(left / folding(model, rate)))


def folding(model: SensorModel, rate: float) -> float:
    """Return how many times N^2 the density of the samples is at low frequencies.

    Parameters
    ----------
    model : SensorModel
    rate : float
        Hz.
    """
    unit = replace(model, noise=NoiseModel(N=1.0), resolution=0.0)
    return float(unit.sampled_spectrum(np.array([_LOW]), rate)[0]) / rate


def _rounding(model: SensorModel, rate: float) -> float:
    return model.resolution**2 / (12.0 * rate)
