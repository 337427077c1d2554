from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.intervals import (
    TARGET_RELATIVE_ERROR,
    compute_cramer_rao_bounds,
    compute_relative_bounds,
    find_durations_needed,
    list_parameter_names,
    make_ideal_spectrum,
)
from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle, make_whittle
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from tests.estimators.test_least_squares import C102, MTI_7

HOURS_10 = 36_000.0

VARIANCE = np.log(2) / (np.pi * 0.4365**2)
"""Of a Gauss-Markov process of B = 1: S_B T_B / 2."""

Named = dict[str, float]


def density(values: Named, f: np.ndarray, rate: float) -> np.ndarray:
    """Two-sided density in continuous time, apart from quantization noise."""
    total = np.full_like(f, values.get("N", 0.0) ** 2)
    total += values.get("K", 0.0) ** 2 / (2 * np.pi * f) ** 2
    total += values.get("Q", 0.0) ** 2 * rate * 4 * np.sin(np.pi * f / rate) ** 2
    for name, level in values.items():
        if name.startswith("B"):
            time = values.get("T_" + name)
            if time is None:
                total += level**2 / (2 * np.pi * f)
            else:
                total += 2 * VARIANCE * level**2 * time / (1 + (2 * np.pi * f * time) ** 2)
    return total


def values_of(model: NoiseModel) -> Named:
    values = {"Q": model.Q, "N": model.N, "B": model.B, "K": model.K}
    if model.T_B:
        values["T_B"] = model.T_B
    for number, process in enumerate(model.further, start=2):
        values |= {f"B {number}": process.B, f"T_B {number}": process.T_B}
    return {name: value for name, value in values.items() if value > 0}


def integrated(model: NoiseModel, rate: float, duration: float, highest: float) -> Named:
    """Bounds from I = T times the integral of (d log S)^2 over the band, beside its ordinates."""
    values = values_of(model)
    # Ordinates are 1 / (2 T) apart: the lowest one by one, then so densely that it is an integral.
    k = np.arange(1, min(20_000, int(2 * duration * highest) + 1))
    edges = np.geomspace(k[-1] + 0.5, 2 * duration * highest, 20_000)
    if edges[-1] <= edges[0]:
        edges = edges[:1]
    f = np.concatenate([k, (edges[1:] + edges[:-1]) / 2]) / (2 * duration)
    weight = 0.5 * np.concatenate([np.ones(len(k)), np.diff(edges)])
    rows = []
    for name in values:
        up, down = values | {name: values[name] * 1.001}, values | {name: values[name] / 1.001}
        change = np.log(density(up, f, rate) / density(down, f, rate))
        rows.append(change / (2 * np.log(1.001)))
    rows = np.array(rows)
    bounds = np.sqrt(np.diag(np.linalg.inv((rows * weight) @ rows.T)))
    return dict(zip(values, bounds, strict=True))


def maximum_of(terms: Terms, powers: list[float], *times: float, ramp: float = 0.0) -> Maximum:
    return Maximum(terms, np.array(powers), np.array(times), ramp, 0.0)


MTI_7_FOUND = maximum_of(Terms("NK", 1), [MTI_7.N**2, MTI_7.K**2, MTI_7.B**2], MTI_7.T_B or np.nan)


@pytest.mark.parametrize(
    ("model", "rate", "printed"),
    [
        (MTI_7, 100.0, {"N": 0.037, "B": 4.2, "T_B": 9.8, "K": 27.7}),
        (C102, 50.0, {"N": 0.053, "B": 7.8, "T_B": 16.7, "K": 22.2}),
    ],
    ids=["MTi-7", "C102"],
)
def test_the_bounds_of_the_papers_sensors_are_those_of_the_method(
    model: NoiseModel, rate: float, printed: Named
) -> None:
    # In per cent, of 10 h, all frequencies used.
    found = compute_cramer_rao_bounds(model, rate, HOURS_10, rate / 2)
    assert found.keys() == printed.keys()
    for name, per_cent in printed.items():
        assert 100 * found[name] == pytest.approx(per_cent, rel=0.012), name


def test_a_band_to_a_tenth_of_the_rate_tells_n_half_as_well_and_the_rest_as_well() -> None:
    whole = compute_cramer_rao_bounds(MTI_7, 100.0, HOURS_10, 50.0)
    tenth = compute_cramer_rao_bounds(MTI_7, 100.0, HOURS_10, 10.0)
    assert 100 * tenth["N"] == pytest.approx(0.084, abs=5e-4)
    for name in ("B", "T_B", "K"):
        assert tenth[name] == pytest.approx(whole[name], rel=0.01)


