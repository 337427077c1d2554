"""Counterparts of the lines of Maia et al.; equations are evaluated for the MTi-7 gyro, Table 2."""

import math
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.score import SUREST, beats, rms
from imubench_pipeline.extensions.papers.printed import (
    Evidence,
    Log,
    Result,
    parse_number,
    read_paper,
)
from imubench_pipeline.model.estimates import ParameterRow, ScoreRow
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.parts import Quantity
from imubench_pipeline.noise import (
    FLOOR,
    PEAK_TAU,
    GaussMarkov,
    NoiseModel,
    RandomWalk,
    WhiteNoise,
    compute_driving_density,
)
from imubench_pipeline.noise.simulate import channel_rng, ensemble
from imubench_pipeline.noise.variance_covariance import compute_variance_covariance
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.typing import Array
from imubench_pipeline.units import convert_to_si
from imubench_pipeline.words.numbers import number_text

DURATION = 36_000.0  # s; assumed, since the paper recommends ten hours

MEMBERS = 200  # reconstructions of each set of parameters, and logs for the comparison

Grid = Literal["steps", "every"]
GRIDS: tuple[Grid, ...] = ("steps", "every")
"""The paper does not print at which tau it compares two curves: the program that it names plots
1, 2, ... 9, 10, 20, ... samples; its equation 10 has every n up to half of the log."""

_CLUSTER_SIZES = 100  # in place of every n: the middles of equal parts


@dataclass(frozen=True)
class Channel:
    """One axis of one sensor with its printed values, SI."""

    name: str  # as the paper calls it
    sensor: str  # its sensor file
    channel: str
    rate: float  # Hz
    table_1: NoiseModel  # read from the curve
    table_2: NoiseModel  # optimised
    table_3: tuple[float, float]  # RMS of one reconstruction by Table 1, and by Table 2

    @property
    def log(self) -> Log:
        """The simulated log."""
        return Log(self.sensor, "sim_published", self.channel)


def _read_channels() -> dict[str, Channel]:
    figures = read_paper("maia").figures

    def model(key: str, table: str) -> NoiseModel:
        by = {row["symbol"]: parse_number(row[table]) for row in figures[key]}
        return NoiseModel(N=by["N"], B=by["B"], K=by["K"], T_B=by["T_B"])

    return {
        row["key"]: Channel(
            row["name"],
            row["sensor"],
            row["channel"],
            float(row["rate"]),
            model(row["key"], "table_1"),
            model(row["key"], "table_2"),
            (parse_number(row["state_space"]), parse_number(row["optimised"])),
        )
        for row in figures["channels"]
    }


CHANNELS = _read_channels()  # by the keys of the paper
MTI_GYRO = CHANNELS["mti_gyro"]

Range = tuple[float, float, float]  # the quantiles of 5, 50 and 95 %, SI


@dataclass(frozen=True)
class Lottery:
    """RMS, as in Table 3, of single reconstructions against single logs, for one grid of tau."""

    ranges: tuple[Range, Range]  # reconstructed by Table 1, and by Table 2 itself
    beats: float  # chance that a reconstruction by Table 1 has the lower RMS of two
    beyond: tuple[float, float]  # shares of the scores that are at least the printed figures
    slow: float  # share of the mean square from tau beyond 300 s, by Table 2


def choose_cluster_sizes(channel: Channel, grid: str) -> NDArray[np.int64]:
    """Return the cluster sizes of a grid in `GRIDS`, or for "read", to read a curve, shape (m,)."""
    longest = round(DURATION * channel.rate) // 2
    if grid == "steps":
        steps = np.outer(10 ** np.arange(len(str(longest))), np.arange(1, 10)).ravel()
        return steps[steps <= longest]
    if grid == "every":
        chosen = (np.arange(_CLUSTER_SIZES) + 0.5) * longest / _CLUSTER_SIZES
    else:
        chosen = np.geomspace(1.0, DURATION / 9.0, _CLUSTER_SIZES) * channel.rate
    return np.rint(chosen).astype(np.int64)


