import base64
import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.model.estimates import EnvelopeRow, HistogramRow
from imubench_pipeline.report.palette import assign_sensor_styles
from imubench_pipeline.report.payload import (
    Arrays,
    pack_channel,
    pack_compared_channel,
    pack_datasheet_lines,
    pack_samples,
    pack_styles,
)
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView, gather_recordings
from tests.report.tables import (
    HOUR,
    MODEL,
    RATE,
    TAU,
    WITHOUT_K,
    joined,
    recording_rows,
)

LOG_ERROR = 3e-4
NEVER = [math.nan, math.inf, -math.inf]


def decoded(arrays: Arrays, place: int) -> NDArray[np.float64]:
    """What static/plot.js makes of an array."""
    kind, low, step, text = json.loads(json.dumps(arrays.texts))[place]
    data = base64.b64decode(text, validate=True)
    if kind == "f":
        return np.frombuffer(data, "<f4").astype(np.float64)
    levels = np.frombuffer(data, "u1").astype(np.float64)
    if kind == "l":
        low_bytes, high_bytes = levels.reshape(2, -1)
        levels = np.cumsum(low_bytes + 256.0 * high_bytes) % 65536.0
    values = np.where(levels == 0, np.nan, low + (levels - 1) * step)
    return 10.0**values if kind == "l" else values


@given(st.lists(st.floats(width=32), max_size=40))
def test_exact_numbers_come_back_as_they_were(values: list[float]) -> None:
    arrays = Arrays()
    np.testing.assert_array_equal(decoded(arrays, arrays.exact(values)), values)


@given(
    st.lists(
        st.one_of(
            st.floats(-6.0, 4.0).map(lambda power: 10.0**power),
            st.sampled_from([0.0, -1.0, *NEVER]),
        ),
        max_size=40,
    )
)
def test_logarithms_come_back_to_a_few_parts_in_10000_and_no_value_as_none(
    values: list[float],
) -> None:
    arrays = Arrays()
    found = decoded(arrays, arrays.log(values))
    given_ = np.array(values, dtype=np.float64)
    there = np.isfinite(given_) & (given_ > 0)
    np.testing.assert_array_equal(np.isnan(found), ~there)
    np.testing.assert_allclose(found[there], given_[there], rtol=LOG_ERROR)


@given(
    st.floats(-100.0, 100.0),
    st.floats(1e-6, 1e3),
    st.lists(st.one_of(st.floats(0.0, 1.0), st.none(), st.sampled_from(NEVER)), max_size=40),
)
def test_even_numbers_come_back_to_half_a_step_of_254(
    low: float, width: float, shares: list[float | None]
) -> None:
    values = np.array([math.nan if s is None else low + width * s for s in shares])
    arrays = Arrays()
    found = decoded(arrays, arrays.even(values))
    there = np.isfinite(values)
    np.testing.assert_array_equal(np.isnan(found), ~there)
    if there.any():
        step = np.ptp(values[there]) / 254
        assert np.abs(found - values)[there].max() <= 0.51 * step + 1e-10 * max(abs(low), width)


def test_gravity_does_not_blur_what_lies_about_it() -> None:
    mean = 9.80665123456 + 1e-6 * np.sin(np.arange(400))
    arrays = Arrays()
    found = decoded(arrays, arrays.even(mean))
    assert np.abs(found - mean).max() <= 0.51 * np.ptp(mean) / 254


@pytest.mark.parametrize("kind", ["exact", "log", "even"])
def test_constants_and_nothing_come_back(kind: str) -> None:
    arrays = Arrays()
    place = getattr(arrays, kind)
    assert decoded(arrays, place([])).size == 0
    np.testing.assert_allclose(decoded(arrays, place([2.5, 2.5, 2.5])), 2.5, rtol=LOG_ERROR)
    assert np.isnan(decoded(arrays, place([math.nan, math.nan]))).all()
    np.testing.assert_allclose(
        decoded(arrays, place([math.nan, 2.5])), [math.nan, 2.5], rtol=LOG_ERROR
    )