@pytest.mark.parametrize(
    ("model", "tolerance"),
    [
        (MTI_7, 0.01),
        (C102, 0.01),
        (NoiseModel(N=1e-3), 1e-3),
        (NoiseModel(N=1e-3, K=1e-5), 0.01),
        (NoiseModel(N=1e-3, B=1e-3), 0.01),
        (NoiseModel(N=1e-3, B=5e-3, T_B=4.0), 0.01),
        (NoiseModel(N=1e-4, B=3e-4, T_B=5.0, further=[GaussMarkov(6e-4, 200.0)]), 0.02),
        (NoiseModel(N=1e-4, B=3e-4, T_B=1.0, K=1e-5, further=[GaussMarkov(9e-4, 150.0)]), 0.03),
        # The ends of the log bend flicker noise where K shows.
        (NoiseModel(Q=2e-6, N=1e-4, B=2e-4, K=3e-6), 0.04),
    ],
    ids=lambda value: value.name if isinstance(value, NoiseModel) else "",
)
def test_bounds_are_those_of_the_integral_over_frequencies(
    model: NoiseModel, tolerance: float
) -> None:
    # Up to a tenth of the rate, where samples and continuous time differ little.
    for highest in (2.0, 10.0):
        expected = integrated(model, 100.0, HOURS_10, highest)
        found = compute_cramer_rao_bounds(model, 100.0, HOURS_10, highest)
        assert found.keys() == expected.keys()
        for name, bound in expected.items():
            assert found[name] == pytest.approx(bound, rel=tolerance), name


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(N=1e-3, K=1e-3),
        NoiseModel(N=1e-3, B=3e-3, T_B=2.0),
        NoiseModel(N=1e-3, B=3e-3, T_B=6.0),
    ],
    ids=["N+K", "N+GM", "slow GM"],
)
def test_bounds_of_a_short_log_are_those_of_its_covariance(model: NoiseModel) -> None:
    # The exact Fisher information of Gaussian samples without their mean, no spectrum at all.
    n, rate = 600, 10.0
    i = np.arange(n)
    lag = np.abs(i[:, None] - i) / rate

    def covariance(values: Named) -> np.ndarray:
        total = values["N"] ** 2 * rate * (lag == 0)
        if "K" in values:
            total = total + values["K"] ** 2 * (np.minimum(i[:, None], i) + 1) / rate
        if "B" in values:
            total = total + VARIANCE * values["B"] ** 2 * np.exp(-lag / values["T_B"])
        return np.diff(np.diff(total, axis=0), axis=1)

    values = values_of(model)
    inverse = np.linalg.inv(covariance(values))
    parts = []
    for name in values:
        up, down = values | {name: values[name] * 1.01}, values | {name: values[name] / 1.01}
        parts.append(inverse @ (covariance(up) - covariance(down)) / (2 * np.log(1.01)))
    information = [[0.5 * np.sum(a * b.T) for b in parts] for a in parts]
    exact = np.sqrt(np.diag(np.linalg.inv(information)))
    found = compute_cramer_rao_bounds(model, rate, n / rate, rate / 2)
    for name, bound in zip(values, exact, strict=True):
        # The transform is exactly diagonal for a random walk, nearly for a Gauss-Markov process.
        assert found[name] == pytest.approx(bound, rel=5e-3 if "K" in values else 0.02), name


@pytest.mark.parametrize(
    ("duration", "highest", "ordinates"),
    [(10.0, 5.0, 99), (10.0, 50.0, 99), (1000.0, 5.0, 9999), (1000.0, 0.3002, 600)],
)
def test_white_noise_alone_is_known_by_the_number_of_its_ordinates(
    duration: float, highest: float, ordinates: int
) -> None:
    # 100 samples have 99 ordinates, half an oscillation and so on.
    found = compute_cramer_rao_bounds(NoiseModel(N=1e-3), 10.0, duration, highest)
    assert found["N"] == pytest.approx(1 / np.sqrt(2 * ordinates), rel=1e-9)


