"""Simulated logs against densities, Allan variances and responses written apart from them."""

import numpy as np
import pytest
from scipy import signal
from scipy.stats import chi2

from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.simulate.imu import SAMPLES_PER_BLOCK, ImuModel, simulate_imu
from imubench_pipeline.simulate.model import SensorModel, TemperatureDrift
from imubench_pipeline.simulate.profiles import Profile, make_constant, make_day_cycle, make_warm_up
from imubench_pipeline.simulate.simulation import SAMPLES_PER_CHUNK, simulate, simulate_blocks
from tests.conftest import few
from tests.sensor_model import theory

RATE = 100.0
MODELS = {
    "white noise behind a cut-off above Nyquist": (
        NoiseModel(N=0.3),
        LowPass(64.0, 1),
        lambda f: np.full_like(f, 0.09),
    ),
    "two Gauss-Markov processes and a walk, second order": (
        NoiseModel(N=0.1, B=0.4, T_B=0.05, K=0.5, further=[GaussMarkov(0.8, 3.0)]),
        LowPass(20.0, 2),
        lambda f: (
            0.01
            + theory.gauss_markov(f, 0.4, 0.05)
            + theory.gauss_markov(f, 0.8, 3.0)
            + 0.25 / (2 * np.pi * f) ** 2
        ),
    ),
    "flicker noise and a cut-off far below Nyquist, fourth order": (
        NoiseModel(N=0.05, B=0.5),
        LowPass(6.0, 4),
        lambda f: 0.0025 + 0.25 / (2 * np.pi * f),
    ),
    "flicker noise behind a third order above Nyquist": (
        NoiseModel(B=0.5),
        LowPass(80.0, 3),
        lambda f: 0.25 / (2 * np.pi * f),
    ),
}
NAMES = list(MODELS)
SAMPLES = 1 << 19


@pytest.fixture(scope="module", params=few(NAMES[1::2], NAMES[::2]))
def simulated(request):
    noise, low_pass, density = MODELS[request.param]
    log = simulate(
        SensorModel(noise=noise, low_pass=low_pass), RATE, SAMPLES, np.random.default_rng(5)
    )

    def filtered(f: np.ndarray) -> np.ndarray:
        return density(f) * theory.butterworth(f, low_pass.cutoff, low_pass.order)

    return log, filtered


