"""Build the model of a sensor from its datasheet; missing figures are assumed and listed."""

from collections.abc import Sequence

import numpy as np

from imubench_pipeline.datasheets.comparable import Comparable, read_comparables
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, PrintedFigure, QuantityDatasheet
from imubench_pipeline.settings.sensor import CHANNELS, Sensor, quantity_of
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.simulate.imu import ImuModel
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift
from imubench_pipeline.simulate.models import Origin, Remark, Topic
from imubench_pipeline.units import convert_to_si, find_dimension, parse_quantity
from imubench_pipeline.words.findings.base import channel_name
from imubench_pipeline.words.numbers import number_text
from imubench_pipeline.words.reasons import simulations as texts

_STEPS_PER_SIDE = 1 << 15  # steps on each side of 0 of a 16-bit register


def from_datasheet(name: str, sensor: Sensor, seed: int) -> Origin:
    """Build the model of a sensor from its datasheet; ``name`` is the name of the sensor file.

    Typical figures are used. Bias and temperature coefficient are the printed figures with random
    signs from the seed. Bias instability is flicker noise if no correlation time is printed. Raises
    ConfigError if no noise is printed for any channel of the log format.
    """
    source = texts.of_data_sheet(name, sensor.datasheet.document)
    origin = Origin(ImuModel(axes={}), source, sensor=name)
    axes: dict[str, SensorModel] = {}
    for channel in (name for name in CHANNELS if name in sensor.log.channels):
        axis = _Printed(sensor, channel, origin)
        noise = axis.noise()
        if noise is None:
            origin.figures.pop(channel)
            origin.assume(
                "noise", f"{channel_name(channel)} is not included, as no noise of it is printed"
            )
            continue
        signs = channel_rng(seed, name, channel, "signs").choice([-1.0, 1.0], 2)
        axes[channel] = axis.model(noise, [float(sign) for sign in signs])
    if not axes:
        raise ConfigError(
            f"{name}: the datasheet prints no noise density, random walk or rms noise of any "
            "channel; add one to the sensor file, or use --results or a file of models"
        )
    origin.imu = ImuModel(axes=axes)
    return origin


