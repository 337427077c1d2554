"""Comparison of logs or estimates: ratios with intervals, by channel and parameter."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

from imubench_pipeline.estimators.estimate import COMPARED, SI_UNITS
from imubench_pipeline.library.drawing import draw_ratios, get_axes
from imubench_pipeline.library.estimates import ChannelEstimate, Estimates, estimate
from imubench_pipeline.library.logs import Log
from imubench_pipeline.library.shown import cut, summarise
from imubench_pipeline.navigation import ratios
from imubench_pipeline.report.practical import choose_page_unit
from imubench_pipeline.settings.config import FusionSettings, Method
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.units import parse_setting
from imubench_pipeline.words.estimates import symbol_text
from imubench_pipeline.words.numbers import count_digits, number_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

_DEFAULT_TAUS = ("1 s", "10 s", "100 s", "1000 s")
_FUSION_DEFAULTS = FusionSettings()


@dataclass(frozen=True)
class Compared:
    """Comparison of one figure of one channel between two logs; values in SI."""

    channel: str
    symbol: str  # A parameter, or ``adev``
    tau: float | None  # s, of the Allan deviation
    names: tuple[str, str]
    values: tuple[float | None, float | None]
    ratio: ratios.Ratio

    @property
    def verdict(self) -> str:
        """Which log has the lower value, as ``quiet lower``; else the verdict of the ratio."""
        lower = {"lower": self.names[0], "higher": self.names[1]}.get(self.ratio.verdict)
        return f"{lower} lower" if lower else self.ratio.verdict

    @property
    def label(self) -> str:
        """Label of the figure."""
        return symbol_text(self.symbol) if self.tau is None else f"σ({self.tau:g} s)"


class Comparison(Sequence[Compared]):
    """Noise parameters and Allan deviations of logs, as ratios with 95 % intervals.

    A verdict depends on a single 95 % interval: of twenty comparisons of equal sensors, about one
    is significant by chance.
    """

    def __init__(self, compared: Sequence[Compared], names: Sequence[str]) -> None:
        self._compared = list(compared)
        self.names = tuple(names)

    def __getitem__(self, place: Any) -> Any:
        return self._compared[place]

    def __len__(self) -> int:
        return len(self._compared)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw each ratio with its interval, on a logarithmic axis."""
        axes: Axes = get_axes(ax)
        labels = []
        for each in self:
            labels.append(f"{each.channel} {each.label}")
            if len(self.names) > 2:
                labels[-1] += f" {each.names[0]} / {each.names[1]}"
        draw_ratios(axes, labels, [each.ratio for each in self])
        two = " / ".join(self.names) if len(self.names) == 2 else "the first / second"
        axes.set_xlabel(f"ratio {two}")
        return axes

    def to_pandas(self) -> "pd.DataFrame":
        """Return a row for each channel, figure and pair; values are in SI, ratios are a over b."""
        import pandas as pd

        return pd.DataFrame(
            {
                "channel": each.channel,
                "parameter": each.symbol,
                "tau": each.tau,
                "a": each.names[0],
                "b": each.names[1],
                "value_a": each.values[0],
                "value_b": each.values[1],
                "unit": SI_UNITS[quantity_of(each.channel)][
                    "B" if each.symbol == "adev" else each.symbol
                ],
                "ratio": each.ratio.value,
                "lower": each.ratio.lower,
                "upper": each.ratio.upper,
                "verdict": each.verdict,
                "reasons": each.ratio.reasons,
            }
            for each in self
        )

    def __repr__(self) -> str:
        heads = ["channel", "", "a", "b", "unit", "a / b", "95 % interval", "verdict", "because"]
        several = len(self.names) > 2
        rows = []
        for each in self:
            unit = choose_page_unit(quantity_of(each.channel), each.symbol, "practical")
            row = [each.channel, each.label, *map(unit.text, each.values)]
            lower, upper = each.ratio.lower or 0.0, each.ratio.upper
            digits, interval = count_digits(each.ratio.value, each.ratio.lower, upper), "–"
            if upper is not None:
                interval = f"{number_text(lower, digits)} to {number_text(upper, digits)}"
            elif each.ratio.lower is not None:
                interval = f"above {number_text(lower, digits)}"
            ratio = "–" if each.ratio.value is None else number_text(each.ratio.value, digits)
            row += [unit.sign, ratio, interval, each.verdict]
            row.append(cut("; ".join(each.ratio.reasons), 50))
            rows.append([f"{each.names[0]} / {each.names[1]}", *row] if several else row)
        if several:
            heads = ["a / b of", *heads]
        a, b, *more = self.names
        title = f"{a} (a) and {b} (b)" if not more else ", ".join(self.names)
        return summarise(f"Comparison of {title}", heads, rows)


