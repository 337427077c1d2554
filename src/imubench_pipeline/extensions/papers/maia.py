"""Claims of Maia et al. (MTi-7, C102-F9R): tables 1 to 4, figures 1 to 9, equations 1 to 27."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np

from imubench_pipeline.estimators.estimate import SI_UNITS
from imubench_pipeline.estimators.score import SUREST
from imubench_pipeline.extensions.papers.about import MAIA
from imubench_pipeline.extensions.papers.claims import (
    DERIVED,
    Claim,
    Paper,
    Result,
    no_result,
    numeric_result,
)
from imubench_pipeline.extensions.papers.evidence import Evidence, Log
from imubench_pipeline.extensions.papers.maia_equations import equations
from imubench_pipeline.extensions.papers.maia_printed import (
    C102_ACCEL,
    C102_GYRO,
    CHANNELS,
    DURATION,
    GRIDS,
    MTI_ACCEL,
    MTI_GYRO,
    TABLE_4,
    Channel,
    Grid,
    lottery,
    lowest_point,
    readings,
)
from imubench_pipeline.model.estimates import ParameterRow, ScoreRow
from imubench_pipeline.navigation.error_budget import Quantity, Start, budget
from imubench_pipeline.noise import FLOOR, PEAK_TAU, NoiseModel
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.units import to_si

_TEST = "tests/papers/test_maia.py"
_NO_LOG = "it takes the simulated log of this sensor"
_SYMBOLS = ("N", "B", "K", "T_B")
_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def _get_log(channel: Channel) -> Log:
    return Log(channel.sensor, "sim_published", channel.channel)


def _get_page(channel: Channel) -> str:
    return f"recordings/{channel.sensor}/sim_published.html#{channel.channel}"


def _get_units(channel: Channel) -> dict[str, str]:
    return SI_UNITS[quantity_of(channel.channel)]


_AS_PRINTED = {
    "rad/s/sqrt(Hz)": "rad/s^(1/2)",
    "m/s^2/sqrt(Hz)": "m/s^(3/2)",
    "rad/s/sqrt(s)": "rad/s^(3/2)",
    "m/s^2/sqrt(s)": "m/s^(5/2)",
}
"""Units of N and K as the paper names them."""


def _format_unit(unit: str) -> str:
    """Return a unit in the notation of the paper."""
    return re.sub(r"\^2", "²", _AS_PRINTED.get(unit, unit))


def _format_power(value: float, digits: int) -> str:
    """Return a number with these digits, such as 8.4·10⁻⁵."""
    text = f"{value:.{digits}g}"
    if "e" not in text and value >= 1e-2:
        return text
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{str(int(power)).translate(_SUPERSCRIPTS)}"


def _format_printed(value: float, unit: str, power: int | None = None) -> str:
    """Return a number as the paper writes it, such as 8,4·10⁻⁵ rad/s^(1/2).

    `power` is the power of ten, if the number before it is not below ten.
    """
    if power is not None:
        number = f"{value / 10.0**power:.1f}·10{str(power).translate(_SUPERSCRIPTS)}"
    else:
        number = f"{value:.1f}" if value >= 1.0 else _format_power(value, 2)
    return f"{number} {_format_unit(unit)}".replace(".", ",")


def _format_derived(words: str) -> str:
    """Return a derived value in place of a printed one."""
    return f"{DERIVED} {words}".replace(".", ",")


def _get_value(model: NoiseModel, symbol: str) -> float:
    return float(getattr(model, symbol))


def _describe(row: ParameterRow | None, what: str) -> str:
    if row is None:
        return ""
    told = row.status.replace("_", " ") if row.value is None else _format_power(row.value, 3)
    return f"{what}: {told}"


def _evaluate_estimate(channel: Channel, symbol: str, run: Evidence) -> Result:
    """Return the result of the optimisation in the simulated log, with that of the likelihood."""
    row = run.parameter(_get_log(channel), symbol, "paper")
    if row is None:
        return no_result(_NO_LOG)
    words = _describe(run.parameter(_get_log(channel), symbol), "likelihood")
    if row.value is None:
        return Result(words=words, verdict="differs", reason=row.reason)
    return Result(value=row.value, lower=row.lower, upper=row.upper, words=words)


def _evaluate_reading(channel: Channel, symbol: str, run: Evidence) -> Result:
    """Return the value read from the curve of Table 2: of the model, and of single logs."""
    model = channel.table_2
    tau, level = lowest_point(model)
    read = {
        "N": math.sqrt(float(model.allan_variance(1.0))),
        "B": level / FLOOR,
        "T_B": tau / PEAK_TAU,
        "K": math.sqrt(float(model.allan_variance(DURATION / 9.0)) * 3.0 / (DURATION / 9.0)),
    }[symbol]
    lower, _, upper = readings(channel)[symbol]
    simulated = _describe(run.parameter(_get_log(channel), symbol, "curve"), "in the simulated log")
    return Result(
        value=read,
        lower=lower,
        upper=upper,
        words="; ".join(filter(None, ("90 % range of single logs", simulated))),
    )


_WHY_READ = (
    "outside what the same reading gives in nine of ten single logs of Table 2: the two tables "
    "are not of one curve, or it was read elsewhere (of sixteen readings one or two are outside by "
    "chance)"
)


def _tables_1_and_2() -> Iterator[Claim]:
    for channel in CHANNELS:
        units = _get_units(channel)
        for symbol in _SYMBOLS:
            value = _get_value(channel.table_1, symbol)
            yield Claim(
                place="Table 1", quantity=f"{symbol} of the {channel.name}, read from the curve",
                printed=_format_printed(value, units[symbol]), value=value,
                evaluate=partial(_evaluate_reading, channel, symbol), basis="computed",
                reason=_WHY_READ, check=f"{_TEST}::test_reading_the_curve_of_table_2",
                unit=units[symbol], page=_get_page(channel),
            )  # fmt: skip
        for symbol in _SYMBOLS:
            value = _get_value(channel.table_2, symbol)
            yield Claim(
                place="Table 2", quantity=f"{symbol} of the {channel.name}, optimised",
                printed=_format_printed(value, units[symbol]), value=value,
                evaluate=partial(_evaluate_estimate, channel, symbol), basis="come back",
                reason="the log is one draw of the noise",
                unit=units[symbol], page=_get_page(channel),
                check="tests/papers/test_panel.py",
            )  # fmt: skip


def _yield_own_curve() -> Iterator[Claim]:
    """Yield whether the four numbers of Table 1 fit the paper's own equation 26."""
    for channel in CHANNELS:
        model, unit = channel.table_1, _get_units(channel)["B"]
        tau, level = lowest_point(model)
        peak = 1.89 * (model.T_B or 0.0)
        at_peak = Claim(
            place="Table 1",
            quantity=f"{channel.name}: lowest point of the curve that its four numbers make",
            printed=_format_derived(f"{peak:.0f} s = 1,89 T_B"), value=peak, unit="s",
            evaluate=numeric_result(tau),
            reason="T_B was read at the lowest point of a curve; the four numbers in equation 26 "
            "make a curve whose lowest point is elsewhere",
            basis="computed", page=_get_page(channel),
            check=f"{_TEST}::test_the_numbers_of_table_1_do_not_fit_equation_26",
        )  # fmt: skip
        yield at_peak
        floor = FLOOR * model.B
        yield replace(
            at_peak, quantity=f"{channel.name}: deviation at that point",
            printed=_format_derived(f"{_format_printed(floor, unit)} = 0,664 B"), value=floor,
            unit=unit,
            evaluate=numeric_result(level), reason=_explain_floor(model, tau),
        )  # fmt: skip
        what: Quantity = "heading" if quantity_of(channel.channel) == "gyro" else "velocity"
        unit = "rad" if what == "heading" else "m/s"
        by_table_2 = _compute_error(channel, channel.table_2, what)
        yield replace(
            at_peak,
            quantity=f"{channel.name}: error of {what} after 600 s (1σ, 60 s at rest before)",
            printed=_format_derived(f"{by_table_2:.2g} {unit} by Table 2"), value=by_table_2,
            unit=unit,
            evaluate=numeric_result(_compute_error(channel, model, what)),
            reason="what the readings of B, T_B and K amount to in use",
        )  # fmt: skip


