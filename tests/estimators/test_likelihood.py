from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import scipy.fft
from scipy.signal import lfilter

from imubench_pipeline.estimators.estimate import CURVE, FAMILY, Parameter
from imubench_pipeline.estimators.likelihood import Likelihood, fit, fit_blocks
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.noise.simulate import channel_rng, simulate
from tests.conftest import few

RATE = 5.0
SAMPLES = 180_000
"""Ten hours."""

MTI_7 = {"N": 8.4e-5, "B": 6.7e-5, "T_B": 89.5, "K": 2e-6}
"""The gyroscope of paper 000, with more of a random walk than its own 8.2e-7."""

FLICKER = {"N": 1e-3, "B": 1e-3}
ALL = ("N", "B", "T_B", "K")

SHORT = NoiseModel(N=1e-3, B=1.5e-3, T_B=30.0, K=1e-4)
SHORT_SAMPLES = 30_000
WITH_HOLES = 4_000
"""Samples of a log whose holes are filled, which takes longest."""

LONG = 300_000
"""Samples of a log that is too long for one transform."""


def density(frequency: np.ndarray, rate: float, N: float, B=0.0, T_B=None, K=0.0) -> np.ndarray:
    """Two-sided density of the samples, from the closed forms of each process."""
    interval = 1 / rate
    turn = 2 - 2 * np.cos(2 * np.pi * frequency * interval)
    total = N**2 + K**2 * interval**2 / turn
    if T_B is None:
        return total + B**2 * interval / np.sqrt(turn)
    driving = 2 * B**2 * np.log(2) / (np.pi * 0.4365**2 * T_B)
    p = np.exp(-interval / T_B)
    return total + driving * T_B / 2 * (1 - p**2) * interval / (1 - 2 * p * np.cos(
        2 * np.pi * frequency * interval
    ) + p**2)  # fmt: skip


def slopes(frequency: np.ndarray, rate: float, truth: dict[str, float]) -> np.ndarray:
    """Derivatives of log density by the logarithms of the parameters, by differences."""
    step = 1e-4
    rows = []
    for name, value in truth.items():
        above, below = (
            density(frequency, rate, **(truth | {name: value * np.exp(sign * step)}))
            for sign in (1, -1)
        )
        rows.append(np.log(above / below) / (2 * step))
    return np.array(rows)


def covariance(
    truth: dict[str, float], rate: float, samples: int, highest: float | None = None
) -> np.ndarray:
    """Inverse of the Fisher information of all frequencies of a log: the Cramér-Rao bound.

    Each ordinate of the DCT-II is the density times a chi-squared variate of one degree.
    """
    frequency = np.arange(1, samples) * rate / (2 * samples)
    rows = slopes(frequency[frequency <= (highest or rate)], rate, truth)
    return np.linalg.inv(rows @ rows.T / 2)


def bounds(
    truth: dict[str, float], rate: float, samples: int, highest: float | None = None
) -> dict[str, float]:
    """Relative standard errors that no unbiased estimate can be below."""
    errors = np.sqrt(np.diag(covariance(truth, rate, samples, highest)))
    return dict(zip(truth, errors.tolist(), strict=True))


def log_of(
    model: NoiseModel, number: int = 0, samples: int = SAMPLES, rate: float = RATE
) -> np.ndarray:
    rng = channel_rng(20260105, model.name, str(samples), str(number))
    return simulate(model, rate, samples, rng)


@cache
def found_in(model: NoiseModel, number: int = 0, samples: int = SAMPLES) -> Likelihood:
    return fit(log_of(model, number, samples), RATE)


def of(found: Likelihood, name: str, method: str = "likelihood") -> Parameter:
    (estimate,) = (e for e in found.estimates if e.method == method)
    return estimate.parameters[name]


def value(found: Likelihood, name: str, method: str = "likelihood") -> float:
    parameter = of(found, name, method)
    assert parameter.value is not None, parameter
    return parameter.value


def limits(found: Likelihood, name: str, method: str = "likelihood") -> tuple[float, float]:
    parameter = of(found, name, method)
    assert parameter.lower is not None and parameter.upper is not None, parameter
    return parameter.lower, parameter.upper


def holds(found: Likelihood, name: str, truth: float, method: str = "likelihood") -> bool:
    lower, upper = limits(found, name, method)
    return lower < truth < upper


def width(found: Likelihood, name: str, method: str = "likelihood") -> float:
    lower, upper = limits(found, name, method)
    return float(np.log(upper / lower))


def in_model(found: Likelihood, name: str, method: str = "likelihood") -> float:
    """What the model has, whether the log tells it or not."""
    parameter = of(found, name, method)
    assert parameter.in_model is not None, parameter
    return parameter.in_model


def assert_close(found: float | None, before: float | None, factor: float, rel: float) -> None:
    if before is None:
        assert found is None
    else:
        assert found == pytest.approx(before * factor, rel=rel)


