"""Channels of many recordings as pages compare them: curves, and tables of parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any

from imubench_pipeline.estimators.estimate import SHOWN
from imubench_pipeline.report.parameters import cell, model_words, shown_symbols
from imubench_pipeline.report.payload import Arrays, compared, datasheet_lines
from imubench_pipeline.report.practical import System
from imubench_pipeline.report.view import QUANTITY_NAMES, ChannelView, RecordingView

_PAPERS = "likelihood_gm"


class Comparison:
    """What is compared of recordings: one after the other is gathered, and let go.

    Parameters
    ----------
    views : sequence of RecordingView
    names : mapping
        Of the sensors, as they are shown.
    system : str
        Units in which the pages open.
    """

    def __init__(
        self, views: Sequence[RecordingView], names: Mapping[str, str], system: System
    ) -> None:
        self._names = names
        self._system = system
        self._arrays = Arrays()
        self._curves: list[dict[str, Any]] = []
        self._datasheets: dict[str, dict[str, Any]] = {}
        self._lines: dict[str, list[dict[str, Any]]] = {name: [] for name in QUANTITY_NAMES}
        self._symbols: dict[str, set[str]] = {name: set() for name in QUANTITY_NAMES}
        for view in views:
            for channel in view.channels():
                self._add(view, channel)

    def _add(self, view: RecordingView, channel: ChannelView) -> None:
        self._curves.append(compared(channel, self._arrays))
        own = self._datasheets.setdefault(view.sensor, {})
        if channel.channel not in own:
            own[channel.channel] = datasheet_lines(channel)
        symbols = shown_symbols(chain(*channel.parameters.values()))
        self._symbols[channel.quantity].update(symbols)
        lines = self._lines[channel.quantity]
        lines.append(self._line(view, channel, channel.recommended, "recommended"))
        if _PAPERS in channel.parameters and channel.recommended != _PAPERS:
            lines.append(self._line(view, channel, _PAPERS, "papers' model"))

    def _line(
        self, view: RecordingView, channel: ChannelView, method: str, asked: str
    ) -> dict[str, Any]:
        duration = view.row["duration"]
        return {
            "view": view,
            "axis": channel.axis,
            "channel": channel.channel,
            "warnings": channel.warnings,
            "asked": asked,
            "model": model_words(channel, method),
            "cells": {
                symbol: cell(channel, method, symbol, duration, self._system)
                for symbol in shown_symbols(chain(*channel.parameters.values()))
            },
        }

    @property
    def page(self) -> dict[str, Any]:
        """What the figures of the page are drawn from."""
        return {
            "channels": self._curves,
            "datasheets": self._datasheets,
            "arrays": self._arrays.texts,
        }

    def tables(self) -> Iterator[dict[str, Any]]:
        """Yield a table a quantity: a line a channel, by the recommended method and the papers'."""
        for quantity, title in QUANTITY_NAMES.items():
            lines = self._lines[quantity]
            if not lines:
                continue
            sensors = dict.fromkeys(line["view"].sensor for line in lines)
            yield {
                "quantity": quantity,
                "title": title,
                "symbols": [s for s in SHOWN if s in self._symbols[quantity]],
                "lines": lines,
                "filters": {
                    "axis": sorted({line["axis"] for line in lines}),
                    "sensor": [self._names[sensor] for sensor in sensors],
                    "method": list(dict.fromkeys(line["asked"] for line in lines)),
                },
            }
