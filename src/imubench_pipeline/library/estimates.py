"""Noise parameters of logs, arrays and tables, estimated by the functions of the workflow."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, get_args

from imubench_pipeline.allan import cluster_sizes
from imubench_pipeline.allan.threads import count_threads
from imubench_pipeline.datasheets.suspicion import UsualFigures, usual_figures
from imubench_pipeline.estimators.estimate import CURVE, SHOWN, Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.library.curves import Curve, Curves, measured
from imubench_pipeline.library.drawing import create_panels, draw_model, get_axes
from imubench_pipeline.library.given import Channels, Units, read_columns, read_rate
from imubench_pipeline.library.logs import Log, ingest_columns
from imubench_pipeline.library.shown import ByChannel, cut, summarise
from imubench_pipeline.model.recordings import DoubtRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.recordings.fitness import derive_doubts
from imubench_pipeline.registry import find_function
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.settings.config import AllanSettings, EstimateSettings, Method
from imubench_pipeline.settings.sensor import quantity_of, shipped_sensors
from imubench_pipeline.settings.validation import parse
from imubench_pipeline.steps.allan import report_too_sparse
from imubench_pipeline.steps.estimate import Estimation, estimate_channel
from imubench_pipeline.steps.sensor_tables import collect_findings
from imubench_pipeline.tables.findings import Finding, make_finding
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.units import parse_setting
from imubench_pipeline.words.estimates import STATUS_WORDS, symbol_text

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd
    from matplotlib.axes import Axes


_SUMMARY_HEADS = ("channel", "", "value", "95 % interval", "unit", "status")


@dataclass(frozen=True, repr=False)
class ChannelEstimate(Estimate):
    """The noise parameters of one channel.

    Attributes
    ----------
    channel : str
    measured : Curve or None
        The Allan curve of the channel.
    log : str
        Sensor and recording.
    """

    channel: str = ""
    measured: Curve | None = field(default=None, compare=False)
    log: str = "/"

    @property
    def quantity(self) -> str:
        """``gyro`` or ``accel``."""
        return quantity_of(self.channel)

    def __getitem__(self, parameter: str) -> Parameter:
        """Return a parameter in SI: Q, N, B, T_B, K, R, B_curve, sigma_min or tau_min."""
        known = {**self.parameters, **self.curve}
        if parameter not in known:
            raise KeyError(f"no parameter {parameter!r}; {self.method} has {', '.join(known)}")
        return known[parameter]

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw the measured curve with 95 % limits, the terms of the model, and their sum."""
        axes: Axes = get_axes(ax)
        assert self.measured is not None
        draw_model(axes, self.measured, self.model, self.quantity)
        axes.set_title(self.channel)
        return axes

    def to_pandas(self, units: System = "si") -> "pd.DataFrame":
        """Return a row for each parameter: see `Estimates.to_pandas`."""
        return _make_table([self], units)

    def __repr__(self) -> str:
        title = f"{self.channel} of {self.log}: {self.model.name}, by {self.method}"
        return summarise(title, _SUMMARY_HEADS, list(_make_rows(self)), _list_reasons([self]))