def assert_same(one: Likelihood, other: Likelihood, rel: float = 1e-5, **scale: float) -> None:
    """All that is said of two logs is the same, up to a factor for each parameter.

    A rounding error can send a chain of draws another way: the limits differ by its noise.
    """
    for first, second in zip(one.estimates, other.estimates, strict=True):
        assert list(first.parameters) == list(second.parameters)
        for name, parameter in first.parameters.items():
            twin, factor = second.parameters[name], scale.get(name, 1.0)
            assert (name, twin.status) == (name, parameter.status)
            # K is a median of draws: the one beside it is up to 2e-5 away.
            exact = max(rel, 1e-4) if name == "K" else rel
            assert_close(twin.value, parameter.value, factor, exact)
            assert_close(twin.fitted, parameter.fitted, factor, exact)
            assert_close(twin.duration_needed, parameter.duration_needed, scale.get("time", 1), rel)
            if not parameter.upper or not parameter.lower:
                assert (twin.upper is None) == (parameter.upper is None)
                continue
            noise = 0.15 * abs(np.log(parameter.upper / parameter.lower))
            assert_close(twin.lower, parameter.lower, factor, noise)
            assert_close(twin.upper, parameter.upper, factor, noise)
    best, others = (found.candidates[0] for found in (one, other))
    assert best.terms == others.terms
    assert others.goodness.deviance == pytest.approx(best.goodness.deviance, rel=1e-4)


@pytest.mark.parametrize(("truth", "logs"), few([(FLICKER, 1)], [(FLICKER, 3), (MTI_7, 6)]))
def test_estimates_lie_within_a_few_cramer_rao_bounds(truth: dict[str, float], logs: int) -> None:
    bound = bounds(truth, RATE, SAMPLES)
    off = np.array(
        [
            [
                np.log(in_model(found_in(NoiseModel(**truth), i), name) / truth[name]) / bound[name]
                for name in truth
            ]
            for i in range(logs)
        ]
    )
    assert np.abs(off).max() < 4
    rms = np.sqrt(np.mean(off**2, axis=0))
    # chi-squared of 3 to 6 degrees of freedom; one log tells nothing of its scatter
    assert logs == 1 or ((rms > 0.25) & (rms < 1.7)).all(), rms


@pytest.mark.release
@pytest.mark.parametrize(("logs", "least"), few([(1, 4)], [(3, 14), (6, 25)]))
def test_intervals_hold_the_truth_as_often_as_they_say(logs: int, least: int) -> None:
    """Of 6 intervals 95 % are 5.7, of 18 17.1, of 30 28.5.

    Fewer than 4, 14 and 25 have probabilities of 0.2, 0.2 and 0.3 %.
    """
    held = [holds(found_in(NoiseModel(**MTI_7), i), name, MTI_7[name])
            for i in range(logs) for name in ALL]  # fmt: skip
    held += [holds(found_in(NoiseModel(**FLICKER), i), name, FLICKER[name])
             for i in range(min(logs, 3)) for name in FLICKER]  # fmt: skip
    assert sum(held) >= least, held


@pytest.mark.parametrize(
    ("truth", "logs"), few([(MTI_7, 1)], [(MTI_7, 3), (FLICKER, 3), (MTI_7, 6)])
)
def test_intervals_are_as_narrow_as_the_bound_allows(truth: dict[str, float], logs: int) -> None:
    # An interval that always holds the truth because it is wide would pass any test of coverage.
    method = "likelihood_gm" if "T_B" in truth else "likelihood"
    for name, bound in bounds(truth, RATE, SAMPLES).items():
        widths = [width(found_in(NoiseModel(**truth), i), name, method) for i in range(logs)]
        assert 0.85 < np.median(widths) / (3.92 * bound) < 1.5, name


@pytest.mark.parametrize(
    ("truth", "name", "logs"),
    few(
        [(MTI_7, "N+GM+K", 1), (FLICKER, "N+F", 1), ({"N": 1e-3}, "N", 1)],
        [(MTI_7, "N+GM+K", 3), (FLICKER, "N+F", 3), ({"N": 1e-3}, "N", 2), (MTI_7, "N+GM+K", 6)],
    ),
)
def test_the_right_model_is_chosen(truth: dict[str, float], name: str, logs: int) -> None:
    chosen = [found_in(NoiseModel(**truth), i).candidates[0].terms.name for i in range(logs)]
    assert chosen.count(name) >= max(1, logs - 1), chosen


def test_flicker_noise_has_a_bias_instability_but_no_correlation_time() -> None:
    found = found_in(NoiseModel(**FLICKER))
    assert of(found, "B").status == "ok"
    assert of(found, "T_B").status == "absent"
    assert "no correlation time" in (of(found, "T_B").reason or "")


