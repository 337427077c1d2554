from collections.abc import Sequence

import numpy as np
import pytest
from scipy import signal, stats

from imubench_pipeline.estimators.likelihood import make_noise_model
from imubench_pipeline.estimators.lines import FALSE_ALARM_PROBABILITY, Line, find_lines, mask_lines
from imubench_pipeline.estimators.spectrum import LineSpectrum, Spectrum, compute_spectra
from imubench_pipeline.estimators.whittle import Terms, make_whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE = 100.0
N = 1e-3
WHITE = NoiseModel(N=N)
MODEL = NoiseModel(N=N, B=1e-3, T_B=20.0, K=1e-4)
DEVIATION = N * np.sqrt(RATE)
"""Of a sample of white noise."""

LONG = 300_000
"""Samples of a log that is too long for one transform: slow lines come from means of blocks."""

STEP = RATE / 32768
"""Resolution of the spectra for lines of such a log, Hz."""


def search(log: np.ndarray, model: NoiseModel | None) -> tuple[list[Line], Spectrum]:
    """The lines of a log beside a model, which is fitted where it is not given."""
    spectrum, line_spectra = compute_spectra([log], len(log), RATE)
    if model is None:
        model = make_noise_model(make_whittle(spectrum, RATE / 2, 2).maximum(Terms("NFK")))
    return find_lines(line_spectra, model, RATE, crossover_of(spectrum)), spectrum


def crossover_of(spectrum: Spectrum) -> float:
    low = spectrum.block > 1
    return float(spectrum.upper[low].max()) if low.any() else 0.0


def wave(samples: int, A: float, frequency: float, phase: float = 1.0) -> np.ndarray:
    return A * np.cos(2 * np.pi * frequency * np.arange(samples) / RATE + phase)


