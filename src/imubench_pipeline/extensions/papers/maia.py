"""Counterparts of the tables and figures of Maia et al. (MTi-7, C102-F9R)."""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import numpy as np

from imubench_pipeline.estimators.score import SUREST
from imubench_pipeline.extensions.papers.evidence import Evidence, Result
from imubench_pipeline.extensions.papers.maia_draws import (
    CHANNELS,
    DURATION,
    GRIDS,
    Grid,
    lottery,
    lowest_point,
    readings,
)
from imubench_pipeline.extensions.papers.printed import parse_number, read_paper
from imubench_pipeline.model.estimates import ParameterRow, ScoreRow
from imubench_pipeline.navigation.error_budget import Quantity, Start, budget
from imubench_pipeline.noise import FLOOR, PEAK_TAU, NoiseModel
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.units import to_si

_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_FIGURES = read_paper("maia").figures
_TABLE_4 = {
    symbol: {row["key"]: row for row in _FIGURES[table]}
    for symbol, table in (("N", "density"), ("B", "stability"))
}


def read_manufacturer(symbol: str, key: str) -> float:
    """Return a figure of the manufacturer as Table 4 prints it, SI."""
    return parse_number(_TABLE_4[symbol][key]["digits"])


def _format_power(value: float, digits: int) -> str:
    """Return a number with these digits, such as 8.4·10⁻⁵."""
    text = f"{value:.{digits}g}"
    if "e" not in text and value >= 1e-2:
        return text
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{str(int(power)).translate(_SUPERSCRIPTS)}"


def _get_model(key: str, table: str) -> NoiseModel:
    return CHANNELS[key].table_1 if table == "table_1" else CHANNELS[key].table_2


def _describe(row: ParameterRow | None, what: str) -> str:
    if row is None:
        return ""
    told = row.status.replace("_", " ") if row.value is None else _format_power(row.value, 3)
    return f"{what}: {told}"


def optimised_estimate(run: Evidence, key: str, symbol: str) -> Result | None:
    """Return the result of the optimisation in the simulated log, with that of the likelihood."""
    log = CHANNELS[key].log
    row = run.parameter(log, symbol, "paper")
    if row is None:
        return None
    shown = {"likelihood": _describe(run.parameter(log, symbol), "likelihood")}
    if row.value is None:
        return Result(verdict="differs", reason=row.reason, fields=shown)
    return Result(value=row.value, lower=row.lower, upper=row.upper, fields=shown)


def read_curve(run: Evidence, key: str, symbol: str) -> Result:
    """Return the value read from the curve of Table 2: of the model, and of single logs."""
    channel = CHANNELS[key]
    model = channel.table_2
    tau, level = lowest_point(model)
    read = {
        "N": math.sqrt(float(model.allan_variance(1.0))),
        "B": level / FLOOR,
        "T_B": tau / PEAK_TAU,
        "K": math.sqrt(float(model.allan_variance(DURATION / 9.0)) * 3.0 / (DURATION / 9.0)),
    }[symbol]
    lower, _, upper = readings(channel)[symbol]
    simulated = _describe(run.parameter(channel.log, symbol, "curve"), "; in the simulated log")
    return Result(value=read, lower=lower, upper=upper, fields={"simulated": simulated})


def lowest_tau(_: Evidence, key: str) -> Result:
    """Return tau of the lowest point of the curve of Table 1, with 1.89 T_B, s."""
    model = CHANNELS[key].table_1
    peak = 1.89 * (model.T_B or 0.0)
    return Result(value=lowest_point(model)[0], printed=peak, fields={"peak": peak})


def lowest_deviation(_: Evidence, key: str) -> Result:
    """Return the deviation at that point, with 0.664 B and the part of the process, %."""
    model = CHANNELS[key].table_1
    tau, level = lowest_point(model)
    assert model.T_B is not None
    process = math.sqrt(float(NoiseModel(B=model.B, T_B=model.T_B).allan_variance(tau)))
    floor = FLOOR * model.B
    return Result(
        value=level,
        printed=floor,
        fields={
            "floor": _format_power(floor, 2).replace(".", ","),
            "tau": tau,
            "side": "before" if tau < PEAK_TAU * model.T_B else "past",
            "share": 100.0 * process / floor,
        },
    )


def error_in_use(_: Evidence, key: str, quantity: Quantity) -> Result:
    """Return the error of dead reckoning by the noise of one channel alone, with Table 2's."""
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
        fields={"by_table_2": f"{by_table_2:.2g}".replace(".", ",")},
    )