@pytest.mark.parametrize("R", [1e-6, -1e-6])
def test_a_ramp_in_white_noise_is_known_as_a_straight_line_is(R: float) -> None:
    # The slope of a straight line in white noise: sqrt(12 / T^3) N.
    found = compute_cramer_rao_bounds(NoiseModel(N=1e-3, R=R), 10.0, 2000.0, 5.0)
    assert found["R"] == pytest.approx(1e-3 * np.sqrt(12 / 2000.0**3) / 1e-6, rel=2e-3)
    # A ramp takes nothing from the other terms.
    assert found["N"] == pytest.approx(
        compute_cramer_rao_bounds(NoiseModel(N=1e-3), 10.0, 2000.0, 5.0)["N"]
    )


def test_a_ramp_in_a_random_walk_is_known_by_its_ends() -> None:
    # Its slope is the last value less the first, over T: K / sqrt(T).
    found = compute_cramer_rao_bounds(NoiseModel(N=1e-7, K=1e-3, R=2e-5), 10.0, 2000.0, 5.0)
    assert found["R"] == pytest.approx(1e-3 / np.sqrt(2000.0) / 2e-5, rel=0.01)


@pytest.mark.parametrize(
    ("duration", "highest", "count"),
    [(3.0, 5.0, 29), (6.4, 5.0, 63), (6.5, 5.0, 64), (6.6, 5.0, 65), (700.0, 0.7003, 980)],
)
def test_the_ordinates_of_an_ideal_spectrum_are_those_of_a_log(
    duration: float, highest: float, count: int
) -> None:
    spectrum, spacing = make_ideal_spectrum(10.0, duration, highest), 1 / (2 * duration)
    assert spectrum.ordinates.sum() == count
    assert (spectrum.ordinates >= 1).all()
    assert spectrum.frequency[0] == pytest.approx(spacing)
    assert spectrum.lower[0] == pytest.approx(spacing / 2)
    np.testing.assert_allclose(spectrum.lower[1:], spectrum.upper[:-1])
    assert spectrum.upper[-1] == pytest.approx((count + 0.5) * spacing)
    mean = np.average(spectrum.frequency, weights=spectrum.ordinates)
    assert mean == pytest.approx(spacing * (count + 1) / 2)


def test_one_ordinate_in_the_band_has_a_bound() -> None:
    assert compute_cramer_rao_bounds(NoiseModel(N=1e-3), 10.0, 0.6, 1.0)["N"] == pytest.approx(
        1 / np.sqrt(2)
    )


@pytest.mark.parametrize(
    "model",
    [
        MTI_7,
        NoiseModel(Q=1e-6, N=1e-4, B=1e-4, K=1e-6, R=1e-9),
        NoiseModel(N=1e-4, B=3e-4, T_B=5.0, further=[GaussMarkov(6e-4, 200.0)]),
    ],
    ids=lambda model: model.name,
)
def test_bounds_do_not_depend_on_units(model: NoiseModel) -> None:
    plain = compute_cramer_rao_bounds(model, 100.0, HOURS_10, 10.0)
    c, s = 57.3, 60.0
    # The signal in other units, and time in minutes.
    other = NoiseModel(
        Q=model.Q * c / s,
        N=model.N * c / np.sqrt(s),
        B=model.B * c,
        T_B=model.T_B / s if model.T_B else None,
        K=model.K * c * np.sqrt(s),
        R=model.R * c * s,
        further=[GaussMarkov(one.B * c, one.T_B / s) for one in model.further],
    )
    scaled = compute_cramer_rao_bounds(other, 100.0 * s, HOURS_10 / s, 10.0 * s)
    assert scaled == pytest.approx(plain, rel=1e-6)


def test_four_times_the_log_halves_the_bounds() -> None:
    for model in (MTI_7, NoiseModel(N=1e-4, B=1e-4, K=1e-6)):
        long = compute_cramer_rao_bounds(model, 100.0, 1e8, 10.0)
        longer = compute_cramer_rao_bounds(model, 100.0, 4e8, 10.0)
        for name, bound in long.items():
            assert longer[name] == pytest.approx(bound / 2, rel=0.01), name


@pytest.mark.parametrize(
    "model",
    [
        MTI_7,
        NoiseModel(N=1e-4, B=2e-4, K=1e-6),
        # Drifts far above the white noise, as a sensor that warms up has them.
        NoiseModel(N=1e-4, B=1e-1, T_B=500.0, K=1e-6),
        NoiseModel(N=1e-4, B=3e-2, T_B=5000.0, K=1e-6),
    ],
    ids=["MTi-7", "flicker", "strong drift", "slow drift"],
)
def test_a_longer_log_never_tells_less(model: NoiseModel) -> None:
    durations = np.geomspace(4.0, 4e6, 25)
    bounds = [compute_cramer_rao_bounds(model, 100.0, duration, 50.0) for duration in durations]
    for name in bounds[0]:
        column = np.array([bound[name] for bound in bounds])
        # Bins are averages, so that a bound may rise a little.
        assert (column[1:] < 1.02 * column[:-1]).all(), (name, column)