def resonance(samples: int, frequency: float, half: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of variance 1 around a frequency, with half its density ``half`` Hz beside it."""
    settling = int(5 * RATE / (2 * np.pi * half))
    radius, angle = np.exp(-2 * np.pi * half / RATE), 2 * np.pi * frequency / RATE
    poles = [1.0, -2 * radius * np.cos(angle), radius**2]
    noise = signal.lfilter([1.0], poles, rng.standard_normal(samples + settling))[settling:]
    return noise / noise.std()


def of_the_line(lines: Sequence[Line], frequency: float) -> list[Line]:
    return [line for line in lines if abs(line.frequency - frequency) < 5 * line.resolution]


@pytest.mark.parametrize(
    ("samples", "lowest", "highest", "A"),
    few(
        [
            (60_000, 0.2, 0.5, 3e-3),
            (60_000, 1.0, 49.0, 3e-3),
        ],
        [
            (LONG, 0.02, 0.05, 2.5e-3),  # seen in the means of blocks
            (LONG, 0.3, 49.0, 1.2e-3),
            (LONG, 3.0, 49.0, 5e-4),  # just strong enough to be found every time
        ],
    ),
)
def test_a_sinusoid_is_found_inside_its_limits(
    rng, samples: int, lowest: float, highest: float, A: float
) -> None:
    logs, others = 15, 0
    frequency_errors, amplitude_errors = [], []
    for _ in range(logs):
        frequency = rng.uniform(lowest, highest)
        log = simulate(MODEL, RATE, samples, rng)
        log += wave(samples, A, frequency, rng.uniform(0, 2 * np.pi))
        lines, _ = search(log, MODEL)
        (line,) = of_the_line(lines, frequency)
        others += len(lines) - 1
        assert line.narrow
        assert line.false_alarm < 1e-4
        assert line.frequency_lower < line.frequency < line.frequency_upper
        assert line.amplitude_lower < line.amplitude < line.amplitude_upper
        assert (line.term.amplitude, line.term.frequency) == (line.amplitude, line.frequency)
        width = line.frequency_upper - line.frequency_lower
        frequency_errors.append((line.frequency - frequency) / width)
        width = line.amplitude_upper - line.amplitude_lower
        amplitude_errors.append((line.amplitude - A) / width)
    assert others <= 2
    for errors in (np.array(frequency_errors), np.array(amplitude_errors)):
        # 95 % limits: of 15 more than 4 miss with a chance of 0.06 %.
        assert (np.abs(errors) > 0.5).sum() <= 4
        # They are not wider than they need be: 3.92 standard errors.
        assert 0.6 < 3.92 * np.sqrt(np.mean(errors**2)) < 1.4
        assert abs(3.92 * errors.mean()) < 4 / np.sqrt(logs)


def test_lines_come_with_their_amplitudes_in_the_order_of_their_frequencies(rng) -> None:
    truth = {0.03: 4e-3, 0.5: 1e-2, 17.3: 1.5e-3, 48.0: 2e-2}
    log = 9.81 + simulate(MODEL, RATE, LONG, rng)
    for frequency, A in truth.items():
        log += wave(LONG, A, frequency)
    lines, _ = search(log, MODEL)
    assert len(lines) == 4
    for line, (frequency, A) in zip(lines, truth.items(), strict=True):
        assert line.frequency == pytest.approx(frequency, abs=0.2 * line.resolution)
        assert line.amplitude == pytest.approx(A, rel=0.15)


@pytest.mark.release
def test_means_of_blocks_do_not_damp_the_amplitude_of_a_slow_line(rng) -> None:
    # Over a block of 64 samples a line of 0.0475 Hz turns by 0.19 rad: its mean has lost 0.15 %.
    noise = DEVIATION * rng.standard_normal(LONG)
    frequencies = rng.uniform(0.045, 0.05, 12)
    lines = [search(noise + wave(LONG, 0.3, frequency), WHITE)[0][0] for frequency in frequencies]
    amplitudes = np.array([line.amplitude for line in lines])
    assert amplitudes.mean() == pytest.approx(0.3, rel=7e-4)
    np.testing.assert_allclose([line.frequency for line in lines], frequencies, atol=0.01 * STEP)


def test_a_line_that_loses_its_phase_is_found_all_the_same(rng) -> None:
    # Half an hour in which the phase walks slowly: not one line over the log, but one in segments.
    samples, A = 180_000, 5e-3
    phase = np.cumsum(rng.standard_normal(samples)) * 4e-3
    line = A * np.cos(2 * np.pi * 12.5 * np.arange(samples) / RATE + phase)
    lines, _ = search(simulate(WHITE, RATE, samples, rng) + line, WHITE)
    strongest = max(lines, key=lambda found: found.amplitude)
    assert strongest.frequency == pytest.approx(12.5, abs=0.02)
    assert strongest.amplitude == pytest.approx(A, rel=0.1)


@pytest.mark.parametrize(
    "model",
    few(
        [MODEL, NoiseModel(Q=1e-4, N=1e-3)],
        [WHITE, NoiseModel(N=1e-4, B=3e-3), NoiseModel(N=1e-4, K=1e-2)],
    ),
    ids=lambda model: model.name,
)
def test_a_channel_of_noise_has_no_lines(rng, model: NoiseModel) -> None:
    # The fitted model knows neither Gauss-Markov processes nor quantization.
    logs = 30
    alarms = sum(bool(search(simulate(model, RATE, 10_000, rng), None)[0]) for _ in range(logs))
    assert alarms <= 3  # of 1 % each more than 3 have a chance of 0.02 %


@pytest.mark.release  # the test before this has shorter ones every day
@pytest.mark.parametrize("model", [MODEL, NoiseModel(N=1e-4, B=3e-3)], ids=lambda m: m.name)
def test_a_long_channel_of_noise_has_no_lines(rng, model: NoiseModel) -> None:
    alarms = sum(bool(search(simulate(model, RATE, LONG, rng), None)[0]) for _ in range(10))
    assert alarms <= 1


@pytest.mark.release
def test_the_false_alarms_are_as_many_as_is_said(rng) -> None:
    logs, segments, points = 8000, 9, 512
    window = signal.get_window("hann", points)
    frequency = np.fft.rfftfreq(points, 1 / RATE)
    alarms = 0
    for _ in range(logs):
        noise = DEVIATION * rng.standard_normal((segments, points))
        power = np.abs(np.fft.rfft(noise * window)) ** 2 / np.sum(window**2) / RATE
        spectrum = LineSpectrum(frequency, power.mean(axis=0), segments, 1)
        alarms += bool(find_lines([spectrum], WHITE, RATE, 0.0))
    # Neighbouring bins of a Hann window are correlated, which leaves fewer than there are bins.
    assert alarms >= stats.binom(logs, FALSE_ALARM_PROBABILITY / 2).ppf(0.003) > 0
    assert alarms <= stats.binom(logs, FALSE_ALARM_PROBABILITY).ppf(0.997)


def test_a_resonance_is_wider_than_a_sinusoid(rng) -> None:
    for half in (2 * STEP, 4 * STEP, 8 * STEP):
        for strength in (0.3, 1.0, 10.0):
            frequency = rng.uniform(15, 35)
            noise = rng.standard_normal(LONG) + strength * resonance(LONG, frequency, half, rng)
            lines, _ = search(DEVIATION * noise, WHITE)
            strongest = max(lines, key=lambda line: line.amplitude)
            assert not strongest.narrow
            assert strongest.width > half
            assert strongest.frequency == pytest.approx(frequency, abs=2 * half)
            # A sinusoid of the same variance; the flanks go to the level of the noise.
            same = np.sqrt(2) * strength * DEVIATION
            assert 0.6 * same < strongest.amplitude < 1.2 * same


@pytest.mark.release
def test_a_resonance_far_wider_than_the_resolution_is_no_line(rng) -> None:
    alarms = 0
    for _ in range(15):
        noise = rng.standard_normal(LONG) + resonance(LONG, rng.uniform(15, 35), 128 * STEP, rng)
        alarms += bool(search(DEVIATION * noise, WHITE)[0])
    assert alarms <= 1


@pytest.mark.release  # test_a_resonance_is_wider_than_a_sinusoid tells them apart every day
@pytest.mark.parametrize("bins", [4, 24])
def test_no_part_of_a_resonance_is_called_a_sinusoid(rng, bins: int) -> None:
    called = 0
    for _ in range(15):
        frequency, half = rng.uniform(15, 35), bins * STEP
        noise = rng.standard_normal(LONG) + resonance(LONG, frequency, half, rng)
        lines, _ = search(DEVIATION * noise, WHITE)
        called += any(line.narrow for line in lines)
    assert called <= 1


@pytest.mark.parametrize("strength", few([1.0, 100.0], [10.0]))
def test_a_strong_sinusoid_is_narrow(rng, strength: float) -> None:
    # The skirts of a Hann window fall as the sixth power of the distance: the line is as narrow.
    for _ in range(5):
        A = np.sqrt(2) * strength * DEVIATION
        frequency = rng.uniform(3, 45)
        log = DEVIATION * rng.standard_normal(LONG) + wave(LONG, A, frequency)
        (line,) = of_the_line(search(log, WHITE)[0], frequency)
        assert line.amplitude == pytest.approx(A, rel=0.02)
        assert line.narrow


@pytest.mark.parametrize("beside", few([-3.0, 0.0, 2.0], [1.0, 3.0, 6.0]))
@pytest.mark.parametrize("A", [1.5e-3, 5e-2, 5.0])
def test_a_line_where_the_two_spectra_meet_is_found_once(rng, beside: float, A: float) -> None:
    log = DEVIATION * rng.standard_normal(LONG)
    crossover = crossover_of(compute_spectra([log], LONG, RATE)[0])
    frequency = crossover + beside * STEP
    lines, _ = search(log + wave(LONG, A, frequency), WHITE)
    (line,) = [line for line in lines if line.frequency < 1.0]
    # As it is: 95 % limits are 4 standard errors apart.
    apart = line.frequency_upper - line.frequency_lower
    assert line.frequency == pytest.approx(frequency, abs=apart)
    apart = line.amplitude_upper - line.amplitude_lower
    assert line.amplitude == pytest.approx(A, abs=apart)


def test_a_fast_line_is_not_found_again_at_a_low_frequency(rng) -> None:
    # Means of 64 samples show a line just beside a multiple of their rate as a slow one.
    A = 10 * np.sqrt(2) * DEVIATION
    for harmonic in (5, 10):
        frequency = harmonic * RATE / 64 + 0.045
        log = DEVIATION * rng.standard_normal(LONG) + wave(LONG, A, frequency)
        slow = [line for line in search(log, WHITE)[0] if line.frequency < 1.0]
        assert [line.kind for line in slow] in ([], ["alias"])


@pytest.mark.parametrize("samples", [60_000, LONG])
@pytest.mark.parametrize(
    ("strength", "most"), [(0.3, 0.02), (3.0, 0.05)], ids=["weak line", "strong line"]
)
def test_bins_that_a_line_leaves_as_they_are_are_kept(
    rng, samples: int, strength: float, most: float
) -> None:
    total, expected, lost = [], [], []
    for _ in range(6):
        frequency = rng.uniform(3, 45)
        A = np.sqrt(2) * strength * DEVIATION
        log = DEVIATION * rng.standard_normal(samples) + wave(samples, A, frequency)
        lines, spectrum = search(log, WHITE)
        found = of_the_line(lines, frequency)
        clear = mask_lines(spectrum, found, np.full(len(spectrum.frequency), N**2))
        touched = np.flatnonzero(~clear)
        # One stretch that holds the line, and the bin that it raises most.
        assert (np.diff(touched) == 1).all()
        assert spectrum.lower[touched[0]] < frequency < spectrum.upper[touched[-1]]
        error = (spectrum.density / N**2 - 1) * np.sqrt(spectrum.ordinates / 2)
        assert np.argmax(error) in touched
        lost.append(len(touched) / len(clear))
        total.append((error * clear).sum())
        expected.append(clear.sum())
        beside = [touched[0] - 1, min(touched[-1] + 1, len(clear) - 1)]
        assert error[beside].max() < 4.5
    assert np.mean(lost) < most
    # Together the bins that stay are not raised: their mean error is that of as many bins.
    assert abs(np.sum(total)) < 4 * np.sqrt(np.sum(expected))


def test_a_channel_without_lines_keeps_every_bin(rng) -> None:
    spectrum = compute_spectra([rng.standard_normal(LONG)], LONG, RATE)[0]
    assert mask_lines(spectrum, [], np.full(len(spectrum.frequency), 1 / RATE)).all()


def test_a_stronger_line_takes_more_bins(rng) -> None:
    spectrum = compute_spectra([DEVIATION * rng.standard_normal(LONG)], LONG, RATE)[0]
    density = np.full(len(spectrum.frequency), N**2)

    def taken(A: float) -> int:
        line = Line(10.0, 9.99, 10.01, A, 0.9 * A, 1.1 * A, 99.0, 0.0, 3 * STEP, STEP, "sinusoid")
        return int((~mask_lines(spectrum, [line], density)).sum())

    amounts = [taken(A) for A in (1e-3, 1e-1, 1.0, 10.0)]
    assert amounts == sorted(amounts)
    assert 1 <= amounts[0] <= 2 < amounts[-1]
