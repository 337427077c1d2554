"""Convert printed figures to SI, in the convention of the estimate that they are compared with.

A printed noise density is mostly one-sided, and N is this density divided by √2. If the datasheet
does not say, both readings are returned. A printed bias instability is the minimum of the Allan
deviation, 0.664 B with a plateau. A temperature coefficient can be compared with the sensitivity of
a static log; a total or an rms over temperature cannot.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from imubench_pipeline.noise import FLOOR
from imubench_pipeline.settings.printed import (
    FIGURE_DIMENSIONS,
    Datasheet,
    PrintedFigure,
    QuantityDatasheet,
    Sidedness,
    compute_noise_bandwidth,
    convert_density,
    convert_power_density,
    noise_of_rms,
)
from imubench_pipeline.units import convert_to_si, find_dimension
from imubench_pipeline.words.reasons import datasheets as texts

_SIDEDNESS_READINGS: dict[str, tuple[Sidedness, ...]] = {
    "one-sided": ("one-sided",),
    "two-sided": ("two-sided",),
    "unknown": ("one-sided", "two-sided"),
}


SENSITIVITY = "sensitivity"  # name of the statistic of a printed temperature coefficient


@dataclass(frozen=True)
class Comparable:
    """A printed figure in SI, in the convention of the estimate that it is compared with."""

    # quantity, statistic: the printed quantity, and the statistic of an estimate to compare it with
    quantity: str
    statistic: str
    figure: PrintedFigure | None  # None: not published, or not looked up
    sidedness: str | None = None  # how a noise density is read: one-sided or two-sided
    # SI; None if nothing is published, or it cannot be compared. The worse end of a range
    value: float | None = None
    reason: str | None = None  # how it was converted, or the reason without a value
    printed: float | None = None  # as printed for the axis
    least: float | None = None  # the better end of a printed range
    # lower, upper: smallest and largest printed value, such as typ and max
    lower: float | None = None
    upper: float | None = None
    obstacle: str | None = None  # why it cannot be compared with a static log
    tau: float | None = None  # averaging time of a printed Allan deviation, s
    is_side_assumed: bool = False  # the document does not say whether it is one- or two-sided
    is_rms: bool = False  # printed as an rms, and converted with the bandwidth
    looked_up: bool = True  # False: the sensor file does not say whether the vendor publishes it


@dataclass(frozen=True)
class PrintedAxis:
    """The datasheet figures of one axis of a quantity."""

    sheet: QuantityDatasheet
    options: Sequence[str]  # grades, ranges and modes that the logged sensors have
    # quantity, axis: ``gyro`` or ``accel``; ``x``, ``y`` or ``z``
    quantity: str
    axis: str

    @classmethod
    def of(cls, datasheet: Datasheet, channel: str) -> "PrintedAxis":
        """Return the datasheet figures of a channel, such as ``gyro_x``."""
        quantity, axis = channel.split("_")
        sheet = getattr(datasheet, quantity) or QuantityDatasheet()
        return cls(sheet, datasheet.options, quantity, axis)

    def si(self, name: str) -> Callable[[float, PrintedFigure], float]:
        """Return a function that converts a number of a printed figure to SI by its unit only."""
        (dimension,) = FIGURE_DIMENSIONS[self.quantity][name]
        return lambda value, figure: convert_to_si(value, figure.unit or "", dimension)

    def read(
        self,
        name: str,
        like: Comparable,
        convert: Callable[[float, PrintedFigure], float],
        figures: Sequence[PrintedFigure] | None = None,
    ) -> list[Comparable]:
        """Return the figures of a name for this axis, as copies of ``like`` with values.

        ``convert`` gives values in SI; ``figures`` are by default all printed under this name.
        Figures of options (settings of the sensor) that are not logged are returned only if no
        other figure is printed.
        """
        listed = [
            figure
            for figure in (self.sheet.printed(name) if figures is None else figures)
            if figure.kind != "choices" and figure.on_axis(self.axis) is not None
        ]
        logged = [f for f in listed if f.option is None or f.option in self.options]
        rows = [self._make_row(name, figure, like, convert) for figure in logged or listed]
        # Add the least and the largest figure of the same option.
        ends: dict[str | None, list[float]] = {}
        for row in rows:
            own = ends.setdefault(row.figure.option if row.figure else None, [])
            own += [value for value in (row.least, row.value) if value is not None]
        return [
            replace(row, lower=min(ends[row.figure.option]), upper=max(ends[row.figure.option]))
            if row.figure and row.value is not None
            else row
            for row in rows
        ]

    def _make_row(
        self,
        name: str,
        figure: PrintedFigure,
        like: Comparable,
        convert: Callable[[float, PrintedFigure], float],
    ) -> Comparable:
        printed = figure.on_axis(self.axis)
        ends = printed if isinstance(printed, tuple) else (printed or 0.0,)
        row = replace(
            like,
            figure=figure,
            printed=max(ends, key=lambda end: (abs(end), end)),
            obstacle=like.obstacle or self._find_obstacle(name, figure),
            tau=figure.tau_s,
        )
        if row.obstacle is not None:
            return row
        values = [convert(end, figure) for end in ends]
        least = min(values) if len(values) > 1 else None
        return replace(row, value=max(map(abs, values)), least=least)

    def _find_obstacle(self, name: str, figure: PrintedFigure) -> str | None:
        if figure.option is not None and figure.option not in self.options:
            return texts.other_option(figure.option, self.options)
        if figure.kind == "min":
            return texts.ONLY_MINIMUM
        if name == "rms_noise" and figure.bandwidth is None:
            return texts.RMS_WITHOUT_BANDWIDTH
        if name == "allan_deviation" and figure.tau is None:
            return texts.DEVIATION_WITHOUT_TIME
        return None

    def unpublished(self, like: Comparable, *names: str) -> Comparable:
        """Return ``like`` with the reason for its missing value: no figure ``names`` is printed."""
        looked_up = any(self.sheet.looked_up(name) for name in names)
        return replace(like, reason=texts.unpublished(looked_up=looked_up), looked_up=looked_up)


def read_comparables(datasheet: Datasheet, channel: str) -> Iterator[Comparable]:
    """Yield the printed N, bias instability, K and T_B of a channel, SI; rows may lack a figure."""
    axis = PrintedAxis.of(datasheet, channel)
    walk = Comparable("N", "N", None, reason=texts.WALK_IS_DENSITY)
    rms_to_si = axis.si("rms_noise")

    def convert_rms(value: float, figure: PrintedFigure) -> float:
        bandwidth = compute_noise_bandwidth(figure.bandwidth_hz or 0.0, figure.filter)
        return noise_of_rms(rms_to_si(value, figure), bandwidth)

    rms = Comparable("N", "N", None, "one-sided", reason=texts.density_of_rms(), is_rms=True)
    noise = [
        *_read_densities(axis),
        *axis.read("random_walk", walk, axis.si("random_walk")),
        *(
            replace(row, reason=texts.density_of_rms(row.figure.bandwidth, row.figure.filter))
            if row.figure and row.value is not None
            else row
            for row in axis.read("rms_noise", rms, convert_rms)
        ),
    ]
    names = ("noise_density", "random_walk", "rms_noise")
    yield from noise or [axis.unpublished(Comparable("N", "N", None), *names)]
    for name, quantity, statistic, reason in (
        ("bias_instability", "bias_instability", "adev_minimum", texts.CURVE_MINIMUM),
        ("bias_instability", "bias_instability", "plateau", texts.curve_plateau(FLOOR)),
        ("rate_random_walk", "K", "K", None),
        ("correlation_time", "T_B", "T_B", None),
    ):
        like = Comparable(quantity, statistic, None, reason=reason)
        yield from axis.read(name, like, axis.si(name)) or [axis.unpublished(like, name)]
    like = Comparable("allan_deviation", "adev", None, reason=texts.CURVE_AT_TIME)
    yield from axis.read("allan_deviation", like, axis.si("allan_deviation"))


def read_bias_comparables(datasheet: Datasheet, channel: str) -> Iterator[Comparable]:
    """Yield the datasheet figures of the fixed bias of a channel, and of its changes, SI.

    The offset is always yielded, other figures if they are published. Apart from the offset, only
    the temperature coefficient is comparable with a log.
    """
    axis = PrintedAxis.of(datasheet, channel)
    like = Comparable("offset", "mean", None)
    yield from axis.read("offset", like, axis.si("offset")) or [axis.unpublished(like, "offset")]
    name = "temperature_coefficient"
    yield from axis.read(name, Comparable(name, SENSITIVITY, None), axis.si(name))
    for name, obstacle in texts.ONE_LOG_OBSTACLES.items():
        like = Comparable(name, "mean", None, obstacle=obstacle)
        yield from axis.read(name, like, axis.si(name))


def _read_densities(axis: PrintedAxis) -> Iterator[Comparable]:
    dimensions = FIGURE_DIMENSIONS[axis.quantity]["noise_density"]
    figures = axis.sheet.printed("noise_density")
    for stated in dict.fromkeys(figure.sidedness for figure in figures):
        for sidedness in _SIDEDNESS_READINGS[stated]:

            def convert(value: float, figure: PrintedFigure, side: Sidedness = sidedness) -> float:
                unit = figure.unit or ""
                dimension = find_dimension(unit, dimensions)
                density = convert_to_si(value, unit, dimension)
                if dimension == dimensions[0]:
                    return convert_density(density, side)
                return convert_power_density(density, side)

            assumed = stated == "unknown"
            reason = texts.density_side(sidedness, assumed=assumed)
            yield from axis.read(
                "noise_density",
                Comparable("N", "N", None, sidedness, reason=reason, is_side_assumed=assumed),
                convert,
                [figure for figure in figures if figure.sidedness == stated],
            )