class _Printed:
    def __init__(self, sensor: Sensor, channel: str, origin: Origin) -> None:
        self._sensor, self._channel = sensor, channel
        self._quantity, self._axis = quantity_of(channel), channel[-1]
        sheet: QuantityDatasheet | None = getattr(sensor.datasheet, self._quantity)
        self._sheet = sheet or QuantityDatasheet()
        self._remarks = origin.figures.setdefault(channel, [])
        self._origin = origin

    def noise(self) -> NoiseModel | None:
        rows = [row for row in read_comparables(self._sensor.datasheet, self._channel) if row.value]
        density = _select_best([row for row in rows if row.statistic == "N"])
        if density is None or density.value is None:
            return None
        self._note("N", density)
        if density.is_side_assumed:
            self._assume("noise", texts.ONE_SIDED_DENSITY)
        B = T_B = K = None
        floor = _select_best([row for row in rows if row.statistic == "adev_minimum"])
        time = _select_best([row for row in rows if row.statistic == "T_B"])
        walk = _select_best([row for row in rows if row.statistic == "K"])
        if floor is not None and floor.value:
            self._note("bias instability", floor)
            B, T_B = floor.value / FLOOR, time.value if time else None
            text = f"B is the printed bias instability / {number_text(FLOOR, 3)}"
            if not T_B:
                text += ", as flicker noise, because no correlation time is printed"
            self._assume("noise", text)
        else:
            self._assume("noise", texts.NO_BIAS_INSTABILITY)
        if walk is not None and walk.value:
            self._note("K", walk)
            K = walk.value
        else:
            self._assume("noise", texts.NO_RANDOM_WALK)
        return NoiseModel(N=density.value, B=B or 0.0, T_B=T_B, K=K or 0.0)

    def model(self, noise: NoiseModel, signs: Sequence[float]) -> SensorModel:
        bias = self._single("offset", "bias", "bias")
        if bias is not None:
            self._assume("bias", texts.BIAS_SIGN_DRAWN)
        slope = self._single("temperature_coefficient", "drift", "temperature sensitivity")
        drift = None
        if slope is not None:
            drift = TemperatureDrift(sensitivity=signs[1] * slope)
            self._assume("drift", texts.DRIFT_SIGN_DRAWN)
        else:
            self._assume("drift", texts.NO_DRIFT)
        steps = (self._single(name, "register", name) for name in ("sensitivity", "resolution"))
        step = next((each for each in steps if each is not None), None)
        if step is None:
            self._assume("register", texts.NOT_ROUNDED)
        stated = self._sensor.log.bandwidth
        if stated is not None:
            self._remarks.append(Remark("low-pass", f"cut-off {stated}: stated for the log"))
            cutoff: float | None = parse_quantity(stated, "frequency")
        else:
            cutoff = self._single("bandwidth", "low-pass", "cut-off")
        filtered = "the low-pass is of first order"
        unknown = "no low-pass, as no cut-off is known"
        self._assume("low-pass", unknown if cutoff is None else filtered)
        return SensorModel(
            noise=noise,
            bias=signs[0] * bias if bias else 0.0,
            drift=drift,
            low_pass=None if cutoff is None else LowPass(cutoff),
            resolution=step or 0.0,
            full_scale=self._full_scale(step),
        )

    def _full_scale(self, step: float | None) -> float | None:
        (dimension,) = FIGURE_DIMENSIONS[self._quantity]["full_scale"]
        for figure in self._typical("full_scale", choices=True):
            value = figure.on_axis(self._axis)
            if value is None or figure.unit is None:
                continue
            values = [value] if isinstance(value, float) else list(value)
            ranges = [convert_to_si(each, figure.unit, dimension) for each in values]
            chosen = len(ranges) - 1
            if step is not None and len(ranges) > 1:
                # The printed sensitivity belongs to the range that it gives with a 16-bit register.
                chosen = int(np.argmin(np.abs(np.log(np.array(ranges) / (step * _STEPS_PER_SIDE)))))
            text = f"full scale {number_text(values[chosen])} {figure.unit}: datasheet"
            self._remarks.append(Remark("register", text))
            if len(ranges) > 1:
                self._assume("register", f"range {number_text(values[chosen])} {figure.unit}")
            return ranges[chosen]
        self._assume("register", texts.NO_SATURATION)
        return None

    def _assume(self, topic: Topic, text: str) -> None:
        self._origin.assume(topic, f"{self._quantity}: {text}")

    def _single(self, name: str, topic: Topic, label: str) -> float | None:
        """Return a figure with a single value, in SI; of steps a unit, the step; None without."""
        for figure in self._typical(name):
            value = figure.on_axis(self._axis)
            if isinstance(value, float) and figure.unit is not None:
                text = texts.printed_figure(label, value, figure.unit, figure.kind)
                self._remarks.append(Remark(topic, text))
                dimension = find_dimension(figure.unit, FIGURE_DIMENSIONS[self._quantity][name])
                in_si = convert_to_si(value, figure.unit, dimension)
                return 1.0 / in_si if dimension.endswith("sensitivity") else in_si
        return None

    def _typical(self, name: str, *, choices: bool = False) -> list[PrintedFigure]:
        """Return the figures of a name for the logged options, typical ones first."""
        options = self._sensor.datasheet.options
        printed = self._sheet.printed(name)
        logged = [each for each in printed if each.option is None or each.option in options]
        several = ("choices", "range")
        usable = [each for each in logged or printed if choices or each.kind not in several]
        return sorted(usable, key=lambda figure: figure.kind not in ("typ", "1sigma"))

    def _note(self, name: str, row: Comparable) -> None:
        assert row.figure is not None  # it has a value
        printed, unit = row.printed or 0.0, row.figure.unit or ""
        text = texts.printed_figure(name, printed, unit, row.figure.kind, row.reason)
        self._remarks.append(Remark("noise", text))


def _select_best(rows: Sequence[Comparable]) -> Comparable | None:
    """Return the figure with the fewest assumptions: typical, and of known sidedness."""

    def doubt(row: Comparable) -> tuple[bool, bool, bool]:
        assert row.figure is not None  # it has a value
        unsure = row.figure.sidedness == "unknown" and row.sidedness is not None
        kind = row.figure.kind not in ("typ", "1sigma", "derived")
        return kind, unsure and not row.is_rms, row.is_rms

    return min(rows, key=doubt, default=None)
