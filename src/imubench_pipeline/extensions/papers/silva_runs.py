"""Claims of Silva et al. about the runs turned between north and south, and their filter."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.earth_rate import published as causes
from imubench_pipeline.extensions.earth_rate.known_rate import STARTS, mean_sigma
from imubench_pipeline.extensions.earth_rate.published import PrintedRun, RunDesign, allowed_sigmas
from imubench_pipeline.extensions.earth_rate.simulation import (
    ASSUMED_LATITUDE,
    ASSUMED_TURNING,
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_PERIOD,
    PAPER_RATE,
)
from imubench_pipeline.extensions.earth_rate.tables import EarthRateRow
from imubench_pipeline.extensions.papers.about import Verdict
from imubench_pipeline.extensions.papers.claims import (
    Claim,
    Result,
    no_result,
    numeric_result,
    verbal_result,
)
from imubench_pipeline.extensions.papers.evidence import Evidence
from imubench_pipeline.extensions.papers.silva_settling import evaluate_settling

DEGREE = math.pi / 180.0
PRINTED = {
    "1": 0.004396,
    "2": 0.0004846,
    "3": 0.002483,
    "4": -0.000193,
    "4, last 13 min": 0.001132,
}
"""Estimates of the Earth's rate by run, deg/s (section 6)."""

DESIGN = RunDesign(PAPER_PERIOD, ASSUMED_TURNING, PAPER_RATE, ASSUMED_LATITUDE)
SENSOR = "sirrs01_03"
NO_LOG = "it takes the simulated log of this sensor"
_Z_95 = 1.96
_TEST = "tests/papers/test_silva.py"
_TEST_OF_SETTLING = f"{_TEST}::test_runs_settle_after_minutes_and_not_by_the_unit_of_the_start"
_TEST_OF_CAUSES = "tests/earth_rate/test_hypotheses.py"
_TEST_OF_KNOWN_RATE = "tests/earth_rate/test_known_rate.py"


def page_of(run: str) -> str:
    """Return the page of the simulated recording of a run."""
    return f"recordings/{SENSOR}/sim_run_{run}.html"


@cache
def printed_run(run: str) -> PrintedRun:
    """Return a run as printed, with the sigma that the printed noise gives the mean over pairs."""
    duration = 60.0 * PAPER_MINUTES[run]
    sigma = allowed_sigmas(DESIGN, duration, PAPER_MODEL)["sigma"]
    return PrintedRun(duration, PRINTED[run] * DEGREE, float(sigma))


def off(run: PrintedRun) -> float:
    """Return the error of a printed estimate of the Earth's rate, rad/s."""
    return run.value - EARTH_RATE


def gain_of_the_filter(run: str) -> float:
    """Return the relative reduction of sigma by a filter with unknown rate, against pairs."""
    sigmas = allowed_sigmas(DESIGN, 60.0 * PAPER_MINUTES[run], PAPER_MODEL)
    return float(1.0 - sigmas["sigma_filter"] / sigmas["sigma"])


def turned() -> Iterator[Claim]:
    """Yield the lines of section 6."""
    yield Claim(
        place="Section 1", quantity="Earth's rate", printed="15 °/h or ≈ 0.004167 °/s",
        value=0.004167 * DEGREE, unit="rad/s", printed_unit="°/s", scale=DEGREE, tolerance=1e-3,
        evaluate=numeric_result(EARTH_RATE), basis="checked",
        check="tests/earth_rate/test_published.py",
        page="earth_rate.html",
        reason="a turn takes a sidereal day, 23 h 56 min",
    )  # fmt: skip
    for figure, run in (("5", "1"), ("6", "2"), ("7", "3"), ("8", "4")):
        turns = round(2 * PAPER_MINUTES[run]) - 1
        yield Claim(
            place=f"Figure {figure}", quantity=f"turns of run {run}",
            printed=f"{PAPER_MINUTES[run]:g} min, turned every 30 s: so {turns} turns",
            value=float(turns), evaluate=_evaluate_turns(run), basis="come back", page=page_of(run),
            tolerance=0.0, check="benchmarks/dwell_detection.py", reason="turns that do not show",
        )  # fmt: skip
    for run, value in PRINTED.items():
        yield Claim(
            place="Section 6", quantity=f"Earth's rate, run {run}", printed=f"{value:g} °/s",
            value=value * DEGREE, unit="rad/s", printed_unit="°/s", scale=DEGREE,
            evaluate=_evaluate_allowed(run), basis="computed", page="earth_rate.html#published",
            check="tests/earth_rate/test_published.py::test_the_runs_of_the_paper",
            reason="beyond what the noise of the printed figures allows: another error of that "
            "run; what each cause asks for stands below",
        )  # fmt: skip
    explained = {
        "2": "a short run: the mean does not attenuate the noise enough",
        "3": "the time was almost enough to filter the noise",
        "4": "the value found is basically noise",
    }
    for run, printed in explained.items():
        z = off(printed_run(run)) / printed_run(run).sigma
        yield Claim(
            place="Section 6", quantity=f"cause of the error of run {run}", printed=printed,
            evaluate=verbal_result(f"{z:.1f} σ of that noise", "refuted"), basis="computed",
            reason="the mean over pairs of a run this long has less noise than that",
            page="earth_rate.html#published",
            check="tests/earth_rate/test_published.py::test_the_runs_of_the_paper",
        )  # fmt: skip
    yield from _hypotheses()


