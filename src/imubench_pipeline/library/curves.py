"""Allan curves of logs, arrays and tables, by channel."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline import allan
from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.allan.threads import count_threads
from imubench_pipeline.estimators.rows import make_allan_rows
from imubench_pipeline.library import drawing, given
from imubench_pipeline.library.logs import Log
from imubench_pipeline.library.shown import ByChannel, summarise
from imubench_pipeline.recordings.recording import ChannelLog
from imubench_pipeline.settings.sensor import TEMPERATURE, quantity_of
from imubench_pipeline.steps.allan import curve_of, report_too_sparse
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.units import SI_UNITS
from imubench_pipeline.words.numbers import number_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

Overlap = Literal["full", "octave"]
_SUMMARY_HEADS = ("channel", "tau", "from", "to", "at the shortest", "lowest", "at tau")
_TABLE_COLUMNS = ("tau", "adev", "lower", "upper", "edf", "cluster_size", "averaged", "exponent",
                  "share")  # fmt: skip


@dataclass(frozen=True, repr=False)
class Curve(AllanCurve):
    """An Allan curve with plots and tables.

    Attributes
    ----------
    channel : str or None
        With a channel the curve is in SI; without one it is in the unit of the samples.
    """

    channel: str | None = None

    @property
    def quantity(self) -> str | None:
        """``gyro`` or ``accel``; None: not known."""
        return None if self.channel is None else quantity_of(self.channel)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the deviation with 95 % limits, and the slopes of noise terms in grey."""
        axes: Axes = drawing.get_axes(ax)
        drawing.draw_curves(axes, {self.channel or "Allan deviation": self}, self.quantity)
        return axes

    def to_pandas(self) -> "pd.DataFrame":
        """Return a row for each tau: deviation, 95 % limits, degrees of freedom; units in attrs."""
        return _make_table([self])

    def __repr__(self) -> str:
        title = f"Allan curve{'' if self.channel is None else f' of {self.channel}'}"
        return summarise(f"{title}, {self.samples:,} samples", _SUMMARY_HEADS, [_make_row(self)])


class Curves(ByChannel[Curve]):
    """Allan curves by channel, in SI.

    Attributes
    ----------
    name : str
        Name of the log.
    """

    def __init__(self, curves: Iterable[Curve], name: str = "") -> None:
        self._by_channel = {str(curve.channel): curve for curve in curves}
        self.name = name

    def plot(self, ax: "Axes | Sequence[Axes] | None" = None) -> Any:
        """Draw the curves, one panel per quantity; return the axes, shape (quantities,)."""
        by_quantity: dict[str, dict[str, AllanCurve]] = {}
        for channel, curve in self.items():
            by_quantity.setdefault(quantity_of(channel), {})[channel] = curve
        axes = drawing.create_panels([*by_quantity], ax)
        for panel, (quantity, curves) in zip(axes, by_quantity.items(), strict=True):
            drawing.draw_curves(panel, curves, quantity)
        return axes

    def to_pandas(self) -> "pd.DataFrame":
        """Return a row for each channel and tau, like the workflow's table ``allan``, in SI."""
        return _make_table(self.values())

    def __repr__(self) -> str:
        title = f"Allan curves{f' of {self.name}' if self.name else ''}"
        return summarise(title, _SUMMARY_HEADS, [_make_row(curve) for curve in self.values()])


def measured(
    log: ChannelLog, sizes: ArrayLike | None, overlap: Overlap, threads: int
) -> Curve | None:
    """Return the curve at cluster sizes of shape (m,); None if too many samples are missing."""
    curve = curve_of(log, sizes, overlap, threads=threads)
    return Curve(**vars(curve), channel=log.channel) if len(curve.tau) else None


def _make_row(curve: Curve) -> list[str]:
    unit = drawing.choose_deviation_unit(curve.quantity)
    lowest = int(np.argmin(curve.deviation))
    sign = "" if curve.quantity is None else f" {unit.sign}"
    return [
        curve.channel or "-",
        str(len(curve.tau)),
        *(f"{number_text(tau, 3)} s" for tau in (curve.tau[0], curve.tau[-1])),
        *(f"{unit.text(curve.deviation[place], 3)}{sign}" for place in (0, lowest)),
        f"{number_text(curve.tau[lowest], 3)} s",
    ]


def _make_table(curves: Iterable[Curve]) -> "pd.DataFrame":
    import pandas as pd

    rows = []
    for curve in curves:
        unit = None if curve.channel is None else SI_UNITS[given.get_dimension(curve.channel)]
        for row in make_allan_rows(Key("", "", curve.channel or ""), curve):
            kept = {key: getattr(row, key) for key in _TABLE_COLUMNS}
            rows.append(({"channel": curve.channel, "unit": unit} if unit else {}) | kept)
    table = pd.DataFrame(rows)
    table.attrs["units"] = {"tau": "s"}
    return table


