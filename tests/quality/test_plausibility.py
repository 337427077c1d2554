"""Units that are mixed up, and sensors that turn: told from levels, beside the sensor file."""

import math
from collections.abc import Mapping

import numpy as np
import pytest

from imubench_pipeline.datasheets.plausibility import implausible, implausible_rates
from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from imubench_pipeline.recordings.quality.levels import bound_noise_density, summarise_level
from imubench_pipeline.recordings.quality.rotation import detect_gravity_turn
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.validation import parse
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.units import find_conversion
from tests.test_configuration import SENSOR

RATE = 100.0
GYRO = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
SI = {"gyro": "rad/s", "accel": "m/s^2"}


def summary(log: np.ndarray) -> ColumnSummary:
    column = ColumnSummary()
    column.add(log)
    return column


def found(
    logs: Mapping[str, np.ndarray],
    units: Mapping[str, str] = SI,
    sensor: Sensor | None = None,
    *,
    static: bool = True,
    timed: bool = True,
) -> list[Finding]:
    """Return what is implausible of logs in SI of what the sensor file takes them for."""
    columns = {name: summary(log) for name, log in logs.items()}
    channels = {
        name: summarise_level(column, RATE, units[name.split("_")[0]], timed=timed)
        for name, column in columns.items()
    }
    axes = [columns.get(f"accel_{axis}") for axis in "xyz"]
    blocks = [column.blocks() for column in axes if column is not None]
    turn = detect_gravity_turn(blocks, RATE) if len(blocks) == 3 else None
    return implausible(channels, turn, sensor, static=static)


def gyro(rng: np.random.Generator, mean: float = 0.01) -> np.ndarray:
    return mean + simulate(GYRO, RATE, 60_000, rng)


def triad(rng: np.random.Generator, gravity: np.ndarray) -> dict[str, np.ndarray]:
    """Return accelerometers that see gravity, shape (3,) or (samples, 3), in m/s²."""
    noise = 1e-2 * rng.standard_normal((60_000, 3))
    return {f"accel_{axis}": log for axis, log in zip("xyz", (gravity + noise).T, strict=True)}


DOWN = STANDARD_GRAVITY * np.array([0.6, 0.0, 0.8])


def printing(**gyro: object) -> Sensor:
    return parse(Sensor, SENSOR | {"datasheet": {"gyro": gyro}}, "s.yaml")


def density(value: float) -> dict[str, object]:
    return {"value": value, "unit": "deg/s/sqrt(Hz)", "sidedness": "two-sided"}


def test_the_white_noise_lies_between_both_estimates(rng: np.random.Generator) -> None:
    white = 3e-3 * math.sqrt(RATE) * rng.standard_normal(100_000)
    smooth = np.convolve(white, np.full(40, 1 / 40), "valid")
    walk = white + np.cumsum(2e-3 * rng.standard_normal(100_000))
    coarse = np.round(white / 0.1) * 0.1  # three standard deviations
    for log in (white, smooth, walk, coarse):
        low, high = bound_noise_density(summary(log), RATE)
        assert high is not None
        assert low < 1.1 * 3e-3 < 1.21 * high
    assert bound_noise_density(summary(white), RATE) == pytest.approx((3e-3, 3e-3), rel=0.1)
    # A short log has no nine blocks; parts of it take their place.
    assert bound_noise_density(summary(white[:2000]), RATE) == pytest.approx((3e-3, 3e-3), rel=0.4)
    assert bound_noise_density(summary(white[:8]), RATE)[1] is None


@pytest.mark.parametrize("meant", ["rad/s", "deg/s", "mdeg/s"])
@pytest.mark.parametrize("stated", ["rad/s", "deg/s", "mdeg/s"])
def test_units_of_angle_that_are_mixed_up_are_named(
    rng: np.random.Generator, meant: str, stated: str
) -> None:
    factor = find_conversion(stated, "angular_rate")[0] / find_conversion(meant, "angular_rate")[0]
    logs = {"gyro_z": factor * gyro(rng)}
    for sensor in (None, printing(noise_density=density(0.004))):
        said = found(logs, {"gyro": stated}, sensor)
        if meant == stated:
            assert said == []
            continue
        (finding,) = said
        assert (finding.finding, finding.channel) == ("suspicious_unit", "gyro_z")
        assert finding.value == pytest.approx(1 / factor)
        assert f"If the log is in {meant}, and not {stated}, this is 0.004" in finding.detail
        # 0.0048 °/s/√Hz, roughly


