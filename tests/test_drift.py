import math
import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from imubench_pipeline.model.comparisons import DriftRow
from imubench_pipeline.model.estimates import FixedBiasRow, ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.drift import SIGNIFICANCE_LEVEL, drift_rows, order_of, series_of
from tests.conftest import few

Z = 1.959963984540054
AXES = tuple(f"{quantity}_{axis}" for quantity in ("gyro", "accel") for axis in "xyz")
TERMS = ("N", "B", "K", "T_B")


def recording(name, started=None, device="d", simulated=False, status="ok"):
    return RecordingRow(
        sensor="S", device=device, recording=name, kind="static", started=started,
        simulated=simulated, status=status,
    )  # fmt: skip


def parameter(name, value, error=0.01, term="N", channel="gyro_x", **more):
    known = value is not None
    about = {
        "sensor": "S", "recording": name, "channel": channel, "method": "likelihood",
        "recommended": True, "model": "N+GM+K", "component": 1, "parameter": term, "value": value,
        "lower": value * math.exp(-Z * error) if known else None,
        "upper": value * math.exp(Z * error) if known else None,
        "unit": "rad/s/sqrt(Hz)", "status": "ok", "reason": None, "duration_needed": None,
    }  # fmt: skip
    return ParameterRow(**(about | more))


def bias(name, value, channel="gyro_x"):
    return FixedBiasRow(sensor="S", recording=name, channel=channel, value=value, unit="rad/s")


def names(count):
    return [f"night_{i}" for i in range(count)]


def rows_of(logs, error=0.01):
    """Rows of one device of which logs[i, j] is the logarithm of term j in recording i."""
    parts = [(axis, term) for axis in AXES for term in TERMS]
    listed = names(len(logs))
    rows = [
        parameter(name, float(math.exp(y)), error, term, channel)
        for name, night in zip(listed, np.asarray(logs), strict=True)
        for (channel, term), y in zip(parts, night, strict=False)
    ]
    return list(drift_rows(rows, [], [recording(name) for name in listed]))


def table(rows, name):
    """Values of a column, by channel and parameter (rows) and recording."""
    found: dict[tuple[str, str], list] = {}
    for row in rows:
        found.setdefault((row["channel"], row["parameter"]), []).append(row[name])
    return found


def flags(rows):
    return np.array(list(table(rows, "verdict").values())) == "changed"


def of_biases(values, channel="gyro_x"):
    listed = names(len(values))
    rows = [bias(name, value, channel) for name, value in zip(listed, values, strict=True)]
    return list(drift_rows([], rows, [recording(name) for name in listed]))


# The statistics


def test_bias_is_the_t_test_of_one_against_the_earlier_ones(rng: np.random.Generator) -> None:
    values = rng.normal(2e-3, 1e-4, 7)
    rows = of_biases(values)
    assert [row["verdict"] for row in rows] == [None] * 3 + ["as before"] * 4
    for n in range(3, 7):
        assert rows[n]["p_value"] == pytest.approx(stats.ttest_ind(values[:n], values[n:][:1])[1])
        half = stats.t.ppf(0.975, n - 1) * values[:n].std(ddof=1) * math.sqrt(1 + 1 / n)
        limits = (rows[n]["expected_lower"], rows[n]["expected_upper"])
        assert limits == pytest.approx((values[:n].mean() - half, values[:n].mean() + half))
        assert rows[n]["change"] is None
    assert "; ".join(rows[0]["reasons"]) == "the first value"
    assert rows[2]["expected"] == pytest.approx(values[:2].mean())
    assert "only 2 earlier recordings at this level: the spread" in "; ".join(rows[2]["reasons"])


def test_the_spread_is_the_one_about_a_line_from_eight_on(rng: np.random.Generator) -> None:
    values = rng.normal(0, 1, 12) + np.arange(12) * 0.2
    rows = of_biases(values)
    for n in range(8, 12):
        line = np.polynomial.Polynomial.fit(np.arange(n), values[:n], 1)
        variance = ((values[:n] - line(np.arange(n))) ** 2).sum() / (n - 2)
        t = (values[n] - values[:n].mean()) / math.sqrt(variance * (1 + 1 / n))
        assert rows[n]["p_value"] == pytest.approx(2 * stats.t.sf(abs(t), n - 2))


