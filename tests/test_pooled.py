import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.model.comparisons import PooledRow
from imubench_pipeline.model.estimates import FixedBiasRow, ParameterRow
from imubench_pipeline.navigation.pooled import Pool, estimate_turn_on_bias, list_pooled_rows, pool
from tests.conftest import few

Z = 1.959963984540054


def from_logs(y, variance) -> Pool:
    y, half = np.asarray(y, float), Z * np.sqrt(np.asarray(variance, float))
    return pool(np.exp(y), np.exp(y - half), np.exp(y + half))


def odds_ratios(events, treated, controls, untreated):
    a, n, c, m = (np.asarray(x, float) for x in (events, treated, controls, untreated))
    y = np.log(a / (n - a) / (c / (m - c)))
    return y, 1 / a + 1 / (n - a) + 1 / c + 1 / (m - c)


def test_paule_and_mandel_of_dersimonian_and_kacker() -> None:
    # R. DerSimonian and R. Kacker, Contemp. Clin. Trials 28, 2007, tables 3 and 4 (CLASP): the
    # Paule-Mandel tau, mean and standard error.
    y, variance = odds_ratios(
        [5, 5, 12, 69, 9, 313],
        [156, 303, 565, 1570, 103, 4659],
        [8, 17, 9, 94, 11, 352],
        [74, 303, 477, 1565, 105, 4650],
    )
    found = from_logs(y, variance)
    assert found.value is not None and found.lower is not None
    assert found.spread == pytest.approx(0.3681, abs=5e-5)
    assert np.log(found.value) == pytest.approx(-0.3811, abs=5e-5)
    # Student's t with 5 degrees of freedom at 97.5 % is 2.570582.
    assert np.log(found.value / found.lower) / 2.570582 == pytest.approx(0.2060, abs=5e-5)


def test_q_profile_of_viechtbauer() -> None:
    # W. Viechtbauer, Stat. Med. 26, 2007, table II: tau^2 from 0.072 to 2.203 (diuretics and
    # pre-eclampsia, Collins et al. 1985, whose Q is 27.26 with 8 degrees of freedom).
    y, variance = odds_ratios(
        [14, 21, 14, 6, 12, 138, 15, 6, 65],
        [131, 385, 57, 38, 1011, 1370, 506, 108, 153],
        [14, 17, 24, 18, 35, 175, 20, 2, 40],
        [136, 134, 48, 40, 760, 1336, 524, 103, 102],
    )
    found = from_logs(y, variance)
    assert found.spread_lower is not None and found.spread_upper is not None
    assert found.spread_lower**2 == pytest.approx(0.072, abs=5e-4)
    assert found.spread_upper**2 == pytest.approx(2.203, abs=5e-4)
    assert found.p_value == pytest.approx(6.4e-4, abs=1e-5)
    assert found.verdict == "differ"


@pytest.mark.parametrize("recordings", [2, 3, 7])
def test_equal_errors_have_a_closed_form(rng: np.random.Generator, recordings: int) -> None:
    # Q = (K - 1) s^2 / (v + tau^2): all of the pool follows from the variance s^2 of the logs.
    y = rng.normal(-4.0, 0.5, recordings)
    found = from_logs(y, np.full(recordings, 1e-4))
    squares = (recordings - 1) * y.var(ddof=1)
    # chi-squared at 2.5 and 97.5 %, and t, from printed tables
    low, high, t = {
        2: (9.821e-4, 5.0239, 12.7062),
        3: (0.050636, 7.37776, 4.30265),
        7: (1.237344, 14.44938, 2.446912),
    }[recordings]
    assert found.value == pytest.approx(np.exp(y.mean()))
    assert found.spread == pytest.approx(np.sqrt(squares / (recordings - 1) - 1e-4), rel=1e-6)
    assert found.spread_lower == pytest.approx(np.sqrt(squares / high - 1e-4), rel=1e-4)
    assert found.spread_upper == pytest.approx(np.sqrt(squares / low - 1e-4), rel=1e-4)
    half = t * np.sqrt(y.var(ddof=1) / recordings)
    assert found.upper == pytest.approx(np.exp(y.mean() + half), rel=1e-4)


