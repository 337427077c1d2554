"""Noise of a sensor in use, from a log with motors on or on the way.

The motion of the vehicle is slow, vibration is fast: below a cut-off the spectrum is taken as
motion and left out. Above it the mean of the two-sided density, without spectral lines, is N^2 of
white noise with the same variance of a sample. A line is listed with its frequency and rms: a
filter does not see it as white noise, and a mount or a notch filter removes it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import label, median_filter
from scipy.signal import detrend, welch

from imubench_pipeline.extensions.exports.imu import ExportError
from imubench_pipeline.typing import Array

MOTION_CUTOFF = 10.0
"""Default cut-off, Hz: a vehicle, a drone or a hand hardly moves faster."""

_SEGMENT = 4.0  # of the spectrum, s: four points a hertz
_MIN_SEGMENTS = 8  # of a log
_MIN_BAND = 16  # points of the spectrum above the cut-off
_MEDIAN_WIDTH = 33  # points of the running median, the level about a line
_MIN_LINE = 8.0  # density of a line over the median about it: 8 segments reach 4
_LINE_SPREAD = 2  # points on either side of a line that its window spreads it over
_MAX_LINES = 3  # that are listed


@dataclass(frozen=True)
class InUseNoise:
    """Noise of one channel in use, SI."""

    N: float  # root of the two-sided density of the broadband noise
    motion: float  # rms below the cut-off
    cutoff: float  # Hz
    lines: Sequence[tuple[float, float]]  # frequency, Hz, and rms of the strongest lines


def measure_in_use(samples: Array, rate: float, cutoff: float = MOTION_CUTOFF) -> InUseNoise:
    """Return the broadband noise and the lines of samples of shape (L,), SI, at a rate in Hz.

    Missing samples are NaN; parts of 4 s or more without a gap are used. All noise below
    ``cutoff``, Hz, counts as motion. Raises ExportError if the used parts have less than 32 s, or
    the rate is too low.
    """
    size = max(int(_SEGMENT * rate), 2 * _MIN_BAND)
    present = np.concatenate(([False], np.isfinite(samples), [False]))
    edges = np.flatnonzero(np.diff(present)).reshape(-1, 2)
    parts = [samples[a:b] for a, b in edges if b - a >= size]
    length = sum(len(part) for part in parts)
    if length < _MIN_SEGMENTS * size:
        raise ExportError(
            f"the log in use has {length / rate:.3g} s in parts of {size / rate:.3g} s or more "
            f"without gaps; expected {_MIN_SEGMENTS * size / rate:.3g} s: record a longer log"
        )
    spectra = [welch(detrend(part), rate, nperseg=size) for part in parts]
    frequency = spectra[0][0]
    density = np.average([own for _, own in spectra], axis=0, weights=[len(part) for part in parts])
    step = float(frequency[1])
    slow = (frequency > 0.0) & (frequency < cutoff)
    band = (frequency >= cutoff) & (frequency < 0.5 * rate)
    if band.sum() < _MIN_BAND:
        raise ExportError(
            f"at {rate:.4g} Hz, a log in use has too little bandwidth above the motion "
            f"({cutoff:.3g} Hz); expected a rate above {2.0 * (cutoff + _MIN_BAND * step):.3g} Hz, "
            "or a lower --motion"
        )
    fast, at = density[band], frequency[band]
    level = median_filter(fast, min(_MEDIAN_WIDTH, len(fast)), mode="nearest")
    peaks = np.flatnonzero(fast > _MIN_LINE * level)
    broad = np.ones(len(fast), bool)
    for peak in peaks:
        broad[max(peak - _LINE_SPREAD, 0) : peak + _LINE_SPREAD + 1] = False
    if not broad.any():
        raise ExportError("the log in use has only spectral lines; expected broadband noise")
    numbers, count = label(~broad)
    power = np.clip(fast - level, 0.0, None) * step
    lines = []
    for number in range(1, count + 1):
        own = np.flatnonzero(numbers == number)
        lines.append((float(at[own[np.argmax(fast[own])]]), math.sqrt(float(power[own].sum()))))
    lines.sort(key=lambda line: -line[1])
    return InUseNoise(
        N=math.sqrt(float(fast[broad].mean()) / 2.0),
        motion=math.sqrt(float(density[slow].sum()) * step),
        cutoff=cutoff,
        lines=lines[:_MAX_LINES],
    )