def test_what_is_far_from_the_bound_is_not_identified() -> None:
    # A weak B under a random walk and white noise, in 10 h and in 100 h.
    weak = NoiseModel(N=8.4e-5, B=8e-6, T_B=89.5, K=8.2e-7)
    assert compute_cramer_rao_bounds(weak, 100.0, HOURS_10, 50.0)["T_B"] > 0.3
    assert compute_cramer_rao_bounds(weak, 100.0, 100 * HOURS_10, 50.0)["T_B"] < 0.3
    assert compute_cramer_rao_bounds(MTI_7, 100.0, HOURS_10, 50.0)["T_B"] < 0.3


def test_at_the_duration_that_is_needed_the_bound_is_ten_per_cent() -> None:
    names = list_parameter_names(MTI_7_FOUND.terms)
    needed = find_durations_needed(MTI_7_FOUND, 100.0, HOURS_10, 10.0)
    for name, duration in zip(names[1:], needed[1:], strict=True):
        assert duration is not None
        exact = integrated(MTI_7, 100.0, duration, 10.0)[name]
        assert exact == pytest.approx(TARGET_RELATIVE_ERROR, rel=0.05), name
    # Far less than 10 h is enough for N.
    short = find_durations_needed(MTI_7_FOUND, 100.0, 60.0, 10.0)
    assert short[0] is not None
    assert compute_cramer_rao_bounds(MTI_7, 100.0, short[0], 10.0)["N"] == pytest.approx(
        TARGET_RELATIVE_ERROR, rel=0.03
    )
    # The duration of the log itself is only where the search begins.
    assert short[1:3] == pytest.approx(needed[1:3], rel=0.05)


@pytest.mark.parametrize("highest", [1.0, 5.0, 50.0])
def test_the_duration_for_white_noise_has_its_closed_form(highest: float) -> None:
    found = maximum_of(Terms("N"), [1e-6])
    (needed,) = find_durations_needed(found, 100.0, 1000.0, highest)
    assert needed == pytest.approx(50 / (2 * highest), rel=0.05)


@pytest.mark.parametrize("ratio", [1e-3, 1e-1, 10.0])
def test_durations_scale_with_time(ratio: float) -> None:
    plain = find_durations_needed(MTI_7_FOUND, 100.0, HOURS_10, 10.0)
    N, K, B = MTI_7_FOUND.powers
    found = maximum_of(
        Terms("NK", 1), [N * ratio, K / ratio, B], float(MTI_7_FOUND.times[0]) * ratio
    )
    scaled = find_durations_needed(found, 100.0 / ratio, HOURS_10 * ratio, 10.0 / ratio)
    assert scaled == pytest.approx([ratio * duration for duration in plain if duration], rel=1e-4)


def test_durations_of_a_strong_drift_are_not_those_at_which_it_looks_like_a_random_walk() -> None:
    # In 10 h its B is known to 9 %. No log of less than a correlation time tells it at all.
    model = NoiseModel(N=1e-4, B=1e-1, T_B=500.0, K=1e-6)
    found = maximum_of(Terms("NK", 1), [1e-8, 1e-12, 1e-2], 500.0)
    needed = find_durations_needed(found, 100.0, HOURS_10, 50.0)[2]
    assert needed is not None
    assert integrated(model, 100.0, 31_200.0, 10.0)["B"] == pytest.approx(
        TARGET_RELATIVE_ERROR, rel=0.02
    )
    assert needed == pytest.approx(31_200, rel=0.03)