def test_the_allan_variance_of_a_log_is_within_its_chi_squared_limits(simulated) -> None:
    log, density = simulated
    sizes = np.array([1, 2, 5, 20, 100, 500])
    wanted = theory.allan_variance(density, sizes, RATE, 1e-7)
    for n, variance in zip(sizes, wanted, strict=True):
        # Pairs of clusters with a gap between them are as good as independent.
        pairs = log[: SAMPLES // (8 * n) * 8 * n].reshape(-1, 8 * n)
        difference = pairs[:, n : 2 * n].mean(axis=1) - pairs[:, :n].mean(axis=1)
        count = len(difference)
        found = (difference**2).sum() / 2 / variance
        lower, upper = chi2.ppf([1e-5, 1 - 1e-5], count)
        assert lower * (1 - 5e-4) < found < upper * (1 + 5e-4), n


def test_the_spectrum_of_a_log_is_within_its_chi_squared_limits(simulated) -> None:
    log, density = simulated
    length = 4096
    parts = log.reshape(-1, length)
    window = np.sin(np.pi * (np.arange(length) + 0.5) / length) ** 4  # leaks least
    power = np.abs(np.fft.rfft(window * (parts - parts.mean(axis=1)[:, None]))) ** 2
    power /= (window @ window) * RATE
    f = np.fft.rfftfreq(length, 1 / RATE)
    wanted = theory.folded(density, f[1:], RATE, 100)
    # Ordinates of this window that are five apart are independent; 8 of them at a time.
    for first in range(12, length // 2 - 40, 97):
        chosen = np.arange(first, first + 40, 5)
        ratio = power[:, chosen] / wanted[chosen - 1]
        found = 2 * ratio.sum()
        lower, upper = chi2.ppf([1e-5, 1 - 1e-5], 2 * ratio.size)
        assert lower * 0.985 < found < upper * 1.015, f[chosen]


@pytest.mark.release
@pytest.mark.parametrize("name", NAMES)
def test_a_log_is_stationary_from_its_first_sample(name: str) -> None:
    noise, low_pass, density = MODELS[name]
    model = SensorModel(noise=noise, low_pass=low_pass)
    logs = np.array([simulate(model, RATE, 4, np.random.default_rng(i)) for i in range(150)])
    wanted = theory.allan_variance(
        lambda f: density(f) * theory.butterworth(f, low_pass.cutoff, low_pass.order),
        np.array([1, 2]),
        RATE,
        1e-7,
    )
    lower, upper = chi2.ppf([1e-5, 1 - 1e-5], len(logs)) / len(logs)
    first = ((logs[:, 1] - logs[:, 0]) ** 2).mean() / 2
    assert lower < first / wanted[0] < upper
    two = ((logs[:, 2:].mean(axis=1) - logs[:, :2].mean(axis=1)) ** 2).mean() / 2
    assert lower < two / wanted[1] < upper


def test_noise_before_and_behind_the_filter() -> None:
    rng = np.random.default_rng(8)
    low_pass = LowPass(2.0, 2)
    behind = simulate(SensorModel(noise=NoiseModel(Q=1e-3), low_pass=low_pass), RATE, 200_000, rng)
    # The angle has the last rounding alone, and a constant.
    assert np.var(np.cumsum(behind) / RATE) == pytest.approx(1e-6, rel=0.02)
    assert np.var(behind) == pytest.approx(2 * 1e-6 * RATE**2, rel=0.02)
    before = simulate(SensorModel(noise=NoiseModel(N=1.0), low_pass=low_pass), RATE, 200_000, rng)
    # Noise bandwidth of a Butterworth filter of order n: cut-off times pi/2n / sin(pi/2n).
    assert np.var(before) == pytest.approx(2 * 2.0 * np.pi / 4 / np.sin(np.pi / 4), rel=0.05)


def linear(values: np.ndarray):
    return lambda start, stop: values[start:stop]


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_motion_that_is_linear_between_samples_passes_the_filter_exactly(order: int) -> None:
    rng = np.random.default_rng(3)
    motion = np.cumsum(rng.standard_normal(800))
    model = SensorModel(bias=0.7, scale_error=0.02, low_pass=LowPass(64.0, order))
    found = simulate(model, RATE, 800, rng, true=linear(motion))
    system = signal.butter(order, 2 * np.pi * 64.0, analog=True)
    step = 1.02 * (motion - motion[0])
    _, wanted, _ = signal.lsim(system, step, np.arange(800) / RATE, interp=True)
    np.testing.assert_allclose(found, wanted + 0.7 + 1.02 * motion[0], atol=1e-9)


@pytest.mark.parametrize("order", [0, 1, 3])
def test_drift_follows_the_temperature_through_lag_and_filter(order: int) -> None:
    rng = np.random.default_rng(4)
    warm = 20.0 + np.cumsum(rng.standard_normal(500))
    lag, s = 0.3, 0.4
    low_pass = LowPass(8.0, order) if order else None
    drift = TemperatureDrift(sensitivity=s, reference=22.0, lag=lag)
    model = SensorModel(drift=drift, low_pass=low_pass)
    found = simulate(model, RATE, 500, rng, temperature=linear(warm))
    zeros, poles, gain = (
        signal.butter(order, 2 * np.pi * 8.0, analog=True, output="zpk") if order else ([], [], 1)
    )
    system = signal.ZerosPolesGain(zeros, [*poles, -1 / lag], gain / lag)
    _, wanted, _ = signal.lsim(system, warm - warm[0], np.arange(500) / RATE, interp=True)
    np.testing.assert_allclose(found, s * (wanted + warm[0] - 22.0), atol=1e-9)


def test_the_quadratic_drift_is_of_the_lagged_temperature() -> None:
    t = np.arange(3000) / RATE
    drift = TemperatureDrift(sensitivity=0.4, quadratic=0.03, reference=20.0, lag=5.0)
    model = SensorModel(drift=drift)
    found = simulate(
        model, RATE, 3000, np.random.default_rng(0), temperature=linear(20.0 + 0.5 * t)
    )
    lagged = 0.5 * (t - 5.0 * (1 - np.exp(-t / 5.0)))  # the answer of a lag to a ramp
    np.testing.assert_allclose(found, 0.4 * lagged + 0.03 * lagged**2, atol=1e-11)
    # Far slower than the filter, the drift passes it with the delay of a ramp.
    filtered = SensorModel(drift=drift, low_pass=LowPass(10.0, 2))
    slow = simulate(
        filtered, RATE, 3000, np.random.default_rng(0), temperature=linear(20.0 + 0.5 * t)
    )
    rate = np.gradient(found, t)
    wanted = found - rate * np.sqrt(2) / (2 * np.pi * 10.0)
    np.testing.assert_allclose(slow[100:-1], wanted[100:-1], atol=3e-5)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_ramp_comes_late_by_the_delay_of_the_filter_from_the_first_sample(order: int) -> None:
    model = SensorModel(noise=NoiseModel(R=-2.0), low_pass=LowPass(5.0, order))
    found = simulate(model, RATE, 300, np.random.default_rng(0))
    delay = {1: 1.0, 2: np.sqrt(2), 4: 2.613125929752753}[order] / (2 * np.pi * 5.0)
    np.testing.assert_allclose(found, -2.0 * (np.arange(300) / RATE - delay), atol=1e-11)


def test_a_line_has_the_gain_of_the_filter_and_is_folded() -> None:
    # 130 Hz sampled at 100 Hz looks like 30 Hz.
    noise = NoiseModel(sinusoids=[Sinusoid(2.0, 130.0)])
    log = simulate(
        SensorModel(noise=noise, low_pass=LowPass(64.0, 2)), RATE, 5000, np.random.default_rng(1)
    )
    t = np.arange(5000) / RATE
    waves = np.column_stack([np.cos(2 * np.pi * 30 * t), np.sin(2 * np.pi * 30 * t)])
    amplitudes, residual, *_ = np.linalg.lstsq(waves, log, rcond=None)
    assert np.hypot(*amplitudes) == pytest.approx(2 / np.sqrt(1 + (130 / 64) ** 4), rel=1e-9)
    assert residual[0] < 1e-15


def test_a_register_saturates_and_rounds() -> None:
    motion = np.linspace(-3, 3, 61)
    model = SensorModel(resolution=0.25, full_scale=2.0)
    log = simulate(model, RATE, 61, np.random.default_rng(0), true=linear(motion))
    assert log.min() == -2.0 and log.max() == 2.0
    inside = np.abs(motion) < 2
    assert (np.abs(log - motion)[inside] <= 0.125 + 1e-12).all()
    assert (log * 4 == np.rint(log * 4)).all()


def test_rounding_with_noise_of_a_step_is_white_noise() -> None:
    rng = np.random.default_rng(2)
    model = SensorModel(noise=NoiseModel(N=0.1), resolution=0.9)
    log = simulate(model, RATE, 400_000, rng)
    for n in (1, 10):
        means = log.reshape(-1, n).mean(axis=1)
        variance = (0.1**2 * RATE + 0.9**2 / 12) / n
        assert np.mean(np.diff(means) ** 2) / 2 == pytest.approx(variance, rel=0.02)


@pytest.mark.parametrize("block", [SAMPLES_PER_CHUNK, 2 * SAMPLES_PER_CHUNK])
def test_a_log_does_not_depend_on_the_size_of_its_blocks(block: int) -> None:
    noise = NoiseModel(Q=1e-3, N=1, B=1, K=1, R=1, sinusoids=[Sinusoid(1.0, 13.0)])
    model = SensorModel(
        noise=noise, drift=TemperatureDrift(sensitivity=1.0, lag=3.0), low_pass=LowPass(9.0, 3)
    )
    length = 40_000
    warm = np.sin(np.arange(length) / 100)

    def blocks(size: int) -> list[np.ndarray]:
        rng = np.random.default_rng(9)
        return list(simulate_blocks(model, RATE, length, rng, temperature=linear(warm), block=size))

    parts = blocks(block)
    assert {len(part) for part in parts[:-1]} <= {block}
    np.testing.assert_array_equal(np.concatenate(parts), np.concatenate(blocks(SAMPLES_PER_CHUNK)))


IMU = ImuModel(
    axes={
        "gyro_x": SensorModel(
            noise=NoiseModel(N=0.1),
            drift=TemperatureDrift(sensitivity=0.1, reference=20.0),
            low_pass=LowPass(64.0),
        ),
        "gyro_z": SensorModel(noise=NoiseModel(N=0.2, K=0.1), scale_error=0.01),
        "accel_z": SensorModel(noise=NoiseModel(B=0.2)),
    },
    misalignment={"gyro": np.array([[1, 0.02, 0], [0, 1, 0], [0, -0.01, 1]])},
    temperature_step=1.0,
)


def joined(threads: int = 1, imu: ImuModel = IMU, **given: object) -> dict[str, np.ndarray]:
    blocks = list(simulate_imu(imu, RATE, SAMPLES_PER_BLOCK + 1000, 3, ("board", "run"), **given))
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def test_an_axis_depends_on_neither_threads_nor_other_axes() -> None:
    profiles: dict[str, Profile] = {"gyro_y": make_constant(1.0)}
    warm = make_warm_up(20.0, 30.0, 100.0, 5.0)
    one = joined(motion=profiles, temperature=warm)
    two = joined(motion=profiles, temperature=warm, threads=2)
    alone = joined(
        imu=ImuModel(axes={"gyro_z": IMU.axes["gyro_z"]}, misalignment=IMU.misalignment),
        motion=profiles,
        temperature=warm,
    )
    assert list(one) == ["gyro_x", "gyro_z", "accel_z", "temperature"]
    for name in one:
        np.testing.assert_array_equal(one[name], two[name])
    np.testing.assert_array_equal(one["gyro_z"], alone["gyro_z"])
    steps = [np.diff(one[name]) for name in ("gyro_x", "gyro_z")]
    assert abs(np.corrcoef(*steps)[0, 1]) < 0.02


def test_axes_share_motion_and_temperature() -> None:
    silent = ImuModel(
        axes={
            "gyro_x": SensorModel(drift=TemperatureDrift(sensitivity=0.1, reference=20.0)),
            "gyro_z": SensorModel(scale_error=0.01),
        },
        misalignment=IMU.misalignment,
        temperature_step=1.0,
    )
    cycle = make_day_cycle(mean=25.0, amplitude=5.0, period=1000.0, highest=100.0)
    found = joined(imu=silent, motion={"gyro_y": cycle}, temperature=cycle)
    t = np.arange(SAMPLES_PER_BLOCK + 1000) / RATE
    wave = 25.0 + 5.0 * np.cos(2 * np.pi * (t - 100.0) / 1000.0)
    np.testing.assert_allclose(found["gyro_x"], 0.02 * wave + 0.1 * (wave - 20.0), atol=1e-12)
    np.testing.assert_allclose(found["gyro_z"], -0.01 * 1.01 * wave, atol=1e-12)
    np.testing.assert_array_equal(found["temperature"], np.rint(wave))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: LowPass(0.0), "cut-off"),
        (lambda: LowPass(1.0, 0), "order"),
        (lambda: SensorModel(resolution=-1.0), "resolution"),
        (lambda: SensorModel(full_scale=0.0), "full_scale"),
        (lambda: SensorModel(bias=np.nan), "bias"),
        (lambda: TemperatureDrift(sensitivity=1.0, lag=-1.0), "lag"),
        (lambda: ImuModel(axes={"gyro": SensorModel()}), "no channel 'gyro'"),
        (lambda: ImuModel(axes={}, misalignment={"gyro": np.eye(2)}), "3 by 3"),
        (lambda: simulate(SensorModel(), 0.0, 1, np.random.default_rng()), "rate"),
        (
            lambda: simulate(
                SensorModel(), 1.0, 2, np.random.default_rng(), true=linear(np.array([1, np.nan]))
            ),
            "motion has values that are not finite",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(make, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make()