def _explain_floor(model: NoiseModel, tau: float) -> str:
    """Return why the lowest point of a curve is not 0.664 B."""
    assert model.T_B is not None
    process = math.sqrt(float(NoiseModel(B=model.B, T_B=model.T_B).allan_variance(tau)))
    side = "before" if tau < PEAK_TAU * model.T_B else "past"
    return (
        f"at {tau:.0f} s the process is {side} its peak of 0.664 B, at "
        f"{100.0 * process / (FLOOR * model.B):.0f} % of it; N and K add the rest"
    )


def _compute_error(channel: Channel, model: NoiseModel, quantity: Quantity) -> float:
    """Return the error of dead reckoning by the noise of one channel alone."""
    of_gyro = quantity_of(channel.channel) == "gyro"
    quiet = NoiseModel()
    return budget(
        quantity,
        600.0,
        gyro=model if of_gyro else quiet,
        accel=quiet if of_gyro else model,
        start=Start.calibrated(60.0),
    ).total


def _table_3() -> Iterator[Claim]:
    for channel in CHANNELS:
        unit = _get_units(channel)["B"]
        check = f"{_TEST}::test_table_3_lies_in_the_spread_of_single_draws"
        for place, name in enumerate(("state space", "optimised")):
            value = channel.table_3[place]
            for grid, words in GRIDS.items():
                yield Claim(
                    place="Table 3",
                    quantity=f"RMS of one reconstruction, {channel.name}, {name}, at {words}",
                    printed=_format_printed(value, unit), value=value, unit=unit,
                    evaluate=partial(_evaluate_draws, channel, place, grid), basis="computed",
                    page=_get_page(channel), check=check,
                )  # fmt: skip
        yield Claim(
            place="Table 3",
            quantity=f"chance that one draw of Table 1 beats one of Table 2, {channel.name}",
            printed="the optimised one is lower", evaluate=partial(_evaluate_order, channel),
            basis="computed",
            reason="one reconstruction each ranks no method, however the two differ",
            page="theory.html#reconstruction", check=check,
        )  # fmt: skip
        for value, method, name in zip(
            channel.table_3, ("authors", "paper"), ("state space", "optimised"), strict=True
        ):
            yield Claim(
                place="Table 3",
                quantity=f"weighted RMS of the model’s own curve, {channel.name}, {name}",
                printed=_format_printed(value, unit), unit=unit,
                evaluate=partial(_evaluate_score, channel, method), basis="come back",
                reason="another measure, so that it has no ratio: printed is one draw with every τ "
                f"alike; here a τ weighs 1/(e² + {SUREST:g}²), e the relative error of the log’s "
                "curve. The log is of Table 2, so that the optimised curve must be nearer",
                page=_get_page(channel), check="tests/test_score.py",
            )  # fmt: skip


