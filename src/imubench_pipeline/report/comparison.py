"""Channels of many recordings for comparison on pages: curves, and tables of parameters."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain

from imubench_pipeline.estimators.estimate import SHOWN
from imubench_pipeline.report import payload
from imubench_pipeline.report.parameters import describe_model, make_parameter_cell, select_symbols
from imubench_pipeline.report.practical import System
from imubench_pipeline.report.view import QUANTITY_NAMES, RecordingView

_PAPERS_METHOD = "likelihood_gm"


@dataclass(frozen=True)
class ComparedRecording:
    """The compared data of a recording, gathered once for all pages."""

    view: RecordingView
    channels: list[payload.ComparedChannel]
    datasheet: Mapping[str, list[payload.Json]]  # its lines, by channel
    lines: Mapping[str, list[payload.Json]]  # of the tables of parameters, by quantity


def gather_recording(view: RecordingView, system: System) -> ComparedRecording:
    """Gather the compared data of a recording; ``system`` has the units of its numbers."""
    channels = view.channels()
    lines: dict[str, list[payload.Json]] = {name: [] for name in QUANTITY_NAMES}
    for channel in channels:
        shown = select_symbols(chain(*channel.parameters.values()))
        methods = {channel.recommended: "recommended"}
        if _PAPERS_METHOD in channel.parameters:
            methods.setdefault(_PAPERS_METHOD, "papers' model")
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
    """The compared data of recordings; ``names`` are the names of sensors on the pages."""

    def __init__(self, recordings: Iterable[ComparedRecording], names: Mapping[str, str]) -> None:
        self._names = names
        self.arrays = payload.Arrays()
        self.channels: list[payload.Json] = []
        self._datasheets: dict[str, payload.Json] = {}
        self._lines: dict[str, list[payload.Json]] = {name: [] for name in QUANTITY_NAMES}
        for recording in recordings:
            self.channels += [channel.among(self.arrays) for channel in recording.channels]
            for channel, lines in recording.datasheet.items():
                own = self._datasheets.setdefault(recording.view.sensor, {})
                own.setdefault(channel, lines)
            for quantity in QUANTITY_NAMES:
                self._lines[quantity] += recording.lines[quantity]

    @property
    def page(self) -> payload.Json:
        """The data of the figures of the page."""
        return {
            "channels": self.channels,
            "datasheets": self._datasheets,
            "arrays": self.arrays.texts,
        }

    def tables(self) -> Iterator[payload.Json]:
        """Yield a table per quantity, with the recommended method and the papers' model."""
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
