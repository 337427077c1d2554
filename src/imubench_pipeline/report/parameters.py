"""Table of parameters: a cell has a value with its interval, or the reason for a missing value."""

from collections.abc import Iterable, Sequence
from itertools import chain

import numpy as np

from imubench_pipeline.estimators.estimate import PARAMETERS, SENSOR, SHOWN
from imubench_pipeline.estimators.model_choice import MIN_AKAIKE_WEIGHT, compute_information_weights
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.report.payload import Json
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.view import ChannelView
from imubench_pipeline.words.estimates import estimate_text, model_text
from imubench_pipeline.words.numbers import count_digits, counted


def select_symbols(rows: Iterable[ParameterRow]) -> list[str]:
    """Return the parameters of the papers' model, and others that were estimated, but N_sensor."""
    estimated = {row.parameter for row in rows if row.status != "absent"}
    return [s for s in SHOWN if s in PARAMETERS or (s in estimated and s != SENSOR)]


def make_methods_table(
    channel: ChannelView, duration: float | None, system: System
) -> tuple[list[str], list[Json]]:
    """Return the symbols, and one line per method; also the true parameters of a simulation."""
    symbols = select_symbols(chain(*channel.parameters.values()))
    lines: list[Json] = [
        {
            "method": method,
            "recommended": method == channel.recommended,
            "model": describe_model(channel, method),
            "cells": [make_parameter_cell(channel, method, s, duration, system) for s in symbols],
        }
        for method in channel.parameters
    ]
    if channel.true_components:
        cells = []
        for symbol in symbols:
            rows = channel.true_components.get(symbol, [])
            parts = [_part(row.value, None, None, "assumed" if row.assumed else "") for row in rows]
            source = rows[0].source if rows else "Not simulated."
            cells.append(_cell(parts, source, count_digits(None, None, None, symbol)))
        lines.append({"method": None, "recommended": False, "model": "", "cells": cells})
    return symbols, lines


def describe_model(channel: ChannelView, method: str) -> str:
    """Return the model of a method, and how many other models its intervals include.

    The intervals of the likelihood include all models that fit nearly as well as the best; the
    intervals of the papers' model are for this model only.
    """
    text = model_text(channel.parameters[method][0].model)
    if method != "likelihood" or not channel.models:
        return text
    shares = compute_information_weights(np.array([row.aic for row in channel.models]))
    others = sum(
        share >= MIN_AKAIKE_WEIGHT and not row.chosen and "R" not in row.model.split("+")
        for share, row in zip(shares, channel.models, strict=True)
    )
    if not others:
        return text
    return f"{text} ({counted(others, 'other model fits', 'other models fit')} as well)"


def make_parameter_cell(
    channel: ChannelView, method: str, symbol: str, duration: float | None, system: System
) -> Json:
    """Return a cell with a part for each component: its value, interval and status."""
    unit = choose_page_unit(channel.quantity, symbol, system)
    rows = channel.named(method, symbol)
    parts = [
        _part(
            row.value,
            None if row.status == "absent" else row.lower,
            row.upper,
            "" if row.status == "ok" else row.status,
        )
        for row in rows
    ]
    digits = max((unit.digits(row.value, row.lower, row.upper) for row in rows), default=3)
    words = [sentence for row in rows if (sentence := estimate_text(row, unit, duration))]
    return _cell(parts, " ".join(words), digits)


def _part(value: float | None, lower: float | None, upper: float | None, status: str) -> Json:
    return {"value": value, "lower": lower, "upper": upper, "status": status}


def _cell(parts: Sequence[Json], words: str, digits: int) -> Json:
    value = parts[0]["value"] if parts else None
    return {"parts": parts, "words": words, "value": value, "digits": digits}
