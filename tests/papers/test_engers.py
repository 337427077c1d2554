"""The lines of Engers that follow from printed figures, by other ways than the module's."""

import math

import numpy as np
import pytest
from scipy import signal

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.extensions.papers.engers import AXES, DEGREE, compute_cutoff
from imubench_pipeline.extensions.papers.papers import make_rows
from imubench_pipeline.extensions.papers.printed import Evidence, read_paper
from imubench_pipeline.extensions.papers.tables import PublishedRow
from imubench_pipeline.settings.simulated_recordings import read_simulated
from imubench_pipeline.tables.files import build
from tests.conftest import PROJECT, catalogue

SENSORS = catalogue()
ROWS = list(make_rows(read_paper("engers"), Evidence()))


def test_every_table_figure_and_equation_has_a_line() -> None:
    places = {row["place"] for row in ROWS}
    assert {f"Table {number}" for number in range(1, 9)} <= places
    assert {f"Figure {number}" for number in range(1, 55)} <= places
    assert {f"Equation {number}" for number in range(1, 26)} <= places


def test_the_factor_of_60_has_its_check() -> None:
    # The -1/2 line N/sqrt(tau) is at the floor where tau = (N/floor)^2, by solving for it.
    times = {axis.name: (axis.meeting(True), axis.meeting(False)) for axis in AXES.values()}
    for axis in AXES.values():
        for density, tau in zip((60.0 * axis.psd, axis.psd), times[axis.name], strict=True):
            assert density / math.sqrt(tau) == pytest.approx(axis.floor)
        # A curve begins at one sample: of 500 Hz, the BNO055's of 100 Hz.
        first = 0.01 if axis.sensor == "bno055" else 0.002
        assert times[axis.name][1] < 20 * first and times[axis.name][0] > 900 * first
    assert min(scaled for scaled, _ in times.values()) == pytest.approx(9.9, abs=0.05)
    assert times["SCC2130 x"] == pytest.approx((120.5, 0.0335), rel=0.01)
    rows = [row for row in ROWS if "60 times the figure" in row["quantity"]]
    assert [row["verdict"] for row in rows] == ["possible"] * len(AXES)
    assert rows[0]["found_words"].endswith("at 120 s with the factor 60, and at 0.033 s without it")
    # What speaks against it: Table 1 has 0.005, 0.01 and 0.014.
    sheets = {"scc2130": 0.005, "mpu9250": 0.01, "bno055": 0.014}
    for axis, row in zip(AXES.values(), rows, strict=True):
        times = 60.0 * axis.psd / sheets[axis.sensor]
        assert f"N is then {times:.2g} times the datasheet value" in row["reason"]
        assert ("against it" in row["reason"]) is (axis.sensor != "scc2130")
    (row,) = [
        row for row in ROWS if row["quantity"] == "SCC2130: noise compared with its datasheet"
    ]
    assert "0.90 times" in row["found_words"] and "1.27 times" in row["found_words"]
    assert row["verdict"] == "possible" and row["printed"] is None


def test_table_8_has_its_columns_mixed() -> None:
    assert 0.005 / math.sqrt(500.0) == pytest.approx(0.0002236, rel=1e-3)
    assert 1.03 / 3600.0 == pytest.approx(0.0002861, rel=1e-3)
    assert AXES["scc2130", "x"].floor == 0.00041


def of_figure(number: int) -> PublishedRow:
    (row,) = [row for row in ROWS if row["place"] == f"Figure {number}"]
    return row


def test_a_fixed_drift_does_not_move_the_curve() -> None:
    log = np.random.default_rng(1).standard_normal(4096)
    plain, moved = (allan_variance(one, 10.0).variance for one in (log, log + 1000.0))
    np.testing.assert_allclose(moved, plain, rtol=1e-6)


