"""What temperature and the sensor's own low-pass do to a channel, as rows of the tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from imubench_pipeline.allan import AllanCurve, of_blocks
from imubench_pipeline.estimators.estimate import SI_UNITS, Estimate, Parameter
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.rows import limit_rows
from imubench_pipeline.estimators.thermal.fit import fit_temperature
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.estimators.thermal.register import step_of
from imubench_pipeline.estimators.thermal.result import ThermalFit, shift_by_effect
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Row

_ENOUGH = 1 << 16
"""Samples that show the step of a register."""


def temperature_of(
    log: ChannelLog,
    path: TemperaturePath,
    plain: Likelihood,
    band: float | None,
    bandwidth: float | None,
    rng: np.random.Generator,
) -> ThermalFit:
    """Estimate what temperature does to a channel that has readings of it.

    Parameters
    ----------
    log : ChannelLog
    path : TemperaturePath
        Of its temperature.
    plain : Likelihood
        The noise of the log as it is.
    band, bandwidth : float or None
        As in `imubench_pipeline.estimators.likelihood.fit`.
    rng : numpy.random.Generator
    """
    return fit_temperature(
        log.blocks,
        log.grid,
        log.rate,
        path,
        holes=log.holes,
        band=band,
        bandwidth=bandwidth,
        resolution=resolution_of(log),
        plain=plain,
        rng=rng,
    )


def compensated_estimate(fit: ThermalFit) -> Estimate:
    """Return the estimate of method ``compensated``: the noise that temperature leaves."""
    without = fit.without_temperature.estimates[0]
    return replace(without, method="compensated")


def compensated_curve(log: ChannelLog, fit: ThermalFit, measured: AllanCurve) -> AllanCurve:
    """Return the Allan variance of a log less what temperature adds to it.

    Parameters
    ----------
    log : ChannelLog
    fit : ThermalFit
    measured : AllanCurve
        Of the log as it is: the same clusters are taken.
    """
    blocks = fit.compensate(log.blocks())
    sizes, rate = measured.cluster_size, log.rate
    return of_blocks(blocks, log.grid, rate, sizes, holes=log.holes, segments=log.segments)


def temperature_curve(log: ChannelLog, fit: ThermalFit, measured: AllanCurve) -> AllanCurve:
    """Return the Allan variance of what temperature adds to a log.

    Its parameters are those of `compensated_curve`.
    """
    nothing = (np.zeros(len(values)) for values in log.blocks())
    blocks = shift_by_effect(nothing, fit.path, fit.effect, 1.0)
    sizes, rate = measured.cluster_size, log.rate
    return of_blocks(blocks, log.grid, rate, sizes, holes=False, segments=log.segments)


def compensated_rows(key: Key, left: AllanCurve, added: AllanCurve) -> Iterator[Row]:
    """Yield the rows of the table ``allan_compensated``.

    Parameters
    ----------
    key : Key
    left, added : AllanCurve
        Of the log without what temperature adds to it, and of that.
    """
    for about, deviation in zip(limit_rows(left), added.deviation, strict=True):
        yield asdict(key) | about | {"temperature": float(deviation)}


def temperature_rows(key: Key, fit: ThermalFit) -> Iterator[Row]:
    """Yield the rows of the table ``temperature``."""
    unit = SI_UNITS[quantity_of(key.channel)]["B"]
    figures = {
        "T_0": (Parameter(fit.reference), "degC"),
        "sensitivity": (fit.sensitivity, f"{unit}/K"),
        "quadratic": (fit.quadratic, f"{unit}/K^2"),
        "lag": (fit.lag, "s"),
        "bias": (fit.bias, unit),
    }
    about = asdict(key) | {"compensated": fit.compensated}
    for name, (parameter, its_unit) in figures.items():
        reason = parameter.reason or (fit.reason if name == "sensitivity" else None)
        yield about | _figure(name, parameter, its_unit) | {"reason": reason}


def low_pass_rows(key: Key, fit: Likelihood) -> Iterator[Row]:
    """Yield the rows of the table ``low_pass``: none where a band was asked for.

    N is that of the estimate, which is the density before the filter.
    """
    low_pass = fit.low_pass
    if low_pass is None:
        return
    density = SI_UNITS[quantity_of(key.channel)]["N"]
    about = asdict(key) | {"kind": low_pass.kind, "order": low_pass.order}
    yield about | _figure("cutoff", low_pass.frequency, "Hz")
    yield about | _figure("N", fit.estimates[0].parameters["N"], density)
    if low_pass.order is not None:
        yield about | _figure("floor", Parameter(low_pass.floor), density)


def resolution_of(log: ChannelLog) -> float:
    """Return the step of the register that the samples at the beginning of a log show, SI.

    `log`: as of `temperature_of`.

    Returns
    -------
    float
        0 where none shows.
    """
    values = next((block for block in log.blocks() if np.isfinite(block).any()), np.empty(0))
    present = values[np.isfinite(values)][:_ENOUGH]
    return step_of(np.unique(present), len(present))


def _figure(name: str, parameter: Parameter, unit: str) -> dict[str, Any]:
    values = asdict(parameter)
    values.pop("duration_needed")
    return {"parameter": name, "unit": unit, **values}
