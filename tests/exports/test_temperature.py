"""How the biases follow the temperature, read back from the files that hold it."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.extensions.exports.imu import TemperatureEffect, find_temperature_effect
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from tests.exports.sensors import imu, write_text
from tests.exports.test_filters import ekf2, mavparm
from tests.rows import typed

RECORDING = {
    "recording": "warm", "device": "serial 7", "temperature_min": 18.0, "temperature_max": 41.0,
}  # fmt: skip
FIGURES = {
    "T_0": (30.0, None, None, "ok"),
    "sensitivity": (2e-4, 1.9e-4, 2.1e-4, "ok"),
    "quadratic": (None, None, None, "absent"),
    "lag": (None, 0.0, 20.0, "not_identified"),
    "bias": (1e-3, 9e-4, 1.1e-3, "ok"),
}
Figures = dict[str, tuple[float | None, float | None, float | None, str]]


def rows(channel: str, compensated: bool = True, **changes: Any) -> list[TemperatureRow]:
    """Rows of the table ``temperature``; ``changes`` by parameter."""
    names = ("value", "lower", "upper", "status")
    about = {"channel": channel, "compensated": compensated, "reason": "why"}
    figures = {name: changes.get(name, figure) for name, figure in FIGURES.items()}
    return typed(
        TemperatureRow,
        [
            about | {"parameter": name} | dict(zip(names, figure, strict=True))
            for name, figure in figures.items()
        ],
    )


def effect(*given: list[TemperatureRow], horizon: float = 60.0, **about: Any) -> TemperatureEffect:
    listed = [row for one in given for row in one]
    (recording,) = typed(RecordingRow, [RECORDING | about])
    return find_temperature_effect(listed, recording, "gyro", horizon)


def px4_offset(found: dict[str, float], axis: int, temperature: float) -> float:
    """Return what calc_thermal_offsets_3D takes from a gyro."""
    within = min(max(temperature, found["TC_G0_TMIN"]), found["TC_G0_TMAX"])
    powers = (within - found["TC_G0_TREF"]) ** np.arange(4)
    return float(sum(found[f"TC_G0_X{n}_{axis}"] * power for n, power in enumerate(powers)))


def test_px4_takes_off_what_temperature_adds_within_the_range_of_the_log() -> None:
    # x bends, y comes from a file whose mean temperature was 2 K higher, z is not told
    told = effect(
        rows("gyro_x", quadratic=(1e-6, 9e-7, 1.1e-6, "ok")),
        rows("gyro_y", T_0=(32.0, None, None, "ok"), quadratic=(-2e-6, -3e-6, -1e-6, "ok")),
        rows("gyro_z", compensated=False),
    )
    text = write_text("px4", imu(temperature={"gyro": told}))
    found = ekf2(text)
    for temperature in (18.0, 30.0, 37.0):
        dT = temperature - 30.0
        assert px4_offset(found, 0, temperature) == pytest.approx(2e-4 * dT + 1e-6 * dT**2)
        at = [2e-4 * (T - 32.0) - 2e-6 * (T - 32.0) ** 2 for T in (temperature, 30.0)]
        assert px4_offset(found, 1, temperature) == pytest.approx(at[0] - at[1], abs=1e-12)
    assert px4_offset(found, 0, 60.0) == px4_offset(found, 0, 41.0)
    assert px4_offset(found, 2, 41.0) == 0.0
    joined = text.replace("\n#  ", "")
    assert "axis z is not included: the log does not show an effect (why)" in joined
    assert "device serial 7. It is valid for that device from 18 to 41 degC" in joined
    assert "TC_A0_" not in text and "TC_G_ENABLE\t" not in text


def ardupilot_change(found: dict[str, float], axis: str, temperature: float) -> float:
    """Return what TCal::correct_sensor takes from a gyro; its reference is 35 degC."""
    within = min(max(temperature, found["INS_TCAL1_TMIN"]), found["INS_TCAL1_TMAX"])
    orders = np.arange(1, 4)
    powers = (within - 35.0) ** orders
    return 1e-6 * float(
        sum(found[f"INS_TCAL1_GYR{n}_{axis}"] * p for n, p in zip(orders, powers, strict=True))
    )


def test_ardupilot_takes_off_the_change_between_two_temperatures() -> None:
    told = effect(
        rows("gyro_x", quadratic=(1e-6, 9e-7, 1.1e-6, "ok")), rows("gyro_z", compensated=False)
    )
    found = mavparm(write_text("ardupilot", imu(temperature={"gyro": told})))
    for temperature in (18.0, 26.0, 41.0):
        change = ardupilot_change(found, "X", temperature) - ardupilot_change(found, "X", 30.0)
        dT = temperature - 30.0
        assert change == pytest.approx(2e-4 * dT + 1e-6 * dT**2, rel=1e-6)
        assert ardupilot_change(found, "Z", temperature) == 0.0
    assert ardupilot_change(found, "X", 60.0) == ardupilot_change(found, "X", 41.0)
    assert all(found[f"INS_TCAL1_ACC{n}_X"] == 0.0 for n in (1, 2, 3))
    assert "INS_TCAL1_ENABLE" not in found  # the user switches it on
    assert not any(name.startswith("INS") for name in mavparm(write_text("ardupilot", imu())))


def test_matlab_adds_nothing_at_the_reference_and_a_line_elsewhere() -> None:
    told = effect(rows("gyro_x"), rows("gyro_y", quadratic=(1e-6, 9e-7, 1.1e-6, "ok")))
    text = write_text("matlab", imu(temperature={"gyro": told}))
    vectors = {
        name: [float(one) for one in values.split(", ")]
        for name, values in re.findall(r"'(ConstantBias|TemperatureBias)', \[([^\]]+)\]", text)
    }
    for temperature in (20.0, 25.0, 30.0, 40.0):
        added = np.array(vectors["ConstantBias"]) + np.array(vectors["TemperatureBias"]) * (
            temperature - 25.0
        )
        assert added == pytest.approx([2e-4 * (temperature - 30.0), 0.0, 0.0], abs=1e-12)
    assert "IMU.Temperature = 30;" in text and "between 18 and 41" in text
    assert "axis y is not included: its bias is not linear" in text.replace("\n%  ", "")
    # the parentheses of the call stay balanced, and one line ends it
    assert text.count("(") == text.count(")")


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"sensitivity": (None, 1e-4, 3e-4, "not_identified")}, "not determined (why)"),
        ({"sensitivity": (2e-4, 0.9e-4, 3.1e-4, "ok")}, "known to 55 %, from noise and"),
        ({"lag": (90.0, 80.0, 100.0, "ok")}, "lag the temperature by 100 s"),
        ({"lag": (None, None, None, "not_identified")}, "its lag is not determined (why)"),
    ],
)
def test_what_is_not_safe_is_left_out_with_the_reason(changes: dict[str, Any], reason: str) -> None:
    told = effect(rows("gyro_x", **changes))
    assert not told.slope
    assert any(reason in note for note in told.notes)
    for target in ("px4", "matlab"):
        text = write_text(target, imu(temperature={"gyro": told}))
        assert reason in re.sub(r"\n[#%]  ", "", text)
        assert "TC_G0" not in text and "'TemperatureBias'" not in text


def test_a_longer_horizon_allows_a_longer_lag_and_a_narrow_range_nothing() -> None:
    lagging = rows("gyro_x", lag=(90.0, 80.0, 100.0, "ok"))
    assert not effect(lagging).slope
    assert effect(lagging, horizon=100.0).slope == {"x": 2e-4}
    narrow = effect(rows("gyro_x"), temperature_max=19.5)
    assert not narrow.slope and "varies by only 1.5 K" in narrow.notes[1]
    none = effect([], temperature_min=None, temperature_max=None)
    assert none.notes == ["not included, as warm has no temperature readings"]


def test_a_file_of_noise_alone_says_so() -> None:
    told = {"gyro": effect(rows("gyro_x"))}
    for name, target in TARGETS.items():
        content = target.write(replace(imu(rate=100.0), temperature=told))
        if isinstance(content, str) and name not in ("px4", "px4-mavparm", "ardupilot", "matlab"):
            assert "The file contains noise only" in re.sub(r"\n(#|%|//)  ", "", content)
