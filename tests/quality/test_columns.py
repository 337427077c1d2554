from collections.abc import Callable

import numpy as np
import pytest

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.quality.columns import check_columns
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.words.findings.base import FINDINGS
from tests.conftest import few

RATE = 100.0
GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
SIGMA = GYRO.N * np.sqrt(RATE)
SETTINGS = QualitySettings()

CLEAN = {
    "gyro": (GYRO, 100.0, 0.01),
    "accelerometer": (NoiseModel(N=1.1e-3, B=7.2e-4, T_B=148.9, K=2e-5), 50.0, 9.81),
    "random walk": (NoiseModel(N=1e-4, K=1e-4), 20.0, 0.0),
    "flicker": (NoiseModel(N=1e-4, B=3e-4), 20.0, 0.0),
    "white": (NoiseModel(N=1e-4), 100.0, 0.0),
}


def summary(log: np.ndarray, pieces: int = 7) -> ColumnSummary:
    column = ColumnSummary()
    for piece in np.array_split(log, pieces):
        column.add(piece)
    return column


def findings(log: np.ndarray, rate: float = RATE, channel: str = "gyro_x") -> list[Finding]:
    return check_columns({channel: summary(log)}, rate, SETTINGS)


def names(log: np.ndarray, rate: float = RATE, channel: str = "gyro_x") -> list[str]:
    return [finding.finding for finding in findings(log, rate, channel)]


def an_hour(rng: np.random.Generator, seconds: float = 3600.0) -> np.ndarray:
    return 0.01 + simulate(GYRO, RATE, round(seconds * RATE), rng)


@pytest.mark.parametrize("case", CLEAN)
def test_clean_logs_have_no_findings(rng: np.random.Generator, case: str) -> None:
    model, rate, bias = CLEAN[case]
    for hours in (0.05, 0.3, 1.5):
        log = bias + simulate(model, rate, round(hours * 3600 * rate), rng)
        assert names(log, rate, "accel_z" if bias > 9 else "gyro_x") == []


def stuck(log: np.ndarray) -> None:
    log[100_000:101_000] = log[100_000]


def saturated(log: np.ndarray) -> None:
    np.clip(log, None, log.mean() + 2.0 * SIGMA, out=log)


def shaken(log: np.ndarray) -> None:
    log[50_000:50_500] += 10.0 * SIGMA * np.sin(np.arange(500.0))


def moved(log: np.ndarray) -> None:
    log[180_000:] += 1.5 * SIGMA


def warming(log: np.ndarray) -> None:
    log += 2.0 * SIGMA * np.exp(-np.arange(len(log)) / 30_000.0)


def noisier(log: np.ndarray) -> None:
    rng = np.random.default_rng(4)
    log[200_000:300_000] += 1.5 * SIGMA * rng.standard_normal(100_000)


def polled(log: np.ndarray) -> None:
    log[1::2] = log[::2]


def coarse(log: np.ndarray) -> None:
    log[:] = np.round(log / (3 * SIGMA)) * (3 * SIGMA)


def quantised(log: np.ndarray) -> None:
    log[:] = np.round(log / (0.3 * SIGMA)) * (0.3 * SIGMA)


def infinite(log: np.ndarray) -> None:
    log[[5, 77]] = np.inf


def empty(log: np.ndarray) -> None:
    log[10:20] = np.nan


@pytest.mark.parametrize(
    ("spoil", "found", "severity", "value", "span"),
    [
        (stuck, "stuck_for_a_while", "warning", 10.0, (1000.0, 1010.0)),
        (saturated, "saturated", "warning", None, None),
        (shaken, "motion", "warning", 5.0, (500.0, 505.0)),
        (moved, "step", "warning", 1.5 * SIGMA, (1800.0, 1800.0)),
        (warming, "warm_up", "warning", None, (0.0, None)),
        (noisier, "not_stationary", "warning", np.sqrt(1 + 1.5**2), None),
        (polled, "repeated_samples", "warning", 0.5, None),
        (coarse, "coarse", "warning", None, None),
        (quantised, "quantised", "note", 0.3 * SIGMA, None),
        (infinite, "not_finite", "warning", 2.0, (0.05, 0.06)),
        (empty, "empty_cells", "note", 10.0, (0.1, 0.2)),
    ],
)
def test_what_is_wrong_is_found_with_its_size_and_its_time(
    rng: np.random.Generator,
    spoil: Callable[[np.ndarray], None],
    found: str,
    severity: str,
    value: float | None,
    span: tuple[float, float | None] | None,
) -> None:
    log = an_hour(rng)
    spoil(log)
    (finding,) = findings(log)
    assert (finding.finding, finding.severity) == (found, severity)
    assert finding.channel == "gyro_x"
    if value is not None:
        assert finding.value == pytest.approx(value, rel=0.15)
    if span is not None:
        assert finding.start == pytest.approx(span[0], abs=10)
        assert finding.end is not None
        if span[1] is not None:
            assert finding.end == pytest.approx(span[1], abs=10)


