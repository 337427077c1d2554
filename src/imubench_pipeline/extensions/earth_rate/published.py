"""Compare published Earth-rate estimates with the scatter that the published noise allows.

A run is modelled as its source describes it: the schedule of turns, and the noise of the printed
figures. An estimate from pairs of dwells then scatters about the true rate with the standard
deviation of `extensions.earth_rate.pairs`. A published estimate many standard deviations away has
other errors: warm-up of the sensor, a misaligned axis, turns within the mean, or a wrong sense.

A printed estimate v of the rate w is the mean over pairs (Silva et al., eq. 14) of a run. If noise
does not explain v - w, another cause must, whose size follows from the printed figures. If a run is
printed as a whole and by its last part, its first part follows, and a constant cause must explain
both. With P the time between turns, D the data in a dwell and L the latitude:

- a bias that drifts by r moves a pair that begins in the north by -r P / (2 cos L);
- an angle a of turning that remains in each dwell, with the sign of the turn, by a / (D cos L);
- turns miscounted so that the part f of the time has the wrong sense: v = (1 - 2 f) w, so that all
  estimates lie between -w and w;
- an axis that deviates from the meridian by A: v = w cos A;
- a wrong clock, so that the dwells are cut s dwells too late: a dwell then contains the part s of
  its neighbour, v = (1 - 2 s) w up to one dwell, and increasing again up to two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.earth_rate.bound import choose_block_length
from imubench_pipeline.extensions.earth_rate.courses import compute_white_sigma
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

Row = dict[str, Any]

_TESTED_CLOCK_ERRORS = 20_001  # number of tested clock errors
_Z_95 = 1.96  # half width, in standard deviations, of the interval with 95 % of the estimates


@dataclass(frozen=True)
class RunDesign:
    """A run as its source describes it."""

    dwell: float  # from turn to turn, s
    turning: float  # turning time within it, s
    rate: float  # sampling rate, Hz
    latitude: float  # rad

    def experiment(self, duration: float) -> Experiment:
        """Return the design of a run of this duration, s."""
        return Experiment.regular(
            dwell=self.dwell - self.turning,
            turning=self.turning,
            dwells=round(duration / self.dwell),
            rate=self.rate,
            latitude=self.latitude,
        )


def compute_allowed_sigmas(run: RunDesign, duration: float, model: NoiseModel) -> Row:
    """Return the standard deviations by noise of the estimates of a run, rad/s; duration in s.

    ``white``: by white noise alone; ``sigma``: of the mean over pairs; ``sigma_filter``: of the
    filter.
    """
    design = run.experiment(duration)
    blocks = design.blocks(choose_block_length(design, model))
    zero_means = np.zeros((1, len(blocks)))
    return {
        "white": compute_white_sigma(model, blocks),
        "sigma": float(by_pairs(zero_means, blocks, model).sigma[-1]),
        "sigma_filter": float(RateFilter(blocks, model).rate_sigma[-1]),
    }


def make_published_row(value: float, run: RunDesign, duration: float, model: NoiseModel) -> Row:
    """Return the columns of ``earth_rate_published`` for a published estimate.

    The value is in rad/s; the duration of the run, or of a part of it, in s; the noise model as
    published.
    """
    noise = compute_allowed_sigmas(run, duration, model)
    off = (value - EARTH_RATE) / noise["sigma"]
    verdict = "within the noise" if abs(off) <= _Z_95 else "beyond the noise"
    return noise | {
        "duration": duration,
        "published": value,
        "truth": EARTH_RATE,
        "off_sigma": off,
        "verdict": verdict,
    }


@dataclass(frozen=True)
class PrintedRun:
    """A run as its source prints it, or a part of it."""

    duration: float  # s
    value: float  # printed estimate, rad/s
    sigma: float  # standard deviation of the mean over pairs by noise, rad/s

    def without(self, last: PrintedRun) -> PrintedRun:
        """Return a run without its last part, whose pairs are disjoint from the others."""
        rest = self.duration - last.duration
        value = (self.duration * self.value - last.duration * last.value) / rest
        # Disjoint pairs: the variances of both parts add up, weighted by their lengths squared.
        squares = (self.duration * self.sigma) ** 2 - (last.duration * last.sigma) ** 2
        return PrintedRun(rest, value, math.sqrt(max(squares, 0.0)) / rest)


def compute_needed_drift(off: float, period: float, latitude: float) -> float:
    """Return the drift of the bias that causes the error of pairs, rad/s^2, north first.

    ``off``: error, rad/s; ``period``: from turn to turn, s; the latitude in rad.
    """
    return -2.0 * math.cos(latitude) * off / period


def compute_needed_angle(off: float, dwell: float, latitude: float) -> float:
    """Return the angle of turning, rad, that must remain in each dwell of this length, s."""
    return off * dwell * math.cos(latitude)


def compute_wrong_share(value: float, true: float) -> float | None:
    """Return the part of a run with the wrong sense; None if no part explains the value."""
    part = 0.5 * (1.0 - value / true)
    return part if 0.0 <= part <= 1.0 else None


def compute_needed_heading(value: float, true: float) -> float | None:
    """Return the angle between axis and meridian, rad; None if no angle explains the value."""
    return math.acos(value / true) if abs(value) <= abs(true) else None


def compute_separation(one: PrintedRun, other: PrintedRun) -> float:
    """Return the difference of two estimates from disjoint pairs, in standard deviations."""
    return (one.value - other.value) / math.hypot(one.sigma, other.sigma)


@dataclass(frozen=True)
class WarmUp:
    """A bias that settles as exp(-t / time_constant)."""

    time_constant: float  # s
    total: float  # change of the bias over the run, rad/s


def fit_warm_up(first: float, last: float, duration: float, last_duration: float) -> WarmUp | None:
    """Return the warm-up with mean drift ``last`` in the last part of a run, ``first`` before.

    Drifts in rad/s^2, durations in s; None if the drift does not decrease, or changes its sign.
    """
    if not 0.0 < last / first < 1.0:
        return None
    rest = duration - last_duration

    def ratio(time_constant: float) -> float:
        before = -math.expm1(-rest / time_constant) / rest
        decayed = math.exp(-rest / time_constant)
        return decayed * -math.expm1(-last_duration / time_constant) / last_duration / before

    # The ratio rises with the time constant: bisection.
    low, high = 1e-3 * duration, 1e4 * duration
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if ratio(middle) < last / first else (low, middle)
    return WarmUp(low, first * rest + last * last_duration)


def fit_single_miscount(whole: PrintedRun, last: PrintedRun, true: float) -> float:
    """Return the misfit of the best single miscount to both printed values, in sigma.

    The senses are right up to a turn and wrong after it, or vice versa. The misfit is the root of
    the least sum of squares over the first and the last part.
    """
    first = whole.without(last)
    flips = np.linspace(0.0, whole.duration, 6001)
    before = np.clip(flips / first.duration, 0.0, 1.0)
    after = np.clip((flips - first.duration) / last.duration, 0.0, 1.0)
    misfits = [
        np.hypot(
            (sign * (2.0 * before - 1.0) * true - first.value) / first.sigma,
            (sign * (2.0 * after - 1.0) * true - last.value) / last.sigma,
        ).min()
        for sign in (1.0, -1.0)
    ]
    return float(min(misfits))


def compute_slipped_share(slip: Array) -> Array:
    """Return the remaining share of the rate, shape (n,), if dwells begin ``slip`` dwells late."""
    return np.asarray(np.abs(2.0 * np.mod(slip, 2.0) - 2.0) - 1.0)


def fit_clock_error(parts: Sequence[PrintedRun], period: float, true: float) -> tuple[float, float]:
    """Return the relative clock error that best explains consecutive parts, and its misfit.

    Errors up to a twentieth are tested; both signs are equivalent. The misfit is the root of the
    sum of squares in sigma. The period is from turn to turn, s.
    """
    errors = np.linspace(0.0, 0.05, _TESTED_CLOCK_ERRORS)
    edges = np.cumsum([0.0, *(part.duration for part in parts)])
    squares = np.zeros(_TESTED_CLOCK_ERRORS)
    for part, start, stop in zip(parts, edges[:-1], edges[1:], strict=True):
        ratio = (
            _integrate_slipped(errors * stop / period) - _integrate_slipped(errors * start / period)
        ) / np.where(errors > 0.0, errors * part.duration / period, 1.0)
        ratio[0] = 1.0
        squares += ((ratio * true - part.value) / part.sigma) ** 2
    best = int(np.argmin(squares))
    return float(errors[best]), math.sqrt(float(squares[best]))


def _integrate_slipped(slip: Array) -> Array:
    """Return the integral of `compute_slipped_share` from 0 on."""
    place = np.mod(slip, 2.0)
    return np.where(place <= 1.0, place - place**2, (place - 1.0) * (place - 2.0))