def test_a_figure_entered_as_power_is_larger_and_makes_no_floor() -> None:
    # Samples of a two-sided density P at 500 Hz have the variance 500 P; of N, 500 N^2.
    rng = np.random.default_rng(1)
    as_power = math.sqrt(0.000075 * 500.0) * rng.standard_normal(100_000)
    as_noise = 0.0045 * math.sqrt(500.0) * rng.standard_normal(100_000)
    ratio = np.std(as_power) / np.std(as_noise)
    assert f"{ratio:.1f}" in of_figure(34)["found_words"] and ratio == pytest.approx(1.92, abs=0.02)
    # 1 K in 18000 s at 0.00041 / 0.662 (deg/s)/K, by its Allan deviation at 120 s.
    course = np.linspace(0.0, 0.00041 / 0.662, 18_000)
    curve = allan_variance(course, 1.0, cluster_sizes=[120])
    times = 0.00041 / math.sqrt(curve.variance[0])
    assert times == pytest.approx(140.0, rel=0.01)
    assert "140 times less" in of_figure(36)["found_words"]


def test_what_he_says_of_axes_and_datasheets() -> None:
    assert "y is 0.93 and N of z is 2.97" in of_figure(31)["found_words"]  # 80/86, 255/86
    assert "y is 1.09 and N of z is 0.52" in of_figure(32)["found_words"]  # 35/32, 16.5/32
    # (0.005/0.00041)^2, half of it, and (0.0045/0.00041)^2
    for text in ("at 149 s", "at 74 s", "the log at 120 s"):
        assert text in of_figure(42)["found_words"]
    assert "5.2, 4.8, 15 times" in of_figure(48)["found_words"]  # 0.0516, 0.048, 0.153 over 0.01
    assert "at 0.87 s" in of_figure(54)["found_words"]  # (0.014/0.015)^2


@pytest.mark.release  # test_confidence.py has the limits of curves every day
def test_one_curve_in_twenty_is_less_in_its_band() -> None:
    # White noise, whose curve is known: points of a curve go together, and so leave a band at once.
    rng = np.random.default_rng(1)
    logs = rng.standard_normal((200, 10_000))
    curves = np.array([allan_variance(log, 1.0, overlap="octave").variance for log in logs])
    lower, upper = np.percentile(curves, [2.5, 97.5], axis=0)
    shares = np.mean((curves >= lower) & (curves <= upper), axis=1)
    assert np.mean(shares) == pytest.approx(0.95, abs=0.005)
    assert 0.02 < np.mean(shares < 0.8) < 0.1, "one in twenty"


def test_a_first_order_of_120_hz_passes_the_noise_of_188_hz() -> None:
    # White noise through a digital low-pass of first order, far below the rate, by its variance.
    rate, cutoff = 100_000.0, compute_cutoff(Evidence(), "188")
    assert cutoff == pytest.approx(119.7, abs=0.05)
    filters = signal.butter(1, cutoff, fs=rate)
    log = signal.lfilter(*filters, np.random.default_rng(1).standard_normal(4_000_000))
    assert np.var(log) == pytest.approx(188.0 / (rate / 2.0), rel=0.02)


def test_what_is_typed_here_is_what_the_board_is_simulated_from() -> None:
    recordings = read_simulated(PROJECT / "config/simulated.yaml", SENSORS).recordings
    board = {one.sensor: one for one in recordings if one.recording == "sim_engers"}
    for axis in AXES.values():
        figures = board[axis.sensor].channels[f"gyro_{axis.axis}"].published
        si = {(one.where, one.parameter): one.si("gyro") for one in figures if one.of == "log"}
        noise, bias = axis.noise, axis.drift
        assert si[noise, "N"] == pytest.approx(60.0 * axis.psd * DEGREE, rel=1e-3)
        assert si[noise, "B"] == pytest.approx(axis.floor / 0.664 * DEGREE, rel=2e-3)
        assert si[bias, "bias"] == pytest.approx(axis.bias * DEGREE)


def found_in(rows: dict[str, list[dict]], place: str, quantity: str) -> PublishedRow:
    """Return the line of a run that has these rows of tables."""
    evidence = Evidence({name: build(name, own) for name, own in rows.items()})
    (line,) = [
        row
        for row in make_rows(read_paper("engers"), evidence)
        if row["place"] == place and quantity in row["quantity"]
    ]
    return line


