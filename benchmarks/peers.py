"""Noise parameters as the programs in common use compute them, for comparison.

Each program is one `Peer`. Its formulas are written anew from the source named beside it, with
the cluster lengths, the fits and the readings of that source, because these, not the Allan
variance, are what the programs differ in. The package ``allan-variance`` is called itself.

Conventions
-----------
`Peer.printed` gives the figures of the program, in SI (degrees are made radians, nothing else).
`Peer.estimate` gives them for comparison with the parameters of
`imubench_pipeline.noise.model.NoiseModel`, where flicker noise or a Gauss-Markov process stands at
sqrt(2 ln 2 / pi) B = 0.664 B at its plateau or peak: a program that prints the minimum of a curve
as bias instability has its figure divided by 0.664. Nothing else is converted. In particular N is
compared as published, also where it is a deviation per sample published as a density.

None of the programs prints a correlation time T_B. (Pull request 45 of allan_variance_ros, not
merged, prints the tau of the minimum under this name; that would be 1.89 T_B.)

All but ``allan-variance`` average over three axes or take the worst; here each channel is an axis
of its own.

python benchmarks/peers.py
"""

from __future__ import annotations

import importlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.noise.simulate import simulate

Array = NDArray[np.float64]
Estimate = dict[str, float | None]
"""Values by symbol: N, B, T_B, K; None where the program gives none."""


@dataclass(frozen=True)
class Peer:
    """A program that estimates noise parameters.

    Attributes
    ----------
    name : str
        The program.
    source : str
        Repository, file and function that the formulas follow, with the commit.
    printed : callable
        Of the samples (SI) and the rate (Hz): the figures as the program prints them, in SI.
    unit_B : float
        The printed bias instability of a process of B = 1: 1, or 0.664 where a minimum of the
        curve is printed.
    """

    name: str
    source: str
    printed: Callable[[Array, float], Estimate]
    unit_B: float = 1.0

    def comparable(self, printed: Estimate) -> Estimate:
        """Return printed figures in the convention of the true parameters."""
        level = printed["B"]
        return {**printed, "B": None if level is None else level / self.unit_B}

    def estimate(self, samples: Array, rate: float) -> Estimate:
        """Return N, B, T_B and K for comparison with the truth.

        Parameters
        ----------
        samples : ndarray, shape (L,)
            rad/s or m/s², without holes.
        rate : float
            Hz.

        Returns
        -------
        dict of str to float or None
            SI; None where the program gives no value, or fails.
        """
        return self.comparable(self.printed(samples, rate))


def adjacent_deviation(samples: Array, sizes: NDArray[np.int64]) -> Array:
    """Return the Allan deviation over adjacent clusters, that is, without overlap.

    Parameters
    ----------
    samples : ndarray, shape (L,)
    sizes : ndarray of int, shape (m,)
        Samples in a cluster; clusters follow one another from the first sample, and samples left
        over at the end are not used.

    Returns
    -------
    ndarray, shape (m,)
        NaN where there are fewer than two clusters.
    """
    theta = np.concatenate(([0.0], np.cumsum(samples - samples[0])))
    deviation = np.full(len(sizes), np.nan)
    distinct, place = np.unique(sizes, return_inverse=True)
    for index, n in enumerate(distinct):
        if 1 <= n <= len(samples) // 2:
            steps = np.diff(theta[::n], 2) / n
            deviation[place == index] = math.sqrt(0.5 * float(np.mean(steps * steps)))
    return deviation


def line_within(x: Array, y: Array, least: float, most: float) -> tuple[float, float]:
    """Return slope and intercept of the least-squares line whose slope lies within limits.

    For each slope the best intercept is known and the sum of squares is then a parabola of the
    slope, so the best slope within the limits is the free one, clipped.
    """
    away = x - np.mean(x)
    slope = min(max(float(away @ y / (away @ away)), least), most)
    return slope, float(np.mean(y) - slope * np.mean(x))