@cache
def simulate_lottery(channel: Channel, grid: Grid) -> Lottery:
    """Simulate the scatter of the RMS of Table 3: `MEMBERS` logs of Table 2, reconstructed."""
    n = choose_cluster_sizes(channel, grid)
    measured, *drawn = (curves[grid] for curves in _simulate_deviations(channel))
    of_each = [rms(one[:, None, :], measured[None, :, :]) for one in drawn]
    chances = [
        beats(first, second) for first, second in zip(of_each[0].T, of_each[1].T, strict=True)
    ]
    square = (drawn[1] - measured) ** 2
    beyond = [
        float(np.mean(values >= printed))
        for values, printed in zip(of_each, channel.table_3, strict=True)
    ]
    return Lottery(
        (_compute_range(of_each[0]), _compute_range(of_each[1])),
        float(np.mean(chances)),
        (beyond[0], beyond[1]),
        float(square[:, n > 300.0 * channel.rate].sum() / square.sum()),
    )


@cache
def simulate_readings(channel: Channel) -> dict[str, Range]:
    """Return 5, 50 and 95 % quantiles of N, B, K and T_B read from curves of logs of Table 2.

    N is read at 1 s, and K at a ninth of a log.
    """
    tau = choose_cluster_sizes(channel, "read") / channel.rate
    curves = _simulate_deviations(channel)[0]["read"]
    return {
        "N": _compute_range(curves[:, 0] * math.sqrt(tau[0])),
        "B": _compute_range(curves.min(axis=1) / FLOOR),
        "K": _compute_range(curves[:, -1] * math.sqrt(3.0 / tau[-1])),
        "T_B": _compute_range(tau[curves.argmin(axis=1)] / PEAK_TAU),
    }


@cache
def _simulate_deviations(channel: Channel) -> tuple[dict[str, Array], ...]:
    """Return Allan deviations of logs of Table 2, and of reconstructions by Tables 1 and 2."""
    grids = {grid: choose_cluster_sizes(channel, grid) for grid in (*GRIDS, "read")}
    together = np.unique(np.concatenate(list(grids.values())))
    samples = round(DURATION * channel.rate)

    def of(model: NoiseModel, use: str) -> dict[str, Array]:
        rng = channel_rng(1, channel.sensor, channel.channel, use)
        curves = np.sqrt(ensemble(model, channel.rate, samples, together, MEMBERS, rng))
        return {grid: curves[:, np.searchsorted(together, n)] for grid, n in grids.items()}

    return (
        of(channel.table_2, "measured"),
        of(channel.table_1, "table 1"),
        of(channel.table_2, "table 2"),
    )


def _compute_range(values: Array) -> Range:
    lower, median, upper = np.quantile(values, [0.05, 0.5, 0.95]).tolist()
    return lower, median, upper


@cache
def find_lowest_point(model: NoiseModel) -> tuple[float, float]:
    """Return tau, s, and Allan deviation, SI, of the lowest point of a curve from 1 s on."""
    tau = np.geomspace(1.0, DURATION / 2.0, 20_001)
    variance = model.allan_variance(tau)
    place = int(np.argmin(variance))
    return float(tau[place]), math.sqrt(float(variance[place]))


_FIGURES = read_paper("maia").figures
_TABLE_4 = {
    symbol: {row["key"]: row for row in _FIGURES[table]}
    for symbol, table in (("N", "density"), ("B", "stability"))
}

_MODEL = MTI_GYRO.table_2
_RATE = MTI_GYRO.rate
assert _MODEL.T_B is not None
_PROCESS = GaussMarkov(_MODEL.B, _MODEL.T_B)
_DEFAULT_TAU = 100.0  # s

WEIGHED_AT = (10.0, 100.0, 1000.0)  # s, to compare the weight of equation 25 with the spread


def read_manufacturer(symbol: str, key: str) -> float:
    """Return a figure of the manufacturer as Table 4 prints it, SI."""
    return parse_number(_TABLE_4[symbol][key]["digits"])


def _format_as_printed(value: float, digits: int = 2) -> str:
    return number_text(value, digits).replace(".", ",").replace("×", "·")


def _describe(row: ParameterRow | None, what: str) -> str:
    if row is None:
        return ""
    text = row.status.replace("_", " ") if row.value is None else number_text(row.value, 3)
    return f"{what}: {text}"


def get_optimised_estimate(run: Evidence, key: str, symbol: str) -> Result | None:
    """Return the estimates by optimisation and by likelihood from the simulated log."""
    log = CHANNELS[key].log
    row = run.parameter(log, symbol, "paper")
    if row is None:
        return None
    shown = {"likelihood": _describe(run.parameter(log, symbol), "likelihood")}
    if row.value is None:
        return Result(verdict="differs", reason=row.reason, fields=shown)
    return Result(value=row.value, lower=row.lower, upper=row.upper, fields=shown)