def test_errors_alone_make_a_prediction_by_hand() -> None:
    # Four alike: their mean has a quarter of the variance; t with 3 degrees is 3.182446.
    rows = rows_of(np.zeros((5, 1)), error=0.1)
    half = 3.182446 * 0.1 * math.sqrt(1.25)
    assert rows[4]["expected"] == pytest.approx(1.0)
    assert rows[4]["expected_upper"] == pytest.approx(math.exp(half), rel=1e-6)
    assert (rows[4]["p_value"], rows[4]["change"]) == pytest.approx((1.0, 0.0))


def test_a_precise_recording_weighs_more_and_an_imprecise_one_is_allowed_more() -> None:
    error = [0.01, 0.1, 0.1, 0.01, 0.3]
    listed = names(5)
    rows = [
        parameter(name, math.exp(y), e)
        for name, y, e in zip(listed, (0.0, 0.1, -0.1, 0.0, 0.4), error, strict=True)
    ]
    found = list(drift_rows(rows, [], [recording(name) for name in listed]))[4]
    weights = np.array(error[:4]) ** -2.0
    assert math.log(found["expected"]) == pytest.approx(0.0, abs=1e-12)
    t = 0.4 / math.sqrt(0.09 + 1 / weights.sum())
    assert found["p_value"] == pytest.approx(2 * stats.t.sf(t, 3), rel=1e-3)


def test_spread_is_added_to_unequal_errors(rng: np.random.Generator) -> None:
    # Paule and Mandel's tau solves sum (y - mu)^2 / (v + tau^2) = n - 1; three steps come near it.
    y, error = rng.normal(0, 0.3, 8), rng.uniform(0.05, 0.2, 8)
    listed = names(8)
    rows = [parameter(name, math.exp(a), e) for name, a, e in zip(listed, y, error, strict=True)]
    found = list(drift_rows(rows, [], [recording(name) for name in listed]))[7]
    low, high = 0.0, 10.0
    for _ in range(80):
        middle = (low + high) / 2
        weight = 1 / (error[:7] ** 2 + middle)
        mu = weight @ y[:7] / weight.sum()
        low, high = (middle, high) if weight @ (y[:7] - mu) ** 2 > 6 else (low, middle)
    assert math.log(found["expected"]) == pytest.approx(mu, abs=0.005)
    t = (y[7] - mu) / math.sqrt(error[7] ** 2 + middle + 1 / weight.sum())
    assert found["p_value"] == pytest.approx(2 * stats.t.sf(abs(t), 6), rel=0.05)


def test_the_half_towards_the_expected_value_counts() -> None:
    listed = names(5)
    recordings = [recording(name) for name in listed]
    p_values = []
    for lower, upper in ((0.7, 3.0), (0.2, 1.3)):
        rows = [parameter(name, 2.0, 0.01) for name in listed[:4]]
        rows.append(parameter(listed[4], 1.0, lower=lower, upper=upper))
        p_values.append(list(drift_rows(rows, [], recordings))[4]["p_value"])
    errors = [math.log(3.0) / Z, math.log(1.3) / Z]
    t = [math.log(2.0) / math.sqrt(error**2 + 0.25e-4) for error in errors]
    assert p_values == pytest.approx(list(2 * stats.t.sf(t, 3)), rel=1e-9)


# How often it errs, and what it finds


