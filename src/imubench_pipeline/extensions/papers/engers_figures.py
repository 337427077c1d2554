"""Claims of Engers about his figures; the text does not contain their curves."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from imubench_pipeline.extensions.papers.claims import (
    Claim,
    Result,
    no_result,
    numeric_result,
    verbal_result,
)
from imubench_pipeline.extensions.papers.engers_axes import (
    DATASHEETS,
    DEGREE,
    NAMES,
    NO_LOG,
    RATES,
    RECORDING,
    Axis,
    axes_of,
    in_unit,
    page_of,
)
from imubench_pipeline.extensions.papers.evidence import Evidence, Log
from imubench_pipeline.model.estimates import (
    AllanRow,
    CompensatedAllanRow,
    ModelSampleRow,
    ReconstructionRow,
)

_TEST = "tests/papers/test_engers.py"
_TEST_OF_SAMPLES = "tests/test_samples_of_models.py"
_MIN_TAU_ABOVE_LOW_PASS = 0.1
"""Cluster time above which the low-passes of these sensors have no effect, s."""

_MIN_PERCENT_IN_BAND = 80.0
"""Least share of a curve, in per cent, within a pointwise band of 95 %. By chance, one curve in
twenty is below."""

_MAX_DEVIATION_DIFFERENCE = 0.05
"""Largest relative difference of two deviations of samples that look alike."""

_PICTURE_FIGURES = {
    1: "a photograph of a BNO055", 2: "classes of gyroscopes, by another author",
    3: "the acceleration of Coriolis", 4: "a package", 5: "a chip",
    11: "the blocks of the simulator", 12: "a dialogue", 13: "a dialogue", 14: "a dialogue",
    15: "a dialogue", 16: "the blocks of a sensor", 17: "the blocks of a sensor",
    18: "the blocks of three sensors", 19: "the blocks of the board", 20: "a dialogue",
    21: "photographs of the boards", 22: "a photograph", 33: "a dialogue", 37: "a dialogue",
    43: "a dialogue", 49: "a dialogue",
}  # fmt: skip
_TERM_FIGURES = {
    6: "slopes of the bias instability", 7: "slope of white noise",
    8: "correlation and density of white noise", 9: "normal distribution",
    10: "slopes of five noise terms",
}  # fmt: skip
_LOG_FIGURES = {
    23: "scc2130", 24: "scc2130", 25: "mpu9250", 26: "mpu9250", 27: "bno055", 28: "bno055",
}  # fmt: skip
_MEASURED_FIGURES = {29: ("scc2130", "x"), 30: ("scc2130", "x")}
_FITTED_FIGURES = {
    40: ("scc2130", "x"), 45: ("mpu9250", "x"), 46: ("mpu9250", "y"), 47: ("mpu9250", "z"),
    51: ("bno055", "x"), 52: ("bno055", "y"), 53: ("bno055", "z"),
}  # fmt: skip


def figures() -> Iterator[Claim]:
    """Yield the lines of figures 1 to 54, in their order."""
    special = {
        31: _axes_alike(31, "mpu9250"), 32: _axes_alike(32, "bno055"),
        34: _larger(), 35: _zoomed(35, "before"), 36: _floor_missed(), 38: _after_the_fit(),
        39: _zoomed(39, "after"), 41: _of_the_vendor(), 42: _by_the_datasheet_scc2130(),
        44: _mpu9250_fitted(), 48: _by_the_datasheet_mpu9250(), 50: _bno055_fitted(),
        54: _by_the_datasheet_bno055(),
    }  # fmt: skip
    for figure in range(1, 55):
        yield special[figure] if figure in special else _make_figure(figure)


def _make_figure(figure: int) -> Claim:
    place = f"Figure {figure}"
    if figure in _PICTURE_FIGURES:
        return Claim(
            place=place, quantity=_PICTURE_FIGURES[figure], printed="–", basis="checked",
            evaluate=lambda _: no_result("a picture, or a window of his program"), check=_TEST,
        )  # fmt: skip
    if figure in _TERM_FIGURES:
        return Claim(
            place=place, quantity=_TERM_FIGURES[figure], printed="–", basis="checked",
            evaluate=verbal_result("drawn from the terms themselves"), page="theory.html#terms",
            check="tests/noise/test_terms.py",
        )  # fmt: skip
    if figure in _LOG_FIGURES:
        sensor = _LOG_FIGURES[figure]
        warm = figure % 2 == 0
        return Claim(
            place=place, quantity=f"{'temperature' if warm else 'samples'} over time, "
            f"{NAMES[sensor]}", printed="a figure", basis="simulated",
            evaluate=lambda _: no_result(
                "the course of his log is not in the text, and that of the simulated one is "
                "assumed" if warm else
                "the course of his log is not in the text; its mean is the fixed drift"
            ),
            page=f"recordings/{sensor}/{RECORDING}.html", check=_TEST,
        )  # fmt: skip
    if figure in _MEASURED_FIGURES:
        sensor, axis = _MEASURED_FIGURES[figure]
        return Claim(
            place=place, quantity=f"Allan deviation of his log, {NAMES[sensor]} {axis}",
            printed="a curve", basis="simulated", page=page_of(sensor, axis), check=_TEST,
            evaluate=lambda _: no_result(
                "the curve is not in the text; what he read of it is Table 5"),
        )  # fmt: skip
    sensor, axis = _FITTED_FIGURES[figure]
    return Claim(
        place=place, quantity=f"Allan deviation of log and fitted model, {NAMES[sensor]} {axis}",
        printed="very much alike", evaluate=_evaluate_band(sensor, axis), basis="come back",
        page=page_of(sensor, axis), check=f"{_TEST}::test_one_curve_in_twenty_is_less_in_its_band",
        reason="less of the curve is in the band than of nineteen in twenty by chance",
    )  # fmt: skip


def _axes_alike(figure: int, sensor: str) -> Claim:
    axes = axes_of(sensor)
    y, z = (axes[axis].psd / axes["x"].psd for axis in "yz")
    printed = {
        "mpu9250": "x and y much alike, z has more noise",
        "bno055": "x and y much alike, z has less noise; correlated noise and a sinusoid",
    }
    more = {"mpu9250": "", "bno055": "; of the latter two no figure is printed"}
    return Claim(
        place=f"Figure {figure}", quantity=f"Allan deviation of his log, {NAMES[sensor]}",
        printed=printed[sensor], basis="computed", page=page_of(sensor), check=_TEST_OF_AXES,
        evaluate=verbal_result(f"N of y {y:.2f} and of z {z:.2f} times that of x, by his table"
                   f"{more[sensor]}"),
    )  # fmt: skip


_TEST_OF_AXES = f"{_TEST}::test_what_he_says_of_axes_and_datasheets"


def _scc2130() -> Axis:
    return axes_of("scc2130")["x"]


def _larger() -> Claim:
    axis = _scc2130()
    rate = RATES[axis.sensor]
    ratio = math.sqrt(axis.psd * rate) / (axis.density * math.sqrt(rate))
    return Claim(
        place="Figure 34", quantity="samples measured, and simulated before the fit, SCC2130",
        printed="the simulation is larger",
        evaluate=verbal_result(
            f"a block that takes the figure of Table 5 as a power makes {ratio:.2f} times "
            "the deviation that N = 60 times the figure makes", "possible"),
        basis="computed", page=_get_page_of_samples(axis.sensor), check=_TEST_OF_BLOCK,
        reason="he entered it as the noise power of a block (section 3.3), whose samples have the "
        "variance of power times rate; the gains beside it are not printed",
    )  # fmt: skip


_TEST_OF_BLOCK = f"{_TEST}::test_a_figure_entered_as_power_is_larger_and_makes_no_floor"


def _zoomed(figure: int, of: str) -> Claim:
    return Claim(
        place=f"Figure {figure}",
        quantity=f"the same, enlarged: {of} the fit, SCC2130",
        printed="alike" if of == "before" else "very much alike",
        evaluate=_evaluate_neighbours("scc2130", of), basis="come back",
        page=_get_page_of_samples("scc2130"),
        check=_TEST_OF_SAMPLES, reason="neighbouring samples go together otherwise",
    )  # fmt: skip


def _floor_missed() -> Claim:
    axis = _scc2130()
    met, lasted = axis.meeting(True), 18_000.0
    drift = axis.floor / 0.662 / lasted * met / math.sqrt(2.0)  # his divisor; 1 K over the log
    return Claim(
        place="Figure 36", quantity="Allan deviation of his log, and simulated before the fit",
        printed="the simulation misses the floor",
        evaluate=verbal_result(
            f"it must: as a coefficient, {axis.floor_as} (°/s)/K makes a steady course of "
            f"1 K, more than his log had, {axis.floor / drift:.0f} times less than the "
            f"floor, where that begins ({met:.0f} s)"),
        basis="computed", page=axis.page, check=_TEST_OF_BLOCK,
    )  # fmt: skip


def _after_the_fit() -> Claim:
    return Claim(
        place="Figure 38", quantity="samples measured, and simulated after the fit, SCC2130",
        printed="the simulation is slightly smaller",
        evaluate=_evaluate_deviations("scc2130", "differs"),
        basis="come back", page=_get_page_of_samples("scc2130"), check=_TEST_OF_SAMPLES,
        reason="he turned gains until the Allan curves looked alike, and says that his model lacks "
        "lesser noise; the estimate here is of a log that has none beside the model",
    )  # fmt: skip


def _of_the_vendor() -> Claim:
    return in_unit("rate", Claim(
        place="Figure 41", quantity="floor of the vendor’s own curve, SCC2130",
        printed="1.03 °/h, so 0.0002861 °/s", value=0.0002861 * DEGREE,
        evaluate=numeric_result(1.03 / 3600.0 * DEGREE, "the curve itself is not at hand"),
        basis="checked",
        page=page_of("scc2130"), tolerance=1e-3,
        check=f"{_TEST}::test_table_8_has_its_columns_mixed",
    ))  # fmt: skip


def _by_the_datasheet_scc2130() -> Claim:
    axis = _scc2130()
    two = (DATASHEETS[axis.sensor] / axis.floor) ** 2
    return Claim(
        place="Figure 42", quantity="Allan deviation by the datasheet, SCC2130",
        printed="log less noisy; the datasheet’s comes to the same floor later",
        evaluate=verbal_result(
            f"at {two:.0f} s if the density is two-sided, at {two / 2.0:.0f} s if "
            f"one-sided; the log at {axis.meeting(True):.0f} s", "possible"),
        basis="computed", page=axis.page, check=_TEST_OF_AXES,
        reason="later or earlier by the side of the density, as in section 4.1.1",
    )  # fmt: skip


def _mpu9250_fitted() -> Claim:
    return Claim(
        place="Figure 44", quantity="samples measured, and simulated after the fit, MPU-9250",
        printed="very much alike, above all z", evaluate=_evaluate_deviations("mpu9250", "agrees"),
        basis="come back", page=_get_page_of_samples("mpu9250"), check=_TEST_OF_SAMPLES,
        reason="the simulation has another deviation of samples",
    )  # fmt: skip


def _bno055_fitted() -> Claim:
    return Claim(
        place="Figure 50", quantity="samples simulated after the fit, BNO055",
        printed="x and y much alike, as in the log; z steadier", evaluate=_evaluate_axes("bno055"),
        basis="come back", page=_get_page_of_samples("bno055"), check=_TEST_OF_SAMPLES,
        reason="the axes of the simulation differ in another way than those of the log",
    )  # fmt: skip


def _by_the_datasheet_mpu9250() -> Claim:
    sheet = DATASHEETS["mpu9250"]
    times = ", ".join(f"{axis.density / sheet:.2g}" for axis in axes_of("mpu9250").values())
    return Claim(
        place="Figure 48", quantity="Allan deviation by the datasheet, MPU-9250",
        printed="close enough to the log’s; a ripple on the −½ line",
        evaluate=verbal_result(
            f"N by Table 6 is {times} times the datasheet’s density (x, y, z)", "differs"
        ),
        basis="computed", page=page_of("mpu9250"), check=_TEST_OF_AXES,
        reason="the gains that he had turned for the log went with the datasheet’s figures, or N "
        "is not 60 times what Table 6 prints; the ripple he puts down to readings of temperature",
    )  # fmt: skip


def _by_the_datasheet_bno055() -> Claim:
    noise, drift = DATASHEETS["bno055"], 0.015
    return Claim(
        place="Figure 54", quantity="Allan deviation by the datasheet, BNO055 (captioned MPU9250)",
        printed="the floor is not reached in 30 h",
        evaluate=verbal_result(
            f"nor can it be: {drift:g} (°/s)/K is no floor, which the −½ line of {noise:g} "
            f"(°/s)/√Hz would meet at {(noise / drift) ** 2:.2g} s"),
        basis="computed", page=page_of("bno055"), check=_TEST_OF_AXES,
    )  # fmt: skip


def _get_page_of_samples(sensor: str) -> str:
    return f"recordings/{sensor}/{RECORDING}.html#gyro_x"


def _evaluate_band(sensor: str, axis: str) -> Callable[[Evidence], Result]:
    """Return the evaluation of the share of the curve within the band of simulated logs."""

    def evaluate(run: Evidence) -> Result:
        log = Log(sensor, RECORDING, f"gyro_{axis}")
        for method in ("compensated", "likelihood"):
            bands = run.of_log(ReconstructionRow, log, method=method)
            if bands:
                break
        else:
            return no_result(NO_LOG)
        curve: type[AllanRow] | type[CompensatedAllanRow] = (
            CompensatedAllanRow if method == "compensated" else AllanRow
        )
        measured = {row.tau: row.adev for row in run.of_log(curve, log)}
        seen = [row for row in bands if row.tau >= _MIN_TAU_ABOVE_LOW_PASS and row.tau in measured]
        inside = sum(row.lower <= measured[row.tau] <= row.upper for row in seen)
        share = 100.0 * inside / len(seen)
        return Result(
            words=f"of the simulated log {share:.0f} % above {_MIN_TAU_ABOVE_LOW_PASS:g} s is in "
            f"the 95 % band of logs of its estimate ({method}); one in twenty has less than "
            f"{_MIN_PERCENT_IN_BAND:.0f} % by chance",
            verdict="agrees" if share >= _MIN_PERCENT_IN_BAND else "differs",
        )

    return evaluate


def _get_sample_deviations(run: Evidence, sensor: str) -> dict[tuple[str, str], float]:
    """Return the deviation of samples by channel, of the log and of the models; maybe none."""
    rows = run.rows(ModelSampleRow, sensor=sensor, recording=RECORDING, what="deviation")
    return {(row.channel, row.of): row.mean for row in rows if row.mean is not None}


def _evaluate_deviations(sensor: str, if_alike: str) -> Callable[[Evidence], Result]:
    """Return the evaluation of the deviation of samples, fitted model over log."""

    def evaluate(run: Evidence) -> Result:
        by = _get_sample_deviations(run, sensor)
        ratios = [
            value / by[channel, "log"] for (channel, of), value in by.items() if of == "after"
        ]
        if not ratios:
            return no_result(NO_LOG)
        shown = ", ".join(f"{ratio:.3f}" for ratio in ratios)
        alike = all(abs(ratio - 1.0) < _MAX_DEVIATION_DIFFERENCE for ratio in ratios)
        return Result(
            words=f"deviation of the samples {shown} times that of the simulated log",
            verdict="agrees" if alike and if_alike == "agrees" else "differs",
        )

    return evaluate


def _evaluate_axes(sensor: str) -> Callable[[Evidence], Result]:
    """Return the evaluation of the deviations of y and z over x, of log and model."""

    def evaluate(run: Evidence) -> Result:
        by = _get_sample_deviations(run, sensor)
        if not by:
            return no_result(NO_LOG)
        ratios = {
            of: [by[f"gyro_{axis}", of] / by["gyro_x", of] for axis in "yz"]
            for of in ("log", "after")
        }
        words = "; ".join(
            f"{name} y {ratios[of][0]:.2f} and z {ratios[of][1]:.2f} times x"
            for of, name in (("log", "deviation of the samples of the simulated log:"),
                             ("after", "of the fitted model:"))
        )  # fmt: skip
        alike = all(
            abs(model / log - 1.0) < _MAX_DEVIATION_DIFFERENCE
            for log, model in zip(ratios["log"], ratios["after"], strict=True)
        )
        return Result(words=words, verdict="agrees" if alike else "differs")

    return evaluate


def _evaluate_neighbours(sensor: str, of: str) -> Callable[[Evidence], Result]:
    """Return the evaluation of the correlation of adjacent samples, of log and model."""

    def evaluate(run: Evidence) -> Result:
        rows = run.rows(
            ModelSampleRow, sensor=sensor, recording=RECORDING, channel="gyro_x",
            what="stretch",
        )  # fmt: skip
        stretches = {
            one: [row.mean for row in rows if row.of == one and row.mean is not None]
            for one in ("log", of)
        }
        if not all(stretches.values()):
            return no_result(NO_LOG)
        log, model = (_compute_correlation(values) for values in stretches.values())
        error = math.sqrt(2.0 * (1.0 - log * log) / len(stretches["log"]))
        return Result(
            words=f"correlation of neighbouring samples {model:.2f}, of the simulated log "
            f"{log:.2f}, in {len(stretches['log'])} samples",
            verdict="agrees" if abs(model - log) < 3.0 * error else "differs",
        )

    return evaluate


def _compute_correlation(values: Sequence[float]) -> float:
    """Return the correlation of each value with the next."""
    samples = np.array(values)
    return float(np.corrcoef(samples[:-1], samples[1:])[0, 1])