def _evaluate_turns(run: str) -> Callable[[Evidence], Result]:
    def evaluate(evidence: Evidence) -> Result:
        rows = evidence.rows(
            EarthRateRow, sensor=SENSOR, recording=f"sim_run_{run}", part="whole", method="pairs"
        )
        turns = rows[0].turns if rows else None
        return no_result(NO_LOG) if turns is None else Result(value=float(turns))

    return evaluate


def _evaluate_allowed(run: str) -> Callable[[Evidence], Result]:
    def evaluate(_: Evidence) -> Result:
        half = _Z_95 * printed_run(run).sigma
        return Result(
            value=EARTH_RATE,
            lower=EARTH_RATE - half,
            upper=EARTH_RATE + half,
            words=f"off by {off(printed_run(run)) / printed_run(run).sigma:+.1f} σ of the pairs",
        )

    return evaluate


def _hypotheses() -> Iterator[Claim]:
    runs = {run: printed_run(run) for run in PRINTED}
    last = runs["4, last 13 min"]
    first = runs["4"].without(last)
    named = {"2": runs["2"], "3": runs["3"], "4": runs["4"]}

    def asks(what: Callable[[PrintedRun], str]) -> str:
        return ", ".join(f"{what(run)} (run {name})" for name, run in named.items())

    def drift(run: PrintedRun) -> float:
        return causes.drift_needed(off(run), PAPER_PERIOD, ASSUMED_LATITUDE)

    def cause(quantity: str, printed: str, words: str, verdict: Verdict, reason: str) -> Claim:
        return Claim(
            place="Section 6", quantity=f"hypothesis: {quantity}", printed=printed,
            evaluate=verbal_result(words, verdict), reason=reason, basis="computed",
            page="earth_rate.html#published", check=_TEST_OF_CAUSES,
        )  # fmt: skip

    warmed = causes.warm_up(drift(first), drift(last), runs["4"].duration, last.duration)
    assert warmed is not None  # of the printed numbers
    yield cause(
        "warm-up",
        "run 4 began 15 min after the sensor was powered",
        "a bias that drifts one way by "
        + asks(lambda run: f"{drift(run) * run.duration / DEGREE:.2f} °/s")
        + f"; of run 4 with a time constant of {warmed.time_constant / 60.0:.0f} min",
        "possible",
        "it can explain all of them, and alone that the last 13 min of run 4 are "
        f"{causes.apart(last, first):.1f} σ nearer to the truth than the rest; but it asks as "
        "steep a drift of run 2, of which no warm-up is told, and a course that Figure 8 would "
        f"show: {warmed.total / PAPER_MODEL.N / math.sqrt(PAPER_RATE):.0f} times the deviation of "
        "a sample. A-B-A differences of the same samples would take it out",
    )
    alone = causes.one_miscount(runs["4"], last, EARTH_RATE)
    yield cause(
        "turns miscounted",
        "–",
        "wrong senses for "
        + asks(lambda run: f"{100 * (_compute_wrong_part(run) or 0.0):.0f} % of the time"),
        "possible",
        "it can explain all of them, and why all lie between −ω and ω: one miscount each in runs 2 "
        f"and 3, two in run 4, as one leaves {alone:.1f} "
        "σ between its two values; a peak that is missed, or taken twice, is enough. From the turn "
        "on the levels alternate the other way",
    )
    yield cause(
        "samples of the turns in the means",
        "outliers were removed",
        "an angle of "
        + asks(lambda run: f"{_compute_angle(run) / DEGREE:.3f}°")
        + " left in each dwell",
        "possible",
        "so little of the 180° is enough to explain each run; the same throughout, it does "
        f"not explain that the parts of run 4 are {causes.apart(last, first):.1f} σ apart",
    )
    clocks = {name: [run] for name, run in named.items()} | {"4": [first, last]}
    slips = {
        name: causes.slip_needed(run, PAPER_PERIOD, EARTH_RATE) for name, run in clocks.items()
    }
    yield cause(
        "dwells cut by a clock that is off",
        "the sampling frequency was 32 Hz on average",
        "a clock that is off by "
        + ", ".join(f"{100 * error:.1f} % (run {name})" for name, (error, _) in slips.items()),
        "possible",
        "it can explain each run, of run 4 both values, but asks another clock of each and none of "
        "run 1; the paper cuts between the peaks of the turns, which follow the clock",
    )
    yield cause(
        "axis off the meridian",
        "–",
        "off by " + asks(lambda run: f"{(_compute_heading(run) or 0.0) / DEGREE:.0f}°"),
        "refuted",
        "nobody lays an axis that far off, on a support for alignment, and another way in each run",
    )
    least = math.cos(ASSUMED_LATITUDE)
    yield cause(
        "another latitude in equation 14",
        "–",
        f"no latitude gives less than {least:.2f} times the rate",
        "refuted",
        "1/cos φ is at least 1, and the axis senses ω cos φ of the place",
    )
    yield cause(
        "more noise than at rest",
        "–",
        "noise of " + asks(lambda run: f"{abs(off(run)) / run.sigma / _Z_95:.1f} times"),
        "refuted",
        "N of those runs would show in each sample of Figures 6 to 8, and run 1 is within "
        "the noise at rest",
    )
    yield cause(
        "scale factor",
        "–",
        "a factor of " + asks(lambda run: f"{run.value / EARTH_RATE:.2f}"),
        "refuted",
        "one sensor has one factor, and it is no negative one",
    )