class Estimates(ByChannel[ChannelEstimate]):
    """The noise parameters of a log, by channel.

    Attributes
    ----------
    log : Log
        The log of the estimates; arrays are ingested like files.
    name : str
        Name of the log: sensor and recording.
    method : str
    findings : tuple of Finding
        Findings of ingest and estimation, as in a run with this log only.
    doubts : tuple of DoubtRow
        Reasons why values may be wrong, as in the same run.
    left_out : dict of str to str
        Channels without an estimate, with the reason.
    rows : Estimation
        The rows of the workflow's tables.
    """

    def __init__(
        self,
        estimates: Sequence[ChannelEstimate],
        log: Log,
        method: str,
        findings: Sequence[Finding],
        doubts: Sequence[DoubtRow],
        left_out: Mapping[str, str],
        rows: Estimation,
    ) -> None:
        self._by_channel = {estimate.channel: estimate for estimate in estimates}
        self.log, self.name, self.method = log, log.name, method
        self.findings, self.doubts = tuple(findings), tuple(doubts)
        self.left_out = dict(left_out)
        self.rows = rows

    @property
    def curves(self) -> Curves:
        """The Allan curves of the channels."""
        return Curves((one.measured for one in self.values() if one.measured), self.name)

    @property
    def models(self) -> dict[str, NoiseModel]:
        """The noise model of each channel."""
        return {channel: estimate.model for channel, estimate in self.items()}

    @property
    def model(self) -> NoiseModel:
        """The noise model of the only channel.

        Raises
        ------
        ValueError
            If there are several.
        """
        if len(self) != 1:
            raise ValueError(
                f"there are several models ({', '.join(self)}); use .models or [channel].model"
            )
        return next(iter(self.values())).model

    def plot(self, ax: "Axes | Sequence[Axes] | None" = None) -> Any:
        """Draw curve and terms of each channel; return the axes, shape (channels,)."""
        axes = create_panels([*self], ax)
        for panel, estimate in zip(axes, self.values(), strict=True):
            estimate.plot(panel)
        return axes

    def to_pandas(self, units: System = "si") -> "pd.DataFrame":
        """Return a row for each channel and parameter, like the workflow's table ``parameters``.

        Parameters
        ----------
        units : {"si", "practical"}
            Units of value and limits: SI, or deg/sqrt(h), deg/h, ug and similar. The column
            ``unit`` names the unit.
        """
        return _make_table(self.values(), units)

    def export(
        self,
        target: str,
        path: "str | Path | None" = None,
        *,
        mode: Literal["bench", "bounded", "in-use"] | None = None,
        axis: str = "worst",
        horizon: float | str = 60.0,
        rate: float | None = None,
        inflation: float = 1.0,
        because: str | None = None,
    ) -> str | bytes:
        """Return the input file of a filter or simulator, as `imubench export` writes it.

        Parameters
        ----------
        target : str
            The program, such as ``kalibr``; ``imubench formats`` lists all.
        path : str or Path, optional
            The file is also written to this path; an existing file is replaced.
        mode : {"bench", "bounded", "in-use"}, optional
            The noise at rest, an upper bound of it, or at least what the authors of the program use
            or recommend; by default ``bench``, and ``in-use`` for programs that fly.
        axis : {"worst", "median"}
            The axis that represents a quantity.
        horizon : float or str
            Longest time without a measurement, s.
        rate : float, optional
            Sampling rate of the program, Hz; by default the rate of the log.
        inflation : float
            Factor on every deviation, with its reason ``because``.
        because : str, optional
            Reason for the inflation, or for the use of an unfit log.

        Raises
        ------
        ValueError
            If the program is not known or cannot represent the noise, or the log is unfit.
        """
        options = {
            "axis": axis,
            "horizon": parse_setting(horizon, "time", "horizon"),
            "inflation": inflation,
            "because": because,
            "mode": mode,
            "rate": rate,
        }
        return find_function("export_estimates")(self, target, path, options)

    def __repr__(self) -> str:
        names = {estimate.model.name for estimate in self.values()}
        model = f": {names.pop()}" if len(names) == 1 else ""
        title = f"Estimates of {self.name}{model}, by {self.method}"
        rows = [row for estimate in self.values() for row in _make_rows(estimate)]
        notes = _list_reasons(self.values())
        notes += [f"{channel}: {reason}" for channel, reason in self.left_out.items()]
        serious = [f.finding for f in self.findings if f.severity != "note"]
        if serious:
            notes.append(f"warnings: {', '.join(dict.fromkeys(serious))} (see .findings)")
        return summarise(title, _SUMMARY_HEADS, rows, notes)