def compare(
    *logs: Log | Estimates,
    names: Sequence[str] | None = None,
    tau: Sequence[float | str] = _DEFAULT_TAUS,
    method: Method = "robust",
) -> Comparison:
    """Compare the noise of logs, channel by channel.

    Parameters
    ----------
    *logs : Log or Estimates
        Two or more; a log is estimated first.
    names : sequence of str, optional
        Names of the logs; by default the names of the recordings, after their sensors if two
        recordings have the same name.
    tau : sequence of float or str
        Averaging times at which Allan deviations of the models are compared, s or with their unit.
        Times beyond a ninth of the shorter log are left out: the log does not determine them.
    method : str
        Method of the estimates, for logs.

    Returns
    -------
    Comparison
        Ratios with 95 % intervals and verdicts, for each pair of logs and each common channel. The
        figures are N, B, the minimum of the curve, K, and the Allan deviation at each tau. The
        intervals follow from the limits of the parameters, and from joint draws for Allan
        deviations.

    Raises
    ------
    ValueError
        If there are fewer than two logs, or a pair has no common channel.

    Examples
    --------
    >>> import imubench_pipeline as imu
    >>> loud = imu.simulate(imu.NoiseModel(N=1.5e-4), "10 Hz", duration="10 min", seed=1)
    >>> quiet = imu.simulate(imu.NoiseModel(N=1.0e-4), "10 Hz", duration="10 min", seed=2)
    >>> a = imu.estimate(loud, "10 Hz", channels="gyro_x")
    >>> b = imu.estimate(quiet, "10 Hz", channels="gyro_x")
    >>> imu.compare(a, b, names=["loud", "quiet"])[0].verdict
    'quiet lower'
    """
    if len(logs) < 2:
        raise ValueError(f"{len(logs)} given; expected two or more logs or estimates")
    estimates = []
    for log in logs:
        if not isinstance(log, Log | Estimates):
            raise ValueError(
                f"found {type(log).__name__}; expected a result of read_log or estimate"
            )
        estimates.append(estimate(log, method=method) if isinstance(log, Log) else log)
    called = list(names or ())
    if names is None:
        called = [each.log.recording for each in estimates]
        if len(set(called)) < len(called):
            called = [each.name for each in estimates]
        if len(set(called)) < len(called):
            called = [f"{name} ({place})" for place, name in enumerate(called, start=1)]
    if len(called) != len(logs) or len(set(called)) < len(called):
        raise ValueError(
            f"names are {', '.join(called)}; expected {len(logs)} of them, all distinct"
        )
    seconds = [parse_setting(each, "time", "tau") for each in tau]
    compared = [
        figure
        for (a, first), (b, second) in combinations(zip(called, estimates, strict=True), 2)
        for figure in _pair((a, b), first, second, seconds)
    ]
    return Comparison(compared, called)


def _pair(
    names: tuple[str, str], first: Estimates, second: Estimates, seconds: Sequence[float]
) -> Iterator[Compared]:
    channels = [channel for channel in first if channel in second]
    if not channels:
        raise ValueError(
            f"{names[0]} has {', '.join(first)}, {names[1]} has {', '.join(second)}; expected at "
            "least one common channel"
        )
    for channel in channels:
        pair = first[channel], second[channel]
        for symbol in COMPARED:
            a, b = ({**one.parameters, **one.curve}.get(symbol) for one in pair)
            if a is not None and b is not None:
                ratio = ratios.compare_parameters(a, b)
                yield Compared(channel, symbol, None, names, (a.value, b.value), ratio)
        a_log, b_log = (_make_fusion_channel(one) for one in pair)
        for tau in seconds:
            if tau > _FUSION_DEFAULTS.longest * min(a_log.duration, b_log.duration):
                continue
            ratio = ratios.compare_deviations(
                a_log,
                b_log,
                tau,
                longest=_FUSION_DEFAULTS.longest,
                draws=_FUSION_DEFAULTS.draws,
                seed=_FUSION_DEFAULTS.seed,
            )
            deviations = a_log.variance(tau) ** 0.5, b_log.variance(tau) ** 0.5
            yield Compared(channel, "adev", tau, names, deviations, ratio)


def _make_fusion_channel(estimate: ChannelEstimate) -> ratios.ComparedChannel:
    curve = estimate.measured
    assert curve is not None
    sensor, _, recording = estimate.log.partition("/")
    return ratios.ComparedChannel(
        sensor=sensor,
        recording=recording,
        channel=estimate.channel,
        simulated=False,
        duration=curve.samples / curve.rate,
        estimate=estimate,
    )
