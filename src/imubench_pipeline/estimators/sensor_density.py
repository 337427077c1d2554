"""N_sensor: the density of a sensor's white noise before its low-pass, or an interpolation.

N is the density in the log, aliases included; N_sensor compares sensors at other filter settings.
"""

from __future__ import annotations

import math

import numpy as np

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.frame import FitSelection
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import Maximum
from imubench_pipeline.typing import Array

_MAX_FILTER_SAMPLES = 10.0
"""Correlation, in samples, up to which a process may be the sensor's filter."""

_MIN_FLOOR_RATIO = 0.03
"""Power of unfiltered over filtered white noise above which the former matters."""


def sensor_density(
    frame: FitSelection,
    maximum: Maximum,
    posterior: Posterior,
    spectrum: Spectrum,
    rng: np.random.Generator,
) -> Parameter | None:
    """Return N_sensor of the best model; None where the spectrum shows no filter.

    Parameters
    ----------
    frame : FitSelection
    maximum, posterior : Maximum, Posterior
        The best fit with the filter of ``frame``, and its draws.
    spectrum : Spectrum
        The whole spectrum of the log.
    rng : numpy.random.Generator

    Returns
    -------
    Parameter or None
        rad/s/sqrt(Hz) or m/s²/sqrt(Hz); the interval covers the filters that the log does not rule
        out. ``not_identified`` where the filter may be a process; ``doubtful`` where a part of the
        noise did not pass it.
    """
    low_pass, terms = frame.low_pass, maximum.terms
    if low_pass is None or "N" not in terms.linear:
        return None
    N, column = maximum.parameter("N"), terms.linear.index("N")
    if low_pass.or_process is not None and low_pass.N_behind is not None:
        drawn = posterior.parameters[:, column]
        return _describe_interval(low_pass.or_process, drawn, low_pass.N_behind)
    if low_pass.behind is None:
        fast = maximum.times < _MAX_FILTER_SAMPLES / spectrum.rate
        if not fast.any():
            return None
        whole = frame.likelihood_of_all_bins(spectrum)
        shapes = [whole.gauss_markov(float(time))[0] for time in maximum.times[fast]]
        before = math.sqrt(N**2 + float(maximum.process_powers[fast] @ np.array(shapes)))
        reason = (
            f"a process with a correlation time of {maximum.times[fast].max():.3g} s, a few "
            "samples, may be the low-pass of the sensor; bandwidth in the sensor file would tell"
        )
        return _describe_interval(reason, posterior.parameters[:, column], before)
    draws = frame.before_the_filter(posterior, terms, rng).parameters[:, column]
    lower, upper = np.quantile(draws, (0.025, 0.975)).tolist()
    lower, upper, share = min(lower, N), max(upper, N), low_pass.beside
    if share < _MIN_FLOOR_RATIO:
        return Parameter(N, lower=lower, upper=upper)
    times = math.sqrt(1.0 + share)
    reason = (
        f"white noise of {100 * share:.2g} % of its power does not pass the {low_pass.words}, as "
        f"in an interpolated log: N_sensor may be up to {times:.3g} times as high"
    )
    return Parameter(N, "doubtful", reason, lower, upper * times)


def _describe_interval(reason: str, drawn: Array, other: float) -> Parameter:
    """Return N_sensor between the limits of draws of N and another density, SI."""
    lower, upper = np.quantile(drawn, (0.025, 0.975)).tolist()
    return Parameter(None, "not_identified", reason, min(lower, other), max(upper, other))