def test_each_array_stands_once() -> None:
    arrays = Arrays()
    tau = np.geomspace(0.01, 1e4, 50)
    first = arrays.log(tau)
    assert arrays.log(tau.copy()) == first == arrays.log(tau.tolist())
    other = arrays.log(2 * tau)
    assert other != first
    assert arrays.even(tau) not in (first, other)
    assert arrays.exact(tau) not in (first, other)
    assert len(arrays.texts) == 4
    # Levels alone are the same: a constant, and the same shape at another height.
    assert arrays.even([1.0, 2.0]) != arrays.even([3.0, 4.0])


def test_arrays_of_a_page_are_few_and_short() -> None:
    arrays = Arrays()
    arrays.log(np.geomspace(1e-6, 1e3, 1000))
    arrays.even(np.linspace(0.0, 1.0, 400))
    assert len(json.dumps(arrays.texts)) < 1000 * 8 / 3 + 400 * 4 / 3 + 100


def channel(**given_: Any) -> ChannelView:
    (view,) = gather_recordings(joined(recording_rows(**given_)))
    return view.channels()[0]


def test_a_channel_among_others_has_its_curve_and_the_curves_of_its_models() -> None:
    arrays = Arrays()
    view = channel(simulated=True)
    found = pack_compared_channel(view).among(arrays)
    assert found["simulated"] is True
    adev = np.sqrt(MODEL.allan_variance(TAU))
    for name, factor in (("adev", 1.0), ("lower", 1 / 1.2), ("upper", 1.2)):
        np.testing.assert_allclose(decoded(arrays, found[name]), factor * adev, rtol=LOG_ERROR)
    assert set(found["models"]) == {"likelihood", "likelihood_gm", "curve"}
    tau, curve = (decoded(arrays, place) for place in found["models"]["likelihood"])
    assert (tau[0], tau[-1]) == pytest.approx((TAU[0], TAU[-1]), rel=LOG_ERROR)
    np.testing.assert_allclose(curve, np.sqrt(MODEL.allan_variance(tau)), rtol=LOG_ERROR)
    white = decoded(arrays, found["models"]["curve"][1])
    np.testing.assert_allclose(white, MODEL.N / np.sqrt(tau), rtol=LOG_ERROR)


def test_parameters_are_drawn_by_the_recommended_method_and_the_papers() -> None:
    found = pack_compared_channel(channel(parameters=WITHOUT_K)).among(Arrays())
    assert set(found["parameters"]) == {"likelihood", "likelihood_gm"}
    ((*numbers, status),) = found["parameters"]["likelihood"]["B"]
    assert numbers == pytest.approx([10 * HOUR, 8 * HOUR, 13 * HOUR], rel=1e-4)
    assert status == "ok"
    ((value, lower, upper, status),) = found["parameters"]["likelihood"]["K"]
    assert (value, lower, status) == (None, None, "absent")
    assert upper == pytest.approx(0.5 * MODEL.K, rel=1e-4)


def test_all_components_of_a_parameter_are_drawn() -> None:
    rows = recording_rows()
    (first,) = (r for r in rows["parameters"] if r["recommended"] and r["parameter"] == "B")
    rows["parameters"].append(first | {"component": 2, "value": 3 * HOUR})
    (time,) = (r for r in rows["parameters"] if r["recommended"] and r["parameter"] == "T_B")
    rows["parameters"].append(time | {"component": 2, "value": 5.0})
    (view,) = gather_recordings(joined(rows))
    found = pack_compared_channel(view.channels()[0]).among(Arrays())["parameters"]["likelihood"]
    assert [value for value, *_ in found["B"]] == pytest.approx([10 * HOUR, 3 * HOUR], rel=1e-4)
    assert [value for value, *_ in found["T_B"]] == [100.0, 5.0]


def test_the_terms_of_a_channel_add_up_to_its_model() -> None:
    arrays = Arrays()
    found = pack_channel(channel(found=[0.5]), arrays)
    names = [term["name"] for term in found["terms"]]
    assert names == ["white noise N", "Gauss-Markov B, T_B", "random walk K"]
    total = sum(decoded(arrays, term["adev"]) ** 2 for term in found["terms"])
    np.testing.assert_allclose(np.sqrt(total), np.sqrt(MODEL.allan_variance(TAU)), rtol=1e-3)
    (line,) = found["spectrum"]["lines"]
    assert (line["frequency"], line["kind"]) == (0.5, "sinusoid")
    frequency = decoded(arrays, found["spectrum"]["frequency"])
    density = MODEL.sampled_spectrum(2 * np.pi * frequency / RATE, RATE) / RATE
    root = decoded(arrays, found["spectrum"]["density"])
    np.testing.assert_allclose(root, np.sqrt(density), rtol=1e-3)
    assert found["spectrum"]["left"] == []
    np.testing.assert_allclose(decoded(arrays, found["spectrum"]["fitted"]), root, rtol=1e-3)