def _evaluate_draws(channel: Channel, place: int, grid: Grid, _: Evidence) -> Result:
    spread = lottery(channel, grid)
    lower, median, upper = (spread.state_space, spread.optimised)[place]
    return Result(
        value=median,
        lower=lower,
        upper=upper,
        words=f"median and 90 % range of single ones; {_format_share(spread.beyond[place])} are as "
        "large as the printed figure",
        reason=f"outside the 90 % range at these τ, which are not printed: of the eight figures "
        f"{_count_in_range()}; about one of eight is outside by chance",
    )


def _format_share(part: float) -> str:
    """Return a share of a few draws in per cent, rounded to their resolution."""
    if 0.01 <= part <= 0.99:
        return f"{100.0 * part:.0f} %"
    return "under 1 %" if part < 0.5 else "over 99 %"


@cache
def _count_in_range() -> str:
    """Return how many figures of Table 3 are within the range of each grid."""
    held = dict.fromkeys(GRIDS, 0)
    for grid, channel in product(GRIDS, CHANNELS):
        spread = lottery(channel, grid)
        for (lower, _, upper), printed in zip(
            (spread.state_space, spread.optimised), channel.table_3, strict=True
        ):
            held[grid] += lower <= printed <= upper
    return " and ".join(f"{held[grid]} are inside at {GRIDS[grid]}" for grid in GRIDS)


def _evaluate_order(channel: Channel, _: Evidence) -> Result:
    steps, every = (lottery(channel, grid) for grid in GRIDS)
    return Result(
        value=round(steps.beats, 2),  # so few draws do not tell it finer
        verdict="agrees" if steps.beats < 0.05 else "differs",
        words=f"at {GRIDS['steps']}; {every.beats:.2f} at {GRIDS['every']}. "
        f"{_format_share(steps.slow)} of the square is of τ > 300 s",
    )


