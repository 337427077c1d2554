"""Where the model of a sensor is from: its datasheet, what a run has estimated, or a file.

What a source does not say is left out of the model or assumed, and is said to be.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc

from imubench_pipeline.comparable import Comparable, comparables
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.printed import FIGURE_DIMENSIONS, PrintedFigure, QuantityDatasheet
from imubench_pipeline.results import estimate_of
from imubench_pipeline.sensor import CHANNELS, Sensor, quantity_of
from imubench_pipeline.sensor_model.imu import ImuModel
from imubench_pipeline.sensor_model.low_pass import LowPass
from imubench_pipeline.sensor_model.model import SensorModel, TemperatureDrift
from imubench_pipeline.sensor_model.settings import ModelSettings
from imubench_pipeline.simulate import channel_rng
from imubench_pipeline.tables import read
from imubench_pipeline.units import dimension_of, to_si
from imubench_pipeline.validation import ConfigError, parse, read_yaml

_LOW = 1e-4
"""rad a sample, far below every cut-off."""

_REGISTER = 1 << 15
"""Steps of a register of 16 bits on each side of 0."""


@dataclass
class Origin:
    """A model, and what it stands on.

    Attributes
    ----------
    imu : ImuModel
    said : str
        What the figures are from, in words.
    figures : dict of str to list of str
        The figures of each channel, with their source.
    assumed : list of str
        What no source says.
    sensor : str or None
        Name of the sensor file that its logs go with.
    """

    imu: ImuModel
    said: str
    figures: dict[str, list[str]] = field(default_factory=dict)
    assumed: list[str] = field(default_factory=list)
    sensor: str | None = None


def from_file(path: Path) -> Origin:
    """Read a file of models (see `settings`).

    Raises
    ------
    ConfigError
        If it is not there, or a figure cannot be used.
    """
    given = parse(ModelSettings, read_yaml(path), str(path))
    named = f"{path.name}" + (f" ({given.source})" if given.source else "")
    figures = {str(name): [f"as {path.name} has it"] for name in given.axes}
    return Origin(given.si(), f"the model file {named}", figures, [], given.sensor)


def from_datasheet(name: str, sensor: Sensor, seed: int) -> Origin:
    """Build the model that a datasheet describes.

    Typical figures are taken. The bias is the printed offset with a sign that is drawn, and so is
    the coefficient of temperature; bias instability is flicker noise where no correlation time is
    printed.

    Parameters
    ----------
    name : str
        Of the sensor file.
    sensor : Sensor
    seed : int
        For the signs.

    Raises
    ------
    ConfigError
        If no noise is printed for any channel of its log format.
    """
    document = sensor.datasheet.document or "the sensor file"
    found = Origin(ImuModel(axes={}), f"the datasheet of {name}: {document}", sensor=name)
    axes: dict[str, SensorModel] = {}
    for channel in (name for name in CHANNELS if name in sensor.log.channels):
        axis = _Printed(sensor, channel, found)
        noise = axis.noise()
        if noise is None:
            found.figures.pop(channel)
            found.assumed.append(f"{channel} is left out: no noise is printed of it")
            continue
        drawn = channel_rng(seed, name, channel, "signs").choice([-1.0, 1.0], 2)
        signs = (float(drawn[0]), float(drawn[1]))
        axes[channel] = axis.model(noise, signs)
    if not axes:
        raise ConfigError(
            f"{name}: the datasheet prints no noise density, random walk or rms noise of any "
            "channel; expected one, or --results, or a file of models"
        )
    found.imu = ImuModel(axes=axes)
    found.assumed = list(dict.fromkeys(found.assumed))
    return found


class _Printed:
    """What a datasheet prints of one axis."""

    def __init__(self, sensor: Sensor, channel: str, origin: Origin) -> None:
        self._sensor, self._channel = sensor, channel
        self._quantity, self._axis = quantity_of(channel), channel[-1]
        sheet: QuantityDatasheet | None = getattr(sensor.datasheet, self._quantity)
        self._sheet = sheet or QuantityDatasheet()
        self._said = origin.figures.setdefault(channel, [])
        self._assumed = origin.assumed

    def noise(self) -> NoiseModel | None:
        rows = [row for row in comparables(self._sensor.datasheet, self._channel) if row.value]
        density = _best([row for row in rows if row.statistic == "N"])
        if density is None or density.value is None:
            return None
        self._say("N", density)
        if density.figure and density.quantity == "N" and "assumed" in (density.reason or ""):
            self._assumed.append(
                f"{self._quantity}: the printed noise density is one-sided (N is it / sqrt(2))"
            )
        B = T_B = K = None
        floor = _best([row for row in rows if row.statistic == "adev_minimum"])
        time = _best([row for row in rows if row.statistic == "T_B"])
        walk = _best([row for row in rows if row.statistic == "K"])
        if floor is not None and floor.value:
            self._say("bias instability", floor)
            B, T_B = floor.value / FLOOR, time.value if time else None
            self._assumed.append(
                f"{self._quantity}: B is the printed bias instability / {FLOOR:.3f}"
                + ("" if T_B else ", as flicker noise: no correlation time is printed")
            )
        else:
            self._assumed.append(f"{self._quantity}: no bias instability, it is not printed")
        if walk is not None and walk.value:
            self._say("K", walk)
            K = walk.value
        else:
            self._assumed.append(f"{self._quantity}: no random walk K, it is not printed")
        return NoiseModel(N=density.value, B=B or 0.0, T_B=T_B, K=K or 0.0)

    def model(self, noise: NoiseModel, signs: Sequence[float]) -> SensorModel:
        bias = self._single("offset", "bias")
        if bias is not None:
            self._assumed.append(f"{self._quantity}: signs of bias and temperature drift are drawn")
        slope = self._single("temperature_coefficient", "temperature sensitivity")
        drift = None
        if slope is not None:
            drift = TemperatureDrift(sensitivity=signs[1] * slope)
            self._assumed.append(f"{self._quantity}: no drift at 25 degC, and no thermal lag")
        else:
            self._assumed.append(
                f"{self._quantity}: no drift with temperature, no coefficient is printed"
            )
        step = self._step()
        return SensorModel(
            noise=noise,
            bias=signs[0] * bias if bias else 0.0,
            drift=drift,
            low_pass=self._low_pass(),
            resolution=step or 0.0,
            full_scale=self._full_scale(step),
        )

    def _low_pass(self) -> LowPass | None:
        stated = self._sensor.log.bandwidth
        printed = self._single("bandwidth", "cut-off") if stated is None else None
        if stated is not None:
            self._said.append(f"cut-off {stated}: of the log format")
            printed = to_si(float(stated.split()[0]), stated.split(maxsplit=1)[1], "frequency")
        if printed is None:
            self._assumed.append(f"{self._quantity}: no low-pass, its cut-off is not known")
            return None
        self._assumed.append(f"{self._quantity}: the low-pass is of first order")
        return LowPass(printed)

    def _step(self) -> float | None:
        for figure in self._typical("resolution"):
            value = figure.on_axis(self._axis)
            if not isinstance(value, float) or figure.unit is None:
                continue
            dimensions = FIGURE_DIMENSIONS[self._quantity]["resolution"]
            dimension = dimension_of(figure.unit, dimensions)
            found = to_si(value, figure.unit, dimension)
            self._said.append(f"resolution {value:g} {figure.unit}: {figure.kind}, datasheet")
            return 1.0 / found if dimension.endswith("sensitivity") else found
        self._assumed.append(f"{self._quantity}: not rounded, no resolution is printed")
        return None

    def _full_scale(self, step: float | None) -> float | None:
        (dimension,) = FIGURE_DIMENSIONS[self._quantity]["full_scale"]
        for figure in self._typical("full_scale", choices=True):
            value = figure.on_axis(self._axis)
            if value is None or figure.unit is None:
                continue
            values = [value] if isinstance(value, float) else list(value)
            ranges = [to_si(each, figure.unit, dimension) for each in values]
            chosen = len(ranges) - 1
            if step is not None and len(ranges) > 1:
                # The resolution is printed for the range that a register of 16 bits then has.
                chosen = int(np.argmin(np.abs(np.log(np.array(ranges) / (step * _REGISTER)))))
            self._said.append(f"full scale {values[chosen]:g} {figure.unit}: datasheet")
            if len(ranges) > 1:
                self._assumed.append(f"{self._quantity}: range {values[chosen]:g} {figure.unit}")
            return ranges[chosen]
        self._assumed.append(f"{self._quantity}: no saturation, no full scale is printed")
        return None

    def _single(self, name: str, label: str) -> float | None:
        """Return a figure that is one number, in SI."""
        (dimension,) = FIGURE_DIMENSIONS[self._quantity][name]
        for figure in self._typical(name):
            value = figure.on_axis(self._axis)
            if isinstance(value, float) and figure.unit is not None:
                self._said.append(f"{label} {value:g} {figure.unit}: {figure.kind}, datasheet")
                return to_si(value, figure.unit, dimension)
        return None

    def _typical(self, name: str, *, choices: bool = False) -> list[PrintedFigure]:
        """Return the figures of a name for the logged options, typical ones first."""
        options = self._sensor.datasheet.options
        printed = self._sheet.printed(name)
        logged = [one for one in printed if one.option is None or one.option in options] or printed
        usable = [one for one in logged if choices or one.kind not in ("choices", "range")]
        return sorted(usable, key=lambda one: one.kind not in ("typ", "1sigma"))

    def _say(self, name: str, row: Comparable) -> None:
        assert row.figure is not None  # it has a value
        why = f" ({row.reason})" if row.reason else ""
        self._said.append(
            f"{name} {row.printed:g} {row.figure.unit}: {row.figure.kind}, datasheet{why}"
        )


def _best(rows: Sequence[Comparable]) -> Comparable | None:
    """Return the figure that leaves least to assume: typical, and of a stated side."""

    def doubt(row: Comparable) -> tuple[bool, bool, bool]:
        assert row.figure is not None  # it has a value
        unsure = row.figure.sidedness == "unknown" and row.sidedness is not None
        rms = (row.reason or "").startswith("rms")
        return (row.figure.kind not in ("typ", "1sigma", "derived"), unsure and not rms, rms)

    return min(rows, key=doubt, default=None)


def with_estimates(found: Origin, results: Path, name: str, recording: str | None = None) -> Origin:
    """Put what a run has estimated in the place of printed figures.

    Noise and bias are taken, as the recommended method estimates them, of the longest recording;
    resolution, full scale, low-pass and drift stay as the datasheet has them.

    Parameters
    ----------
    found : Origin
        What is known without them; its channels may be none.
    results : Path
        Folder of the results of a run.
    name : str
        Of the sensor file.
    recording : str, optional

    Raises
    ------
    ConfigError
        If there is no estimate of the sensor, or of the recording.
    """
    folder = results / "tables" if (results / "tables").is_dir() else results
    needed = ("recordings", "parameters", "fixed_bias")
    try:
        tables = {one: read(one, [folder / f"{one}.parquet"]) for one in needed}
    except (OSError, ValueError) as error:
        raise ConfigError(f"{folder}: not the tables of a run: {error}") from error
    mine = tables["recordings"].filter(pc.equal(tables["recordings"]["sensor"], name))
    usable = [row for row in mine.to_pylist() if row["status"] == "ok"]
    if not usable:
        there = ", ".join(sorted(set(tables["recordings"]["sensor"].to_pylist()))) or "none"
        raise ConfigError(f"{folder}: no estimate of sensor {name!r}; there are: {there}")
    about = {row["recording"]: row for row in usable}
    if recording is not None and recording not in about:
        raise ConfigError(
            f"{folder}: no recording {recording!r} of {name}; there are: {', '.join(about)}"
        )
    chosen = recording or max(about, key=lambda key: (about[key]["duration"], key))
    rows = _of(tables["parameters"].to_pylist(), name, chosen)
    biases = {
        row["channel"]: row["value"] for row in _of(tables["fixed_bias"].to_pylist(), name, chosen)
    }
    axes: dict[str, SensorModel] = {}
    figures: dict[str, list[str]] = {}
    for channel in CHANNELS:
        own = [row for row in rows if row["channel"] == channel and row["recommended"]]
        if not own:
            continue
        estimate = estimate_of(str(own[0]["method"]), own)
        printed = found.imu.axes.get(channel) or SensorModel()
        bias = biases.get(channel)
        gravity = quantity_of(channel) == "accel"
        axes[channel] = replace(
            printed,
            noise=before_the_filter(printed, estimate.model, float(about[chosen]["rate"])),
            bias=printed.bias if bias is None or gravity else float(bias),
        )
        kept = [
            line
            for line in found.figures.get(channel, [])
            if line.split()[0] in ("resolution", "full", "cut-off", "temperature")
            or (gravity and line.startswith("bias "))
        ]
        figures[channel] = [
            f"noise {estimate.model.name}: estimated by {estimate.method} from {name}/{chosen}, N "
            "taken back to before low-pass and rounding",
            *([] if bias is None or gravity else [f"bias {bias:g} rad/s: mean of {chosen}"]),
            *kept,
        ]
    if not axes:
        raise ConfigError(f"{folder}: no estimate of {name}/{chosen}")
    noisy = ("bias instability", "random walk", "noise density", " B is ", "is left out")
    assumed = [line for line in found.assumed if not any(word in line for word in noisy)]
    if about[chosen]["simulated"]:
        assumed.append(f"{name}/{chosen} is itself simulated")
    if any(quantity_of(channel) == "accel" for channel in axes):
        assumed.append("accel: the mean of a recording is mostly gravity, so it is no bias here")
    imu = ImuModel(axes=axes)
    said = f"the estimates of a run in {results}, from the recording {name}/{chosen}"
    return Origin(imu, said, figures, assumed, name)


def only(origin: Origin, channels: Sequence[str]) -> Origin:
    """Return a model with some of its channels.

    Raises
    ------
    ConfigError
        If it has no such channel.
    """
    if missing := [name for name in channels if name not in origin.imu.axes]:
        there = ", ".join(origin.imu.axes) or "none"
        raise ConfigError(f"no figures of {missing[0]}; there are those of {there}")
    axes = {name: axis for name, axis in origin.imu.axes.items() if name in channels}
    figures = {name: lines for name, lines in origin.figures.items() if name in channels}
    return replace(origin, imu=replace(origin.imu, axes=axes), figures=figures)


def before_the_filter(model: SensorModel, noise: NoiseModel, rate: float) -> NoiseModel:
    """Return noise with N as it is before filter and rounding, from N as a log shows it.

    Sampling folds into the log what lies above Nyquist, and a register adds LSB^2 / 12 a sample.

    Parameters
    ----------
    model : SensorModel
        Of which filter and resolution are taken.
    noise : NoiseModel
        As estimated from a log.
    rate : float
        Of the log, Hz.
    """
    left = max(noise.N**2 - model.resolution**2 / (12.0 * rate), 0.0)
    return replace(noise, N=math.sqrt(left / folding(model, rate)))


def folding(model: SensorModel, rate: float) -> float:
    """Return how many times N^2 the density of the samples is at low frequencies.

    Parameters
    ----------
    model : SensorModel
    rate : float
        Hz.
    """
    unit = replace(model, noise=NoiseModel(N=1.0), resolution=0.0)
    return float(unit.sampled_spectrum(np.array([_LOW]), rate)[0]) / rate


def _of(rows: Iterable[Mapping[str, Any]], sensor: str, recording: str) -> list[Mapping[str, Any]]:
    return [row for row in rows if row["sensor"] == sensor and row["recording"] == recording]