@pytest.mark.parametrize(
    ("spread", "ratio"), few([(1.0, 3.0)], [(30.0, 10.0), (0.0, 1.0), (3.0, 1.0)])
)
def test_false_alarms(rng: np.random.Generator, spread: float, ratio: float) -> None:
    # 24 tests a night for 20 nights of 15 devices: 255 recordings are judged. With 1 % of false
    # alarms there are more than 8 in fewer than one of 500 such tests.
    alarms = 0
    for _ in range(15):
        errors = 0.01 * np.exp(rng.uniform(-0.5, 0.5, (20, 24)) * math.log(ratio))
        logs = rng.normal(0.0, np.hypot(errors, 0.01 * spread))
        listed, parts = names(20), [(axis, term) for axis in AXES for term in TERMS]
        rows = [
            parameter(name, float(math.exp(y)), float(e), term, channel)
            for name, ys, es in zip(listed, logs, errors, strict=True)
            for (channel, term), y, e in zip(parts, ys, es, strict=True)
        ]
        found = list(drift_rows(rows, [], [recording(name) for name in listed]))
        alarms += int(flags(found).any(axis=0).sum())
    assert alarms <= 8


def test_limits_of_what_is_expected_hold_95_percent(rng: np.random.Generator) -> None:
    rows = rows_of(rng.normal(0.0, 0.05, (200, 12)), error=0.01)
    judged = [row for row in rows if row["p_value"] is not None]
    inside = np.mean(
        [row["expected_lower"] < row["value"] < row["expected_upper"] for row in judged]
    )
    assert inside == pytest.approx(0.95, abs=0.02)


@pytest.mark.release
def test_a_step_is_flagged_once(rng: np.random.Generator) -> None:
    # Of 6 standard deviations, in three of 24, after 30 nights: found in 94 %; of 8 in all.
    for size, least in ((6.0, 0.8), (8.0, 0.97)):
        logs = rng.normal(0.0, 0.03, (40, 24 * 4))
        stepped = []
        for device in range(4):
            of_device = logs[:, 24 * device :][:, :24]
            of_device[30:, :12] += 0.03 * size
            stepped.append(flags(rows_of(of_device, error=0.01))[:12])
        found = np.concatenate(stepped)
        assert found[:, 30].mean() >= least
        assert (found[:, 30:].sum(axis=1) > 1).mean() <= 0.05


@pytest.mark.release  # test_a_step_is_flagged_once has steps of six and eight every day
def test_a_step_of_five_deviations_of_all_of_a_parameter_is_flagged(
    rng: np.random.Generator,
) -> None:
    found, repeats = 0, 12
    for _ in range(repeats):
        logs = rng.normal(0.0, 0.01, (21, 24))
        logs[20, ::4] += 0.05  # N of the six channels
        found += bool(flags(rows_of(logs))[::4, 20].any())
    assert found == repeats


def test_what_follows_a_step_is_compared_with_the_new_level(rng: np.random.Generator) -> None:
    y = rng.normal(0.0, 0.01, (30, 1))
    y[15:] += 1.0
    rows = rows_of(y)
    assert [row["recording"] for row in rows if row["verdict"] == "changed"] == ["night_15"]
    assert rows[15]["change"] == pytest.approx(math.e - 1.0, rel=0.05)
    assert "; ".join(rows[15]["reasons"]) == "above the range expected from 15 earlier recordings"
    assert [row["verdict"] for row in rows[16:18]] == [None, None]
    assert "; ".join(rows[17]["reasons"]).startswith("only 2 earlier recordings at this level")
    assert {row["verdict"] for row in rows[18:]} == {"as before"}
    assert rows[29]["expected"] == pytest.approx(math.exp(y[15:29].mean()), rel=1e-3)


def test_an_odd_night_does_not_end_the_level(rng: np.random.Generator) -> None:
    y = rng.normal(0.0, 0.01, (25, 1))
    y[15] -= 1.0
    rows = rows_of(y)
    assert [row["recording"] for row in rows if row["verdict"] == "changed"] == ["night_15"]
    assert "; ".join(rows[15]["reasons"]).startswith("below")
    assert (rows[16]["verdict"], "; ".join(rows[16]["reasons"])) == (
        "as before",
        "night_15 was an outlier",
    )
    without = np.delete(y[:24], 15)
    assert rows[24]["expected"] == pytest.approx(math.exp(without.mean()), rel=1e-3)


