"""Allan curves of what users have, against allantools."""

import allantools
import numpy as np
import pandas as pd
import pytest

import imubench_pipeline as imu
from imubench_pipeline import allan
from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.units import UnitError
from tests.library.conftest import RATE

CHANNELS = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]


@pytest.fixture(scope="module")
def samples() -> np.ndarray:
    """Six channels as a logger writes them, in deg/s and g."""
    return np.cumsum(np.random.default_rng(7).normal(size=(4000, 6)), axis=0) * 1e-4 + 0.3


def truth(samples: np.ndarray, curve: AllanCurve) -> np.ndarray:
    _, deviation, _, _ = allantools.oadev(samples, RATE, data_type="freq", taus=curve.tau)
    return deviation


def test_arrays_and_tables_have_the_curves_of_another_program(samples: np.ndarray) -> None:
    si = samples * np.repeat([np.pi / 180.0, 9.80665], 3)
    names = [f"{name} [{'deg/s' if name[0] == 'g' else 'g'}]" for name in CHANNELS]
    named = pd.DataFrame(samples, columns=names)
    plain = pd.DataFrame(samples, columns=CHANNELS)
    noted = plain.copy()
    noted.attrs = {"units": {"gyro": "deg/s", "accel": "g"}, "rate": "10 Hz"}
    units = {"gyro": "deg/s", "accel": "g"}
    for curves in (
        imu.allan_variance(si, RATE),
        imu.allan_variance(samples.tolist(), "10 Hz", units=units),
        imu.allan_variance(named, "0.01 kHz"),
        imu.allan_variance(plain, RATE, units=units),
        imu.allan_variance(noted),
        imu.allan_variance(dict(zip(CHANNELS, si.T, strict=True)), RATE),
    ):
        assert list(curves) == CHANNELS
        for place, curve in enumerate(curves.values()):
            np.testing.assert_allclose(curve.deviation, truth(si[:, place], curve), rtol=1e-9)
    some = imu.allan_variance(named, RATE, channels=["accel_y"])
    np.testing.assert_allclose(some["accel_y"].deviation, truth(si[:, 4], some["accel_y"]))
    three = imu.allan_variance(si[:, 3:], RATE, channels="accel")
    np.testing.assert_array_equal(three["accel_z"].variance, curves["accel_z"].variance)


def test_one_column_has_the_curve_of_its_room(samples: np.ndarray) -> None:
    column = samples[:, 0].copy()
    column[100:120] = np.nan
    settings = {"cluster_sizes": [1, 10, 100], "segments": [(0, 2000), (2000, 4000)]}
    expected = allan.allan_variance(column, RATE, **settings)
    curve = imu.allan_variance(column, "10 Hz", **settings)
    assert isinstance(curve, AllanCurve) and curve.channel is None
    np.testing.assert_array_equal(curve.variance, expected.variance)
    np.testing.assert_array_equal(curve.edf, expected.edf)
    np.testing.assert_array_equal(
        imu.allan_variance(pd.Series(column), RATE, **settings).variance, expected.variance
    )


@pytest.mark.parametrize("overlap", ["full", "octave"])
@pytest.mark.parametrize("holes", [False, True])
def test_any_number_of_threads_gives_the_same_bits(overlap: str, holes: bool) -> None:
    samples = np.random.default_rng(1).normal(size=150_000)
    if holes:
        samples[1000:1500] = np.nan
    curves = [
        imu.allan_variance(samples, 100.0, overlap=overlap, threads=threads)
        for threads in (1, 2, 5, None)
    ]
    for curve in curves[1:]:
        assert curve.variance.tobytes() == curves[0].variance.tobytes()
        assert curve.edf.tobytes() == curves[0].edf.tobytes()


def test_a_log_has_the_curves_of_its_samples(log) -> None:
    curves = imu.allan_variance(log)
    assert list(curves) == ["gyro_x", "accel_z"]
    for name, curve in curves.items():
        expected = allan.allan_variance(log[name], log.rate)
        np.testing.assert_allclose(curve.variance, expected.variance, rtol=1e-9)
    assert list(imu.allan_variance(log, channels="accel_z")) == ["accel_z"]
    with pytest.raises(ValueError, match="has no channel gyro_y; it has gyro_x, accel_z"):
        imu.allan_variance(log, channels="gyro")
    with pytest.raises(ValueError, match="a Log has its own rate"):
        imu.allan_variance(log, 10.0)


