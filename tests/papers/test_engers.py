"""The lines of Engers that follow from printed figures, by other ways than the module's."""

import math

import numpy as np
import pytest
from scipy import signal

from imubench_pipeline.experiments.papers import engers
from imubench_pipeline.experiments.papers.claims import rows_of
from imubench_pipeline.experiments.papers.evidence import Evidence
from imubench_pipeline.settings.sensor import read_sensors
from imubench_pipeline.settings.simulated_recordings import read_simulated
from tests.conftest import PROJECT

SENSORS = read_sensors(PROJECT / "config/sensors")
ROWS = list(rows_of(engers.PAPER, Evidence()))


def test_every_table_figure_and_equation_has_a_line() -> None:
    places = {row["place"] for row in ROWS}
    assert {f"Table {number}" for number in range(1, 9)} <= places
    assert {f"Figure {number}" for number in range(1, 55)} <= places
    assert {f"Equation {number}" for number in range(1, 26)} <= places


def test_the_factor_of_60_has_its_check() -> None:
    # The -1/2 line N/sqrt(tau) is at the floor where tau = (N/floor)^2, by solving for it.
    times = {axis.name: (axis.meeting(True), axis.meeting(False)) for axis in engers.AXES}
    for axis in engers.AXES:
        for density, tau in zip((60.0 * axis.psd, axis.psd), times[axis.name], strict=True):
            assert density / math.sqrt(tau) == pytest.approx(axis.floor)
        # A curve begins at one sample: of 500 Hz, the BNO055's of 100 Hz.
        first = 0.01 if axis.sensor == "bno055" else 0.002
        assert times[axis.name][1] < 20 * first and times[axis.name][0] > 900 * first
    assert min(scaled for scaled, _ in times.values()) == pytest.approx(9.9, abs=0.05)
    assert times["SCC2130 x"] == pytest.approx((120.5, 0.0335), rel=0.01)
    words = [row["found_words"] for row in ROWS if "meets the floor" in row["quantity"]]
    assert words[0] == "at 120 s with the 60, at 0.033 s without"


def test_table_8_has_its_columns_mixed() -> None:
    assert 0.005 / math.sqrt(500.0) == pytest.approx(0.0002236, rel=1e-3)
    assert 1.03 / 3600.0 == pytest.approx(0.0002861, rel=1e-3)
    assert engers.AXES[0].floor == 0.00041


def test_a_first_order_of_120_hz_passes_the_noise_of_188_hz() -> None:
    # White noise through a digital low-pass of first order, far below the rate, by its variance.
    rate, cutoff = 100_000.0, engers.first_order_of_noise_bandwidth(188.0)
    assert cutoff == pytest.approx(119.7, abs=0.05)
    filters = signal.butter(1, cutoff, fs=rate)
    log = signal.lfilter(*filters, np.random.default_rng(1).standard_normal(4_000_000))
    assert np.var(log) == pytest.approx(188.0 / (rate / 2.0), rel=0.02)


def test_what_is_typed_here_is_what_the_board_is_simulated_from() -> None:
    recordings = read_simulated(PROJECT / "config/simulated.yaml", SENSORS).recordings
    board = {one.sensor: one for one in recordings if one.recording == "sim_engers"}
    for axis in engers.AXES:
        figures = board[axis.sensor].channels[f"gyro_{axis.axis}"].published
        si = {(one.where, one.parameter): one.si("gyro") for one in figures if one.of == "log"}
        noise, bias = engers.OF_NOISE[axis.sensor], engers.OF_BIAS[axis.sensor]
        assert si[noise, "N"] == pytest.approx(60.0 * axis.psd * engers.DEGREE, rel=1e-3)
        assert si[noise, "B"] == pytest.approx(axis.floor / 0.664 * engers.DEGREE, rel=2e-3)
        assert si[bias, "bias"] == pytest.approx(axis.bias * engers.DEGREE)