def test_a_warm_up_ends_where_the_drift_does(rng: np.random.Generator) -> None:
    log = an_hour(rng)
    warming(log)
    (finding,) = findings(log)
    # The drift of 2 sigma e^(-t / 300 s) is below the usual one after some time constants.
    assert 600.0 < (finding.end or 0.0) < 2400.0
    assert "use: {start: " in finding.detail
    assert finding.value == pytest.approx(-2.0 * SIGMA, rel=0.3)


@pytest.mark.parametrize("step", [1.5, 0.7, 0.1])
def test_rounding_is_not_taken_for_repeats_or_for_a_stuck_axis(
    rng: np.random.Generator, step: float
) -> None:
    log = np.round(an_hour(rng) / (step * SIGMA)) * (step * SIGMA)
    assert set(names(log)) <= {"quantised", "coarse"}


@pytest.mark.parametrize(
    ("log", "found"),
    [
        (np.full(1000, np.nan), "no_samples"),
        (np.arange(99.0) * 1e-4, "too_short"),
        (np.full(1000, 0.25), "stuck"),
    ],
)
def test_a_column_that_cannot_be_used_is_fatal(log: np.ndarray, found: str) -> None:
    finding = findings(log)[0]
    assert (finding.finding, finding.severity) == (found, "fatal")


def test_a_coarse_register_that_seldom_changes_has_no_warm_up() -> None:
    """Its parts have medians that do not change at all, but for the first."""
    log = np.zeros(300_000)
    log[:4000] = 1.0
    log[::501] += 1.0
    assert "warm_up" not in names(log)


def test_an_axis_that_is_zero_throughout_is_told_as_such() -> None:
    (finding,) = findings(np.zeros(5000))
    assert (finding.finding, finding.severity, finding.value) == ("stuck", "fatal", 0.0)
    assert "is exactly 0 in all 5000 samples" in finding.detail
    assert FINDINGS[finding.finding].unfit


def test_steps_of_the_temperature_are_noted(rng: np.random.Generator) -> None:
    temperature = np.round(25 + 0.02 * np.cumsum(rng.standard_normal(5000)), 1)
    (finding,) = check_columns({"temperature": summary(temperature)}, 1.0, SETTINGS)
    assert (finding.finding, finding.severity) == ("quantised", "note")
    assert finding.value == pytest.approx(0.1)


def filled(log: np.ndarray, rng: np.random.Generator) -> None:
    log[rng.random(len(log)) < 0.2] = log.mean()


def dead_band(log: np.ndarray, rng: np.random.Generator) -> None:
    log -= log.mean()
    log[np.abs(log) < SIGMA] = 0.0


@pytest.mark.parametrize("spoil", [filled, dead_band])
@pytest.mark.parametrize("step", few([0.0, 0.1], [0.02]))
def test_samples_that_pile_up_at_one_value_are_found(
    rng: np.random.Generator, spoil: Callable[..., None], step: float
) -> None:
    log = an_hour(rng)
    if step:
        log = np.round(log / (step * SIGMA)) * step * SIGMA
    spoil(log, rng)
    assert "piled_up" in names(log)


@pytest.mark.parametrize("step", few([0.3, 1.0, 3.0], [0.02, 0.7, 1.5]))
@pytest.mark.parametrize("digit", few([0.0, 0.97, 1.5], [0.3, 1.024]))
def test_registers_pile_nothing_up(rng: np.random.Generator, step: float, digit: float) -> None:
    step *= SIGMA
    log = np.round((0.37 * step + an_hour(rng)) / step) * step
    if digit:
        log = np.round(log / (digit * step)) * digit * step
    assert "piled_up" not in names(log)


@pytest.mark.parametrize("step", few([0.5], [0.6, 0.7, 0.8]))
def test_the_last_level_of_a_coarse_register_is_no_saturation(
    rng: np.random.Generator, step: float
) -> None:
    for _ in range(10):
        log = np.round((rng.standard_normal(20_000) + rng.random()) / step) * step
        assert "saturated" not in names(log)
        clipped = names(np.clip(log, None, np.round(2.0 / step) * step))
        assert {"saturated", "coarse"} & set(clipped)


