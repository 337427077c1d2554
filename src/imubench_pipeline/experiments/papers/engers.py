"""What Engers prints of SCC2130, MPU-9250 and BNO055, and of his simulator: 001."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

from imubench_pipeline.experiments.papers.about import ENGERS, Verdict
from imubench_pipeline.experiments.papers.claims import Claim, Found, Paper, nothing
from imubench_pipeline.experiments.papers.evidence import Evidence, Log
from imubench_pipeline.noise import FLOOR

DEGREE = math.pi / 180.0
READ_AT = 3600.0
"""Cluster time at which the figures under "PSD" were read, s (section 2.2.4)."""

_RECORDING = "sim_engers"
_PASSED = 0.1
"""Cluster time above which the low-passes of these sensors no longer show, s."""

_MOSTLY = 80.0
"""Per cent of a curve in the band that is much: its points are not independent."""

_TEST = "tests/papers/test_engers.py"
_NO_LOG = "it takes the simulated log of this sensor"
_UNITS = {
    "density": ("rad/s/sqrt(Hz)", "(°/s)/√Hz"),
    "rate": ("rad/s", "°/s"),
    "coefficient": ("rad/s/K", "(°/s)/K"),
}


@dataclass(frozen=True)
class Axis:
    """What tables 2 to 7 print of an axis, as printed."""

    sensor: str
    axis: str
    psd: float  # read at 1 h, deg/s
    bias: float  # deg/s
    floor: float  # of the curve, deg/s; printed per kelvin

    @property
    def name(self) -> str:
        """Sensor and axis in words."""
        return f"{NAMES[self.sensor]} {self.axis}"

    @property
    def log(self) -> Log:
        """The channel that is simulated of it."""
        return Log(self.sensor, _RECORDING, f"gyro_{self.axis}")

    def meeting(self, scaled: bool) -> float:
        """Return the cluster time at which the -1/2 line meets the floor, s.

        Scaled: of N as read at 1 h; else of the figure as if it were N.
        """
        density = self.psd * math.sqrt(READ_AT) if scaled else self.psd
        return (density / self.floor) ** 2


NAMES = {"scc2130": "SCC2130", "mpu9250": "MPU-9250", "bno055": "BNO055"}
AXES = (
    Axis("scc2130", "x", 0.000075, 0.0981, 0.00041),
    Axis("mpu9250", "x", 0.00086, 5.1740, 0.0164),
    Axis("mpu9250", "y", 0.00080, -3.3396, 0.015),
    Axis("mpu9250", "z", 0.00255, -6.0934, 0.039),
    Axis("bno055", "x", 0.0032, -5.3726, 0.02),
    Axis("bno055", "y", 0.0035, -5.0823, 0.0225),
    Axis("bno055", "z", 0.00165, -6.3640, 0.0065),
)
OF_NOISE = {"scc2130": "Table 5", "mpu9250": "Table 6", "bno055": "Table 7"}
OF_BIAS = {"scc2130": "Table 2", "mpu9250": "Table 3", "bno055": "Table 4"}


def first_order_of_noise_bandwidth(bandwidth: float) -> float:
    """Return the cut-off of a low-pass of first order whose noise bandwidth is this, Hz.

    White noise passes it as it passes a filter of this width with steep edges: pi/2 times the
    cut-off is its noise bandwidth.
    """
    return 2.0 / math.pi * bandwidth


def _in(quantity: str, claim: Claim) -> Claim:
    """Return a claim with the unit of a quantity of `_UNITS`, printed in degrees."""
    unit, printed = _UNITS[quantity]
    return replace(claim, unit=unit, printed_unit=printed, scale=DEGREE)


def _said(words: str, verdict: Verdict = "agrees") -> Callable[[Evidence], Found]:
    return lambda _: Found(words=words, verdict=verdict)


def _number(value: float, words: str = "") -> Callable[[Evidence], Found]:
    return lambda _: Found(value=value, words=words)


def _published(axis: Axis, place: str, parameter: str) -> Callable[[Evidence], Found]:
    """Return what the run finds of a figure that is printed of an axis."""

    def found(run: Evidence) -> Found:
        of_axis = run.of_log("published_figures", axis.log, place=place, parameter=parameter)
        row = next((row for row in of_axis if row["of"] == "log"), None)
        if row is None or row["value"] is None:
            return nothing(_NO_LOG)
        curve = None if parameter == "bias" else row["curve"]
        words = "" if curve is None else f"{curve / DEGREE:.4g} read from its curve, before the fit"
        return Found(value=row["value"], lower=row["lower"], upper=row["upper"], words=words)

    return found


def _page(sensor: str, axis: str = "x") -> str:
    return f"boards.html#engers-{sensor}-gyro_{axis}"


def _datasheets() -> Iterator[Claim]:
    def line(sensor: str, quantity: str, printed: str, value: float, found: float | None,
             reason: str, unit: str) -> Claim:  # fmt: skip
        known = Found(value=found * DEGREE) if found is not None else nothing(reason)
        return _in(unit, Claim(
            place="Table 1", quantity=f"{NAMES[sensor]}: {quantity}", printed=printed,
            value=value * DEGREE, found=lambda _: known, basis="computed", reason=reason,
            page=_page(sensor), check="tests/test_printed.py",
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
        page = _page(axis.sensor, axis.axis)
        yield _in("rate", Claim(
            place=OF_BIAS[axis.sensor], quantity=f"fixed drift, {axis.name}",
            printed=f"{axis.bias:.4f} °/s", value=axis.bias * DEGREE,
            found=_published(axis, OF_BIAS[axis.sensor], "bias"), basis="come back", page=page,
            check="tests/test_published_figures.py", tolerance=0.03,
            reason="temperature moves the mean; ours is that at the mean temperature"
        ))  # fmt: skip
    for axis in AXES:
        page, place = _page(axis.sensor, axis.axis), OF_NOISE[axis.sensor]
        yield _in("density", Claim(
            place=place, quantity=f"PSD, {axis.name}: N is 60 times the figure",
            printed=f"{axis.psd:g} (°/s)/√Hz", value=math.sqrt(READ_AT) * axis.psd * DEGREE,
            found=_published(axis, place, "N"), basis="come back", page=page,
            check="tests/test_published_figures.py",
            reason="the log is one draw of the noise", ))  # fmt: skip
        yield Claim(
            place=place, quantity=f"PSD, {axis.name}: where the −½ line meets the floor",
            printed="decades below the floor (Figures 29 to 32)", unit="s",
            found=_said(
                f"at {axis.meeting(True):.3g} s with the 60, at {axis.meeting(False):.2g} s "
                "without",
                "misprint",
            ),
            basis="computed", page=page, check=f"{_TEST}::test_the_factor_of_60_has_its_check",
            reason="read at 1 h the line is at N/60: without the factor the curve would be flat "
            "from its first samples on",
        )  # fmt: skip
        yield _in("rate", Claim(
            place=place, quantity=f"dynamic drift, {axis.name}: B is the floor over 0.664",
            printed=f"{axis.floor:g} (°/s)/K", value=axis.floor / FLOOR * DEGREE,
            found=_published(axis, place, "B"), basis="come back", page=page,
            check="tests/test_published_figures.py",
            reason="a floor in °/s, printed as a coefficient of temperature; read from the curve B "
            "holds what N and temperature add to the floor", ))  # fmt: skip
    yield Claim(
        place="Table 8", quantity="SCC2130: ARW by the datasheet", printed="0.0002861 °/√Hz",
        found=_said("0.0002236 by his own rule, 0.005/√500; 0.0002861 °/s is the bias instability, "
                    "1.03 °/h", "misprint"),
        basis="checked", page=_page("scc2130"),
        check=f"{_TEST}::test_table_8_has_its_columns_mixed",
        reason="the columns are mixed",
    )  # fmt: skip
    yield Claim(
        place="Table 8", quantity="SCC2130: dynamic drift by the datasheet", printed="0.00041 °/K",
        found=_said("the floor that Table 5 measured, not the datasheet's 0.0002861 °/s",
                    "misprint"),
        basis="checked", page=_page("scc2130"),
        check=f"{_TEST}::test_table_8_has_its_columns_mixed",
        reason="the columns are mixed, and the floor is no coefficient of temperature",
    )  # fmt: skip
    yield Claim(
        place="Section 4.1.1", quantity="deviation of a sample from a density",
        printed="0.005 (°/s)/√Hz divided by √500",
        found=_said("σ = N √f: 0.005/√2 × √500 = 0.079 °/s before the low-pass", "misprint"),
        basis="checked", page="theory.html#units", check="tests/test_conversions.py",
        reason="a density is multiplied by the root of the rate, and its one side is √2 too much",
    )  # fmt: skip
    yield _in("density", Claim(
        place="Section 4.1.1", quantity="SCC2130: noise beside its datasheet",
        printed="lower, above all the ARW", value=0.005 / math.sqrt(2.0) * DEGREE,
        found=_number(AXES[0].psd * math.sqrt(READ_AT) * DEGREE),
        basis="computed", page=_page("scc2130"),
        check=f"{_TEST}::test_the_factor_of_60_has_its_check",
        reason="higher: N is 60 times the figure of Table 5, and the datasheet's density one-sided",
    ))  # fmt: skip
    yield Claim(
        place="Section 4.1.2", quantity="MPU-9250: cut-off in the simulation",
        printed="120 Hz in place of 188 Hz, as more alike", value=120.0, unit="Hz",
        found=_number(first_order_of_noise_bandwidth(188.0),
                      "first order, noise bandwidth 188 Hz"),
        basis="computed", page=_page("mpu9250"), tolerance=0.01,
        check=f"{_TEST}::test_a_first_order_of_120_hz_passes_the_noise_of_188_hz",
    )  # fmt: skip


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
              page="", check=_SIMULATOR),
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
              page="", check=_SIMULATOR),
)  # fmt: skip


def _equations() -> Iterator[Claim]:
    for one in _EQUATIONS:
        yield Claim(
            place=f"Equation {one.number}", quantity=one.quantity, printed=one.printed,
            found=_said(one.words, one.verdict), basis="checked", reason=one.reason,
            page=one.page, check=one.check,
        )  # fmt: skip


_PICTURES = {
    1: "a photograph of a BNO055", 2: "classes of gyroscopes, by another author",
    3: "the acceleration of Coriolis", 4: "a package", 5: "a chip",
    11: "the blocks of the simulator", 12: "a dialogue", 13: "a dialogue", 14: "a dialogue",
    15: "a dialogue", 16: "the blocks of a sensor", 17: "the blocks of a sensor",
    18: "the blocks of three sensors", 19: "the blocks of the board", 20: "a dialogue",
    21: "photographs of the boards", 22: "a photograph", 33: "a dialogue", 37: "a dialogue",
    43: "a dialogue", 49: "a dialogue",
}  # fmt: skip
_GRADES: dict[str, str | None] = {"stim300": None, "hg4930": "C", "ln_200": None}
"""The sensors that are to be reached, and which grade of them."""

_DRAWN = {
    6: "slopes of the bias instability", 7: "slope of white noise",
    8: "correlation and density of white noise", 9: "normal distribution",
    10: "slopes of five noise terms",
}  # fmt: skip
_CURVES = {
    29: ("scc2130", "x"), 30: ("scc2130", "x"), 31: ("mpu9250", "x"), 32: ("bno055", "x"),
    36: ("scc2130", "x"), 40: ("scc2130", "x"), 41: ("scc2130", "x"), 42: ("scc2130", "x"),
    45: ("mpu9250", "x"), 46: ("mpu9250", "y"), 47: ("mpu9250", "z"), 48: ("mpu9250", "x"),
    51: ("bno055", "x"), 52: ("bno055", "y"), 53: ("bno055", "z"), 54: ("bno055", "x"),
}  # fmt: skip
_SAMPLES = {
    23: "scc2130", 24: "scc2130", 25: "mpu9250", 26: "mpu9250", 27: "bno055", 28: "bno055",
}  # fmt: skip
_COMPARED = {
    34: "scc2130",
    35: "scc2130",
    38: "scc2130",
    39: "scc2130",
    44: "mpu9250",
    50: "bno055",
}
_SAID = {
    31: "Allan deviation, all axes; z has more noise", 32: "correlated noise, and a sinusoid",
    42: "noise lower than the datasheet’s", 54: "captioned MPU9250, of the BNO055",
}  # fmt: skip


def _figures() -> Iterator[Claim]:
    for number in range(1, 55):
        place = f"Figure {number}"
        if number in _PICTURES:
            yield Claim(
                place=place, quantity=_PICTURES[number], printed="–", basis="checked",
                found=lambda _: nothing("a picture, or a window of his program"), check=_TEST,
            )  # fmt: skip
        elif number in _DRAWN:
            yield Claim(
                place=place, quantity=_DRAWN[number], printed="–", basis="checked",
                found=_said("drawn from the terms themselves"), page="theory.html#terms",
                check="tests/noise/test_terms.py",
            )  # fmt: skip
        elif number in _CURVES:
            sensor, axis = _CURVES[number]
            yield Claim(
                place=place, quantity=_SAID.get(number, f"Allan deviation, {NAMES[sensor]} {axis}"),
                printed="a curve", found=_inside(sensor, axis), basis="simulated",
                page=_page(sensor, axis), check="tests/test_reconstruction.py",
                reason="the simulated curve leaves the band of the reconstructions",
            )  # fmt: skip
        elif number in _SAMPLES:
            sensor = _SAMPLES[number]
            what = "temperature" if number % 2 == 0 else "samples"
            yield Claim(
                place=place, quantity=f"{what} over time, {NAMES[sensor]}", printed="a figure",
                found=_there(sensor, "a simulated log"), basis="simulated",
                page=f"recordings/{sensor}/{_RECORDING}.html", check=_SIMULATOR,
            )  # fmt: skip
        else:
            sensor = _COMPARED[number]
            yield Claim(
                place=place, quantity=f"samples measured and simulated, {NAMES[sensor]}",
                printed="alike, by eye", found=_deviations(sensor), basis="simulated",
                page=f"recordings/{sensor}/{_RECORDING}.html#gyro_x",
                check="tests/test_samples_of_models.py",
                reason="the simulation before the fit has another deviation of samples",
            )  # fmt: skip


def _there(sensor: str, words: str) -> Callable[[Evidence], Found]:
    def found(run: Evidence) -> Found:
        there = run.has(sensor, _RECORDING)
        return Found(words=words, verdict="agrees") if there else nothing(_NO_LOG)

    return found


def _inside(sensor: str, axis: str) -> Callable[[Evidence], Found]:
    """Return how much of the curve is in the band of the logs that the estimate makes."""

    def found(run: Evidence) -> Found:
        log = Log(sensor, _RECORDING, f"gyro_{axis}")
        for method in ("compensated", "likelihood"):
            bands = run.of_log("reconstruction", log, method=method)
            if bands:
                break
        else:
            return nothing(_NO_LOG)
        table = "allan_compensated" if method == "compensated" else "allan"
        measured = {row["tau"]: row["adev"] for row in run.of_log(table, log)}
        seen = [row for row in bands if row["tau"] >= _PASSED and row["tau"] in measured]
        inside = sum(row["lower"] <= measured[row["tau"]] <= row["upper"] for row in seen)
        share = 100.0 * inside / len(seen)
        return Found(
            words=f"above {_PASSED:g} s {share:.0f} % of the curve is in the 95 % band of logs of "
            f"the estimate ({method})",
            verdict="agrees" if share > _MOSTLY else "differs",
        )

    return found


def _deviations(sensor: str) -> Callable[[Evidence], Found]:
    """Return the deviation of the samples of the models over that of the log."""

    def found(run: Evidence) -> Found:
        rows = run.rows("samples_of_models", sensor=sensor, recording=_RECORDING, what="deviation")
        by = {(row["channel"], row["of"]): row["mean"] for row in rows}
        ratios = {
            of: [value / by[channel, "log"] for (channel, own), value in by.items() if own == of]
            for of in ("before", "after")
        }
        if not all(ratios.values()):
            return nothing(_NO_LOG)
        words = "; ".join(
            f"deviation of the samples {of} the fit "
            + ", ".join(f"{ratio:.3g}" for ratio in ratios[of])
            + " times the log’s"
            for of in ratios
        )
        alike = all(abs(ratio - 1.0) < 0.05 for ratio in ratios["after"])
        return Found(words=words, verdict="agrees" if alike else "differs")

    return found


def _reached(run: Evidence) -> Found:
    """Return how many SCC2130 reach the tactical class, and what 25 of them, fused, leave."""
    words = []
    for sensor, name in (("scc2130", "of one SCC2130 it takes"), ("scc2130_x25", "of 25 fused")):
        numbers = []
        for row in run.rows("grades", sensor=sensor, quantity="gyro"):
            if row["grade"] not in _GRADES or row["option"] not in (None, _GRADES[row["grade"]]):
                continue
            figure = "white noise" if row["statistic"] == "N" else "lowest point"
            if row["n"] is not None:
                numbers.append(f"{row['n']:.2g} for the {figure} of {row['grade']}")
            elif row["n_upper"] is not None:
                numbers.append(f"at most {row['n_upper']:.2g} for the {figure} of {row['grade']}")
        if numbers:
            words.append(f"{name} {', '.join(numbers)}")
    if not words:
        return nothing("it takes the simulated logs of both")
    return Found(words="; ".join(words), verdict="agrees")


def _aim() -> Iterator[Claim]:
    yield Claim(
        place="Section 1.0.1.1", quantity="several cheap gyros in place of a better one: how many",
        printed="left for later", found=_reached, basis="simulated", page="fusion.html#grades",
        check="tests/test_specimens.py",
    )  # fmt: skip


@cache
def _claims() -> tuple[Claim, ...]:
    return (*_datasheets(), *_of_axes(), *_equations(), *_figures(), *_aim())


PAPER = Paper(about=ENGERS, claims=lambda _: _claims())