def _evaluate_score(channel: Channel, method: str, run: Evidence) -> Result:
    rows = run.of_log(ScoreRow, _get_log(channel), method=method)
    if not rows or rows[0].rms is None:
        return no_result(_NO_LOG)
    row = rows[0]
    low, high = row.drawn_log10_lower, row.drawn_log10_upper
    return Result(
        value=row.rms,
        verdict="differs",
        words=f"{row.rms_log10:.3f} decades; of one reconstruction {row.drawn_log10:.3f} "
        f"({low:.3f} to {high:.3f})",
    )


_VENDOR_FIGURES = {
    ("N", "gyro_x"): (0.007, "deg/s/sqrt(Hz)", "gyro_density", "0.007 °/s/√Hz"),
    ("N", "accel_x"): (120.0, "ug/sqrt(Hz)", "accel_density", "120 µg/√Hz"),
    ("B", "gyro_x"): (10.0, "deg/h", "angular_rate", "10 °/h"),
    ("B", "accel_x"): (0.03, "mg", "acceleration", "0.03 mg"),
}
"""Figures of the vendor behind the column of the manufacturer."""


def _table_4() -> Iterator[Claim]:
    for symbol in ("N", "B"):
        for channel in (MTI_ACCEL, MTI_GYRO):
            value = TABLE_4[symbol][channel.channel]
            printed, unit, dimension, words = _VENDOR_FIGURES[symbol, channel.channel]
            vendor = to_si(printed, unit, dimension)
            si = _get_units(channel)[symbol]
            page = f"recordings/{channel.sensor}/sim_published.html#{channel.channel}"
            check = f"{_TEST}::test_table_4"
            yield Claim(
                place="Table 4", quantity=f"{symbol} of the {channel.name}, manufacturer",
                printed=_format_printed(value, si, -4 if channel is MTI_ACCEL else -5), value=value,
                unit=si, evaluate=numeric_result(vendor, words), basis="computed",
                page=page, check=check,
            )  # fmt: skip
            for name, model in (("state space", channel.table_1), ("optimised", channel.table_2)):
                own = _get_value(model, symbol) / value
                yield Claim(
                    place="Table 4",
                    quantity=f"{symbol} of the {channel.name}, {name} over manufacturer",
                    printed=_format_derived(f"{own:.2f}, {symbol} against {symbol}"),
                    value=own, evaluate=partial(_evaluate_comparison, symbol, model, vendor),
                    basis="computed",
                    reason=_WHY_4[symbol], page=page, check=check,
                )  # fmt: skip


_WHY_4 = {
    "N": "a printed density is taken to be one-sided, and √2 less two-sided; the paper takes it as "
    "N. The document does not say, so the page of the recording has both",
    "B": "a printed in-run stability is the lowest point of a curve, and is compared with that; "
    "the paper takes it as B, and draws its line at 0.664 B",
}


def _evaluate_comparison(symbol: str, model: NoiseModel, vendor: float, _: Evidence) -> Result:
    if symbol == "N":
        return Result(value=model.N / (vendor / math.sqrt(2.0)), words="one-sided density over √2")
    return Result(value=lowest_point(model)[1] / vendor, words="lowest points of the curves")