def allan_variance_ros(samples: Array, rate: float) -> Estimate:
    """Return the figures of allan_variance_ros.

    tau = 0.1, 0.2, ... 999.9 s, always all 9999 of them; adjacent clusters of the whole part of
    tau times the rate, with tau itself taken for their length (at 125 Hz the first has 12 samples
    and 0.096 s). Straight lines are fitted to the logarithms, every tau with the same weight: of
    slope -0.5 (to -0.499) through tau < 10 s, read at 1 s as N; of slope 0.5 (to 0.501) through
    *all* tau, read at 3 s as K, whether the curve rises or not. B is the least deviation.

    The measuring rate, a whole number in the program's settings, is the rate of the log. A log
    shorter than 2000 s leaves the last tau without a difference, and the program stops with an
    error: no figures.
    """
    periods = np.arange(1, 10_000)
    tau = periods * 0.1
    sizes = np.maximum((tau * round(rate)).astype(np.int64), 1)
    deviation = adjacent_deviation(samples, sizes)
    if not (deviation > 0.0).all():
        return {"N": None, "B": None, "T_B": None, "K": None}
    x, y = np.log(tau), np.log(deviation)
    short = periods < 100
    _, white = line_within(x[short], y[short], -0.5, -0.499)
    slope, walk = line_within(x, y, 0.5, 0.501)
    return {
        "N": math.exp(white),
        "B": float(deviation.min()),
        "T_B": None,
        "K": math.exp(walk + slope * math.log(3.0)),
    }


def dogleg_fit(powers: Array, measured: Array, start: Array, steps: int = 50) -> Array:
    """Return coefficients c that fit log10(powers @ c^2) to the measured logarithms.

    Powell's dog-leg in a trust region, with the scaling, the tolerances and the limit of steps
    that are the defaults of Ceres Solver (its documentation, "Solving Non-linear Least Squares"):
    with them imu_utils often ends well before the minimum, so they are part of its figures.

    Parameters
    ----------
    powers : ndarray, shape (m, p)
        Each term at each tau.
    measured : ndarray, shape (m,)
        log10 of the variance.
    start : ndarray, shape (p,)
    steps : int
        Steps at most, rejected ones included.

    Returns
    -------
    ndarray, shape (p,)
        The coefficients reached, of either sign.
    """

    def evaluate(terms: Array) -> tuple[Array, Array, float]:
        fitted = powers @ terms**2
        residual = np.log10(fitted) - measured
        slopes = powers * (2.0 * terms) / (math.log(10.0) * fitted[:, None])
        return residual, slopes, 0.5 * float(residual @ residual)

    terms = start
    residual, slopes, cost = evaluate(terms)
    columns = 1.0 / (1.0 + np.sqrt(np.sum(slopes**2, axis=0)))
    radius = 1e4
    for _ in range(steps):
        scaled = slopes * columns
        diagonal = np.maximum(np.sqrt(np.sum(scaled**2, axis=0)), 1e-3)
        scaled /= diagonal
        gradient = scaled.T @ residual
        steepest = -gradient * float(gradient @ gradient) / float(np.sum((scaled @ gradient) ** 2))
        # Gauss and Newton's step, damped just enough to exist.
        damped = np.vstack([scaled, 1e-4 * np.eye(len(terms))])
        aim = np.concatenate([-residual, np.zeros(len(terms))])
        step = np.linalg.lstsq(damped, aim, rcond=None)[0]
        if np.linalg.norm(step) > radius:
            if np.linalg.norm(steepest) >= radius:
                step = steepest * radius / float(np.linalg.norm(steepest))
            else:
                leg = step - steepest
                along, length = float(steepest @ leg), float(leg @ leg)
                room = radius**2 - float(steepest @ steepest)
                step = steepest + leg * (math.sqrt(along**2 + length * room) - along) / length
        move = step * columns / diagonal
        if np.linalg.norm(move) <= 1e-8 * (np.linalg.norm(terms) + 1e-8):
            break
        change = slopes @ move
        expected = -float(change @ (residual + 0.5 * change))
        trial = evaluate(terms + move)
        gain = cost - trial[2]
        if abs(gain) <= 1e-6 * cost:
            break
        if gain > 1e-3 * expected:
            if gain > 0.75 * expected:
                radius = max(radius, 3.0 * float(np.linalg.norm(step)))
            elif gain < 0.25 * expected:
                radius *= 0.5
            terms = terms + move
            residual, slopes, cost = trial
        else:
            radius *= 0.5
    return terms