TABLE = pd.DataFrame({"gyro_x [deg/s]": [0.1, 0.2, 0.3]})


@pytest.mark.parametrize(
    ("data", "arguments", "expected"),
    [
        (np.full(50, np.nan), {}, "none of the 50 samples is a finite number"),
        (np.full((50, 6), np.nan), {}, "gyro_x: none of the 50 samples"),
        ([], {}, "is empty"),
        (np.zeros((0, 6)), {}, r"has shape \(0, 6\)"),
        (np.zeros((6, 50)), {}, "transpose it"),
        (np.zeros((50, 3)), {}, "'gyro', 'accel'"),
        (np.zeros((50, 2)), {"channels": "gyro"}, "expected a column for each of gyro_x"),
        (np.zeros((50, 6, 2)), {}, r"has shape \(50, 6, 2\)"),
        (["a", "b"], {}, "no array of numbers"),
        (np.zeros((50, 6)), {"rate": None}, "no rate is given; .*rate='100 Hz'"),
        (np.zeros((50, 6)), {"rate": "3 m"}, "rate: 'm' is no unit of frequency"),
        (np.zeros((50, 6)), {"units": {"gyro": "mg"}}, "gyro_x: 'mg' is no unit of angular rate"),
        (np.zeros((50, 6)), {"units": {"gyros": "mg"}}, "units= has the key 'gyros'"),
        (np.zeros((50, 6)), {"units": "deg/s"}, "expected such as {'gyro': 'deg/s'"),
        (np.zeros(50), {"channels": "gyro_u"}, "no channel 'gyro_u'"),
        (TABLE.rename(columns=lambda _: "gyro_x"), {}, "does not state its unit, which is never"),
        (TABLE.rename(columns=lambda _: "wx [deg/s]"), {}, "the column 'wx .deg/s.'"),
        (TABLE, {"units": {"gyro": "rad/s"}}, "in 'deg/s' by the name .* and in 'rad/s' by units="),
        (TABLE.rename(columns=lambda _: "gyro_x [furlong]"), {}, "gyro_x: unknown unit 'furlong'"),
        (TABLE, {"channels": "gyro_y"}, "no column gyro_y; found gyro_x"),
        ({"gyro_x": [1.0, 2.0], "gyro_y": [1.0]}, {}, r"have \[1, 2\] samples"),
        (np.where(np.arange(50) == 3, 1.0, np.nan), {}, "1 of 50 samples are finite .* 90%"),
        (np.zeros(50), {"threads": 0}, "threads is 0"),
    ],
)
def test_what_cannot_be_used_says_why(data: object, arguments: dict, expected: str) -> None:
    with pytest.raises(ValueError, match=expected) as error:
        imu.allan_variance(data, **{"rate": 10.0} | arguments)
    assert ("unit" in expected and "units" not in expected) <= isinstance(error.value, UnitError)


@pytest.mark.usefixtures("no_screen")
def test_curves_are_shown_drawn_and_given_as_tables(samples: np.ndarray) -> None:
    curves = imu.allan_variance(samples, RATE)
    assert "gyro_x   31   0.1 s" in repr(curves) and len(repr(curves)) < 1000
    table = curves.to_pandas()
    assert list(table.columns[:4]) == ["channel", "unit", "tau", "adev"]
    assert table.unit.unique().tolist() == ["rad/s", "m/s^2"]
    own = table[table.channel == "accel_z"]
    np.testing.assert_array_equal(own.adev, curves["accel_z"].deviation)
    axes = curves.plot()
    assert [panel.get_ylabel() for panel in axes] == [
        "Allan deviation (°/h)",
        "Allan deviation (µg)",
    ]
    line = axes[1].get_lines()[2]
    expected = curves["accel_z"].deviation / 9.80665e-6
    assert line.get_label() == "accel_z"
    np.testing.assert_allclose(line.get_ydata(), expected)
    given = curves["gyro_x"].plot(axes[0])
    assert given is axes[0]
    with pytest.raises(ValueError, match="1 axes; expected one each for gyro, accel"):
        curves.plot(axes[0])
    one = imu.allan_variance(samples[:, 0], RATE)
    assert "unit" not in one.to_pandas() and "unit of the samples" in one.plot().get_ylabel()
    assert "array(" not in repr(one) + repr(allan.allan_variance(samples[:, 0], RATE))
