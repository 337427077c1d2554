"""Claims of Silva et al. about a SiRRS01-03 and the Earth's rotation."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np

from imubench_pipeline.extensions.calibration.tables import CalibrationRow
from imubench_pipeline.extensions.earth_rate.known_rate import STARTS, as_printed
from imubench_pipeline.extensions.earth_rate.simulation import PAPER_MODEL, PAPER_RATE
from imubench_pipeline.extensions.papers.about import SILVA
from imubench_pipeline.extensions.papers.claims import (
    Claim,
    Paper,
    Result,
    no_result,
    numeric_result,
    verbal_result,
)
from imubench_pipeline.extensions.papers.evidence import Evidence, Log
from imubench_pipeline.extensions.papers.silva_runs import (
    DEGREE,
    NO_LOG,
    SENSOR,
    filtered,
    turned,
)
from imubench_pipeline.extensions.papers.silva_weeks import evaluate_weeks
from imubench_pipeline.noise import FLOOR, PEAK_TAU

AT_REST = Log(SENSOR, "sim_published", "gyro_x")
_TEST = "tests/papers/test_silva.py"
_WEEKS = f"{_TEST}::test_a_week_shows_k_by_reading_and_two_days_seldom_do"
_GIVEN = "tests/earth_rate/test_known_rate.py"


@cache
def minimum_of_the_curve() -> tuple[float, float]:
    """Return tau and deviation of the lowest point of the curve of the four printed numbers, SI."""
    tau = np.geomspace(1.0, 1e4, 40_001)
    variance = PAPER_MODEL.allan_variance(tau)
    place = int(np.argmin(variance))
    return float(tau[place]), math.sqrt(float(variance[place]))


def _evaluate_parameter(name: str) -> Callable[[Evidence], Result]:
    def evaluate(run: Evidence) -> Result:
        row = run.parameter(AT_REST, name, "likelihood_gm")
        if row is None:
            return no_result(NO_LOG)
        if row.value is None:
            status = row.status.replace("_", " ")
            return Result(words=status, verdict="differs", reason=row.reason)
        return Result(value=row.value, lower=row.lower, upper=row.upper)

    return evaluate


def _evaluate_reading(name: str) -> Callable[[Evidence], Result]:
    """Return what reading the simulated curve gives, as the paper read its own."""

    def evaluate(run: Evidence) -> Result:
        row = run.parameter(AT_REST, name, "curve")
        if row is None:
            return no_result(NO_LOG)
        if row.value is None:
            return Result(words="no such slope", verdict="differs", reason=row.reason)
        return Result(value=row.value)

    return evaluate


def _equations() -> Iterator[Claim]:
    def equation(number: int, quantity: str, printed: str, **known: object) -> Claim:
        about = {
            "basis": "checked",
            "evaluate": verbal_result("holds", "agrees"),
            "check": _TEST,
        } | known
        return Claim(
            place=f"Equation {number}",
            quantity=quantity,
            printed=printed,
            **about,  # type: ignore[arg-type]  # fields of a claim, of several types
        )

    yield equation(
        1, "Allan variance of overlapping clusters", "Σ over L − 2n, divided by L − 2n",
        evaluate=verbal_result(
            "the same estimator; θ of L samples has L + 1 points, and L − 2n + 1 terms",
            "agrees"),
        page="theory.html#allan", check="tests/test_allan.py",
    )  # fmt: skip
    of_curve = {"page": "theory.html#reading", "check": "tests/test_estimation.py"}
    yield equation(2, "N on the −½ line", "N = σ √τ", **of_curve)
    yield equation(
        3, "B from the floor", "B = σ/0.664", value=0.664, printed_unit="", tolerance=1e-3,
        evaluate=numeric_result(FLOOR, "√(2 ln 2/π)"), page="theory.html#bias-instability",
        check="tests/noise/test_terms.py",
    )  # fmt: skip
    yield equation(
        4, "T_B from the place of the floor", "T_b = τ/1.89", value=1.89, tolerance=2e-3,
        evaluate=numeric_result(
            PEAK_TAU, "the peak of a Gauss-Markov process alone: N and K move it"
        ),
        page="theory.html#bias-instability", check="tests/noise/test_terms.py",
    )  # fmt: skip
    yield equation(5, "K on the +½ line", "K = σ √(3/τ)", **of_curve)
    yield equation(
        6, "output of the gyro", "θ̃ = θ + z_f + z_rrw + n + b",
        evaluate=verbal_result(
            "rates are meant: N, Gauss-Markov process, walk and bias add up", "agrees"
        ),
        page="theory.html#terms", check="tests/test_simulate.py",
    )  # fmt: skip
    of_filter = {"page": "earth_rate.html#two-position", "check": _GIVEN}
    filters = f"{_GIVEN}::test_it_is_the_filter_of_equations_15_and_16"
    yield equation(7, "state equation", "ẋ = Ax + Bu + Gw", **of_filter)
    yield equation(8, "measurement equation", "y = Cx + n", **of_filter)
    yield equation(9, "prediction of the state", "x⁻(k+1) = F x⁺(k) + Γ u(k)", **of_filter)
    yield equation(
        10, "update of the state", "x⁺(k+1) = x⁻(k+1) + K(k) (y(k) − H x⁻(k+1))",
        evaluate=verbal_result("gain and measurement of k + 1 are meant", "misprint"),
        reason="the measurement of one time would correct the state of the next",
        page="earth_rate.html#two-position", check=filters,
    )  # fmt: skip
    yield equation(11, "gain", "K = P⁻Hᵀ (H P⁻Hᵀ + R_d)⁻¹", **of_filter)
    yield equation(
        12, "prediction of the covariance", "P⁻(k+1) = F P⁺(k) Fᵀ + G Q_d Gᵀ", **of_filter
    )
    steps = int(np.isfinite(as_printed(PAPER_MODEL, PAPER_RATE, 20, STARTS["degrees"])).sum())
    yield equation(
        13, "update of the covariance", "P⁺ = (I − K H)⁻¹ P⁻",
        evaluate=verbal_result(
            f"(I − K H) P⁻; as printed P leaves all numbers after {steps} samples",
            "misprint"),
        reason="the inverse adds what a measurement takes off: P grows without bound",
        page="earth_rate.html#two-position",
        check=f"{_GIVEN}::test_equation_13_as_printed_grows_without_bound",
    )  # fmt: skip
    yield equation(
        14, "Earth's rate from a pair of dwells", "ω = (ω_N − ω_S)/(2 cos φ)",
        page="earth_rate.html#two-position", check="tests/earth_rate/test_pairs.py",
        evaluate=verbal_result(
            "the mean over pairs, with its σ by the noise; A-B-A differences take a steady "
            "drift out", "agrees"),
    )  # fmt: skip
    yield equation(
        15, "model of the slow errors", "F = diag(e^(−βT), 1), Q_d = T diag(S_f, S_K)",
        evaluate=verbal_result("holds to the first order; the variance of a step of z_f is "
                    "S_B T_B/2 (1 − e^(−2T/T_B))", "agrees"),
        page="earth_rate.html#two-position", check=filters,
    )  # fmt: skip
    yield equation(
        16, "measurement of the filter", "y = ω − ω̃",
        evaluate=verbal_result(
            "needs ω to find ω: given twice the rate it finds twice the rate", "differs"
        ),
        reason="the filter is given the Earth's rate that it then finds; the honest one has the "
        "rate as an unknown state, seen with the sign of the dwell",
        page="earth_rate.html#two-position",
        check=f"{_GIVEN}::test_it_finds_what_it_is_given_whatever_the_truth",
    )  # fmt: skip


def _noise() -> Iterator[Claim]:
    yield Claim(
        place="Section 3", quantity="white noise, and the noise that drives z_f and z_rrw",
        printed="n ~ N(0, N²), w_f ~ N(0, S_B), w_rrw ~ N(0, K²)",
        evaluate=verbal_result("of a sample N²/T; of a step S_B T and K² T", "misprint"),
        basis="checked",
        reason="densities printed as variances; section 7 divides and multiplies by T_s",
        page="theory.html#terms", check="tests/test_simulate.py",
    )  # fmt: skip
    degrees = (("N", PAPER_MODEL.N, "0.0122 °/√s", "rad/s/sqrt(Hz)", "°/√s"),
               ("B", PAPER_MODEL.B, "0.0027 °/s", "rad/s", "°/s"),
               ("K", PAPER_MODEL.K, "6.8314 × 10⁻⁵ °/s^(3/2)", "rad/s^(3/2)",
                "°/s^(3/2)"))  # fmt: skip
    page = f"recordings/{SENSOR}/sim_published.html"
    for name, value, printed, unit, shown in degrees:
        yield Claim(
            place="Section 5.1", quantity=name, printed=printed, value=value, unit=unit,
            printed_unit=shown, scale=DEGREE, evaluate=_evaluate_parameter(name), basis="come back",
            page=page, check="tests/test_simulated_logs.py",
            reason="the log is one draw of the noise",
        )  # fmt: skip
    yield Claim(
        place="Section 5.1", quantity="T_B", printed="238.1 s", value=238.1, unit="s",
        evaluate=_evaluate_parameter("T_B"), basis="come back", page=page,
        check="tests/test_simulated_logs.py", reason="the log is one draw of the noise",
    )  # fmt: skip
    tau, level = minimum_of_the_curve()
    yield Claim(
        place="Figure 2", quantity="cluster time of the floor",
        printed="T_b = 238.1 s, so 1.89 T_b = 450 s",
        value=PAPER_MODEL.T_B * 1.89 if PAPER_MODEL.T_B else None, unit="s",
        evaluate=numeric_result(tau),
        basis="computed", page=page, check=f"{_TEST}::test_the_four_numbers_do_not_fit_each_other",
        reason="the four printed numbers have their lowest point elsewhere: they are not of one "
        "curve, as B and T_B are read where N and K add to it",
    )  # fmt: skip
    yield Claim(
        place="Figure 2", quantity="deviation at the floor",
        printed="B = 0.0027 °/s, so 0.664 B = 0.00179 °/s",
        value=FLOOR * PAPER_MODEL.B, unit="rad/s", printed_unit="°/s", scale=DEGREE,
        evaluate=numeric_result(level), basis="computed", page=page,
        check=f"{_TEST}::test_the_four_numbers_do_not_fit_each_other",
        reason="at the lowest point of their curve N, B and K add up",
    )  # fmt: skip
    yield Claim(
        place="Figure 3", quantity="T_B, read from the curve of the printed numbers",
        printed="238.1 s", value=238.1, unit="s",
        evaluate=numeric_result(tau / PEAK_TAU), basis="computed", page=page,
        check=f"{_TEST}::test_the_four_numbers_do_not_fit_each_other",
        reason="reading the curve that the four numbers make does not give them back",
    )  # fmt: skip
    for name, _, printed, unit, shown in degrees:
        value = {"N": PAPER_MODEL.N, "B": PAPER_MODEL.B, "K": PAPER_MODEL.K}[name]
        yield Claim(
            place="Figure 3", quantity=f"{name}, read from a simulated curve", printed=printed,
            value=value, unit=unit, printed_unit=shown, scale=DEGREE,
            evaluate=_evaluate_reading(name),
            basis="simulated", page=page, check="tests/test_estimation.py",
            reason="read where the other terms add to it",
        )  # fmt: skip
    for name, printed, value, unit, scale, why in (
        ("K", "6.8314 × 10⁻⁵ °/s^(3/2)", PAPER_MODEL.K, "rad/s^(3/2)", DEGREE, "read where the "
         "process adds to it"),
        ("T_B", "238.1 s", 238.1, "s", 1.0, "N and K move the floor of the curve: no week of these "
         "numbers reads so"),
    ):  # fmt: skip
        yield Claim(
            place="Figure 3", quantity=f"{name}, read from curves of simulated weeks",
            printed=printed, value=value, unit=unit, scale=scale,
            printed_unit="°/s^(3/2)" if name == "K" else "",
            evaluate=evaluate_weeks(name, AT_REST, NO_LOG), basis="simulated", page=page,
            check=_WEEKS,
            reason=why,
        )  # fmt: skip


def _future() -> Iterator[Claim]:
    for quantity, page, words, check in (
        ("a rate table", "earth_rate.html#rate-table", "scale factor and bias from known rates",
         "benchmarks/alignment_and_rate_table.py"),
        ("longer runs, other dwells", "earth_rate.html#needs",
         "what each takes, and the best dwell",
         "tests/earth_rate/test_prediction.py"),
        ("no turns: the bias", "earth_rate.html#at-rest",
         "told where latitude and direction are known; the rate itself is not",
         "tests/calibration/test_still.py"),
    ):  # fmt: skip
        yield Claim(
            place="Section 9", quantity=quantity, printed="left for later",
            evaluate=verbal_result(words, "done here"), basis="simulated", page=page, check=check,
        )  # fmt: skip


def _evaluate_alignment(run: Evidence) -> Result:
    rows = run.rows(
        CalibrationRow, sensor=f"{SENSOR}_triad", recording="sim_aligned", parameter="heading"
    )
    row = next(iter(rows), None)
    if (
        row is None
        or row.value is None
        or row.lower is None
        or row.upper is None
        or row.duration is None
        or row.truth is None
    ):
        return no_result("it takes the simulated log of the triad")
    half = (row.upper - row.lower) / 2.0
    return Result(
        words=f"heading {row.value / DEGREE:.1f}° ± {half / DEGREE:.1f}° (95 %) after "
        f"{row.duration / 60.0:.0f} min of turns by 180°; it is {row.truth / DEGREE:g}°",
        verdict="done here",
    )


def _triad() -> Iterator[Claim]:
    yield Claim(
        place="Section 9", quantity="a triad that aligns itself", printed="left for later",
        evaluate=_evaluate_alignment, basis="simulated", page="earth_rate.html#positions",
        check="tests/alignment/test_positions.py",
    )  # fmt: skip


def _pictures() -> Iterator[Claim]:
    yield Claim(
        place="Figure 1", quantity="slopes of the Allan deviation", printed="−½, 0, +½",
        evaluate=verbal_result("each noise term with its slope", "agrees"), basis="checked",
        page="theory.html#terms", check="tests/noise/test_terms.py",
    )  # fmt: skip
    yield Claim(
        place="Figure 4", quantity="the gyro on its support", printed="a photograph",
        evaluate=lambda _: no_result("a photograph has no counterpart"), basis="checked",
        check=_TEST,
    )  # fmt: skip


@cache
def _claims() -> tuple[Claim, ...]:
    return (*_equations(), *_pictures(), *_noise(), *turned(), *filtered(), *_future(), *_triad())


PAPER = Paper(about=SILVA, claims=lambda _: _claims())