def test_equal_values_are_not_known_better_than_their_errors_allow() -> None:
    found = from_logs([0.0] * 4, [0.04] * 4)
    assert (found.value, found.upper) == pytest.approx((1.0, np.exp(Z * 0.1)))
    assert (found.spread, found.spread_upper, found.p_value) == (0.0, 0.0, 1.0)
    assert found.verdict == "agree"


def test_the_half_of_the_limits_towards_the_pool_counts() -> None:
    # Of 1 (0.9 to 4) and 2 (1.8 to 2.2): the pool lies above the first, whose upper half is wide.
    wide, narrow = np.log(4.0) / Z, np.log(2.0 / 1.8) / Z
    found = pool([1.0, 2.0], [0.9, 1.8], [4.0, 2.2])
    mean = np.log(2.0) * narrow**-2 / (wide**-2 + narrow**-2)
    assert found.value == pytest.approx(np.exp(mean))
    assert found.verdict == "agree"
    assert pool([1.0, 2.0], [0.25, 1.8], [1.0 / 0.9, 2.2]).verdict == "differ"


def test_a_value_at_its_limit_is_no_wall() -> None:
    found = pool([1.0, 0.9], [0.999, 0.87], [2.0, 0.93])
    assert found.verdict == "agree"


def test_what_is_not_identified_is_left_out_and_counted() -> None:
    values = [1.0, 1.1, None, float("nan"), None, 1.0, 3.0]
    lower = [0.9, 1.0, 1e-9, 0.5, None, None, 0.5]
    upper = [1.1, 1.2, 1e-3, 2.0, None, None, 2.0]
    found = pool(values, lower, upper)
    assert (found.recordings, found.left_out, found.contradicting) == (2, 5, 1)
    alone = pool(values[:2], lower[:2], upper[:2])
    assert (found.value, found.spread) == (alone.value, alone.spread)


def test_one_recording_keeps_its_own_limits() -> None:
    assert pool([2.0], [1.0], [5.0]) == Pool(2.0, 1.0, 5.0, 1, 0)
    assert pool([], [], []) == Pool(None, None, None, 0, 0)
    assert pool([None], [0.1], [0.2]) == Pool(None, None, None, 0, 1)


def test_lengths_must_agree() -> None:
    with pytest.raises(ValueError, match="shorter"):
        pool([1.0, 2.0], [0.5], [3.0, 3.0])


def test_far_apart_values_give_numbers() -> None:
    found = pool([1e-150, 1e150], [0.9e-150, 0.9e150], [1.1e-150, 1.1e150])
    assert found.upper is not None and np.isfinite(found.upper)
    assert found.verdict == "differ" and found.p_value == 0.0


recordings = st.lists(
    st.tuples(st.floats(-6, 6), st.floats(1e-4, 2), st.floats(1e-4, 2)), min_size=2, max_size=12
)


@given(recordings, st.randoms(use_true_random=False), st.floats(1e-8, 1e8))
def test_order_and_unit_do_not_matter(drawn, random, scale: float) -> None:
    def pooled(entries, unit: float) -> Pool:
        y, below, above = (np.array(column) for column in zip(*entries, strict=True))
        return pool(unit * np.exp(y), unit * np.exp(y - below), unit * np.exp(y + above))

    first = pooled(drawn, 1.0)
    random.shuffle(drawn)
    second = pooled(drawn, scale)
    for name in ("value", "lower", "upper"):
        expected, found = np.log(getattr(first, name)), np.log(getattr(second, name))
        if abs(expected) < 600:
            assert found - np.log(scale) == pytest.approx(expected, rel=1e-6, abs=1e-5)
    assert second.p_value == pytest.approx(first.p_value, rel=1e-4, abs=1e-9)
    assert second.spread == pytest.approx(first.spread, rel=1e-4, abs=1e-4)
    assert first.spread_lower is not None and first.spread_upper is not None
    assert first.spread is not None and first.value is not None
    assert first.spread_lower <= first.spread <= first.spread_upper or not first.spread_upper
    logs = [y for y, _, _ in drawn]
    assert min(logs) - 1e-9 <= np.log(first.value) <= max(logs) + 1e-9