@pytest.mark.parametrize("samples", [200, 2000])
@pytest.mark.parametrize(("factor", "stated"), [(1e-3, "mdeg/s"), (1e3, "rad/s")])
def test_a_short_log_in_another_unit_is_named(
    rng: np.random.Generator, samples: int, factor: float, stated: str
) -> None:
    logs = {f"gyro_{axis}": factor * gyro(rng)[:samples] for axis in "xyz"}
    for finding in found(logs, {"gyro": stated}):
        assert finding.finding == "suspicious_unit"
        assert finding.value == pytest.approx(1 / factor)
    assert found({name: log / factor for name, log in logs.items()}) == []


def test_the_other_unit_explains_noise_and_mean(rng: np.random.Generator) -> None:
    # 0.075 °/s/√Hz as deg/s is usual, but not a mean rate of 50 °/s; both are as mrad/s.
    logs = {f"gyro_{axis}": 1e3 * (0.05 + 1e-3 * rng.standard_normal(60_000)) for axis in "xyz"}
    for finding in found(logs):
        assert finding.finding == "suspicious_unit"
        assert finding.value == pytest.approx(1e-3)


def test_the_datasheet_says_what_noise_is_usual(rng: np.random.Generator) -> None:
    quiet, loud = gyro(rng, 0.0) / 57.3, gyro(rng, 0.0) * 10
    noisy = printing(noise_density=density(0.02))
    assert found({"gyro_x": loud}) == []  # 0.05 °/s/√Hz
    (finding,) = found({"gyro_x": loud / 57.3}, {"gyro": "deg/s"}, noisy)
    assert finding.value == pytest.approx(57.3, rel=1e-3)
    assert found({"gyro_x": loud / 57.3}, {"gyro": "deg/s"}) == []  # that of many a gyro
    assert found({"gyro_x": quiet}, SI, printing(noise_density=density(1e-4))) == []
    # Far off, and in degrees or radians, too.
    assert found({"gyro_x": loud}, SI, printing(noise_density=density(0.001))) != []
    (finding,) = found({"gyro_x": loud}, SI, printing(noise_density=density(0.004)))
    assert finding.finding == "noise_unlike_datasheet"  # no unit explains it
    huge = found({"gyro_x": 1e7 * loud}, SI, printing(noise_density=density(0.004)))
    assert [f.finding for f in huge] == ["noise_unlike_datasheet", "turning"]


def test_the_offset_of_degrees_taken_for_radians_is_no_turn(rng: np.random.Generator) -> None:
    (finding,) = found({"gyro_x": np.degrees(gyro(rng))})
    assert finding.finding == "suspicious_unit"


@pytest.mark.parametrize("meant", ["m/s^2", "g", "mg", "ug"])
@pytest.mark.parametrize("stated", ["m/s^2", "g", "mg", "ug"])
def test_gravity_names_the_unit_of_acceleration(
    rng: np.random.Generator, meant: str, stated: str
) -> None:
    factor = find_conversion(stated, "acceleration")[0] / find_conversion(meant, "acceleration")[0]
    logs = {name: factor * log for name, log in triad(rng, 1.05 * DOWN).items()}
    said = found(logs, {"accel": stated})
    assert {f.channel for f in said} == (set() if meant == stated else set(logs))
    for finding in said:
        assert finding.finding == "suspicious_unit"
        assert finding.value == pytest.approx(1 / factor)
        assert f"If the log is in {meant}, and not {stated}, this is 10.3 m/s²" in finding.detail


@pytest.mark.parametrize(
    ("factor", "words"), [(0.0, "subtracted already"), (1.7, "Check unit, scale")]
)
def test_gravity_that_no_unit_explains(rng: np.random.Generator, factor: float, words: str) -> None:
    (finding,) = found(triad(rng, factor * DOWN))
    assert (finding.finding, finding.channel) == ("gravity_norm", None)
    assert words in finding.detail


def test_one_accelerometer_is_judged_by_its_noise(rng: np.random.Generator) -> None:
    printed = {"noise_density": {"value": 100, "unit": "ug/sqrt(Hz)", "sidedness": "two-sided"}}
    sensor = parse(Sensor, SENSOR | {"datasheet": {"accel": printed}}, "s.yaml")
    log = triad(rng, DOWN)["accel_x"]
    assert found({"accel_x": log}, SI, sensor) == []
    (finding,) = found({"accel_x": 1000 * log}, {"accel": "g"}, sensor)
    assert "If the log is in mg, and not g, this is 89.3 µg/√Hz" in finding.detail
    assert found({"accel_x": 1000 * log}, {"accel": "g"}) == []  # nothing is known of it


# ------------------------------------------------------------------------------------- rate


