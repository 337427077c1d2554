"""Tables of parameters, and the channels of many recordings for comparison on pages."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from imubench_pipeline.estimators.estimate import PARAMETERS, SENSOR, SHOWN
from imubench_pipeline.estimators.model_choice import MIN_AKAIKE_WEIGHT, compute_information_weights
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.report import payload
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.view import QUANTITY_NAMES, ChannelView, RecordingView
from imubench_pipeline.words.estimates import estimate_text, model_text
from imubench_pipeline.words.numbers import count_digits, counted

_PAPERS_METHOD = "likelihood_gm"


def select_symbols(rows: Iterable[ParameterRow]) -> list[str]:
    """Return the symbols of N, B, T_B and K, and of other estimated parameters except N_sensor."""
    estimated = {row.parameter for row in rows if row.status != "absent"}
    return [s for s in SHOWN if s in PARAMETERS or (s in estimated and s != SENSOR)]


def make_methods_table(
    channel: ChannelView, duration: float | None, system: System
) -> tuple[list[str], list[payload.Json]]:
    """Return the symbols (columns) and a line per method; the last has the truth if simulated."""
    symbols = select_symbols(chain(*channel.parameters.values()))
    lines: list[payload.Json] = [
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
            term = "GM" * (len(rows) > 1)
            parts = [
                _part(r.value, None, None, "assumed, not published" * r.assumed, term) for r in rows
            ]
            source = rows[0].source if rows else "Not simulated."
            cells.append(_cell(parts, source, count_digits(None, None, None, symbol)))
        lines.append({"method": None, "recommended": False, "model": "", "cells": cells})
    return symbols, lines


def describe_model(channel: ChannelView, method: str) -> str:
    """Return the model of a method, such as ``N+GM+K (4 other models fit as well)``."""
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
) -> payload.Json:
    """Return the table cell of a parameter (value, interval, status); ``duration`` is in s."""
    unit = choose_page_unit(channel.quantity, symbol, system)
    rows = channel.named(method, symbol)
    rows = [row for row in rows if row.status != "absent"] or rows
    named = rows[0].model.split("+") if len(rows) > 1 else ()
    terms = dict(enumerate((term for term in named if term in ("F", "GM")), start=1))
    parts = [
        _part(
            row.value,
            None if row.status == "absent" else row.lower,
            row.upper,
            "" if row.status == "ok" else row.status,
            terms.get(row.component, ""),
        )
        for row in rows
    ]
    digits = max((unit.digits(row.value, row.lower, row.upper) for row in rows), default=3)
    words = [sentence for row in rows if (sentence := estimate_text(row, unit, duration))]
    return _cell(parts, " ".join(words), digits)


def _part(
    value: float | None, lower: float | None, upper: float | None, status: str, term: str = ""
) -> payload.Json:
    return {"value": value, "lower": lower, "upper": upper, "status": status, "term": term}


def _cell(parts: Sequence[payload.Json], words: str, digits: int) -> payload.Json:
    value = parts[0]["value"] if parts else None
    return {"parts": parts, "words": words, "value": value, "digits": digits}


@dataclass(frozen=True)
class ComparedRecording:
    """The data of a recording that pages compare with others, gathered once for all pages."""

    view: RecordingView
    channels: list[payload.ComparedChannel]
    datasheet: Mapping[str, list[payload.Json]]  # lines in the Allan plot, by channel
    lines: Mapping[str, list[payload.Json]]  # lines of the tables of parameters, by quantity


def gather_recording(view: RecordingView, system: System) -> ComparedRecording:
    """Return the data of a recording that pages compare; ``system``: the units in its texts."""
    channels = view.channels()
    lines: dict[str, list[payload.Json]] = {name: [] for name in QUANTITY_NAMES}
    for channel in channels:
        shown = select_symbols(chain(*channel.parameters.values()))
        methods = {channel.recommended: "recommended"}
        if _PAPERS_METHOD in channel.parameters:
            methods.setdefault(_PAPERS_METHOD, "model N+GM+K")
        lines[channel.quantity] += [
            {
                "view": view,
                "axis": channel.axis,
                "channel": channel.channel,
                "warnings": channel.warnings,
                "asked": asked,
                "model": describe_model(channel, method),
                "cells": {
                    symbol: make_parameter_cell(channel, method, symbol, view.row.duration, system)
                    for symbol in shown
                },
            }
            for method, asked in methods.items()
        ]
    datasheet = {channel.channel: payload.pack_datasheet_lines(channel) for channel in channels}
    return ComparedRecording(
        view, [payload.pack_compared_channel(channel) for channel in channels], datasheet, lines
    )


class Comparison:
    """The data of recordings that a page compares; ``names`` has the shown name of each sensor."""

    def __init__(self, recordings: Iterable[ComparedRecording], names: Mapping[str, str]) -> None:
        self._names = names
        self.arrays = payload.Arrays()
        self.channels: list[payload.Json] = []
        self._datasheets: dict[str, payload.Json] = {}
        self._lines: dict[str, list[payload.Json]] = {name: [] for name in QUANTITY_NAMES}
        for recording in recordings:
            self.channels += [channel.among(self.arrays) for channel in recording.channels]
            for channel, lines in recording.datasheet.items():
                self._datasheets.setdefault(recording.view.sensor, {}).setdefault(channel, lines)
            for quantity in QUANTITY_NAMES:
                self._lines[quantity] += recording.lines[quantity]

    @property
    def page(self) -> payload.Json:
        """The data for the scripts that draw the figures of the page."""
        return {
            "channels": self.channels,
            "datasheets": self._datasheets,
            "arrays": self.arrays.texts,
        }

    def tables(self) -> Iterator[payload.Json]:
        """Yield a table of parameters per quantity, by the recommended method and with N+GM+K."""
        for quantity, lines in self._lines.items():
            if not lines:
                continue
            sensors = dict.fromkeys(line["view"].sensor for line in lines)
            symbols = {symbol for line in lines for symbol in line["cells"]}
            yield {
                "quantity": quantity,
                "title": QUANTITY_NAMES[quantity],
                "symbols": [symbol for symbol in SHOWN if symbol in symbols],
                "lines": lines,
                "filters": {
                    "axis": sorted({line["axis"] for line in lines}),
                    "sensor": [self._names[sensor] for sensor in sensors],
                    "method": list(dict.fromkeys(line["asked"] for line in lines)),
                },
            }