def simulated(rng: np.random.Generator, recordings: int, spread: float, ratio: float, pools: int):
    errors = 0.05 * np.geomspace(ratio**-0.5, ratio**0.5, recordings)
    for _ in range(pools):
        y = rng.normal(-7.0, np.hypot(errors, 0.05 * spread))
        yield from_logs(y, errors**2)


@pytest.mark.parametrize(
    ("recordings", "spread", "ratio", "least", "most"),
    few(
        [
            (2, 0.0, 1.0, 0.98, 1.0),  # two values do not know their spread: see the module
            (5, 0.0, 3.0, 0.96, 0.992),
            (5, 1.0, 3.0, 0.93, 0.97),
        ],
        [
            (2, 1.0, 1.0, 0.96, 0.995),
            (2, 5.0, 1.0, 0.93, 0.975),
            (3, 0.0, 1.0, 0.97, 0.995),
            (3, 5.0, 1.0, 0.93, 0.97),
            (20, 0.0, 3.0, 0.95, 0.985),
            (20, 1.0, 3.0, 0.93, 0.97),
            (20, 5.0, 1.0, 0.93, 0.97),
        ],
    ),
)
def test_intervals_cover_the_truth(
    rng: np.random.Generator, recordings: int, spread: float, ratio: float, least, most
) -> None:
    found = list(simulated(rng, recordings, spread, ratio, 1500))
    covered = np.mean([p.lower < np.exp(-7.0) < p.upper for p in found])
    assert least <= covered <= most
    inside = np.mean([p.spread_lower <= 0.05 * spread <= p.spread_upper for p in found])
    # Without spread the lower limit alone errs: 97.5 %.
    assert inside == pytest.approx(0.95 if spread else 0.975, abs=0.02)
    if not spread:
        assert np.mean([p.verdict == "differ" for p in found]) == pytest.approx(0.01, abs=0.009)


def test_spread_is_found_without_bias(rng: np.random.Generator) -> None:
    squares = [(p.spread or 0.0) ** 2 for p in simulated(rng, 10, 3.0, 3.0, 1500)]
    assert np.mean(squares) == pytest.approx(0.15**2, rel=0.05)


def test_skew_limits_of_few_degrees_of_freedom(rng: np.random.Generator) -> None:
    # sigma^2 from 12 degrees of freedom; chi-squared at 2.5 and 97.5 % is 4.403789, 23.336664.
    found = []
    for _ in range(1500):
        sigma = np.sqrt(rng.chisquare(12, 5) / 12)
        found.append(pool(sigma, sigma * np.sqrt(12 / 23.336664), sigma * np.sqrt(12 / 4.403789)))
    assert np.mean([(p.lower or 2) < 1 < (p.upper or 0) for p in found]) > 0.955
    assert np.mean([p.verdict == "differ" for p in found]) == pytest.approx(0.01, abs=0.009)


def test_turn_on_bias_by_hand() -> None:
    # s = 2; chi-squared with 3 degrees of freedom: 0.2157953 and 9.348404; t = 3.182446.
    found = estimate_turn_on_bias(
        [-2.0, 2.0, -1.0 - np.sqrt(2), None, -1.0 + np.sqrt(2), float("nan")]
    )
    assert (found.recordings, found.left_out) == (4, 2)
    assert found.value == pytest.approx(-0.5)
    squares = 1.5**2 + 2.5**2 + (0.5 + np.sqrt(2)) ** 2 + (0.5 - np.sqrt(2)) ** 2
    assert found.spread == pytest.approx(np.sqrt(squares / 3))
    assert found.spread_lower == pytest.approx(np.sqrt(squares / 9.348404))
    assert found.spread_upper == pytest.approx(np.sqrt(squares / 0.2157953))
    assert found.upper == pytest.approx(-0.5 + 3.182446 * np.sqrt(squares / 3) / 2)