def estimate(
    data: Any,
    rate: float | str | None = None,
    *,
    method: Method = "robust",
    channels: Channels | None = None,
    units: Units | None = None,
    name: str = "samples",
    threads: int | None = None,
    **settings: Any,
) -> Estimates:
    """Estimate the noise parameters of each channel, with 95 % intervals.

    Parameters
    ----------
    data : Log, array_like, DataFrame, or mapping of str to array_like
        See `imubench_pipeline.allan_variance`; an array of shape (L,) is gyro_x unless ``channels``
        names another channel. Arrays are ingested like files: knocks are left out, and problems
        are reported as findings.
    rate : float or str, optional
        Sampling rate, Hz, or with its unit: ``"100 Hz"``. A log has its own.
    method : str
        ``robust`` (the Allan variance, with limits that also hold if the noise changes), or another
        of the workflow: ``likelihood`` (spectrum), ``likelihood_gm`` (the papers' N, B, T_B, K),
        ``compensated`` (without the temperature effect), ``weighted``, ``curve``, ``paper``.
    channels : str or sequence of str, optional
        For an array, the channels of the columns; for a log or table, the selected channels.
    units : mapping of str to str, optional
        Units, by ``gyro`` and ``accel`` or by channel; by default, arrays are in SI.
    name : str
        Name of the log, for an array or table.
    threads : int, optional
        Threads of the Allan variance; by default one for each core.
    **settings
        ``longest``, ``band`` and ``seed`` as under ``estimate`` of a run's configuration.

    Returns
    -------
    Estimates
        For a log with the same names as in a run, the numbers equal the run's.

    Raises
    ------
    ValueError
        If the data, a unit (`UnitError`), the method or a setting cannot be used.

    Examples
    --------
    >>> import imubench_pipeline as imu
    >>> gyro = imu.NoiseModel(N=8.7e-5, K=2e-5)
    >>> samples = imu.simulate(gyro, "10 Hz", duration="20 min", seed=1)
    >>> estimates = imu.estimate(samples, "10 Hz", channels="gyro_z")
    >>> N = estimates["gyro_z"]["N"]
    >>> N.lower < 8.7e-5 < N.upper
    True
    """
    if method not in get_args(Method):
        raise ValueError(f"method is {method!r}, expected one of {', '.join(get_args(Method))}")
    if isinstance(data, Log):
        if rate is not None or units is not None:
            raise ValueError("a Log has its own rate and units; omit rate= and units=")
        log = data
    else:
        log = ingest_columns(read_columns(data, channels, units), read_rate(rate, data), name)
    chosen = log.chosen(channels if log is data else None)
    if method == "compensated" and not any(kept.temperature for kept in chosen.values()):
        raise ValueError(f"{log.name} has no temperature, as {method} needs; use another method")
    # The doubts about a curve come from the likelihood: this method always runs.
    asked = tuple(dict.fromkeys(("likelihood", method)))
    how = parse(EstimateSettings, {**settings, "methods": asked}, "estimate")
    grid = AllanSettings()
    into = Estimation()
    estimates: list[ChannelEstimate] = []
    left_out: dict[str, str] = {}
    for channel, kept in chosen.items():
        sizes = cluster_sizes(kept.grid, per_decade=grid.per_decade, longest=grid.longest)
        curve = measured(kept, sizes, grid.overlap, count_threads(threads))
        key = Key(log.sensor, log.recording, channel)
        if curve is None:
            lack = report_too_sparse(channel, kept)
            into.add_findings(key, [lack])
            left_out[channel] = lack.detail
            continue
        estimate_channel(key, kept, curve, how, log.bandwidth, into)
        found = into.estimates[channel].get(method)
        if found is None:
            reasons = (
                row.reason or "the data do not favour it"
                for row in into.temperature
                if (row.channel, row.parameter) == (channel, "sensitivity")
            )
            left_out[channel] = next(reasons, "its clock has no readings of the temperature")
        else:
            values = {**vars(found), "channel": channel, "measured": curve, "log": log.name}
            estimates.append(ChannelEstimate(**values))
    if not estimates:
        raise ValueError(
            f"{log.name}: no channel is estimated by {method}: {'; '.join(left_out.values())}"
        )
    recommended = [row for row in into.parameters if row.recommended]
    rows = collect_findings(
        [log.quality],
        into.deterministic,
        into.estimate_findings,
        recommended,
        {} if log.declared is None else {log.sensor: log.declared},
        _usual_of_catalogue(),
    )
    doubted = list(derive_doubts(rows, recommended, into.models))
    return Estimates(estimates, log, method, list(map(make_finding, rows)), doubted, left_out, into)


@cache
def _usual_of_catalogue() -> UsualFigures:
    return usual_figures(shipped_sensors())


def _make_rows(estimate: ChannelEstimate) -> Iterator[list[str]]:
    order = {symbol: place for place, symbol in enumerate(SHOWN)}
    components = [
        (component, symbol, parameter)
        for component, symbol, parameter in estimate.components()
        if symbol in order and (parameter.value is not None or parameter.upper is not None)
    ]
    for component, symbol, parameter in sorted(components, key=lambda c: (c[0], order[c[1]])):
        unit = choose_page_unit(estimate.quantity, symbol, "practical")
        value, interval = unit.estimate_texts(parameter.value, parameter.lower, parameter.upper)
        yield [
            estimate.channel,
            symbol_text(symbol) + (f" {component}" if component > 1 else ""),
            value,
            interval,
            unit.sign,
            STATUS_WORDS[parameter.status],
        ]


def _list_reasons(estimates: Any) -> list[str]:
    reasons = (
        f"{estimate.channel} {symbol_text(symbol)}: {cut(parameter.reason, 150)}"
        for estimate in estimates
        for _, symbol, parameter in estimate.components()
        if parameter.reason and symbol not in CURVE
        if parameter.status == "doubtful" or (parameter.status == "ok" and symbol == "N")
    )
    return list(dict.fromkeys(reasons))


def _make_table(estimates: Any, units: System) -> "pd.DataFrame":
    import pandas as pd

    if units not in get_args(System):
        raise ValueError(f"units is {units!r}, expected 'si' or 'practical'")
    rows = []
    for estimate in estimates:
        sensor, _, recording = estimate.log.partition("/")
        key = Key(sensor, recording, estimate.channel)
        for row in make_parameter_rows(key, estimate, recommended=True):
            kept = {name: value for name, value in row.columns().items() if name != "recommended"}
            if units == "practical" and row.parameter in SHOWN:
                unit = choose_page_unit(estimate.quantity, row.parameter, "practical")
                for name in ("value", "lower", "upper", "fitted"):
                    value = getattr(row, name)
                    kept[name] = None if value is None else value * unit.per_si
                kept["unit"] = unit.sign
            rows.append(kept)
    return pd.DataFrame(rows)