def read_curve(run: Evidence, key: str, symbol: str) -> Result:
    """Return the value read from the curve of the model of Table 2, and of single logs."""
    channel = CHANNELS[key]
    model = channel.table_2
    tau, level = find_lowest_point(model)
    read = {
        "N": math.sqrt(float(model.allan_variance(1.0))),
        "B": level / FLOOR,
        "T_B": tau / PEAK_TAU,
        "K": math.sqrt(float(model.allan_variance(DURATION / 9.0)) * 3.0 / (DURATION / 9.0)),
    }[symbol]
    lower, _, upper = simulate_readings(channel)[symbol]
    simulated = _describe(run.parameter(channel.log, symbol, "curve"), "; in the simulated log")
    return Result(value=read, lower=lower, upper=upper, fields={"simulated": simulated})


def find_lowest_of_table_1(_: Evidence, key: str, quantity: str) -> Result:
    """Return tau or deviation of the lowest point by Table 1, and 1.89 T_B or 0.664 B, SI."""
    model = CHANNELS[key].table_1
    assert model.T_B is not None
    tau, level = find_lowest_point(model)
    peak, floor = 1.89 * model.T_B, FLOOR * model.B
    process = math.sqrt(float(NoiseModel(B=model.B, T_B=model.T_B).allan_variance(tau)))
    fields = {
        "tau": tau,
        "peak": peak,
        "floor": _format_as_printed(floor),
        "side": "before" if tau < PEAK_TAU * model.T_B else "past",
        "share": 100.0 * process / floor,  # of the process in that deviation, %
    }
    value, printed = (tau, peak) if quantity == "tau" else (level, floor)
    return Result(value=value, printed=printed, fields=fields)


def compute_error_in_use(_: Evidence, key: str, quantity: Quantity) -> Result:
    """Return the dead-reckoning error after 600 s by the noise of Table 1, and of Table 2."""
    channel = CHANNELS[key]
    quiet = NoiseModel()

    def compute(model: NoiseModel) -> float:
        of_gyro = quantity_of(channel.channel) == "gyro"
        return budget(
            quantity,
            600.0,
            gyro=model if of_gyro else quiet,
            accel=quiet if of_gyro else model,
            start=Start.calibrated(60.0),
        ).total

    by_table_2 = compute(channel.table_2)
    return Result(
        value=compute(channel.table_1),
        printed=by_table_2,
        fields={"by_table_2": _format_as_printed(by_table_2)},
    )


def summarise_draws(_: Evidence, key: str, table: str, grid: Grid) -> Result:
    """Return the median and 90 % range of the RMS of single reconstructions."""
    spread = simulate_lottery(CHANNELS[key], grid)
    place = ("table_1", "table_2").index(table)
    lower, median, upper = spread.ranges[place]
    return Result(
        value=median,
        lower=lower,
        upper=upper,
        fields={"share": _format_share(spread.beyond[place]), **_count_in_range()},
    )


def _format_share(part: float) -> str:
    """Return a share of a few draws in per cent, rounded to their resolution."""
    if 0.01 <= part <= 0.99:
        return f"{100.0 * part:.0f} %"
    return "under 1 %" if part < 0.5 else "over 99 %"


@cache
def _count_in_range() -> dict[str, int]:
    inside: dict[str, int] = dict.fromkeys(GRIDS, 0)
    for grid, channel in product(GRIDS, CHANNELS.values()):
        spread = simulate_lottery(channel, grid)
        for (lower, _, upper), printed in zip(spread.ranges, channel.table_3, strict=True):
            inside[grid] += lower <= printed <= upper
    return inside


def compute_chance_of_order(_: Evidence, key: str) -> Result:
    """Return the chance that a reconstruction by Table 1 has a lower RMS than one by Table 2."""
    steps, every = (simulate_lottery(CHANNELS[key], grid) for grid in GRIDS)
    return Result(
        value=round(steps.beats, 2),  # so few draws do not resolve a smaller share
        verdict="agrees" if steps.beats < 0.05 else "differs",
        fields={"every": every.beats, "slow": _format_share(steps.slow)},
    )


def get_weighted_rms(run: Evidence, key: str, method: str) -> Result | None:
    """Return the weighted RMS of the curve of a model and of single reconstructions."""
    rows = run.of_log(ScoreRow, CHANNELS[key].log, method=method)
    if not rows or rows[0].rms is None:
        return None
    return Result(value=rows[0].rms, fields={**rows[0].columns(), "surest": SUREST})