def test_one_mean_has_no_deviation() -> None:
    found = estimate_turn_on_bias([-0.3])
    assert (found.value, found.spread, found.upper) == (-0.3, None, None)
    assert estimate_turn_on_bias([]).value is None


def parameter(recording, name="N", value=1.0, status="ok", half=0.01, **more):
    known = value is not None
    about = {
        "sensor": "S", "recording": recording, "channel": "gyro_x", "method": "likelihood",
        "recommended": True, "model": "N+F+K", "component": 1, "parameter": name, "value": value,
        "lower": value * np.exp(-half) if known else None,
        "upper": value * np.exp(half) if known else None,
        "unit": "rad/s/sqrt(Hz)", "status": status, "reason": None, "duration_needed": None,
    }  # fmt: skip
    return ParameterRow(**(about | more))


def bias(recording, value, channel="gyro_x"):
    unit = "rad/s" if channel.startswith("gyro") else "m/s^2"
    return FixedBiasRow(sensor="S", recording=recording, channel=channel, value=value, unit=unit)


def by_key(rows):
    rows = list(rows)
    assert all(isinstance(row, PooledRow) for row in rows)
    return {(row["device"], row["channel"], row["parameter"]): row for row in rows}


def test_rows_of_one_device() -> None:
    rows = [parameter(r, value=v) for r, v in (("a", 1.0), ("b", 1.005), ("c", 1.1))]
    rows.append(parameter("a", method="curve", recommended=False, value=9.0))
    rows.append(parameter("b", component=2, value=9.0))
    found = by_key(list_pooled_rows(rows, [], {("S", r): "d" for r in "abc"}))
    assert list(found) == [(None, "gyro_x", "N")]
    row = found[None, "gyro_x", "N"]
    alone = pool(*([row[k] for row in rows[:3]] for k in ("value", "lower", "upper")))
    assert alone.spread and alone.value
    assert row["spread"] == pytest.approx(alone.spread * alone.value)
    assert (row["recordings"], row["left_out"], row["verdict"]) == (3, 0, "differ")
    assert row["unit"] == "rad/s/sqrt(Hz)"
    assert "; ".join(row["reasons"]) == "the recordings differ: the sensor is not stationary"


def test_devices_that_differ_are_told_from_recordings_that_do(rng: np.random.Generator) -> None:
    names = [f"{device}{i}" for device in "xyz" for i in range(4)]
    devices = {("S", name): name[0] for name in names}
    level = {"x": 0.0, "y": 0.3, "z": 0.6}
    apart, alike = (
        by_key(
            list_pooled_rows(
                [
                    parameter(n, value=np.exp(rng.normal(factor * level[n[0]], spread)))
                    for n in names
                ],
                [bias(n, rng.normal(factor * level[n[0]], spread)) for n in names],
                devices,
            )
        )
        for factor, spread in ((1.0, 0.005), (0.0, 0.1))
    )
    assert set(key[0] for key in apart) == {None, "x", "y", "z"}
    assert apart[None, "gyro_x", "N"]["verdict"] == "differ"
    assert apart["y", "gyro_x", "N"]["verdict"] == "agree"
    assert alike["y", "gyro_x", "N"]["verdict"] == "differ"


def test_one_recording_a_device_cannot_tell_which() -> None:
    rows = [parameter("a"), parameter("b", value=2.0)]
    found = by_key(list_pooled_rows(rows, [], {}))
    assert list(found) == [(None, "gyro_x", "N")]
    reason = "; ".join(found[None, "gyro_x", "N"]["reasons"])
    assert reason == "the recordings differ: the devices differ, or the sensor is not stationary"