def imu_utils(samples: Array, rate: float) -> Estimate:
    """Return the figures of imu_utils.

    The overlapping Allan variance at 100 log-spaced cluster sizes (``max_cluster`` of its launch
    files), rounded up, from 1 to the largest power of two within half the log. Fitted to the
    logarithm of the variance, every size with the same weight, is

        sigma^2 = q^2/tau^2 + n^2/tau + b^2 + k^2 tau + r^2 tau^2

    from a linear fit of the deviation by powers -1, -1/2, 0, 1/2, 1 of tau. Printed are, of the
    fitted curve and not of its terms: ``gyr_n`` or ``acc_n``, its deviation at 1 s times the root
    of the rate, that is, the deviation of a sample (its read-me gives the unit of a density, its
    output file rad/s); and ``gyr_w`` or ``acc_w``, the least deviation at the sizes above, named
    bias instability. b, k and r reach no output file, so there is no K.

    The minimisation is the dog-leg of Ceres Solver as the program calls it (`dogleg_fit`): on
    simulated logs Ceres 2 itself, in the program's deg/h, gives the same figures to 1e-5. For
    accelerometers the program first drops sizes below 1 s at which the variance reaches a new
    maximum (always the first size); here, as for its gyroscopes, none.
    """
    largest = 1 << (len(samples) // 2).bit_length() - 1
    spaced = np.geomspace(1.0, largest, 100)
    # The rounding errors of the spacing must not lift a whole number to the next one.
    sizes = np.unique(np.ceil(spaced * (1.0 - 1e-12)).astype(np.int64))
    curve = allan_variance(samples, rate, cluster_sizes=sizes)
    scale = math.exp(0.5 * float(np.mean(np.log(curve.variance))))
    variance = curve.variance / scale**2
    powers = curve.tau[:, None] ** np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    start = np.abs(np.linalg.lstsq(np.sqrt(powers), np.sqrt(variance), rcond=None)[0])
    terms = dogleg_fit(powers, np.log10(variance), start)
    return {
        "N": math.sqrt(rate * float(np.sum(terms**2))) * scale,
        "B": math.sqrt(float(np.min(powers @ terms**2))) * scale,
        "T_B": None,
        "K": None,
    }


def kalibr_allan(samples: Array, rate: float) -> Estimate:
    """Return the figures of kalibr_allan.

    The Allan deviation over adjacent clusters at 2000 log-spaced sizes, rounded down, from less
    than one sample (no value) to half the log; sizes that are the same after rounding count as
    often as they occur. A line of slope -1/2 through everything up to 50 points before the least
    deviation, by the mean of the logarithms, read at the tau nearest 1 s, is N; a line of slope
    1/2 through everything from 50 points after it, to tau of half the log, read at the tau
    nearest 3 s, is K. (50 points are a factor of 1.5 in tau for 1 h at 100 Hz.) There is no B.
    Where the least deviation is among the last 50 points the program prints NaN for K.
    """
    interval = 1.0 / rate
    largest = (len(samples) - 1) // 2
    spaced = np.logspace(math.log10(interval), math.log10(largest), 2000)
    sizes = np.floor(interval * spaced * rate).astype(np.int64)
    tau = sizes / rate
    deviation = adjacent_deviation(samples, sizes)
    lowest, margin = int(np.nanargmin(deviation)), 50

    def read(window: slice, slope: float, reference: float) -> float | None:
        found = np.isfinite(deviation[window])
        if not found.any():
            return None
        x, y = tau[window][found], deviation[window][found]
        level = float(np.mean(np.log(y) - slope * np.log(x)))
        nearest = float(tau[np.argmin(np.abs(tau - reference))])
        return math.exp(level) * nearest**slope

    return {
        "N": read(slice(0, max(lowest - margin + 1, 0)), -0.5, 1.0),
        "B": None,
        "T_B": None,
        "K": read(slice(lowest + margin, None), 0.5, 3.0),
    }


def allan_variance_package(samples: Array, rate: float) -> Estimate:
    """Return the figures of the package ``allan-variance``, by calling it with its defaults.

    The overlapping Allan variance at 100 log-spaced sizes up to a tenth of the log, and a
    non-negative least-squares fit, weighted by one over the variance squared, of quantization,
    white noise, flicker noise ((2 ln 2 / pi) B^2 at every tau), random walk and ramp. So N, B and
    K are in the convention of `NoiseModel`; 0 is a value (the term is not needed).

    Raises
    ------
    ModuleNotFoundError
        If the package, an optional one, is not installed.
    """
    package = importlib.import_module("allan_variance")
    tau, variance = package.compute_avar(samples, 1.0 / rate)
    parameters, _ = package.estimate_parameters(tau, variance)
    return {
        "N": float(parameters["white"]),
        "B": float(parameters["flicker"]),
        "T_B": None,
        "K": float(parameters["walk"]),
    }


PEERS: tuple[Peer, ...] = (
    Peer(
        "allan_variance_ros",
        "github.com/ori-drs/allan_variance_ros: src/AllanVarianceComputor.cpp, allanVariance "
        "(0ef9204); scripts/analysis.py, get_intercept and what calls it (23599fa)",
        allan_variance_ros,
        unit_B=FLOOR,
    ),
    Peer(
        "imu_utils",
        "github.com/gaowenliang/imu_utils: src/gyr_lib/allan_gyr.cpp, initStrides and "
        "calcVariance (7262b35); src/gyr_lib/fitallan_gyr.h and .cpp, getWhiteNoise and "
        "getBiasInstability (2cdda91); src/imu_an.cpp, writeYAML (7262b35)",
        imu_utils,
        unit_B=FLOOR,
    ),
    Peer(
        "kalibr_allan",
        "github.com/rpng/kalibr_allan: matlab/SCRIPT_allan_matparallel.m and "
        "matlab/functions/gen_chart.m (f9918a1); matlab/functions/allan_v3/allan.m, sig2 (9244c4e)",
        kalibr_allan,
    ),
    Peer(
        "allan-variance",
        "the package allan-variance 1.0: compute_avar, estimate_parameters",
        allan_variance_package,
    ),
)
"""The programs; the last needs the package ``allan-variance``."""


def main() -> None:
    """Print what each program makes of one simulated log of 10 h at 100 Hz."""
    model = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
    log = simulate(model, 100.0, 3_600_000, np.random.default_rng(1))
    print(f"{'program':20}{'N':>12}{'B printed':>12}{'B':>12}{'K':>12}{'seconds':>10}")
    print(f"{'truth':20}{model.N:12.3g}{'':12}{model.B:12.3g}{model.K:12.3g}")
    for peer in PEERS:
        start = time.perf_counter()
        try:
            printed = peer.printed(log, 100.0)
        except ModuleNotFoundError:
            print(f"{peer.name:20}{'not installed':>48}")
            continue
        seconds = time.perf_counter() - start
        values = (printed["N"], printed["B"], peer.comparable(printed)["B"], printed["K"])
        cells = "".join(f"{'none':>12}" if value is None else f"{value:12.3g}" for value in values)
        print(f"{peer.name:20}{cells}{seconds:10.2f}")


if __name__ == "__main__":
    main()