def samples(of: str, what: str, means: list[float], channel: str = "gyro_x") -> list[dict]:
    key = {"sensor": "scc2130", "recording": "sim_engers", "channel": channel}
    return [
        key | {"of": of, "what": what, "start": 0.0, "end": 1.0, "mean": mean} for mean in means
    ]


@pytest.mark.parametrize(("smoothed", "verdict"), [(True, "agrees"), (False, "differs")])
def test_neighbouring_samples_tell_a_model_that_lacks_the_low_pass(smoothed, verdict) -> None:
    rng = np.random.default_rng(1)
    log, other = (signal.lfilter([1.0], [1.0, -0.5], rng.standard_normal(500)) for _ in range(2))
    model = other if smoothed else rng.standard_normal(500)
    rows = samples("log", "stretch", list(log)) + samples("after", "stretch", list(model))
    line = found_in({"samples_of_models": rows}, "Figure 39", "")
    assert line["verdict"] == verdict and "in 500 samples" in line["found_words"]


def test_figure_38_is_not_alike_as_he_saw_it_smaller() -> None:
    rows = samples("log", "deviation", [0.1]) + samples("after", "deviation", [0.1001])
    line = found_in({"samples_of_models": rows}, "Figure 38", "")
    assert line["verdict"] == "differs"
    assert line["printed_as"] == "the simulation is slightly smaller"
    assert "simulated log: 1.001" in line["found_words"]


def test_ratios_are_those_of_the_cells() -> None:
    # B and the curve's are sigma / 0.664: what is shown is the floor itself.
    figure = {
        "sensor": "scc2130", "recording": "sim_engers", "channel": "gyro_x",
        "place": "Table 5", "figure": "dynamic drift", "printed": "0.00041", "parameter": "B",
        "of": "log", "means": 1.0, "unit": "rad/s", "value": 0.0005 * DEGREE,
        "lower": 0.0004 * DEGREE, "upper": 0.0006 * DEGREE, "curve": 0.0006 * DEGREE,
    }  # fmt: skip
    line = found_in({"published_figures": [figure]}, "Table 5", "dynamic drift")
    assert line["found"] / DEGREE == pytest.approx(0.0005 * 0.6643, rel=1e-3)
    assert line["ratio"] == pytest.approx(0.0005 * 0.6643 / 0.00041, rel=1e-3)
    assert line["found_words"] == "0.000399 read from its curve, before the fit"


def test_how_many_reach_a_class_and_what_25_leave() -> None:
    one = {
        "quantity": "gyro", "sensor": "scc2130", "recording": "r", "channel": "gyro_x",
        "simulated": True, "grade": "hg4930", "grade_name": "H", "option": "B", "statistic": "N",
        "value": 5e-5, "lower": 4.9e-5, "upper": 5.1e-5, "printed": 1e-5, "n": 25.0,
        "n_lower": 24.01, "n_upper": 26.01,
    }  # fmt: skip
    lowest = {"statistic": "sigma_min", "value": None, "n": None, "n_lower": 0.0, "n_upper": 9.1}
    fused = {"sensor": "scc2130_x25", "value": 1.01e-5, "n": 1.02, "n_upper": 1.04}
    unprinted = {"grade": "ln_200", "grade_name": "L", "option": None, "printed": None, "n": None,
                 "n_upper": None, "reason": "it prints none"}  # fmt: skip
    rows = [one, one | lowest, one | fused, one | unprinted, one | fused | unprinted]
    line = found_in({"grades": rows}, "Section 1.0.1.1", "HG4930, grade B")
    assert line["found_words"] == (
        "25 by its white noise, at most 10 by its lowest point; of 25 fused 2 by its white noise"
    )
    assert line["verdict"] == "new result"
    line = found_in({"grades": rows}, "Section 1.0.1.1", "LN-200")
    assert (line["verdict"], line["reason"]) == ("not available", "noise of L: it prints none")
    line = found_in({"grades": rows}, "Section 1.0.1.1", "fused")
    assert line["found"] == 1.01e-5
    assert f"{math.degrees(1e-5) * 60.0:.4f}" in line["found_words"]