@pytest.mark.parametrize("number", few([0], [1]))
def test_what_is_not_there_is_absent(number: int) -> None:
    found = found_in(NoiseModel(N=1e-3), number)
    for name in ("Q", "B", "T_B", "K", "R"):
        parameter = of(found, name)
        assert (parameter.value, parameter.status) == (None, "absent")
        assert parameter.reason
    for name in ("B", "K"):
        parameter = of(found, name, "likelihood_gm")
        assert parameter.value is None
        assert parameter.status in ("absent", "not_identified")
        assert limits(found, name, "likelihood_gm")[1] > 0
        if parameter.status == "absent":
            assert parameter.lower == 0
            assert "upper limit" in (parameter.reason or "")
    assert of(found, "T_B", "likelihood_gm").status != "ok"


@pytest.mark.parametrize("number", few([0], [1]))
def test_a_random_walk_too_weak_to_show_is_below_its_upper_limit(number: int) -> None:
    # At a relative standard error of 1, K^2 is half a standard error from 0.
    truth = {"N": 1e-3, "K": 1e-7}
    assert bounds(truth, RATE, SAMPLES)["K"] > 0.9
    found = found_in(NoiseModel(**truth), number)
    parameter = of(found, "K", "likelihood_gm")
    # It is given as a number only where its interval is one: far from 0, on this log's side.
    assert parameter.value is None or parameter.lower > 0
    assert parameter.upper is not None
    assert truth["K"] < parameter.upper
    # A walk of the size of the limit would show, and the limit is not far beyond that.
    assert 0.1 < bounds(truth | {"K": parameter.upper}, RATE, SAMPLES)["K"] < 0.5


@pytest.mark.release  # test_identifiability.py has the rule every day
@pytest.mark.parametrize("number", [0, 1])
def test_a_weak_bias_instability_has_no_wrong_correlation_time(number: int) -> None:
    truth = {"N": 1e-3, "B": 5e-5, "T_B": 200.0}
    assert bounds(truth, RATE, SAMPLES)["T_B"] > 0.5
    found = found_in(NoiseModel(**truth), number)
    assert of(found, "T_B").status in ("not_identified", "absent")
    time = of(found, "T_B", "likelihood_gm")
    assert (time.value, time.status) == (None, "not_identified")
    assert time.fitted is not None and "times apart" in (time.reason or "")
    assert holds(found, "T_B", 200.0, "likelihood_gm")
    assert time.duration_needed is None or time.duration_needed > SAMPLES / RATE


@pytest.mark.release
@pytest.mark.parametrize("name", ["B", "T_B", "K"])
def test_the_duration_needed_tells_a_parameter_to_a_tenth(name: str) -> None:
    found = found_in(NoiseModel(**MTI_7))
    fitted = {name: value(found, name) for name in ALL}
    needed = of(found, name).duration_needed
    assert needed is not None
    bound = bounds(fitted, RATE, round(needed * RATE))
    assert bound[name] == pytest.approx(0.1, rel=0.05)


def test_a_log_that_is_too_short_shows_nothing_and_says_why(rng: np.random.Generator) -> None:
    found = fit(rng.standard_normal(16), 100.0)
    assert found.band is None and not found.candidates
    assert np.isnan(found.fitted).all()
    for estimate in found.estimates:
        assert not estimate.model.terms
        for parameter in estimate.parameters.values():
            assert (parameter.value, parameter.status) == (None, "not_shown")
            assert "too short" in (parameter.reason or "")


@pytest.mark.parametrize("samples", [17, 18, 19, 20, 21])
def test_a_log_of_a_few_samples_more_gives_an_answer(rng: np.random.Generator, samples) -> None:
    found = fit(rng.standard_normal(samples), 100.0)
    assert of(found, "N").status in ("ok", "not_shown", "not_identified")


def test_a_band_of_a_few_bins_gives_an_answer(rng: np.random.Generator) -> None:
    # 10 s at 100 Hz: 19 ordinates lie below 1 Hz.
    found = fit(rng.standard_normal(1000), 100.0, band=1.0)
    assert found.used.sum() == 19
    assert of(found, "N").status in ("ok", "not_shown", "not_identified")


@pytest.mark.parametrize("samples", few([16], [24, 32]))
def test_a_short_log_with_a_hole_gives_an_answer(rng: np.random.Generator, samples: int) -> None:
    log = rng.standard_normal(samples + 1)
    log[7] = np.nan
    assert of(fit(log, 100.0), "N").status in ("ok", "not_shown", "not_identified")


@pytest.mark.parametrize("samples", [0, 1, 2, 15])
def test_fewer_than_sixteen_samples_are_refused(samples: int) -> None:
    with pytest.raises(ValueError, match=f"{samples} samples, expected 16"):
        fit(np.arange(samples) % 3, 100.0)


def test_samples_that_are_all_missing_are_refused() -> None:
    with pytest.raises(ValueError):
        fit(np.full(1000, np.nan), 100.0)


@pytest.mark.release  # test_posterior.py has the limit of such noise every day
def test_white_noise_that_the_band_hardly_shows_is_inside_its_interval() -> None:
    """Of 4 logs 95 % are 3.8; fewer than 3 has a probability of 1.4 %."""
    truth, band = {"N": 1e-3, "K": 4e-4}, 0.04
    assert 0.25 < bounds(truth, RATE, 30_000, band)["N"] < 0.4
    found = [fit(log_of(NoiseModel(**truth), i, 30_000), RATE, band=band) for i in range(4)]
    for method in ("likelihood", "likelihood_gm"):
        intervals = [limits(one, "N", method) for one in found]
        assert sum(lower < 1e-3 < upper for lower, upper in intervals) >= 3, intervals


