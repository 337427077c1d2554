"""Claims of Engers about SCC2130, MPU-9250 and BNO055, and about his simulator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from imubench_pipeline.extensions.fusion.tables import PublishedFigureRow
from imubench_pipeline.extensions.papers.about import ENGERS, Verdict
from imubench_pipeline.extensions.papers.claims import (
    Claim,
    Paper,
    Result,
    no_result,
    numeric_result,
    verbal_result,
)
from imubench_pipeline.extensions.papers.engers_aim import aim
from imubench_pipeline.extensions.papers.engers_axes import (
    AXES,
    DATASHEETS,
    DEGREE,
    NAMES,
    NO_LOG,
    OF_BIAS,
    OF_NOISE,
    RATES,
    READ_AT,
    Axis,
    in_unit,
    page_of,
)
from imubench_pipeline.extensions.papers.engers_figures import figures
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.noise import FLOOR

_TEST = "tests/papers/test_engers.py"
_OF_BOARD = "tests/test_published_figures.py"


def first_order_of_noise_bandwidth(bandwidth: float) -> float:
    """Return the cut-off of a low-pass of first order whose noise bandwidth is this, Hz.

    White noise passes it as it passes a filter of this width with steep edges: pi/2 times the
    cut-off is its noise bandwidth.
    """
    return 2.0 / math.pi * bandwidth


def _evaluate_published(
    axis: Axis, place: str, parameter: str, times: float
) -> Callable[[Evidence], Result]:
    """Return the evaluation of a printed figure of an axis from the run.

    The printed figure is ``times`` the parameter.
    """

    def evaluate(run: Evidence) -> Result:
        of_axis = run.of_log(PublishedFigureRow, axis.log, place=place, parameter=parameter)
        row = next((row for row in of_axis if row.of == "log"), None)
        if row is None or row.value is None:
            return no_result(NO_LOG)
        value, lower, upper = (
            None if end is None else times * end for end in (row.value, row.lower, row.upper)
        )
        curve = None if parameter == "bias" else row.curve
        words = ""
        if curve is not None:
            shown = np.format_float_positional(
                times * curve / DEGREE, precision=3, fractional=False, trim="-"
            )
            words = f"{shown} read from its curve, before the fit"
        return Result(value=value, lower=lower, upper=upper, words=words)

    return evaluate


def _datasheets() -> Iterator[Claim]:
    def line(sensor: str, quantity: str, printed: str, value: float, found: float | None,
             reason: str, unit: str) -> Claim:  # fmt: skip
        known = Result(value=found * DEGREE) if found is not None else no_result(reason)
        return in_unit(unit, Claim(
            place="Table 1", quantity=f"{NAMES[sensor]}: {quantity}", printed=printed,
            value=value * DEGREE, evaluate=lambda _: known, basis="computed", reason=reason,
            page=page_of(sensor), check="tests/test_printed.py",
        ))  # fmt: skip

    secondary = "the document is not at hand: what is known of it is what this paper quotes"
    yield line("scc2130", "PSD", "0.005 (°/s)/√Hz", 0.005, None, secondary, "density")
    yield line("scc2130", "fixed drift", "±1 °/s", 1.0, None, secondary, "rate")
    yield line("scc2130", "dynamic drift", "0.008 (°/s)/K", 0.008, None, secondary, "coefficient")
    yield line(
        "bno055", "PSD", "0.014 (°/s)/√Hz", 0.014, 0.1 / math.sqrt(47.0),
        "the document prints 0.1 °/s rms over 47 Hz and no density", "density",
    )  # fmt: skip
    yield line(
        "bno055", "fixed drift", "±3 °/s", 3.0, 1.0,
        "±3 °/s is the largest that the document prints, ±1 °/s is typical; all three axes of "
        "Table 4 are beyond both", "rate",
    )  # fmt: skip
    yield line("bno055", "dynamic drift", "0.015 (°/s)/K", 0.015, 0.015, "", "coefficient")
    yield line("mpu9250", "PSD", "0.01 (°/s)/√Hz", 0.01, 0.01, "", "density")
    yield line("mpu9250", "fixed drift", "±5 °/s", 5.0, 5.0, "", "rate")
    yield line(
        "mpu9250", "dynamic drift", "0.05 (°/s)/K", 0.05, 30.0 / 125.0,
        "the document prints ±30 °/s over -40 to 85 °C and no coefficient; 0.05 is printed of "
        "another gyro of the vendor", "coefficient",
    )  # fmt: skip


def _of_axes() -> Iterator[Claim]:
    for axis in AXES:
        place = OF_BIAS[axis.sensor]
        yield in_unit("rate", Claim(
            place=place, quantity=f"fixed drift, {axis.name}", printed=f"{axis.bias_as} °/s",
            value=axis.bias * DEGREE, evaluate=_evaluate_published(axis, place, "bias", 1.0),
            basis="come back", page=axis.page, check=_OF_BOARD, tolerance=0.0,
            reason="temperature moves the mean; ours is that at the mean temperature"
        ))  # fmt: skip
    for axis in AXES:
        place = OF_NOISE[axis.sensor]
        yield in_unit("rate", Claim(
            place=place, quantity=f"PSD, {axis.name}: N/60, the −½ line at 1 h",
            printed=f"{axis.psd_as} (°/s)/√Hz", value=axis.psd * DEGREE,
            evaluate=_evaluate_published(axis, place, "N", 1.0 / math.sqrt(READ_AT)),
            basis="come back",
            page=axis.page, check=_OF_BOARD, reason="the log is one draw of the noise",
        ))  # fmt: skip
        yield _factor(axis, place)
        yield in_unit("rate", Claim(
            place=place, quantity=f"fixed drift, {axis.name}", printed=f"{axis.bias_as} °/s",
            value=axis.bias * DEGREE,
            evaluate=numeric_result(axis.bias * DEGREE, f"as in {OF_BIAS[axis.sensor]}"),
            basis="checked", page=axis.page, tolerance=0.0,
            check=f"{_TEST}::test_what_is_typed_here_is_what_the_board_is_simulated_from",
        ))  # fmt: skip
        yield in_unit("rate", Claim(
            place=place, quantity=f"dynamic drift, {axis.name}: the floor, 0.664 B",
            printed=f"{axis.floor_as} (°/s)/K", value=axis.floor * DEGREE,
            evaluate=_evaluate_published(axis, place, "B", FLOOR), basis="come back",
            page=axis.page,
            check=_OF_BOARD,
            reason="a floor in °/s, printed as a coefficient of temperature; read from the curve "
            "it holds what N and temperature add", ))  # fmt: skip
    yield Claim(
        place="Table 8", quantity="SCC2130: fixed drift by the datasheet", printed="0 °/s",
        evaluate=verbal_result("left out: the Allan deviation does not see it"), basis="checked",
        page=page_of("scc2130"), check=f"{_TEST}::test_a_fixed_drift_does_not_move_the_curve",
    )  # fmt: skip
    yield Claim(
        place="Table 8", quantity="SCC2130: ARW by the datasheet", printed="0.0002861 °/√Hz",
        evaluate=verbal_result(
            "0.0002236 by his own rule, 0.005/√500; 0.0002861 °/s is the bias instability, "
            "1.03 °/h", "misprint"),
        basis="checked", page=page_of("scc2130"),
        check=f"{_TEST}::test_table_8_has_its_columns_mixed",
        reason="the columns are mixed",
    )  # fmt: skip
    yield Claim(
        place="Table 8", quantity="SCC2130: dynamic drift by the datasheet", printed="0.00041 °/K",
        evaluate=verbal_result("the floor that Table 5 measured, not the datasheet's 0.0002861 °/s",
                    "misprint"),
        basis="checked", page=page_of("scc2130"),
        check=f"{_TEST}::test_table_8_has_its_columns_mixed",
        reason="the columns are mixed, and the floor is no coefficient of temperature",
    )  # fmt: skip
    yield Claim(
        place="Section 4.1.1", quantity="deviation of a sample from a density",
        printed="0.005 (°/s)/√Hz divided by √500",
        evaluate=verbal_result(
            "σ = N √f: 0.005/√2 × √500 = 0.079 °/s before the low-pass", "misprint"
        ),
        basis="checked", page="theory.html#units", check="tests/test_conversions.py",
        reason="a density is multiplied by the root of the rate, and its one side is √2 too much",
    )  # fmt: skip
    two_sided = AXES[0].density / DATASHEETS["scc2130"]
    yield Claim(
        place="Section 4.1.1", quantity="SCC2130: noise beside its datasheet",
        printed="lower, above all the ARW",
        evaluate=verbal_result(
            f"N by Table 5 is {two_sided:.2f} times the datasheet’s density if that is "
            f"two-sided, {math.sqrt(2.0) * two_sided:.2f} times if one-sided", "possible"),
        basis="computed", page=page_of("scc2130"),
        check=f"{_TEST}::test_the_factor_of_60_has_its_check",
        reason="lower or higher by the side of a density whose document is not at hand; most "
        "vendors print one-sided ones",
    )  # fmt: skip
    yield Claim(
        place="Section 4.1.2", quantity="MPU-9250: cut-off in the simulation",
        printed="120 Hz in place of 188 Hz, as more alike", value=120.0, unit="Hz",
        evaluate=numeric_result(first_order_of_noise_bandwidth(188.0),
                      "first order, noise bandwidth 188 Hz"),
        basis="computed", page=page_of("mpu9250"), tolerance=0.01,
        check=f"{_TEST}::test_a_first_order_of_120_hz_passes_the_noise_of_188_hz",
    )  # fmt: skip


def _factor(axis: Axis, place: str) -> Claim:
    """Return the line for and against N as 60 times what is printed of an axis."""
    samples = axis.meeting(False) * RATES[axis.sensor]
    sheet = DATASHEETS[axis.sensor]
    return Claim(
        place=place, quantity=f"PSD, {axis.name}: is N 60 times the figure?",
        printed="the −½ line, read at 1 h (section 3.8.1)",
        evaluate=verbal_result(
            f"the −½ line meets the floor at {axis.meeting(True):.3g} s with the 60, at "
            f"{axis.meeting(False):.2g} s without", "possible"),
        basis="computed", page=axis.page, check=f"{_TEST}::test_the_factor_of_60_has_its_check",
        reason=f"for it: without the 60 the floor would begin after {_sample(samples)}, and hardly "
        f"a −½ line could be drawn; {_AGAINST[axis.density > 2.0 * sheet]}N is then "
        f"{axis.density / sheet:.2g} times the datasheet’s as Table 1 quotes it "
        f"({math.sqrt(2.0) * axis.density / sheet:.2g} times, of a one-sided density)",
    )  # fmt: skip


_AGAINST = {True: "against it: ", False: ""}


def _sample(number: float) -> str:
    return f"{number:.0f} samples" if number >= 1.5 else "one sample"


@dataclass(frozen=True)
class _Equation:
    number: int
    quantity: str
    printed: str
    words: str = "holds"
    verdict: Verdict = "agrees"
    reason: str = ""
    page: str = "theory.html#terms"
    check: str = "tests/noise/test_terms.py"


_FLOOR_PAGE, _SIDES = "theory.html#bias-instability", "theory.html#sidedness"
_SIMULATOR = "tests/sensor_model/test_truth.py"
_OF_SIDES = "of two-sided densities; of one-sided ones √2 less"
_ONE_SIDE = "a vendor's density is one-sided: N is √2 less than what this gives"
_CONVERSIONS = "tests/test_conversions.py"
_CURVE_PAGE, _OF_CURVES = "theory.html#allan", "tests/test_allan.py"

_EQUATIONS = (
    _Equation(1, "a spinning top", "ΣM = −I φ′² sin θ cos θ + …", "", "not to be had",
              "of spinning gyroscopes; these vibrate", "", _TEST),
    _Equation(2, "reading of a gyro", "Ω_g = Ω + s_g + n_g", "rate, bias and noise",
              check=_SIMULATOR),
    _Equation(3, "density of the bias instability", "(R²/2π)/f for f ≤ f₀, 0 for f > 0",
              "B² in place of R², f > f₀", "misprint",
              "R is the rate ramp; the second case is f > f₀"),
    _Equation(4, "B from the floor", "σ/0.662", "σ/0.664", "differs",
              "√(2 ln 2/π) is 0.6643; equation 5 has it right", _FLOOR_PAGE),
    _Equation(5, "floor of the bias instability", "√(2 ln 2/π) B ≅ 0.664 B", page=_FLOOR_PAGE),
    _Equation(6, "ARW from a density of power", "√PSD/60", _OF_SIDES, "differs", _ONE_SIDE,
              _SIDES, _CONVERSIONS),
    _Equation(7, "ARW from a density of amplitude", "FFT/60", _OF_SIDES, "differs", _ONE_SIDE,
              _SIDES, _CONVERSIONS),
    _Equation(8, "ARW from rms and bandwidth", "σ/(60 √BW)", _OF_SIDES, "differs", _ONE_SIDE,
              _SIDES, _CONVERSIONS),
    _Equation(9, "density of white noise", "N²"),
    _Equation(10, "Allan variance of white noise", "N²/τ"),
    *(
        _Equation(number, quantity, printed, check="tests/test_noise.py")
        for number, quantity, printed in (
            (11, "correlation of white noise", "0 for τ ≠ 0"),
            (12, "the same at 0", "A δ(τ)"),
            (13, "its density", "A"),
            (14, "of a limited band", "A for |ω| ≤ ω_c"),
            (15, "its correlation", "(A ω_c/π) sin(ω_c τ)/(ω_c τ)"),
            (16, "normal distribution", "exp(−V²/2σ²)/(√(2π) σ)"),
        )
    ),
    *(
        _Equation(number, quantity, printed, page=_CURVE_PAGE, check=_OF_CURVES)
        for number, quantity, printed in (
            (17, "mean of a cluster", "(1/T) ∫ Ω dt"),
            (18, "mean of the next cluster", "(1/T) ∫ Ω dt from t_k + T"),
            (19, "their difference", "Ω_next − Ω_k"),
            (20, "Allan variance", "½⟨(Ω_next − Ω_k)²⟩"),
            (21, "angle", "∫ Ω dt"),
            (22, "mean of a cluster from the angle", "(θ(k+n) − θ(k))/T"),
        )
    ),
    _Equation(23, "Allan variance from the density", "4 ∫ S sin⁴(πfτ)/(πfτ)² df", "two-sided S"),
    _Equation(24, "error of a deviation", "100/√(2(k − 1)) %",
              "of separate clusters; overlapping ones have more degrees of freedom", "differs",
              "an approximation; limits here follow from the degrees of freedom of the noise",
              "theory.html#intervals", "tests/test_confidence.py"),
    _Equation(25, "model of the simulator", "ω_g = ω + β_g + b_g + η_g",
              "the same, with correlated noise, lines, lag, register and range",
              check=_SIMULATOR),
)  # fmt: skip


def _equations() -> Iterator[Claim]:
    for one in _EQUATIONS:
        yield Claim(
            place=f"Equation {one.number}", quantity=one.quantity, printed=one.printed,
            evaluate=verbal_result(one.words, one.verdict), basis="checked", reason=one.reason,
            page=one.page, check=one.check,
        )  # fmt: skip


@cache
def _claims() -> tuple[Claim, ...]:
    return (*_datasheets(), *_of_axes(), *_equations(), *figures(), *aim())


PAPER = Paper(about=ENGERS, claims=lambda _: _claims())