def test_a_slow_drift_is_found(rng: np.random.Generator) -> None:
    # A fifth of the deviation of a night each night: the spread about the mean would hide it.
    found = flags(rows_of(rng.normal(0.0, 0.01, (60, 6)) + 0.002 * np.arange(60)[:, np.newaxis]))
    assert found.any(axis=1).all()


def test_a_spread_that_grows_is_learnt(rng: np.random.Generator) -> None:
    logs = rng.normal(0.0, 0.01, (60, 24))
    logs[20:] *= 10.0
    found = flags(rows_of(logs))
    assert found[:, 20:].any(axis=1).mean() > 0.8
    assert found[:, 40:].mean() < 0.02


def test_the_level_is_shared_by_the_tests_of_a_recording() -> None:
    values = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0]
    alone = of_biases([*values, 5.0])[-1]
    assert (
        SIGNIFICANCE_LEVEL / 12 < alone["p_value"] < SIGNIFICANCE_LEVEL
        and alone["verdict"] == "changed"
    )
    listed = names(8)
    rows = [
        bias(name, value, f"{axis}_{n}")
        for axis in ("gyro", "accel")
        for n in range(6)
        for name, value in zip(
            listed, [*values, 5.0 if (axis, n) == ("gyro", 0) else 0.5], strict=True
        )
    ]
    found = list(drift_rows([], rows, [recording(name) for name in listed]))
    assert found[7]["p_value"] == pytest.approx(alone["p_value"])
    assert found[7]["verdict"] == "as before"


@pytest.mark.parametrize(("model", "verdict"), [("N+GM+K", "changed"), ("N+F+GM", "as before")])
def test_b_of_a_single_term_and_that_of_the_curve_are_one_test(model: str, verdict: str) -> None:
    values = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0, 4.3]
    listed = names(8)
    rows = [
        parameter(name, math.exp(value), term=term, model=model)
        for term in ("B", "B_curve")
        for name, value in zip(listed, values, strict=True)
    ]
    found = list(drift_rows(rows, [], [recording(name) for name in listed]))
    last = [row for row in found if row["recording"] == listed[7]]
    assert all(SIGNIFICANCE_LEVEL / 2 < row["p_value"] < SIGNIFICANCE_LEVEL for row in last)
    assert [row["verdict"] for row in last] == [verdict] * 2


# Which recordings, and in which order


def test_order() -> None:
    plain = [recording(name) for name in ("run_10", "run_2", "Run_1", "run_02")]
    found, order = order_of(plain)
    assert order == "name"
    assert [row["recording"] for row in found] == ["Run_1", "run_02", "run_2", "run_10"]


def test_order_by_stamps() -> None:
    # In UTC: 22:00, 21:30, 23:00, midnight of the next day, and 23:00 again.
    stamps = {
        "e": "2026-03-01T22:00:00.5Z", "a": " 2026-03-01 23:30:00+02:00", "d": "2026-03-01T23:00",
        "b": "2026-03-02", "c": "20260301T180000-0500",
    }  # fmt: skip
    rows = [recording(name, started) for name, started in stamps.items()]
    found, order = order_of(rows)
    assert order == "started"
    assert [row["recording"] for row in found] == ["a", "e", "c", "d", "b"]
    for unusual in (None, "", "1 March 2026", "2026-13-01", "24.12.2026"):
        assert order_of([*rows, recording("f", unusual)])[1] == "name"
    assert order_of([recording(n, "1980-01-06T00:00:00") for n in "ab"])[1] == "name"
    extremes = [
        recording("a", "9999-12-31T23:59:59-12:00"),
        recording("b", "0001-01-01T00:00+12:00"),
    ]
    assert [row["recording"] for row in order_of(extremes)[0]] == ["b", "a"]