@pytest.mark.parametrize("rate", [0.2, 1.0, 20.0, 100.0, 1000.0, 8000.0])
@pytest.mark.parametrize("factor", [1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9])
def test_a_unit_of_time_that_is_another_is_named(rate: float, factor: float) -> None:
    read = factor * rate
    found = implausible_rates({"gyro_x": read, "accel_x": read}, {"gyro_x": None, "accel_x": 200})
    if 1.1 < read < 1e4:
        assert found == []  # some sensor does that
        return
    assert {f.finding for f in found} == {"rate_implausible"}
    if 20.0 <= rate <= 1000.0:
        (finding,) = found
        assert (finding.value, finding.channel) == (pytest.approx(factor), None)
        assert f"the rate is {rate:.4g} Hz. If so, correct" in finding.detail


@pytest.mark.parametrize("rate", [0.125, 0.5, 1.0])
def test_a_slow_log_is_plausible_once_its_rate_is_stated(rate: float) -> None:
    (finding,) = implausible_rates({"gyro_x": rate}, {"gyro_x": None})
    assert f"{1000 * rate:.4g} Hz" in finding.detail
    assert f"'rate: {rate:.4g} Hz'" in finding.detail
    assert implausible_rates({"gyro_x": rate}, {"gyro_x": None}, stated=rate) == []


def test_a_rate_is_held_against_the_bandwidth() -> None:
    def found(rate: float, bandwidth: float) -> list[float]:
        return [f.value for f in implausible_rates({"gyro_x": rate}, {"gyro_x": bandwidth})]

    assert found(6000.0, 40.0) == [60.0]  # 100 Hz in minutes
    assert found(3900.0, 40.0) == []
    assert found(32_000.0, 4000.0) == []
    assert found(50_000.0, 4000.0) == [1e3]


def test_rates_of_one_clock_alone_are_those_of_its_channels() -> None:
    rates = {"gyro_x": 1e5, "gyro_y": 1e5, "accel_x": 100.0}
    found = implausible_rates(rates, dict.fromkeys(rates))
    assert [f.channel for f in found] == ["gyro_x", "gyro_y"]


# ---------------------------------------------------------------------------------- turning


@pytest.mark.parametrize(
    ("sensor", "limit", "words"),
    [
        (None, 30.0, "of any gyro"),
        (printing(offset={"value": 1, "unit": "deg/s"}), 4.0, "by its datasheet"),
        (printing(offset={"value": 2, "unit": "deg/s", "kind": "max"}), 3.0, "by its datasheet"),
        (printing(offset={"value": 30, "unit": "deg/h"}), 2.0, "by its datasheet"),
        (printing(offset={"value": 20, "unit": "deg/s"}), 30.0, "by its datasheet"),
        (parse(Sensor, SENSOR | {"price_class": "tactical, IMU"}, "s"), 2.0, "class tactical"),
    ],
)
def test_a_mean_rate_that_no_offset_explains_is_a_turn(
    rng: np.random.Generator, sensor: Sensor | None, limit: float, words: str
) -> None:
    assert found({"gyro_y": gyro(rng, math.radians(0.97 * limit))}, SI, sensor) == []
    logs = {"gyro_y": gyro(rng, -math.radians(1.03 * limit))}
    (finding,) = found(logs, SI, sensor)
    assert (finding.finding, finding.channel) == ("turning", "gyro_y")
    assert finding.value == pytest.approx(-math.radians(1.03 * limit), rel=0.01)
    assert words in finding.detail
    assert found(logs, SI, sensor, static=False) == []


def turned(rate: np.ndarray, samples: int = 60_000) -> np.ndarray:
    """Return gravity in a sensor that turns at a constant rate, rad/s, shape (samples, 3)."""
    speed = float(np.linalg.norm(rate))
    axis, angle = rate / speed, -speed * np.arange(samples)[:, None] / RATE
    return np.asarray(
        DOWN * np.cos(angle)
        + np.cross(axis, DOWN) * np.sin(angle)
        + axis * (axis @ DOWN) * (1 - np.cos(angle))
    )


@pytest.mark.parametrize("speed", [0.05, 3.0, 25.0])
def test_gravity_that_turns_tells_the_rate_of_the_sensor(
    rng: np.random.Generator, speed: float
) -> None:
    rate = math.radians(speed) * np.array([0.48, 0.6, -0.64])
    logs = triad(rng, turned(rate))
    turn = detect_gravity_turn([summary(log).blocks() for log in logs.values()], RATE)
    assert turn is not None
    np.testing.assert_allclose(turn.rate, rate, atol=0.02 * float(np.linalg.norm(rate)))
    assert turn.swept == pytest.approx(600 * math.radians(speed), rel=0.02)
    logs |= {f"gyro_{axis}": gyro(rng, of) for axis, of in zip("xyz", rate, strict=True)}
    (finding,) = found(logs)
    assert (finding.finding, finding.channel) == ("turning", None)
    assert "The gyros show" in finding.detail