def test_the_band_of_the_reconstruction_is_that_of_the_recommended_method() -> None:
    arrays = Arrays()
    found = pack_channel(channel(), arrays)["methods"]
    assert set(found) == {"likelihood"}
    adev = np.sqrt(MODEL.allan_variance(TAU))
    for name, factor in (("lower", 0.5), ("upper", 2.0), ("reconstructed", 1.0)):
        shown = decoded(arrays, found["likelihood"][name])
        np.testing.assert_allclose(shown, factor * adev, rtol=LOG_ERROR)


def test_a_channel_without_spectrum_or_datasheet_is_drawn_all_the_same() -> None:
    rows = recording_rows(printed=False)
    del rows["spectrum"]
    (view,) = gather_recordings(joined(rows))
    found = pack_channel(view.channels()[0], Arrays())
    assert found["spectrum"] is None
    assert found["datasheet"] == []


def test_a_datasheet_is_drawn_in_the_convention_of_what_is_measured() -> None:
    (line,) = pack_datasheet_lines(channel())
    assert line["slope"] == -0.5
    assert line["value"] == pytest.approx(18 * HOUR)
    assert line["label"] == "noise density 0.005 deg/s/sqrt(Hz) (typ, read as two-sided)"


def part_of(
    channel: str,
    start: float,
    end: float,
    low: float | None = None,
    high: float | None = None,
    mean: float | None = None,
) -> EnvelopeRow:
    """A part of the samples of a log; without samples, one that has none."""
    return EnvelopeRow(
        sensor="s",
        recording="r",
        channel=channel,
        start=start,
        end=end,
        low=low,
        high=high,
        mean=mean,
        samples=0 if mean is None else 100,
    )


def test_samples_are_drawn_by_channel_with_holes_where_there_are_none() -> None:
    envelope = [
        part_of("gyro_x", 0.0, 5.0, -1.0, 1.0, 0.5),
        part_of("temperature", 0.0, 9.0, 20.0, 21.0, 20.5),
        part_of("gyro_x", 5.0, 9.0),
    ]
    histogram = [
        HistogramRow(
            sensor="s",
            recording="r",
            channel="gyro_x",
            lower=float(i),
            upper=i + 1.0,
            count=count,
        )
        for i, count in enumerate([1, 10, 0, 1000])
    ]
    arrays = Arrays()
    found = pack_samples(envelope, histogram, arrays)
    assert set(found["envelope"]) == {"gyro_x", "temperature"}
    own = found["envelope"]["gyro_x"]
    assert (own["start"], own["end"]) == (0.0, 9.0)
    np.testing.assert_array_equal(decoded(arrays, own["low"]), [-1.0, math.nan])
    assert set(found["histogram"]) == {"gyro_x"}
    bins = found["histogram"]["gyro_x"]
    assert decoded(arrays, bins["edges"]).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    counts = np.nan_to_num(decoded(arrays, bins["count"]))
    np.testing.assert_allclose(counts, [1.0, 10.0, 0.0, 1000.0], rtol=LOG_ERROR)
    assert pack_samples([], [], arrays) == {"envelope": {}, "histogram": {}}


def test_looks_name_every_method_as_the_pages_do() -> None:
    found = pack_styles(assign_sensor_styles(["a"]))
    assert {name: look["name"] for name, look in found["methods"].items()} == METHOD_NAMES
    assert set(found["sensors"]["a"]) == {"light", "dark", "dash", "marker"}


def test_a_page_can_hold_what_is_drawn_as_json() -> None:
    unknown = {"N": Parameter(None, "not_identified", lower=1e-5, upper=2e-5, fitted=1.4e-5)}
    arrays = Arrays()
    view = channel(parameters=unknown)
    found = [pack_compared_channel(view).among(arrays), pack_channel(view, arrays), arrays.texts]
    assert json.loads(json.dumps(found, allow_nan=False)) == found