def test_series() -> None:
    rows = [recording(f"m{i}", f"2026-01-0{9 - i}") for i in range(3)]
    rows += [recording(f"s{i}", simulated=True) for i in range(2)]
    rows += [recording("lone", device="e"), recording("bad", device="e", status="rejected")]
    rows.append(replace(recording("x"), sensor="T"))
    measured, simulated = series_of(rows)
    assert (measured.simulated, measured.order) == (False, "started")
    assert [row["recording"] for row in measured.recordings] == ["m2", "m1", "m0"]
    assert (simulated.simulated, simulated.order, len(simulated.recordings)) == (True, "name", 2)
    listed = [parameter(row["recording"], 1.0 + i) for i, row in enumerate(rows)]
    found = list(drift_rows(listed, [], rows))
    assert [(row["recording"], row["position"]) for row in found] == [
        ("m2", 1), ("m1", 2), ("m0", 3), ("s0", 1), ("s1", 2)
    ]  # fmt: skip
    assert (found[1]["expected"], found[4]["expected"]) == pytest.approx((3.0, 4.0))
    assert found[0]["started"] == "2026-01-07"


# What is not an estimate, or not of the same thing


def test_rows_fit_the_table() -> None:
    rows = [parameter(name, 2.0, term=term) for name in names(2) for term in ("K", "N")]
    rows += [parameter(name, 9.0, component=2) for name in names(2)]
    rows += [parameter(name, 9.0, term="frequency") for name in names(2)]
    rows += [parameter(name, None, term="Q", status="absent") for name in names(2)]
    biases = [bias(name, 9.8, "accel_x") for name in names(2)]
    found = list(drift_rows(rows, biases, [recording(name) for name in names(2)]))
    assert all(isinstance(row, DriftRow) for row in found)
    keys = [(row["channel"], row["parameter"], row["position"]) for row in found]
    assert keys == [
        ("gyro_x", "N", 1), ("gyro_x", "N", 2), ("gyro_x", "K", 1), ("gyro_x", "K", 2),
        ("accel_x", "bias", 1), ("accel_x", "bias", 2),
    ]  # fmt: skip
    assert found[1] == {
        "sensor": "S", "device": "d", "channel": "gyro_x", "parameter": "N",
        "recording": "night_1", "position": 2, "started": None, "value": 2.0,
        "lower": rows[0]["lower"], "upper": rows[0]["upper"], "unit": "rad/s/sqrt(Hz)",
        "expected": pytest.approx(2.0), "expected_lower": None, "expected_upper": None,
        "change": pytest.approx(0.0), "p_value": None, "verdict": None,
        "reasons": (
            "only 1 earlier recording at this level: the spread between recordings is not known",
        ),
    }  # fmt: skip


def test_what_has_no_value_is_not_judged_and_does_not_count() -> None:
    listed = names(9)
    rows = [parameter(name, 1.0) for name in listed[:4]]
    rows.append(parameter(listed[4], None, status="not_identified", reason="too short", upper=3.0))
    rows.append(parameter(listed[5], None, status="absent", reason="no need"))
    rows.append(parameter(listed[6], 5.0, lower=0.0))
    rows.append(parameter(listed[8], 1.0))  # and the seventh has no such row
    found = list(drift_rows(rows, [], [recording(name) for name in listed]))
    reasons = [
        "not determined: too short",
        "not in the model: no need",
        "the value has no 95 % limits",
        "not in the model",
    ]
    assert ["; ".join(row["reasons"]) for row in found[4:8]] == reasons
    assert [row["value"] for row in found[4:8]] == [None, None, 5.0, None]
    assert {(row["verdict"], row["expected"]) for row in found[4:8]} == {(None, None)}
    assert (found[4]["upper"], found[7]["unit"]) == (3.0, "rad/s/sqrt(Hz)")
    assert found[8]["verdict"] == "as before"


def test_flicker_noise_is_not_compared_with_a_gauss_markov_process() -> None:
    listed = names(10)
    models = ["N+GM+K"] * 4 + ["N+F"] * 4 + ["Q+N+GM", "N+F+K"]
    values = [1.0] * 4 + [50.0] * 4 + [1.0, 50.0]
    rows = [
        parameter(name, value, term=term, model=model)
        for name, model, value in zip(listed, models, values, strict=True)
        for term in ("N", "B")
    ]
    found = list(drift_rows(rows, [], [recording(name) for name in listed]))
    by_term = {term: [r for r in found if r["parameter"] == term] for term in ("N", "B")}
    assert by_term["N"][4]["verdict"] == "changed"
    assert "changed" not in {row["verdict"] for row in by_term["B"]}
    assert "; ".join(by_term["B"][4]["reasons"]) == "the first value with F"
    assert [row["verdict"] for row in by_term["B"][8:]] == ["as before"] * 2