def rms_of_draws(_: Evidence, key: str, table: str, grid: Grid) -> Result:
    """Return the median and 90 % range of the RMS of single reconstructions."""
    spread = lottery(CHANNELS[key], grid)
    place = ("table_1", "table_2").index(table)
    lower, median, upper = (spread.state_space, spread.optimised)[place]
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
    """Return how many figures of Table 3 are within the range of each grid."""
    inside: dict[str, int] = dict.fromkeys(GRIDS, 0)
    for grid, channel in product(GRIDS, CHANNELS.values()):
        spread = lottery(channel, grid)
        for (lower, _, upper), printed in zip(
            (spread.state_space, spread.optimised), channel.table_3, strict=True
        ):
            inside[grid] += lower <= printed <= upper
    return inside


def chance_of_order(_: Evidence, key: str) -> Result:
    """Return the chance that a reconstruction by Table 1 has the lower RMS."""
    steps, every = (lottery(CHANNELS[key], grid) for grid in GRIDS)
    return Result(
        value=round(steps.beats, 2),  # so few draws do not tell it finer
        verdict="agrees" if steps.beats < 0.05 else "differs",
        fields={"every": every.beats, "slow": _format_share(steps.slow)},
    )


def weighted_rms(run: Evidence, key: str, method: str) -> Result | None:
    """Return the weighted RMS of the curve of a model, with that of single reconstructions."""
    rows = run.of_log(ScoreRow, CHANNELS[key].log, method=method)
    if not rows or rows[0].rms is None:
        return None
    row = rows[0]
    return Result(
        value=row.rms,
        fields={
            "decades": row.rms_log10,
            "drawn": row.drawn_log10,
            "low": row.drawn_log10_lower,
            "high": row.drawn_log10_upper,
            "surest": SUREST,
        },
    )


def convert_vendor_figure(_: Evidence, value: str, unit: str, dimension: str) -> float:
    """Return a figure of the vendor in SI."""
    return to_si(float(value), unit, dimension)


def over_vendor(_: Evidence, symbol: str, key: str, table: str) -> Result:
    """Return N, or the lowest point of the curve (B), of a table over the vendor's figure.

    The printed number is the parameter over the figure of Table 4.
    """
    model = _get_model(key, table)
    row = _TABLE_4[symbol][key]
    vendor = convert_vendor_figure(_, row["vendor"], row["in"], row["dimension"])
    if symbol == "N":
        value = model.N / (vendor / math.sqrt(2.0))
    else:
        value = lowest_point(model)[1] / vendor
    printed = float(getattr(model, symbol)) / read_manufacturer(symbol, key)
    own = f"{printed:.2f}".replace(".", ",")
    return Result(value=value, printed=printed, fields={"own": own})


def slopes(_: Evidence) -> Result:
    """Return the slopes of the Allan deviation of three terms."""
    tau = np.array([10.0, 1000.0])
    models = {"white": NoiseModel(N=1.0), "flicker": NoiseModel(B=1.0), "walk": NoiseModel(K=1.0)}
    shown = {
        name: float(np.diff(np.log10(model.allan_variance(tau))).item()) / 4.0
        for name, model in models.items()
    }
    right = np.allclose(list(shown.values()), [-0.5, 0.0, 0.5], atol=1e-9)
    return Result(verdict="agrees" if right else "differs", fields=shown)


def nearer_curve(run: Evidence, key: str) -> Result | None:
    """Return the distance of two curves from that of the log, decades."""
    scores = {row.method: row.rms_log10 for row in run.of_log(ScoreRow, CHANNELS[key].log)}
    authors, optimised = scores.get("authors"), scores.get("paper")
    if authors is None or optimised is None:
        return None
    return Result(
        verdict="agrees" if optimised < authors else "differs",
        fields={"authors": authors, "optimised": optimised},
    )


def largest_ratio(_: Evidence, better: str, worse: str) -> Result:
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


def datasheet_line(_: Evidence, key: str) -> Result:
    """Return the line N / sqrt(tau) of the datasheet at 1 s over the optimised curve."""
    curve = math.sqrt(float(CHANNELS[key].table_2.allan_variance(1.0)))
    ratio = read_manufacturer("N", key) / curve
    return Result(value=ratio, fields={"one_sided": ratio / math.sqrt(2.0)})


def datasheet_floor(_: Evidence, key: str) -> Result:
    """Return the lowest point of the optimised curve, with 0.664 B of the datasheet."""
    floor = FLOOR * read_manufacturer("B", key)
    shown = _format_power(floor, 2).replace(".", ",")
    return Result(
        value=lowest_point(CHANNELS[key].table_2)[1], printed=floor, fields={"floor": shown}
    )