@pytest.mark.parametrize("step", [0.0, 0.1])
@pytest.mark.parametrize("samples_each", [1, 2])
def test_isolated_values_beyond_the_others_are_no_end_of_a_range(
    rng: np.random.Generator, step: float, samples_each: int
) -> None:
    for _ in range(5):
        log = rng.standard_normal(5000)
        log = np.round(log / step) * step if step else log
        places = 9 + 50 * rng.permutation(99)[:16, None] + np.arange(samples_each)
        log[places] = log.min() - 1.0  # a sample each, or one that the logger read twice
        assert "saturated" not in names(log)
        assert "saturated" in names(np.clip(log, -1.5, None))


@pytest.mark.parametrize("drift", [0.0, 3.0, 12.0])
@pytest.mark.parametrize(("sigma", "expected"), [(0.3, True), (0.5, True), (0.8, False)])
def test_a_register_is_coarse_by_its_step_over_the_noise(
    rng: np.random.Generator, drift: float, sigma: float, expected: bool
) -> None:
    # Rounding adds a twelfth of a step squared: N is 39, 15 and 6 % too large.
    log = sigma * rng.standard_normal(20_000) + drift * np.sin(np.linspace(0.0, np.pi, 20_000))
    assert ("coarse" in names(np.round(log + 0.3))) is expected


def test_a_last_block_of_one_sample_is_no_step(rng: np.random.Generator) -> None:
    for _ in range(5):
        log = 0.01 + SIGMA * rng.standard_normal(59 * 256 + 1)
        log[-1] = 0.01 + 1.5 * SIGMA
        assert "step" not in names(log)


@pytest.mark.parametrize("step", few([0.1], [0.01, 0.3]))
def test_ten_levels_are_not_fewer_than_ten(rng: np.random.Generator, step: float) -> None:
    for first in range(-200, 200, 21):
        log = (first + np.clip(np.round(4.5 + 1.3 * rng.standard_normal(5000)), 0, 9)) * step
        log[:2] = first * step, (first + 9) * step
        assert "coarse" not in names(log)


@pytest.mark.parametrize("levels", [0.0, 3.0])
def test_a_mean_that_crosses_the_edge_of_a_coarse_register_is_no_step(
    rng: np.random.Generator, levels: float
) -> None:
    # In steps of six sigma the means move only while the level lies near an edge.
    register = 6.0 * SIGMA
    level = np.interp(np.arange(360_000), [176_000, 184_000], [0.2, 0.8]) * register
    level[180_000:] += levels * register
    log = level + SIGMA * rng.standard_normal(360_000)
    found = names(np.round(log / register) * register)
    assert ("step" in found) == (levels > 1.5)


def test_coarse_log_without_noise_has_only_the_coarse_warning(rng: np.random.Generator) -> None:
    # Three levels: the level wanders from the edge of one to the middle of another, and stays.
    samples = 540_000
    level = np.concatenate([np.full(samples - 800, 0.5), np.full(800, 1.0)])
    level += 0.05 * np.sin(np.arange(samples) / 40.0)
    log = np.round(level + rng.standard_normal(samples) / 6.0)
    column = ColumnSummary()
    column.add(0.004 * log)
    found = check_columns({"gyro_z": column}, 50.0, SETTINGS)
    assert {finding.finding for finding in found if finding.severity == "warning"} == {"coarse"}


@pytest.mark.parametrize("first", [0.0, 0.25])
def test_a_level_that_comes_to_an_edge_of_a_coarse_register_is_no_motion(
    rng: np.random.Generator, first: float
) -> None:
    level = np.zeros(72_000)  # in steps; the edges are at 0.5
    level[:20_000] = first
    level[50_000:52_000] = 0.5
    column = ColumnSummary()
    column.add(0.01 * np.round(level + rng.standard_normal(72_000) / 6.0))
    found = check_columns({"accel_x": column}, 20.0, SETTINGS)
    assert {finding.finding for finding in found if finding.severity != "note"} == {"coarse"}


def test_a_channel_that_seldom_changes_is_coarse() -> None:
    log = np.full(72_000, 9.81)
    log[[100, 30_000, 50_000]] += 0.05
    column = ColumnSummary()
    column.add(log)
    assert "coarse" in {f.finding for f in check_columns({"accel_x": column}, 20.0, SETTINGS)}


def test_motion_shows_in_a_coarse_register(rng: np.random.Generator) -> None:
    log = rng.standard_normal(72_000) / 6.0
    log[30_000:31_000] += 4.0 * np.sin(np.arange(1000) / 3.0)
    column = ColumnSummary()
    column.add(0.01 * np.round(log + 0.5))
    assert "motion" in {f.finding for f in check_columns({"accel_x": column}, 20.0, SETTINGS)}