def test_gravity_that_tilts_alone_is_no_sensor_at_rest(rng: np.random.Generator) -> None:
    tilting = triad(rng, turned(np.array([0.0, math.radians(0.02), 0.0])))  # 12° in 600 s
    assert [f.finding for f in found(tilting)] == ["turning"]
    drifting = triad(rng, turned(np.array([0.0, math.radians(0.01), 0.0])))
    gyros = {f"gyro_{axis}": gyro(rng) for axis in "xyz"}
    assert found(drifting | gyros) == []  # 6°, and the gyros' means do not turn with it


def test_one_move_or_a_warm_up_is_no_steady_turn(rng: np.random.Generator) -> None:
    time = np.arange(60_000.0)[:, None] / RATE
    sideways = STANDARD_GRAVITY * np.array([0.8, 0.0, -0.6])
    for course in (time > 300, 1 - np.exp(-time / 60)):
        moved = DOWN * np.cos(course) + sideways * np.sin(course)
        assert found(triad(rng, moved)) == []


def triad_of_gyros(rng: np.random.Generator, *scales: float) -> dict[str, np.ndarray]:
    return {f"gyro_{a}": scale * gyro(rng) for a, scale in zip("xyz", scales, strict=True)}


@pytest.mark.parametrize("scale", [math.radians(1.0), 0.15, 6.0])
def test_an_axis_unlike_both_others_is_named(rng: np.random.Generator, scale: float) -> None:
    # Loud enough for the one axis to be usual of some gyro.
    (one,) = found(triad_of_gyros(rng, 5.0, 5.0, 5.0 * scale), {"gyro": "deg/s"})
    assert (one.finding, one.channel, one.severity) == ("axis_unlike", "gyro_z", "warning")
    assert one.value == pytest.approx(scale, rel=0.2)
    assert ("rad/s instead of deg/s would explain it" in one.detail) is (scale == math.radians(1.0))


def test_an_accelerometer_axis_in_g_is_named(rng: np.random.Generator) -> None:
    logs = triad(rng, DOWN)
    logs["accel_y"] /= STANDARD_GRAVITY
    (one,) = found(logs)
    assert (one.finding, one.channel) == ("axis_unlike", "accel_y")
    assert "g instead of m/s^2 would explain it" in one.detail


@pytest.mark.parametrize("scales", [(1.0, 1.0, 3.0), (1.0, 1.0, 0.4), (1.0, 3.0, 13.0)])
def test_axes_may_differ(rng: np.random.Generator, scales: tuple[float, float, float]) -> None:
    assert found(triad_of_gyros(rng, *scales)) == []


@pytest.mark.parametrize("scale", [1 / 6, 8.0])
def test_a_noise_far_from_the_printed_one_is_in_doubt(
    rng: np.random.Generator, scale: float
) -> None:
    sensor = printing(noise_density=density(math.degrees(GYRO.N)))
    (one,) = found({"gyro_x": scale * gyro(rng, 1e-3)}, sensor=sensor)
    assert (one.finding, one.severity) == ("noise_unlike_datasheet", "warning")
    assert one.value == pytest.approx(scale, rel=0.3)


@pytest.mark.parametrize("scale", [0.3, 1.0, 3.0])
def test_a_noise_about_as_printed_is_not(rng: np.random.Generator, scale: float) -> None:
    sensor = printing(noise_density=density(math.degrees(GYRO.N)))
    assert found({"gyro_x": scale * gyro(rng, 1e-3)}, sensor=sensor) == []


@pytest.mark.parametrize(("times", "said"), [(10.0, True), (0.1, True), (2.0, False)])
def test_stated_rate_is_checked_against_the_datasheet_noise(
    rng: np.random.Generator, times: float, said: bool
) -> None:
    sensor = printing(noise_density=density(math.degrees(GYRO.N)))
    log = {"gyro_x": math.sqrt(times) * gyro(rng, 1e-3)}  # N as of another rate
    assert found(log, sensor=sensor) == []
    both = log | {"gyro_y": log["gyro_x"]}
    names = [(one.finding, one.channel, "the sampling rate (100 Hz is stated)" in one.detail)
             for one in found(both, sensor=sensor, timed=False)]  # fmt: skip
    # The rate is that of all channels.
    assert names == [("noise_unlike_datasheet", None, True)] * said