def _figures() -> Iterator[Claim]:
    yield Claim(
        place="Figure 1", quantity="slopes of white noise, flicker noise and random walk",
        printed="−1/2, 0, +1/2", evaluate=_evaluate_slopes, basis="checked",
        page="theory.html#reading",
        check=f"{_TEST}::test_lines_and_floor",
    )  # fmt: skip
    for figure, channel in ((2, C102_ACCEL), (3, MTI_ACCEL), (4, C102_GYRO), (5, MTI_GYRO)):
        yield Claim(
            place=f"Figure {figure}",
            quantity=f"ASD of the {channel.name}: measured, state space, optimised",
            printed="the optimised curve is nearer", evaluate=partial(_evaluate_nearer, channel),
            basis="come back", page=f"papers.html#maia-{channel.sensor}-{channel.channel}",
            check="tests/test_score.py",
        )  # fmt: skip
    for figure, better, worse, printed, value in (
        (6, MTI_ACCEL, C102_ACCEL, "the same profile", 1.0),
        (7, MTI_GYRO, C102_GYRO, "up to 100 times", 100.0),
    ):
        yield Claim(
            place=f"Figure {figure}",
            quantity=f"largest ratio of the ASDs, {worse.name} over {better.name}, by Table 2, "
            "from 1 s to half of 10 h",
            printed=printed, value=value, evaluate=partial(_evaluate_separation, better, worse),
            basis="computed",
            reason=_WHY_APART[figure], page="index.html", check=f"{_TEST}::test_figures_6_and_7",
            tolerance=0.1,
        )  # fmt: skip
    for figure, channel in ((8, MTI_ACCEL), (9, MTI_GYRO)):
        model, unit = channel.table_2, _get_units(channel)["B"]
        ratio = TABLE_4["N"][channel.channel] / math.sqrt(float(model.allan_variance(1.0)))
        line = Claim(
            place=f"Figure {figure}",
            quantity=f"line N/√τ of the datasheet over the optimised ASD at 1 s, {channel.name}",
            printed="“coherent”", value=1.0,
            evaluate=numeric_result(ratio, f"{ratio / math.sqrt(2.0):.3g} as a one-sided density"),
            reason=_WHY_4["N"], basis="computed", check=f"{_TEST}::test_table_4",
            page=f"papers.html#maia-{channel.sensor}-{channel.channel}",
        )  # fmt: skip
        yield line
        floor = FLOOR * TABLE_4["B"][channel.channel]
        yield replace(
            line, quantity=f"line 0,664 B of the datasheet: lowest ASD of the {channel.name}",
            printed=_format_derived(_format_printed(floor, unit)), value=floor, unit=unit,
            evaluate=numeric_result(lowest_point(model)[1]), reason=_WHY_4["B"],
        )  # fmt: skip


_WHY_APART = {
    6: "the process of the C102-F9R is twice as large and four times as slow: alike to a half at "
    "short τ alone",
    7: "the figures of the C102-F9R are most probably in degrees: 57.3 times less, it is like "
    "other gyros of its class, and its recording has the finding suspicious_unit",
}


def _evaluate_slopes(_: Evidence) -> Result:
    tau = np.array([10.0, 1000.0])
    slopes = [
        float(np.diff(np.log10(model.allan_variance(tau))).item()) / 4.0
        for model in (NoiseModel(N=1.0), NoiseModel(B=1.0), NoiseModel(K=1.0))
    ]
    right = np.allclose(slopes, [-0.5, 0.0, 0.5], atol=1e-9)
    return Result(
        words=", ".join(f"{slope:+.2g}" for slope in slopes),
        verdict="agrees" if right else "differs",
    )


def _evaluate_nearer(channel: Channel, run: Evidence) -> Result:
    scores = {row.method: row.rms_log10 for row in run.of_log(ScoreRow, _get_log(channel))}
    authors, optimised = scores.get("authors"), scores.get("paper")
    if authors is None or optimised is None:
        return no_result(_NO_LOG)
    return Result(
        words=f"from the simulated log {authors:.3f} decades by Table 1, "
        f"{optimised:.3f} optimised; it cannot be otherwise, as the log is of Table 2",
        verdict="agrees" if optimised < authors else "differs",
    )


def _evaluate_separation(better: Channel, worse: Channel, _: Evidence) -> Result:
    tau = np.geomspace(1.0, DURATION / 2.0, 1000)
    ratio = np.sqrt(worse.table_2.allan_variance(tau) / better.table_2.allan_variance(tau))
    place = int(np.argmax(ratio))
    end = ", the end, and still growing" if place == tau.size - 1 else ""
    words = f"at {tau[place]:,.0f} s{end}; the least is {ratio.min():.3g}"
    walks = worse.table_2.K / better.table_2.K
    return Result(value=float(ratio[place]), words=f"{words}, that of the K {walks:.3g}")


_CLAIM_GROUPS: tuple[Callable[[], Iterator[Claim]], ...] = (
    _tables_1_and_2, _yield_own_curve, _table_3, _table_4, _figures, equations,
)  # fmt: skip

_PLACE_ORDER = ("Table", "Figure", "Equation")


def _get_sort_key(claim: Claim) -> tuple[int, int]:
    kind, number = claim.place.split()
    return _PLACE_ORDER.index(kind), int(number)


@cache
def _claims() -> tuple[Claim, ...]:
    claims = sorted((claim for part in _CLAIM_GROUPS for claim in part()), key=_get_sort_key)
    return tuple(replace(claim, printed_unit=_format_unit(claim.unit)) for claim in claims)


PAPER = Paper(about=MAIA, claims=lambda _: _claims())