def convert_vendor_figure(_: Evidence, symbol: str, key: str) -> float:
    """Return the vendor's figure from which a value of Table 4 derives, SI."""
    row = _TABLE_4[symbol][key]
    return convert_to_si(float(row["vendor"]), row["in"], row["dimension"])


def compare_with_vendor(run: Evidence, symbol: str, key: str, table: str) -> Result:
    """Return the ratio of N, or the lowest point (B), to the vendor's figure, and to Table 4."""
    channel, vendor = CHANNELS[key], convert_vendor_figure(run, symbol, key)
    model = channel.table_1 if table == "table_1" else channel.table_2
    if symbol == "N":
        value = model.N / (vendor / math.sqrt(2.0))
    else:
        value = find_lowest_point(model)[1] / vendor
    printed = float(getattr(model, symbol)) / read_manufacturer(symbol, key)
    return Result(value=value, printed=printed, fields={"own": _format_as_printed(printed, 3)})


def compute_slopes(_: Evidence) -> Result:
    """Return the slopes of the Allan deviation of three terms."""
    tau = np.array([10.0, 1000.0])
    models = {"white": NoiseModel(N=1.0), "flicker": NoiseModel(B=1.0), "walk": NoiseModel(K=1.0)}
    shown = {
        name: float(np.diff(np.log10(model.allan_variance(tau))).item()) / 4.0
        for name, model in models.items()
    }
    right = np.allclose(list(shown.values()), [-0.5, 0.0, 0.5], atol=1e-9)
    return Result(verdict="agrees" if right else "differs", fields=shown)


def compare_distances(run: Evidence, key: str) -> Result | None:
    """Return the distances of two curves from the curve of the log, decades."""
    scores = {row.method: row.rms_log10 for row in run.of_log(ScoreRow, CHANNELS[key].log)}
    authors, optimised = scores.get("authors"), scores.get("paper")
    if authors is None or optimised is None:
        return None
    return Result(
        verdict="agrees" if optimised < authors else "differs",
        fields={"authors": authors, "optimised": optimised},
    )


def find_largest_ratio(_: Evidence, better: str, worse: str) -> Result:
    """Return the largest ratio of two curves of Table 2, and where it is."""
    one, other = CHANNELS[better].table_2, CHANNELS[worse].table_2
    tau = np.geomspace(1.0, DURATION / 2.0, 1000)
    ratio = np.sqrt(other.allan_variance(tau) / one.allan_variance(tau))
    place = int(np.argmax(ratio))
    return Result(
        value=float(ratio[place]),
        fields={
            "tau": tau[place],
            "end": ", the end, and still growing" if place == tau.size - 1 else "",
            "least": ratio.min(),
            "walks": other.K / one.K,
        },
    )


def compute_datasheet_line(_: Evidence, key: str) -> Result:
    """Return the ratio of the datasheet's line N / sqrt(tau) to the optimised curve at 1 s."""
    curve = math.sqrt(float(CHANNELS[key].table_2.allan_variance(1.0)))
    ratio = read_manufacturer("N", key) / curve
    return Result(value=ratio, fields={"one_sided": ratio / math.sqrt(2.0)})


def compute_datasheet_floor(_: Evidence, key: str) -> Result:
    """Return the lowest point of the optimised curve, with 0.664 B of the datasheet."""
    floor = FLOOR * read_manufacturer("B", key)
    level = find_lowest_point(CHANNELS[key].table_2)[1]
    return Result(value=level, printed=floor, fields={"floor": _format_as_printed(floor)})


def integrate_density(model: NoiseModel, tau: float) -> float:
    """Return the Allan variance at a tau, s, by integration of the density, as a reference.

    It is 4 ∫ S(f) sin⁴(π f τ) / (π f τ)² df from 0, integrated over x = π f τ.
    """
    # The random walk is steep at 0. White noise converges slowly: its tail has the mean 3/8 of
    # sin⁴.
    ends = np.concatenate(([1e-9, 1e-3, 1e-2, 0.1], np.pi * np.arange(0.5, 400.5, 0.5)))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    half = np.diff(ends)[:, None] / 2.0
    x = ends[:-1, None] + half * (1.0 + nodes)
    last = float(ends[-1])
    density = model.psd(x / (math.pi * tau))
    total = float((half * (density * np.sin(x) ** 4 / x**2) @ weights[:, None]).sum())
    rest = float(model.psd(last / (math.pi * tau))) * 0.375 / last
    return 4.0 / (math.pi * tau) * (total + rest)