@pytest.mark.release  # test_a_process_of_few_samples has a corner that is nearer to a filter's
def test_the_corner_of_a_gauss_markov_process_is_no_filter() -> None:
    # Its T_B is 50 sampling intervals; the fit looks for those of 20 and more.
    truth = {"N": 1e-3, "B": 1.5e-3, "T_B": 10.0}
    found = found_in(NoiseModel(**truth))
    for name, bound in bounds(truth, RATE, SAMPLES).items():
        off = np.log(value(found, name) / truth[name])
        assert abs(off) < 4 * bound, (name, of(found, name), found.band)


def singles(samples: int) -> np.ndarray:
    return np.random.default_rng(5).random(samples) < 0.1


def bursts(samples: int) -> np.ndarray:
    missing = np.zeros(samples, dtype=bool)
    for start in np.random.default_rng(5).integers(0, samples - 100, samples // 350):
        missing[start : start + 100] = True
    return missing


def one_hole(samples: int) -> np.ndarray:
    missing = np.zeros(samples, dtype=bool)
    missing[70_000:75_000] = True
    return missing


def one_hole_that_divides_the_log(samples: int) -> np.ndarray:
    missing = np.zeros(samples, dtype=bool)
    missing[60_000:130_000] = True
    return missing


@pytest.mark.release
@pytest.mark.parametrize("lose", few([bursts], [one_hole_that_divides_the_log, singles, one_hole]))
def test_holes_leave_the_estimates_inside_their_intervals(
    lose: Callable[[int], np.ndarray],
) -> None:
    model = NoiseModel(**MTI_7)
    log, whole = log_of(model), found_in(model)
    missing = lose(SAMPLES)
    log[missing] = np.nan
    before = log.copy()
    found = fit(log, RATE)
    np.testing.assert_array_equal(log, before)
    part = 1 - missing.mean()
    for name in ALL:
        assert holds(found, name, MTI_7[name], "likelihood_gm")
        # What is lost moves an estimate by sigma sqrt(1 / part - 1), and widens its interval.
        error = width(whole, name, "likelihood_gm") / 3.92 * max(np.sqrt(1 / part - 1), 0.35)
        moved = value(found, name, "likelihood_gm") / value(whole, name, "likelihood_gm")
        assert abs(np.log(moved)) < 3.5 * error, name
    wider = width(found, "N", "likelihood_gm") / width(whole, "N", "likelihood_gm")
    assert wider == pytest.approx(1 / np.sqrt(part), rel=0.08)


@pytest.mark.release  # bursts lose as many every day
def test_many_missing_samples_do_not_bias_white_noise() -> None:
    # Few clusters of the Allan variance are 90 % there: what fills the holes first is far off.
    samples = SAMPLES // 3
    log = log_of(NoiseModel(**MTI_7), samples=samples)
    log[np.random.default_rng(0).random(samples) < 0.3] = np.nan
    bound = bounds(MTI_7, RATE, samples)["N"] / np.sqrt(0.7)
    assert value(fit(log, RATE), "N") == pytest.approx(MTI_7["N"], rel=5 * bound)


@pytest.mark.release  # the next test has another level without a hole
def test_a_jump_of_level_between_segments_does_not_matter() -> None:
    model = NoiseModel(**MTI_7)
    spans = [(0, 80_000), (80_500, SAMPLES)]
    apart = log_of(model)
    apart[80_000:80_500] = np.nan
    apart[80_500:] += 0.3  # a thousand standard deviations
    found = fit(apart, RATE, segments=spans)
    for name in ALL:
        assert holds(found, name, MTI_7[name], "likelihood_gm")


@pytest.mark.release
def test_segments_without_holes_do_not_share_a_level() -> None:
    # No sample is missing: the clock alone says that the sensor was restarted.
    log = log_of(SHORT, samples=SHORT_SAMPLES)
    spans = [(0, 10_000), (10_000, SHORT_SAMPLES)]
    stepped = log + np.where(np.arange(SHORT_SAMPLES) < 10_000, 0.0, 5.0)
    found = fit(stepped, RATE, segments=spans)
    assert_same(fit(log, RATE, segments=spans), found)
    assert holds(found, "N", 1e-3, "likelihood_gm") and holds(found, "B", 1.5e-3, "likelihood_gm")


def log_with_holes() -> np.ndarray:
    log = log_of(SHORT, samples=WITH_HOLES)
    log[np.random.default_rng(3).random(WITH_HOLES) < 0.05] = np.nan
    return log


@cache
def found_with_holes() -> Likelihood:
    return fit(log_with_holes(), RATE)


@pytest.mark.release  # test_blocks_do_not_matter is one more fit of the log
def test_the_same_log_gives_the_same_result() -> None:
    np.random.seed(1)  # noqa: NPY002  # the global state must not matter
    again = fit(log_with_holes(), RATE)
    assert again.estimates == found_with_holes().estimates
    np.testing.assert_array_equal(again.fitted, found_with_holes().fitted)


@pytest.mark.release  # test_estimation.py has other draws every day
def test_other_draws_are_within_the_noise_of_the_intervals() -> None:
    one = found_in(SHORT, samples=SHORT_SAMPLES)
    other = fit(log_of(SHORT, samples=SHORT_SAMPLES), RATE, rng=np.random.default_rng(2))
    for name in ("N", "B", "T_B"):
        assert value(one, name) == value(other, name)
        assert limits(one, name) != limits(other, name)
        # 20,000 correlated draws: a limit is known to a few per cent of the interval.
        for a, b in zip(limits(one, name), limits(other, name), strict=True):
            assert np.log(a / b) == pytest.approx(0.0, abs=0.15 * width(one, name))


def test_unit_rate_constant_direction_and_type_change_what_they_must_alone() -> None:
    # In one fit: the variance of a sample is N^2 / T, and that of a step of the walk K^2 T.
    unit, faster = 1e-7, 17.0  # T_B stays above a second
    log = unit * (log_of(SHORT, samples=SHORT_SAMPLES)[::-1] - 4e3)
    root = np.sqrt(faster)
    scale = {"N": 1 / root, "B": 1.0, "K": root, "Q": 1 / faster, "R": faster}
    other = fit(log.tolist(), RATE * faster)
    scale = {name: unit * factor for name, factor in scale.items()} | {"T_B": 1 / faster}
    assert_same(found_in(SHORT, samples=SHORT_SAMPLES), other, **scale, time=1 / faster)


@pytest.mark.release  # the test before this has a list every day
def test_lists_are_taken_as_they_are() -> None:
    log = log_of(SHORT, samples=SHORT_SAMPLES)
    assert fit(log.tolist(), RATE).estimates == found_in(SHORT, samples=SHORT_SAMPLES).estimates


@pytest.mark.release  # the test of all of them at once is run every day
def test_lists_and_single_precision_are_taken() -> None:
    log = log_of(SHORT, samples=SHORT_SAMPLES).astype(np.float32)
    assert_same(found_in(SHORT, samples=SHORT_SAMPLES), fit(list(log), RATE))


@pytest.mark.release  # the test of all of them at once is run every day
@pytest.mark.parametrize("scale", [1e-7, 3e8])
def test_parameters_scale_with_the_unit(scale: float) -> None:
    other = fit(scale * log_of(SHORT, samples=SHORT_SAMPLES), RATE)
    same = dict.fromkeys(("Q", "N", "B", "K", "R"), scale)
    assert_same(found_in(SHORT, samples=SHORT_SAMPLES), other, **same)


@pytest.mark.release  # those of a log without holes are scaled every day
def test_parameters_of_a_log_with_holes_scale_with_the_unit() -> None:
    same = dict.fromkeys(("Q", "N", "B", "K", "R"), 1e-6)
    assert_same(found_with_holes(), fit(1e-6 * log_with_holes(), RATE), rel=1e-4, **same)


@pytest.mark.release  # the test of all of them at once is run every day
def test_a_constant_is_no_noise() -> None:
    # A million standard deviations of a sample.
    other = fit(log_of(SHORT, samples=SHORT_SAMPLES) - 4e3, RATE)
    assert_same(found_in(SHORT, samples=SHORT_SAMPLES), other)


@pytest.mark.release  # the test of all of them at once is run every day
@pytest.mark.parametrize("faster", [17.0, 0.01])  # T_B stays above a second
def test_the_same_samples_at_another_rate_scale_with_time(faster: float) -> None:
    # The variance of a sample is N^2 / T, and that of a step of the walk K^2 T.
    other = fit(log_of(SHORT, samples=SHORT_SAMPLES), RATE * faster)
    root = np.sqrt(faster)
    scale = {"N": 1 / root, "K": root, "T_B": 1 / faster, "Q": 1 / faster, "R": faster}
    assert_same(found_in(SHORT, samples=SHORT_SAMPLES), other, **scale, time=1 / faster)


@pytest.mark.release  # the test of all of them at once is run every day
def test_a_log_read_backwards_has_the_same_noise() -> None:
    other = fit(log_of(SHORT, samples=SHORT_SAMPLES)[::-1], RATE)
    assert_same(found_in(SHORT, samples=SHORT_SAMPLES), other)


@pytest.mark.release  # the short one is read backwards every day
def test_a_long_log_read_backwards_has_nearly_the_same_noise() -> None:
    # Its high frequencies come from segments, which are others from the other end.
    one = found_in(SHORT, samples=LONG)
    other = fit(log_of(SHORT, samples=LONG)[::-1], RATE)
    for name in ALL:
        assert holds(one, name, getattr(SHORT, name), "likelihood_gm")
        moved = value(one, name, "likelihood_gm") / value(other, name, "likelihood_gm")
        assert abs(np.log(moved)) < 0.25 * width(one, name, "likelihood_gm")


@pytest.mark.release
@pytest.mark.parametrize("backwards", [False, True])
def test_a_ramp_is_found_with_its_sign(backwards: bool) -> None:
    # Over 4000 s it climbs sixty times as far as the walk and a hundred times the noise.
    ramp, samples = -1e-4, 20_000
    walk = log_of(NoiseModel(N=1e-3, K=1e-4), 100, samples)
    log = walk + ramp * np.arange(samples) / RATE
    found = fit(log, RATE)
    # The mean slope of a walk of K over a time D has a standard deviation near K / sqrt(D).
    assert value(found, "R") == pytest.approx(ramp, abs=4 * 1e-4 / np.sqrt(samples / RATE))
    assert holds(found, "R", ramp)
    bound = bounds({"N": 1e-3, "K": 1e-4}, RATE, samples)["K"]
    assert value(found, "K") == pytest.approx(1e-4, rel=4 * bound)
    assert found.estimates[0].model.R == value(found, "R")
    if backwards:
        reverse = fit(log[::-1], RATE)
        assert value(reverse, "R") == pytest.approx(-value(found, "R"), rel=1e-6)


@pytest.mark.release
def test_what_lies_beyond_a_stated_band_does_not_matter() -> None:
    band = 0.3
    log = log_of(NoiseModel(**MTI_7))
    coefficients = scipy.fft.dct(log, norm="ortho")
    frequency = np.arange(SAMPLES) * RATE / (2 * SAMPLES)
    coefficients[frequency > 1.001 * band] *= 30.0
    spoilt = fit(scipy.fft.idct(coefficients, norm="ortho"), RATE, band=band)
    clean = fit(log, RATE, band=band)
    assert spoilt.band is not None and spoilt.band.highest == band
    used = spoilt.spectrum.upper[spoilt.used]
    assert 0.9 * band < used.max() <= band * (1 + 1e-6)
    assert not spoilt.used[spoilt.spectrum.lower >= band].any()
    assert_same(clean, spoilt)
    # The bound of N goes with the root of the band.
    bound = bounds(MTI_7, RATE, SAMPLES, band)["N"]
    assert width(clean, "N", "likelihood_gm") == pytest.approx(3.92 * bound, rel=0.2)
    assert holds(clean, "N", MTI_7["N"], "likelihood_gm")


@pytest.mark.release
def test_a_band_beyond_nyquist_is_the_whole_spectrum() -> None:
    found = fit(log_of(SHORT, samples=SHORT_SAMPLES), RATE, band=1e3)
    assert found.band is not None and found.band.highest == RATE / 2
    assert_same(found_in(SHORT, samples=SHORT_SAMPLES), found)


@pytest.mark.release  # test_joint_cutoff.py takes one out every day
@pytest.mark.parametrize("stated", [None, 0.8])
def test_a_filter_that_nobody_states_is_found_and_taken_out(stated: float | None) -> None:
    # White noise behind a first-order filter applied to the samples, whose cut-off is a third of
    # Nyquist: a tenth of it would leave 8 % of N.
    cutoff = 0.8
    pole = np.exp(-2 * np.pi * cutoff / RATE)
    model = NoiseModel(**MTI_7)
    log = lfilter([1 - pole], [1, -pole], log_of(model, samples=SAMPLES + 1000))[1000:]
    found = fit(log, RATE, bandwidth=stated)
    assert found.band is not None and found.band.highest == RATE / 2
    assert "low-pass of order 1" in found.frame.band_words
    N = found.estimates[0].parameters["N"]
    assert N.lower is not None and N.upper is not None
    # Before the sampling, the same filter would have folded more noise into it.
    assert N.lower < MTI_7["N"] < N.upper < 1.2 * N.lower
    bound = bounds(MTI_7, RATE, SAMPLES, found.band.highest)
    for name in ("B", "T_B", "K"):
        off = np.log(value(found, name, "likelihood_gm") / MTI_7[name])
        assert abs(off) < 0.01 + 4 * bound[name], name


# Every day test_cutoff.py finds a mean, and test_joint_cutoff.py takes a filter out.
@pytest.mark.release
def test_a_mean_of_two_samples_is_a_filter_and_harms_nothing() -> None:
    # Fitted up to Nyquist without it, N would be 0 and B many times too large.
    log = log_of(NoiseModel(**MTI_7), samples=SAMPLES + 1)
    found = fit((log[1:] + log[:-1]) / 2, RATE)
    assert found.band is not None and found.band.highest > 0.4 * RATE
    for name, bound in bounds(MTI_7, RATE, SAMPLES, found.band.highest).items():
        off = np.log(value(found, name, "likelihood_gm") / MTI_7[name])
        assert abs(off) < 0.01 + 4 * bound, name


def process_and_walk(T_B: float, rate: float, seed: int, N: float = 1e-4) -> np.ndarray:
    """White noise, a Gauss-Markov process of B = 3 N and a walk, by recursions alone."""
    rng = np.random.default_rng(seed)
    samples, decay = 144_000, np.exp(-1.0 / (T_B * rate))
    # v = S_B T_B / 2, S_B = 2 B^2 ln 2 / (pi 0.43654^2 T_B)
    deviation = 3.0 * N * np.sqrt(np.log(2.0) / np.pi) / 0.43654
    driven = deviation * np.sqrt(1.0 - decay**2) * rng.standard_normal(samples)
    driven[0] = deviation * rng.standard_normal()
    walk = np.cumsum(2e-2 * N / np.sqrt(rate) * rng.standard_normal(samples))
    white = N * np.sqrt(rate) * rng.standard_normal(samples)
    return np.asarray(white + lfilter([1.0], [1.0, -decay], driven) + walk)


@pytest.mark.release
@pytest.mark.parametrize("T_B", few([2.0], [5.0, 8.0]))
def test_a_process_of_few_samples_is_not_taken_for_the_sensors_filter(T_B: float) -> None:
    found = fit(process_and_walk(T_B, 10.0, 3), 10.0)
    assert found.band is not None and found.band.highest == 5.0
    assert found.candidates[0].goodness.verdict == "explained"
    for name, truth in (("N", 1e-4), ("B", 3e-4), ("T_B", T_B)):
        one = of(found, name)
        assert one.status == "ok", name
        assert one.lower is not None and one.upper is not None
        assert 0.9 * one.lower < truth < 1.1 * one.upper, name


@pytest.mark.release  # test_cutoff_rules.py tells such a process and a filter every day
def test_white_noise_below_a_process_as_fast_as_a_filter_is_not_told() -> None:
    # Three samples: the sensor's low-pass and white noise behind it would look the same.
    found = fit(process_and_walk(0.3, 10.0, 4), 10.0)
    # N is the level of the curve beyond the process, whatever that is.
    white, N = of(found, "N"), of(found, "N_sensor")
    assert white.status == "ok" and white.value == pytest.approx(1e-4, rel=0.02)
    assert (N.value, N.status) == (None, "not_identified")
    assert N.reason is not None and "low-pass" in N.reason
    assert N.lower is not None and N.upper is not None
    assert N.lower < 1e-4 < N.upper


@pytest.mark.release
def test_what_a_process_hides_is_not_taken_for_white_noise_before_a_filter() -> None:
    # 30 samples long and so strong that white noise does not show at Nyquist.
    hidden = fit(3e3 * process_and_walk(3.0, 10.0, 5, N=1e-4 / 3e3) + strong(), 10.0)
    N = of(hidden, "N")
    assert N.status in ("not_identified", "absent")
    assert N.value is None


def strong() -> np.ndarray:
    """A process 3,000 times the white noise beside it."""
    rng = np.random.default_rng(6)
    decay = np.exp(-1.0 / 30.0)
    return np.asarray(
        lfilter([1.0], [1.0, -decay], 0.3 * np.sqrt(1.0 - decay**2) * rng.standard_normal(144_000))
    )


def test_below_a_resonance_n_is_the_density_at_low_frequencies() -> None:
    # Neither a process nor a low-pass has such a spectrum.
    rng = np.random.default_rng(8)
    radius, angle = 0.97, 2 * np.pi * 1.0 / RATE
    ringing = lfilter(
        [1.0], [1.0, -2 * radius * np.cos(angle), radius**2], rng.normal(size=100_000)
    )
    log = rng.standard_normal(100_000) + 0.5 * ringing / ringing.std()
    found = fit(log, RATE)
    assert found.band is not None and found.band.highest < 0.9
    # The density at no frequency, over that of the white noise: of the ringing, 1 / (1 - a - b)^2
    # over its variance (G. Box and G. Jenkins, Time Series Analysis, 3.2.4), and a quarter of it.
    squared = radius**2
    variance = (1 + squared) / ((1 - squared) * (1 + squared**2 - 2 * squared * np.cos(2 * angle)))
    below = 1.0 / (1 - 2 * radius * np.cos(angle) + squared) ** 2 / variance
    N, truth = of(found, "N"), np.sqrt((1.0 + 0.25 * below) / RATE)
    assert N.lower is not None and N.upper is not None
    assert N.status == "ok" and N.lower < truth < N.upper


@pytest.mark.parametrize("truth", [MTI_7, FLICKER])
def test_the_fitted_density_is_that_of_the_process(truth: dict[str, float]) -> None:
    found = found_in(NoiseModel(**truth))
    frequency = found.spectrum.frequency
    inside = frequency > 4 / (SAMPLES / RATE)  # below, the ends of the log count
    expected = density(frequency[inside], RATE, **truth)
    rows = slopes(frequency[inside], RATE, truth)
    error = np.sqrt(np.einsum("ai,ab,bi->i", rows, covariance(truth, RATE, SAMPLES), rows))
    off = np.log(found.fitted[inside] / expected)
    assert (np.abs(off) < 4 * error + 2e-3).all()
    # Nothing is gained by scaling the whole model: a property of every maximum.
    nu, data = found.spectrum.ordinates[found.used], found.spectrum.density[found.used]
    balance = np.sum(nu * (data / found.fitted[found.used] - 1))
    assert abs(balance) < 0.02 * np.sqrt(2 * nu.sum())


def test_the_papers_model_has_four_parameters() -> None:
    found = found_in(NoiseModel(**FLICKER))
    assert [estimate.method for estimate in found.estimates] == ["likelihood", "likelihood_gm"]
    favoured, papers = found.estimates
    assert tuple(favoured.parameters) == FAMILY
    assert tuple(papers.parameters) == ALL
    assert not papers.further
    # Whatever the data favour, its bias instability is a Gauss-Markov process.
    assert papers.model.T_B is not None and papers.model.Q == 0 and papers.model.R == 0
    assert favoured.model.T_B is None


def test_two_processes_are_two_components() -> None:
    fast, slow = GaussMarkov(1e-3, 40.0), GaussMarkov(1e-3, 1500.0)
    model = NoiseModel(N=1e-3, B=slow.B, T_B=slow.T_B, further=[fast])
    found = fit(simulate(model, RATE, 400_000, np.random.default_rng(7)), RATE)
    estimate = found.estimates[0]
    rows = [(number, name) for number, name, _ in estimate.components()]
    assert rows == [(1, name) for name in (*FAMILY, *CURVE)] + [(2, "B"), (2, "T_B")]
    for number, truth in ((1, fast), (2, slow)):  # by T_B
        parts = {name: part for n, name, part in estimate.components() if n == number}
        for name in ("B", "T_B"):
            lower, upper = parts[name].lower, parts[name].upper
            assert lower is not None and upper is not None
            assert lower < getattr(truth, name) < upper
            assert upper < 2 * lower or number == 2
    assert estimate.model.name == "N+GM+GM"
    assert estimate.model.allan_variance(100.0) == pytest.approx(
        model.allan_variance(100.0), rel=0.1
    )


@pytest.mark.release  # test_estimation.py has the rows of a line every day
def test_lines_are_components_and_leave_the_noise_alone() -> None:
    waves = [Sinusoid(6e-5, 0.0123), Sinusoid(3e-5, 0.7)]
    time = np.arange(SAMPLES) / RATE
    log = log_of(NoiseModel(**MTI_7))
    for wave in waves:
        log = log + wave.amplitude * np.cos(2 * np.pi * wave.frequency * time + 1.0)
    found = fit(log, RATE)
    assert len(found.lines) == 2
    for estimate in found.estimates:
        lines = [(n, name, part) for n, name, part in estimate.components()
                 if name in ("amplitude", "frequency")]  # fmt: skip
        assert [(n, name) for n, name, _ in lines] == [
            (1, "amplitude"), (1, "frequency"), (2, "amplitude"), (2, "frequency")]  # fmt: skip
        for n, name, part in lines:
            truth = getattr(waves[n - 1], name)
            assert part.value == pytest.approx(truth, rel=0.1)
            assert part.lower is not None and part.upper is not None and part.value is not None
            assert abs(part.value - truth) < part.upper - part.lower  # four standard errors
        assert estimate.model.name.endswith("S+S")
        made = [wave.frequency for wave in estimate.model.sinusoids]
        assert made == pytest.approx([0.0123, 0.7], rel=3e-3)
    for name, bound in bounds(MTI_7, RATE, SAMPLES).items():
        off = np.log(value(found, name, "likelihood_gm") / MTI_7[name])
        assert abs(off) < 4 * bound, name


def in_pieces(log: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    cuts = np.sort(rng.integers(0, len(log), 25))
    pieces = np.split(log, [0, *cuts, cuts[-1], len(log)])
    assert sum(len(piece) == 0 for piece in pieces) >= 3
    return pieces


@pytest.mark.release
@pytest.mark.parametrize("holes", [False, True])
def test_blocks_do_not_matter(holes: bool, rng: np.random.Generator) -> None:
    log = log_with_holes() if holes else log_of(SHORT, samples=LONG)
    whole = found_with_holes() if holes else found_in(SHORT, samples=LONG)
    pieces = in_pieces(log, rng)
    found = fit_blocks(
        lambda: iter(pieces),
        WITH_HOLES if holes else LONG,
        RATE,
        holes=holes,
        rng=np.random.default_rng(0),
    )
    assert_same(whole, found)


@pytest.mark.release
def test_a_complete_log_that_may_have_holes_is_the_same() -> None:
    log = log_of(SHORT, samples=SHORT_SAMPLES)
    whole = found_in(SHORT, samples=SHORT_SAMPLES)
    found = fit_blocks(
        lambda: [log],
        SHORT_SAMPLES,
        RATE,
        holes=True,
        rng=np.random.default_rng(0),
    )
    for name in ALL:
        expected = value(whole, name, "likelihood_gm")
        assert value(found, name, "likelihood_gm") == pytest.approx(expected, rel=1e-3)