@pytest.mark.parametrize(
    "model",
    [
        MTI_7,
        C102,
        NoiseModel(N=1e-3, K=1e-8),
        NoiseModel(Q=1e-6, N=1e-4, B=1e-4, K=1e-6, R=1e-9),
        NoiseModel(N=1e-4, B=3e-6, T_B=20.0, K=1e-7),
        NoiseModel(N=1e-4, B=3e-4, T_B=5.0, K=1e-6, further=[GaussMarkov(6e-4, 200.0)]),
        NoiseModel(N=1e-4, B=1e-4, K=1e-6, further=[GaussMarkov(1e-3, 1.0)]),
    ],
    ids=lambda model: model.name,
)
def test_durations_are_those_of_a_scan_of_many_lengths(model: NoiseModel) -> None:
    values = values_of(model)
    letters = {"Q": "Q", "N": "N", "F": "B", "K": "K"}
    linear = "".join(
        letter
        for letter, name in letters.items()
        if name in values and not (letter == "F" and model.T_B)
    )
    processes = [(values[n], values["T_" + n]) for n in ("B", "B 2") if "T_" + n in values]
    found = maximum_of(
        Terms(linear, len(processes), model.R != 0),
        [*(values[letters[letter]] ** 2 for letter in linear), *(B**2 for B, _ in processes)],
        *(time for _, time in processes),
        ramp=model.R,
    )
    needed = find_durations_needed(found, 10.0, 3600.0, 5.0)
    lengths = 3600.0 * np.geomspace(1e-2, 1e4, 85)
    bounds = [compute_cramer_rao_bounds(model, 10.0, float(length), 5.0) for length in lengths]
    for name, duration in zip(list_parameter_names(found.terms), needed, strict=True):
        errors = np.array([bound[name] for bound in bounds])
        enough = np.flatnonzero(errors <= TARGET_RELATIVE_ERROR)
        if not len(enough):
            assert duration is None or duration > lengths[-2], name
        elif enough[0] > 0:
            place = enough[0] - 1, enough[0]
            crossing = np.interp(
                -np.log(TARGET_RELATIVE_ERROR), -np.log(errors[[*place]]), np.log(lengths[[*place]])
            )
            assert duration == pytest.approx(np.exp(crossing), rel=0.05), name


def test_no_duration_is_given_for_what_no_log_would_tell() -> None:
    # B is 0, and so has no T_B; K is so weak that years would not do.
    found = maximum_of(Terms("NK", 1), [1e-6, 1e-24, 0.0], 100.0)
    needed = find_durations_needed(found, 100.0, 3600.0, 10.0)
    assert needed[0] is not None
    assert needed[1:] == [None, None, None]


def test_a_term_that_is_nothing_has_no_bound_and_takes_none_from_the_others() -> None:
    spectrum = make_ideal_spectrum(10.0, 2000.0, 5.0)
    whittle = make_whittle(spectrum, 5.0)
    with_it = compute_relative_bounds(whittle, maximum_of(Terms("NFK"), [1e-6, 0.0, 1e-8]))
    without = compute_relative_bounds(whittle, maximum_of(Terms("NK"), [1e-6, 1e-8]))
    assert np.isinf(with_it[1])
    np.testing.assert_allclose(with_it[[0, 2]], without, rtol=1e-9)


def test_bounds_come_in_the_order_of_their_names() -> None:
    model = NoiseModel(Q=1e-6, N=1e-4, B=2e-4, K=1e-6, R=1e-9, further=[GaussMarkov(3e-4, 50.0)])
    names = list_parameter_names(Terms("QNFK", 1, ramp=True))
    assert names == ["Q", "N", "B", "K", "B 2", "T_B 2", "R"]
    assert list(compute_cramer_rao_bounds(model, 100.0, HOURS_10, 10.0)) == names
    assert list_parameter_names(Terms("NK", 2)) == ["N", "K", "B", "B 2", "T_B", "T_B 2"]
    # Of two processes the one with the shorter correlation time comes first.
    short, long = GaussMarkov(3e-4, 5.0), GaussMarkov(6e-4, 200.0)
    one, other = (
        compute_cramer_rao_bounds(
            NoiseModel(N=1e-4, B=a.B, T_B=a.T_B, further=[b]), 100.0, HOURS_10, 10.0
        )
        for a, b in ((short, long), (long, short))
    )
    assert one == other


def test_bounds_do_not_depend_on_what_was_measured() -> None:
    # Expected information: the densities of a spectrum play no role in it.
    spectrum = make_ideal_spectrum(10.0, 2000.0, 5.0)
    noisy = replace(
        spectrum, density=np.random.default_rng(0).chisquare(1, len(spectrum.density)) + 1e-3
    )
    found = maximum_of(Terms("NK", 1), [1e-6, 1e-8, 1e-5], 20.0)
    one, other = (
        compute_relative_bounds(Whittle(part, 1.0, 400.0), found) for part in (spectrum, noisy)
    )
    np.testing.assert_allclose(one, other, rtol=1e-12)