def evaluate_as_printed(model: NoiseModel, tau: float) -> float:
    """Return equation 26 as it is printed, with e^(+τ/T_B)."""
    assert model.T_B is not None
    T_B, x = model.T_B, tau / model.T_B
    bracket = 1.0 - (3.0 - 4.0 * math.exp(x) + math.exp(-2.0 * x)) / (2.0 * x)
    driven = compute_driving_density(model.B, T_B) * T_B**2 / tau * bracket
    return model.N**2 / tau + driven + model.K**2 * tau / 3.0


def compute_weight_ratios(tau: float) -> tuple[float, float]:
    """Return the ratios of the spread at a tau, s, to the weights as meant and as printed.

    These are 2 √(n/2L) σ̂² and 2 √(n/2L) σ̂, with n samples in a cluster and L in the log.
    """
    samples, n = round(DURATION * _RATE), round(tau * _RATE)
    variance = float(_MODEL.allan_variance(tau, _RATE))
    spread = math.sqrt(compute_variance_covariance(_MODEL, _RATE, samples, np.array([n]))[0, 0])
    meant = 2.0 * math.sqrt(n / (2.0 * samples)) * variance
    return spread / meant, spread / (meant / math.sqrt(variance))


def evaluate_equation(_: Evidence, number: str) -> Result:
    """Return the result of an equation, and the printed result if it follows from Table 2."""
    N, B, K, T_B, T = _MODEL.N, _MODEL.B, _MODEL.K, _PROCESS.T_B, 1.0 / _RATE
    f, omega = np.array(1e-3), 2.0 * math.pi * 1e-3
    space, driven = _MODEL.state_space(_RATE), compute_driving_density(B, T_B)
    parts = [NoiseModel(N=N), NoiseModel(B=B, T_B=T_B), NoiseModel(K=K)]
    of_parts = sum(part.allan_variance(_DEFAULT_TAU) for part in parts)
    decay = _PROCESS.state_space(T_B).transition[0, 0]
    S_B = 2.0 * B**2 * math.log(2.0) / (math.pi * 0.4365**2 * T_B)
    return {
        "2": Result(value=float(_MODEL.allan_variance(_DEFAULT_TAU) / of_parts)),
        "4": Result(value=float(decay), printed=math.exp(-1.0)),
        "5": Result(value=float(RandomWalk(1.0).state_space(1.0).process_noise[0, 0])),
        "7": Result(value=float(WhiteNoise(2.0).psd(f) / 4.0)),
        "8": Result(value=driven, printed=S_B),
        "9": Result(value=float(RandomWalk(1.0).psd(f) * omega**2)),
        # Differences of adjacent clusters of two, begun at every one of ten samples.
        "10": Result(value=float(sum(start + 2 * 2 <= 10 for start in range(10)))),
        "11": Result(value=math.sqrt(float(NoiseModel(N=1.0).allan_variance(1.0)))),
        "12": Result(value=math.sqrt(float(NoiseModel(K=1.0).allan_variance(3.0)))),
        "20": Result(value=float(space.transition[0, 0]), printed=math.exp(-T / T_B)),
        "21": Result(fields={"matrix": space.output.astype(int).tolist()}),
        "22": Result(value=float(space.process_noise[0, 0]) / (driven / _RATE)),
        "23": Result(value=float(space.measurement_noise), printed=N**2 / T),
    }[number]


def compute_spread_over_weight(_: Evidence) -> Result:
    """Return the spread of the Allan variance over the value that the intended weight assumes."""
    return Result(fields={f"at_{tau:.0f}": compute_weight_ratios(tau)[0] for tau in WEIGHED_AT})


def evaluate_sign(_: Evidence) -> Result:
    """Return the error of equation 26 with the right sign, and its ratio to truth as printed."""
    truth = integrate_density(_MODEL, _DEFAULT_TAU)
    ours = abs(float(_MODEL.allan_variance(_DEFAULT_TAU)) / truth - 1.0)
    ratio = evaluate_as_printed(_MODEL, _DEFAULT_TAU) / truth
    return Result(fields={"ours": ours, "printed_ratio": ratio})
