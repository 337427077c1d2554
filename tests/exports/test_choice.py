import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.exports.choice import choose, parameter_notes, pool_recordings
from imubench_pipeline.extensions.exports.imu import ExportError
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.tables.keys import Key


def estimate(method: str = "likelihood", **values: float | Parameter | None) -> Estimate:
    parameters = {
        name: value if isinstance(value, Parameter) else Parameter(value)
        for name, value in values.items()
    }
    return Estimate(method, parameters)


def rows(
    channel: str, found: Estimate, recording: str = "a", *, recommended: bool = True
) -> list[ParameterRow]:
    key = Key("mti_7", recording, channel)
    return list(make_parameter_rows(key, found, recommended=recommended))


# At 60 s x is the best, y the worst; at 1 s y is the best and x the worst.
AXES = [
    *rows("gyro_x", estimate(N=3e-4, K=1e-7)),
    *rows("gyro_y", estimate(N=1e-4, K=5e-5)),
    *rows("gyro_z", estimate(N=2e-4, K=2e-5)),
    *rows("accel_x", estimate(N=1e-3, K=1e-5)),
]


def test_the_worst_axis_is_that_of_the_largest_error_at_the_horizon_and_no_mix() -> None:
    found = choose(AXES, "gyro", horizon=60.0)
    assert found.channel == "gyro_y"
    assert (found.axis.model.N, found.axis.model.K) == (1e-4, 5e-5)
    assert "gyro y of recording a by method likelihood, the worst of 3 axes" in found.axis.origin
    assert choose(AXES, "gyro", horizon=1.0).channel == "gyro_x"


def test_the_median_axis_is_one_axis() -> None:
    assert choose(AXES, "gyro", axis="median", horizon=60.0).channel == "gyro_z"
    even = [*AXES, *rows("gyro_x", estimate(N=1e-5, K=1e-8), "b")]
    # of four the larger of the two in the middle
    assert choose(even, "gyro", axis="median", horizon=60.0).channel == "gyro_z"


def test_a_device_or_a_recording_gives_its_worst_axis() -> None:
    both = [*AXES, *rows("gyro_x", estimate(N=1e-5, K=1e-6), "b")]
    devices = {"a": "serial 1", "b": "serial 2"}
    found = choose(both, "gyro", axis="serial 2", devices=devices)
    assert (found.recording, found.channel) == ("b", "gyro_x")
    assert "the only axis of serial 2" in found.axis.origin
    assert choose(both, "gyro", axis="a", devices=devices).channel == "gyro_y"
    with pytest.raises(ExportError, match="there are: serial 1, serial 2"):
        choose(both, "gyro", axis="serial 3", devices=devices)


def test_the_recommended_method_is_taken_unless_another_is_asked_for() -> None:
    both = [*AXES, *rows("gyro_x", estimate("weighted", N=9.0), recommended=False)]
    assert choose(both, "gyro").method == "likelihood"
    assert choose(both, "gyro", method="weighted").axis.model.N == 9.0
    with pytest.raises(ExportError, match="no gyro estimate"):
        choose(AXES, "gyro", method="curve")


def test_the_error_in_words_is_that_of_coasting_over_the_horizon() -> None:
    found = choose(AXES, "accel", horizon=60.0)
    variance = NoiseModel(N=1e-3, K=1e-5).allan_variance(np.array([60.0]))[0]
    assert f"after 60 s is {np.sqrt(2.0 * 60.0**2 * variance):.3g} m/s, with" in found.axis.origin


def test_what_has_no_plain_value_is_said() -> None:
    found = estimate(
        N=1e-4,
        B=Parameter(None, "not_identified", "a short log", 1e-6, 9e-6, None, 5e-6),
        T_B=Parameter(7200.0, "at_bound", "the longest", 100.0, 7200.0),
        K=Parameter(None, "absent", "the data do not support it", 0.0, 2e-6),
        R=Parameter(None, "absent", "the data do not support it"),
    )
    notes = parameter_notes(found)
    assert notes == [
        "B is not determined (a short log). The fitted 5.000e-06 is used, with 95 % limits of "
        "1.000e-06 to 9.000e-06",
        "T_B is at the end of its search (the longest). Its value of 7.2000e+03 is used, with 95 % "
        "limits of 1.000e+02 to 7.200e+03",
        "K is not in the model (the data do not support it). It is 0 in this file, and its upper "
        "limit is 2.000e-06",
    ]
    choice = choose(rows("gyro_x", found), "gyro")
    assert choice.axis.model.B == 5e-6
    assert not choice.determined
    without = "axes without an estimate: gyro y and gyro z"
    assert list(choice.axis.notes) == [without, notes[1]]  # slow terms are limited, and not used
    assert choose(AXES, "gyro").determined


def test_recordings_of_a_device_are_pooled_by_the_mean_of_their_spectra() -> None:
    models = {
        "one": NoiseModel(N=1e-4, K=2e-6, B=1e-5, T_B=100.0),
        "two": NoiseModel(N=3e-4, B=4e-5),
    }
    every = [
        *rows("gyro_x", estimate(N=1e-4, K=2e-6, B=1e-5, T_B=100.0), "one"),
        *rows("gyro_x", estimate(N=3e-4, B=4e-5), "two"),
    ]
    pooled = pool_recordings(every, choose(every, "gyro"))
    frequency = np.geomspace(1e-4, 10.0, 30)
    mean = (models["one"].psd(frequency) + models["two"].psd(frequency)) / 2.0
    assert pooled.axis.model.psd(frequency) == pytest.approx(mean)
    assert "2 recordings of the device: one, two" in pooled.axis.origin


def test_each_axis_is_chosen_among_its_own_estimates() -> None:
    both = [
        *AXES,
        *rows("gyro_x", estimate(N=9e-4, K=1e-7), "b"),
        *rows("gyro_y", estimate(N=0.0), "c"),
    ]
    found = choose(both, "gyro", horizon=60.0).each
    assert {axis: one.axis.model.N for axis, one in found.items()} == {
        "x": 9e-4,
        "y": 1e-4,
        "z": 2e-4,
    }
    assert (
        "gyro x of recording b by method likelihood, the worst of 2 est" in found["x"].axis.origin
    )
    assert found["x"].axis.notes[0] == "axes not used (less noise at 60 s): gyro x of a"
    assert found["y"].axis.notes[0] == "axes not used (no white noise in the model): gyro y of c"
    assert not found["z"].axis.notes and not found["z"].each
    device = choose(both, "gyro", axis="b", horizon=60.0).each
    assert device.keys() == {"x"}
    assert device["x"].axis.notes[0] == "axes not used (of another device): gyro x of a"
    assert choose(both, "gyro", axis="median").each["x"].axis.model.N == 9e-4
    assert choose(AXES, "accel").each.keys() == {"x"}