def _compute_wrong_part(run: PrintedRun) -> float | None:
    return causes.wrong_part(run.value, EARTH_RATE)


def _compute_heading(run: PrintedRun) -> float | None:
    return causes.heading_needed(run.value, EARTH_RATE)


def _compute_angle(run: PrintedRun) -> float:
    return abs(causes.angle_needed(off(run), PAPER_PERIOD - ASSUMED_TURNING, ASSUMED_LATITUDE))


def filtered() -> Iterator[Claim]:
    """Yield the lines of sections 7 and 8."""
    yield Claim(
        place="Section 7", quantity="start of the covariance", printed="P₀ = 0.1 I",
        evaluate=verbal_result(
            "no unit: as (°/s)² 3.05 × 10⁻⁵ (rad/s)², as (rad/s)² 3,283 times that",
            "misprint"),
        reason="all else in the paper is in degrees; both are shown", basis="checked",
        page=page_of("2"), check=f"{_TEST_OF_KNOWN_RATE}::test_its_start_has_no_unit_in_print",
    )  # fmt: skip
    yield Claim(
        place="Figure 9", quantity="run 2: cumulative mean of the samples without correction",
        printed="an order of magnitude off the true rate",
        evaluate=verbal_result(
            "the mean of both positions: the bias, in which the Earth's rate cancels",
            "differs"),
        reason="the samples point north and south in turn; their mean is no estimate of the rate",
        basis="checked", page=page_of("2"),
        check=f"{_TEST}::test_the_mean_of_all_samples_is_the_bias",
    )  # fmt: skip
    for figure, run in (("10", "1"), ("11", "2"), ("12", "3"), ("13", "4")):
        yield Claim(
            place=f"Figure {figure}",
            quantity=f"run {run}: time after which the cumulative mean stays at the true rate",
            printed="about 10³ samples, 30 to 60 s", value=1000.0 / PAPER_RATE, unit="s",
            evaluate=evaluate_settling(run, SENSOR, NO_LOG), basis="simulated",
            page=f"{page_of(run)}#estimates", check=_TEST_OF_SETTLING,
            reason="within a tenth of it; the mean has the white noise of all samples so far, "
            "whether the filter is given the rate or not. A single run says little: runs differ by "
            "more than the units of P₀",
        )  # fmt: skip
    scatter = {
        name: float(mean_sigma(PAPER_MODEL, PAPER_RATE, 1000, start, 0.0)[-1])
        for name, start in STARTS.items()
    }
    yield Claim(
        place="Section 7", quantity="error of the cumulative mean after 10³ samples, 1 σ",
        printed="aligned with the true rate",
        evaluate=verbal_result(
            f"{_format_rate(scatter['degrees'])} °/h of the Earth's rate with P₀ in (°/s)², "
            f"{_format_rate(scatter['radians'])} in (rad/s)², of {_format_hours(EARTH_RATE)} °/h",
            "refuted"),
        reason=f"a mean over 31 s of this noise is not better, even of a filter that is given the "
        "rate; a pair of dwells, 60 s, tells it to "
        f"{_format_hours(_compute_pair_sigma())} °/h without",
        basis="computed", page=page_of("1"),
        check=f"{_TEST}::test_errors_are_those_of_the_earths_rate",
    )  # fmt: skip
    gains = [100.0 * gain_of_the_filter(run) for run in PRINTED]
    yield Claim(
        place="Section 8", quantity="what a Kalman filter improves",
        printed="can much improve the results, in accuracy and in time",
        evaluate=verbal_result(
            f"σ is {min(gains):.1f} to {max(gains):.1f} % less than that of the mean over "
            "pairs", "refuted"),
        reason="turned every 30 s, the noise is white noise, of which the mean over pairs loses "
        "nothing; what the filter shows is the rate that it is given",
        basis="computed", page="earth_rate.html#published",
        check=f"{_TEST}::test_a_filter_improves_the_pairs_by_a_per_cent",
    )  # fmt: skip


def _compute_pair_sigma() -> float:
    """Return the standard deviation of the Earth's rate from one pair of dwells, rad/s."""
    return float(allowed_sigmas(DESIGN, 2.0 * PAPER_PERIOD, PAPER_MODEL)["sigma"])


def _format_rate(along_axis: float) -> str:
    """Return an error along the axis as an error of the Earth's rate, divided by cos φ."""
    return _format_hours(along_axis / math.cos(ASSUMED_LATITUDE))


def _format_hours(rate: float) -> str:
    return f"{rate / DEGREE * 3600.0:.1f}"