def test_values_without_scatter_judge_nothing() -> None:
    rows = of_biases([0.1] * 5 + [0.2])
    assert {row["verdict"] for row in rows} == {None}
    assert "; ".join(rows[5]["reasons"]) == "all earlier values are equal"
    assert "changed" in {row["verdict"] for row in of_biases([0.1] * 40 + [0.2] * 4)}
    assert not list(drift_rows([], [], [recording(name) for name in names(3)]))


def test_limits_far_narrower_than_before_are_not_judged() -> None:
    listed = names(5)
    rows = [parameter(name, 1.0, 0.3) for name in listed[:4]] + [parameter(listed[4], 1.5, 0.001)]
    found = list(drift_rows(rows, [], [recording(name) for name in listed]))[4]
    assert (found["verdict"], "; ".join(found["reasons"])) == (
        None,
        "its limits are far narrower than before",
    )


def test_an_accelerometer_may_have_been_laid_differently() -> None:
    values = [9.81, 9.8, 9.81, 9.8, 9.81, 9.8]
    assert "gravity" in "; ".join(of_biases([*values, -9.8], "accel_z")[-1]["reasons"])
    assert "gravity" not in "; ".join(of_biases([*values, -9.8])[-1]["reasons"])


series = st.lists(
    st.tuples(st.floats(-3, 3), st.floats(0.01, 1), st.floats(0.01, 1)), min_size=2, max_size=14
)


@pytest.mark.release
@given(series, st.randoms(use_true_random=False), st.sampled_from([1e-7, 0.3, 3600.0]))
def test_order_of_the_rows_and_unit_do_not_matter(drawn, random, scale: float) -> None:
    listed = names(len(drawn))

    def found(unit: float, shuffled: bool):
        rows, biases = [], [bias(n, unit * y) for n, (y, _, _) in zip(listed, drawn, strict=True)]
        for name, (y, below, above) in zip(listed, drawn, strict=True):
            value = unit * math.exp(y)
            limits = {"lower": value * math.exp(-below), "upper": value * math.exp(above)}
            rows += [parameter(name, value, **limits), parameter(name, value, 0.1, "B")]
        recordings = [recording(name) for name in listed]
        if shuffled:
            for one in (rows, biases, recordings):
                random.shuffle(one)
        return list(drift_rows(rows, biases, recordings))

    plain = found(1.0, False)
    assert found(1.0, True) == plain
    for one, other in zip(plain, found(scale, True), strict=True):
        for name in ("value", "expected", "expected_lower", "expected_upper"):
            if one[name] is not None and (one["p_value"] or 1.0) > 1e-6:
                close = pytest.approx(scale * one[name], rel=1e-6, abs=1e-9 * scale)
                assert other[name] == close
        if one["p_value"] is not None and other["p_value"] is not None:
            assert other["p_value"] == pytest.approx(one["p_value"], rel=1e-5, abs=1e-12)


@pytest.mark.release
@pytest.mark.parametrize("repeats", few([3000], [2, 30]))
def test_time_is_linear(rng: np.random.Generator, repeats: int) -> None:
    values = np.exp(rng.normal(0.0, 0.2, (300, 24))).tolist()
    listed = names(300)
    recordings = [recording(n, device=str(i // repeats)) for i, n in enumerate(listed)]
    parts = [(axis, term) for axis in AXES for term in TERMS]
    rows = [
        parameter(name, value, 0.2, term, channel)
        for name, night in zip(listed, values, strict=True)
        for (channel, term), value in zip(parts, night, strict=True)
    ]
    start = time.process_time()
    assert len(list(drift_rows(rows, [], recordings))) == 300 * 24
    assert time.process_time() - start < 1.0