def allan_variance(
    data: Any,
    rate: float | str | None = None,
    *,
    channels: given.Channels | None = None,
    units: given.Units | None = None,
    cluster_sizes: ArrayLike | None = None,
    overlap: Overlap = "full",
    valid: ArrayLike | None = None,
    segments: Sequence[tuple[int, int]] | None = None,
    threads: int | None = None,
) -> Curve | Curves:
    """Return the overlapping Allan variance, with confidence limits.

    Parameters
    ----------
    data : Log, array_like, DataFrame, or mapping of str to array_like
        A log; samples of shape (L,), (L, 3) or (L, 6), SI unless ``units`` say otherwise; or a
        table whose columns are channels with units, such as ``gyro_x [deg/s]``. NaN marks a
        missing sample.
    rate : float or str, optional
        Sampling rate, Hz, or with its unit: ``"100 Hz"``. A log has its own.
    channels : str or sequence of str, optional
        For an array of several columns, the channels of the columns; ``"gyro"`` and ``"accel"`` are
        three axes (six columns are gyro_x to accel_z). For a log or table, the selected channels.
    units : mapping of str to str, optional
        Units, by ``gyro`` and ``accel`` or by channel: ``{"gyro": "deg/s", "accel": "g"}``.
    cluster_sizes : array_like of int, optional
        Samples n of a cluster for each tau, log-spaced by default.
    overlap : {"full", "octave"}
        ``full``: all clusters. ``octave``: clusters that start 1/48 of their length apart, which is
        many times faster, with practically the same confidence limits.
    valid : array_like of bool, shape (L,), optional
        False where a sample is missing.
    segments : sequence of (int, int), optional
        First and one-past-last sample of each segment; no difference spans two. A log has its own.
    threads : int, optional
        By default one for each core. The result has the same bits for any number.

    Returns
    -------
    Curve or Curves
        For samples of shape (L,) one `imubench_pipeline.allan.AllanCurve` in their unit, else a
        mapping of channels to curves in SI. Knocks are left out of logs, but not of arrays.

    Raises
    ------
    ValueError
        If the shape, the rate, a unit (`UnitError`) or another argument cannot be used, or a
        channel has no number.

    References
    ----------
    IEEE Std 952-2020; see `imubench_pipeline.allan.allan_variance`.

    Examples
    --------
    >>> import numpy as np, imubench_pipeline as imu
    >>> samples = np.random.default_rng(1).normal(0.0, 0.1, (10_000, 3))
    >>> curves = imu.allan_variance(samples, "100 Hz", channels="gyro", units={"gyro": "deg/s"})
    >>> curves
    Allan curves
      channel  tau  from    to      at the shortest  lowest    at tau
      gyro_x   34   0.01 s  39.8 s  362 °/h          3.52 °/h  39.8 s
      gyro_y   34   0.01 s  39.8 s  351 °/h          3.85 °/h  31.6 s
      gyro_z   34   0.01 s  39.8 s  354 °/h          3.75 °/h  39.8 s
    """
    cores = count_threads(threads)
    if isinstance(data, Log):
        if rate is not None or units is not None or valid is not None or segments is not None:
            raise ValueError(
                "a Log has its own rate, units, missing samples and segments; omit rate=, units=, "
                "valid= and segments="
            )
        chosen = data.chosen(channels)
        curves = [measured(log, cluster_sizes, overlap, cores) for log in chosen.values()]
        if not any(curves):
            reasons = [report_too_sparse(name, log).detail for name, log in chosen.items()]
            raise ValueError(f"{data.name}: {'; '.join(reasons)}")
        return Curves((curve for curve in curves if curve is not None), data.name)
    hertz = given.read_rate(rate, data)

    def of_samples(samples: Any, channel: str | None) -> Curve:
        curve = allan.allan_variance(
            samples,
            hertz,
            cluster_sizes=cluster_sizes,
            overlap=overlap,
            valid=valid,
            segments=segments,
            threads=cores,
        )
        return Curve(**vars(curve), channel=channel)

    if channels is None and units is None and not given.has_columns(data):
        samples = given.convert_to_numbers(data, "the array")
        if samples.ndim == 1:
            given.check_present(samples, "the array")
            return of_samples(samples, None)
    return Curves(
        of_samples(column.in_si(name), name)
        for name, column in given.read_columns(data, channels, units).items()
        if name != TEMPERATURE
    )
