"""Noise models for the tuning of a filter, from the results of a run for a sensor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import pyarrow.compute as pc

from imubench_pipeline.datasheets.comparable import read_comparables
from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.rows import read_estimates, read_recommended_estimates
from imubench_pipeline.export.overbound import overbound
from imubench_pipeline.export.request import curve_of
from imubench_pipeline.model.estimates import AllanRow
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.settings.sensor import CHANNELS, Sensor, quantity_of
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.from_datasheet import from_datasheet
from imubench_pipeline.tables import read

T = TypeVar("T")

Models = dict[str, NoiseModel]
"""By channel."""

DATASHEET, MISREAD, TENFOLD = "datasheet", "datasheet_misread", "times_ten"
TABLE_1, OVERBOUND, TRUE = "table_1", "overbound", "true"
"""Tunings other than those named after a method."""

_ESTIMATION_METHODS = ("curve", "paper", "weighted", "likelihood", "likelihood_gm", "compensated")
_TENFOLD_FACTOR = 10.0


def complete_axes(models: Mapping[str, T]) -> dict[str, T]:
    """Return models of all six channels; a missing axis takes one of the same quantity."""
    whole = {}
    for channel in CHANNELS:
        own = [name for name in models if quantity_of(name) == quantity_of(channel)]
        here = channel if channel in own else own["xyz".index(channel[-1]) % len(own)]
        whole[channel] = models[here]
    return whole


def complete_noise_models(models: Mapping[str, NoiseModel]) -> Models | None:
    """Return models of all six channels; None if gyros or accelerometers have no white noise."""
    usable = {name: model for name, model in models.items() if model.N > 0.0}
    quantities = {quantity_of(name) for name in usable}
    return complete_axes(usable) if quantities >= {"gyro", "accel"} else None


def collect_tunings(
    folder: Path, sensor: str, declared: Sensor | None, horizon: float, stand_in: Models
) -> tuple[dict[str, Models], dict[str, str]]:
    """Return the tunings from a recording and the datasheet of its sensor, by name.

    The second mapping has the reasons of missing tunings. ``horizon``, s, is for the overbound;
    ``stand_in`` replaces the channels of a quantity that the recording does not have.
    """
    every = read_estimates(folder / "parameters.parquet", folder / "draws.parquet")
    best = read_recommended_estimates(folder / "parameters.parquet", folder / "draws.parquet")
    named = _make_printed_models(sensor, declared)
    lacking: dict[str, str] = {}
    ten = {
        channel: scale_model(estimate.model, _TENFOLD_FACTOR) for channel, estimate in best.items()
    }
    named |= {TENFOLD: ten, TABLE_1: _select_method(every, "authors")}
    named |= {method: _select_method(every, method) for method in _ESTIMATION_METHODS}
    try:
        named[OVERBOUND] = _make_overbounds(folder, best, horizon)
    except ValueError as error:
        lacking[OVERBOUND] = str(error)
    replaced = {quantity_of(channel) for channel in stand_in}
    found = {}
    for name, models in named.items():
        if not models:
            continue
        own = {c: m for c, m in models.items() if quantity_of(c) not in replaced}
        whole = complete_noise_models(own | stand_in)
        if whole is None:
            lacking[name] = "it tells no white noise of a gyro or of an accelerometer"
        else:
            found[name] = whole
    return found, lacking


def scale_model(model: NoiseModel, factor: float) -> NoiseModel:
    """Return the model of a signal that is a factor larger; a ramp and lines are left out."""
    return NoiseModel(
        Q=model.Q * factor,
        N=model.N * factor,
        B=model.B * factor,
        T_B=model.T_B,
        K=model.K * factor,
        further=tuple(term.scaled(factor) for term in model.further),
    )


def _select_method(every: Mapping[str, Sequence[Estimate]], method: str) -> Models:
    """Return the models of a method without a ramp and lines: no filter expects them to go on."""
    return {
        channel: scale_model(estimate.model, 1.0)
        for channel, own in every.items()
        for estimate in own
        if estimate.method == method
    }


def _make_overbounds(folder: Path, best: Mapping[str, Estimate], horizon: float) -> Models:
    """Return the smallest models of white noise and a walk above the curves (or ValueError)."""
    table = read("allan", [folder / "allan.parquet"])
    models = {}
    for channel, estimate in best.items():
        curve = curve_of(AllanRow.rows_of(table.filter(pc.field("channel") == channel)))
        rate = float(curve.cluster_size[0] / curve.tau[0])
        drawn = estimate.draws
        many = [drawn.model(number) for number in range(len(drawn))] if drawn is not None else []
        models[channel] = overbound(
            curve, estimate.model, rate, horizon=horizon, drawn=many, most_excess=_TENFOLD_FACTOR
        ).model
    return models


def _make_printed_models(sensor: str, declared: Sensor | None) -> dict[str, Models]:
    """Return what the datasheet says, read right, and as Maia et al. read it."""
    if declared is None:
        return {}
    try:
        axes = from_datasheet(sensor, declared, 0).imu.axes
    except ConfigError:
        return {}
    right = {channel: model.noise for channel, model in axes.items()}
    wrong = {}
    for channel, noise in right.items():
        halved = any(
            row.statistic == "N" and row.sidedness == "one-sided" and row.quantity == "N"
            for row in read_comparables(declared.datasheet, channel)
            if row.value == noise.N
        )
        # A one-sided density for N, and the lowest point of the curve for B.
        factor = math.sqrt(2.0) if halved else 1.0
        wrong[channel] = replace(noise, N=noise.N * factor, B=noise.B * FLOOR)
    return {DATASHEET: right, MISREAD: wrong}