def test_a_term_absent_in_some_is_no_agreement() -> None:
    rows = [parameter(r) for r in "abcd"]
    rows += [parameter(r, "K", 1.0) for r in "ab"]
    rows += [parameter("c", "K", None, "absent")]  # and the model of d has no row of K at all
    rows += [parameter(r, "T_B", 100.0, half=0.3) for r in "ab"]
    rows += [parameter(r, "T_B", None, "absent") for r in "cd"]
    rows += [parameter(r, "Q", None, "absent") for r in "abcd"]
    found = by_key(list_pooled_rows(rows, [], {("S", r): "d" for r in "abcd"}))
    assert set(key[2] for key in found) == {"N", "K", "T_B"}
    walk = found[None, "gyro_x", "K"]
    assert (walk["recordings"], walk["left_out"], walk["verdict"]) == (2, 2, None)
    assert "not in the model of 2 of 4 recordings" in "; ".join(walk["reasons"])
    times = found[None, "gyro_x", "T_B"]
    assert (times["recordings"], times["left_out"], times["verdict"]) == (2, 0, "agree")


def test_reasons_say_what_is_left_out() -> None:
    rows = [parameter(r) for r in "ab"]
    rows += [parameter("c", value=None, status="not_identified", lower=1e-9, upper=0.5)]
    rows += [parameter("d", value=7.0, status="at_bound"), parameter("e", lower=None)]
    row = by_key(list_pooled_rows(rows, [], {}))[None, "gyro_x", "N"]
    assert (row["recordings"], row["left_out"]) == (2, 3)
    for why in ("not determined", "bounded", "no 95 % limits"):
        assert f"1 recording not used ({why})" in "; ".join(row["reasons"])
    assert "2 recordings not used have limits outside the predicted range" in "; ".join(
        row["reasons"]
    )


def test_none_identified_gives_a_row_without_a_value() -> None:
    rows = [parameter(r, "B", None, "not_identified") for r in "ab"]
    row = by_key(list_pooled_rows(rows, [], {}))[None, "gyro_x", "B"]
    assert (row["recordings"], row["left_out"], row["value"], row["spread"]) == (0, 2, None, None)
    assert "; ".join(row["reasons"]) == "2 recordings not used (not determined)"


def test_biases() -> None:
    given_biases = [bias("a", -1e-3), bias("b", 1e-3), bias("c", np.nan)]
    given_biases += [bias(r, 9.8, "accel_z") for r in "ab"]
    found = by_key(list_pooled_rows([], given_biases, {("S", r): "d" for r in "abc"}))
    row = found[None, "gyro_x", "bias"]
    assert (row["recordings"], row["left_out"], row["unit"]) == (2, 1, "rad/s")
    assert row["spread"] == pytest.approx(np.sqrt(2) * 1e-3)
    assert (row["verdict"], row["p_value"]) == (None, None)
    assert "gravity" in "; ".join(found[None, "accel_z", "bias"]["reasons"])


@pytest.mark.release
@pytest.mark.parametrize("repeats", [2, 3000])
def test_time_is_linear(rng: np.random.Generator, repeats: int) -> None:
    names = [f"r{i}" for i in range(3000)]
    devices = {("S", name): str(i // repeats) for i, name in enumerate(names)}
    rows = [
        parameter(name, term, float(np.exp(rng.normal(0, 0.2))), half=0.2, channel=f"gyro_{axis}")
        for name in names
        for axis in range(6)
        for term in ("N", "B", "K")
    ]
    start = time.process_time()
    found = list(list_pooled_rows(rows, [], devices))
    assert len(found) == 18 * (1 + (1500 if repeats == 2 else 0))
    assert time.process_time() - start < 10.0
