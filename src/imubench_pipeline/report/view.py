"""What the report shows of each channel, taken from the tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.results import estimate_of

Row = Mapping[str, Any]
Name = tuple[str, str, str]
METHOD_NAMES = {
    "likelihood": "likelihood",
    "likelihood_gm": "likelihood, papers' model",
    "curve": "read from the curve",
    "paper": "fit, weights as printed",
    "weighted": "fit, right weights",
}


@dataclass
class ChannelView:
    """Everything that the tables say of one channel; numbers are SI."""

    sensor: str
    recording: str
    channel: str
    simulated: bool
    tau: NDArray[np.float64]
    adev: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    parameters: dict[str, list[Row]] = field(default_factory=dict)
    recommended: str = ""
    reconstruction: dict[str, dict[str, NDArray[np.float64]]] = field(default_factory=dict)
    scores: dict[str, Row] = field(default_factory=dict)
    datasheet: list[Row] = field(default_factory=list)
    datasheet_curve: list[Row] = field(default_factory=list)
    truth: dict[str, Row] = field(default_factory=dict)
    models: list[Row] = field(default_factory=list)
    lines: list[Row] = field(default_factory=list)
    spectrum: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    findings: list[Row] = field(default_factory=list)

    @property
    def warnings(self) -> list[str]:
        """Names of the findings that put the results of the channel in doubt, each once."""
        serious = [row["finding"] for row in self.findings if row["severity"] != "note"]
        return [name.replace("_", " ") for name in dict.fromkeys(serious)]

    @property
    def quantity(self) -> str:
        """``gyro`` or ``accel``."""
        return self.channel.split("_", maxsplit=1)[0]

    @property
    def anchor(self) -> str:
        """Name of the section of the page."""
        return f"{self.sensor}-{self.recording}-{self.channel}"

    @property
    def label(self) -> str:
        """Sensor and recording, and whether it is simulated."""
        return f"{self.sensor} / {self.recording}" + " (simulated)" * self.simulated

    def model(self, method: str) -> NoiseModel:
        """Return the noise model that a method estimated."""
        return estimate_of(method, self.parameters[method]).model

    def named(self, method: str, symbol: str) -> list[Row]:
        """Return the rows of a parameter of a method, one a component."""
        return [row for row in self.parameters[method] if row["parameter"] == symbol]


def channel_views(tables: Mapping[str, pa.Table]) -> list[ChannelView]:
    """Gather the tables by channel, in their order."""
    simulated = {
        (row["sensor"], row["recording"]): row["simulated"]
        for row in tables["recordings"].to_pylist()
    }
    views: dict[Name, ChannelView] = {}
    for name, part in _by_channel(tables["allan"]).items():
        views[name] = ChannelView(
            *name,
            simulated[name[0], name[1]],
            tau=_floats(part, "tau"),
            adev=_floats(part, "adev"),
            lower=_floats(part, "lower"),
            upper=_floats(part, "upper"),
        )
    for row in tables["parameters"].to_pylist():
        view = views[_name(row)]
        view.parameters.setdefault(row["method"], []).append(row)
        if row["recommended"]:
            view.recommended = row["method"]
    for name, part in _by_channel(tables["reconstruction"]).items():
        methods = part["method"].to_pylist()
        for method in dict.fromkeys(methods):
            chosen = part.filter(pa.array([each == method for each in methods]))
            views[name].reconstruction[method] = {
                column: _floats(chosen, column)
                for column in ("tau", "adev", "lower", "upper", "reconstructed")
            }
    for table in ("models", "lines", "datasheet", "datasheet_curve"):
        for row in tables[table].to_pylist():
            getattr(views[_name(row)], table).append(row)
    for name, part in _by_channel(tables["spectrum"]).items():
        views[name].spectrum = {
            column: _floats(part, column)
            for column in ("frequency", "ordinates", "density", "fitted", "used")
        }
    for row in tables["scores"].to_pylist():
        views[_name(row)].scores[row["method"]] = row
    for row in tables["simulated_truth"].to_pylist():
        if _name(row) in views:
            views[_name(row)].truth[row["parameter"]] = row
    for row in tables["findings"].to_pylist():
        for (sensor, recording, channel), view in views.items():
            here = (sensor, recording) == (row["sensor"], row["recording"])
            if here and row["channel"] in (None, channel):
                view.findings.append(row)
    return list(views.values())


def _name(row: Row) -> Name:
    return row["sensor"], row["recording"], row["channel"]


def _floats(part: pa.Table, column: str) -> NDArray[np.float64]:
    return np.asarray(part[column].to_numpy(), dtype=np.float64)


def _by_channel(table: pa.Table) -> dict[Name, pa.Table]:
    """Divide a table, whose channels stand together, into one slice a channel."""
    keys = ("sensor", "recording", "channel")
    names: list[Name] = list(zip(*(table[key].to_pylist() for key in keys), strict=True))
    starts = [i for i, name in enumerate(names) if i == 0 or name != names[i - 1]]
    stops = [*starts[1:], len(names)] if names else []
    return {
        names[start]: table.slice(start, stop - start)
        for start, stop in zip(starts, stops, strict=True)
    }
