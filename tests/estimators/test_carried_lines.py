"""A comb of lines is carried on as a few, with the power of all."""

import math
from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.lines import (
    MAX_LINES,
    Line,
    describe_grouping,
    select_sinusoids,
)
from imubench_pipeline.estimators.spectral_findings import describe_lines
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.words.numbers import number_text, percent_text


def comb(number: int, kind: str = "sinusoid") -> list[Line]:
    rng = np.random.default_rng(1)
    amplitudes = rng.uniform(0.3, 1.3, number)
    return [
        Line(f, f - 1e-3, f + 1e-3, a, 0.9 * a, 1.1 * a, 50.0, 1e-9, 1e-2, 1e-2, kind)  # type: ignore[arg-type]  # a literal
        for f, a in zip(0.5 + 0.1 * np.arange(number), amplitudes.tolist(), strict=True)
    ]


def model_of(lines: list[dict[str, Parameter]]) -> NoiseModel:
    return Estimate("likelihood", {"N": Parameter(1e-3)}, lines=lines).model


def test_few_lines_are_carried_as_they_are() -> None:
    lines = [*comb(MAX_LINES), *comb(5, "band")]
    found = select_sinusoids(lines)
    assert [one["frequency"].value for one in found] == [
        line.frequency for line in lines[:MAX_LINES]
    ]
    assert describe_lines("gyro_x", lines, None)[1:] == []


@pytest.mark.parametrize("number", [MAX_LINES + 1, 363, 1000])
def test_many_lines_keep_their_power_and_that_of_their_integral(number: int) -> None:
    lines = comb(number)
    found = select_sinusoids(lines)
    assert len(found) == MAX_LINES + 1
    model = model_of(found)
    amplitudes = np.array([line.amplitude for line in lines])
    frequencies = np.array([line.frequency for line in lines])
    kept = np.array([part.amplitude for part in model.sinusoids])
    at = np.array([part.frequency for part in model.sinusoids])
    assert np.sum(kept**2) == pytest.approx(np.sum(amplitudes**2))
    assert np.sum((kept / at) ** 2) == pytest.approx(np.sum((amplitudes / frequencies) ** 2))
    strongest = set(np.sort(amplitudes)[-MAX_LINES:].tolist())
    assert strongest < set(kept.tolist())
    assert np.all(np.diff(at) > 0)


def test_a_comb_is_a_warning_that_says_how_many_and_how_much_power() -> None:
    lines = comb(363)
    note, warning = describe_lines("gyro_x", lines, None)
    assert (note.finding, warning.finding) == ("lines", "too_many_lines")
    assert warning.severity == "warning" and warning.value == 363
    powers = np.sort([0.5 * line.amplitude**2 for line in lines])
    rest = powers[:-MAX_LINES].sum()
    assert "The other 347" in warning.detail
    assert f"{percent_text(rest / powers.sum())} of the power of all lines" in warning.detail
    assert f"({number_text(np.degrees(np.sqrt(rest)), 3)} °/s rms)" in warning.detail
    assert describe_grouping("gyro_x", lines) == warning


def test_a_line_that_integrates_to_as_much_as_the_noise_is_warned_of() -> None:
    # A gyro's angle swings by A / (2 pi f), about its value a second before, and walks by N.
    frequency, white = 17.3, 6.6e-4
    one = replace(comb(1)[0], frequency=frequency, ratio=1e4)
    for part, names in ((0.49, ["lines"]), (0.51, ["lines", "strong_line"])):
        amplitude = part * white * math.pi * frequency * math.sqrt(2.0)
        line = replace(one, amplitude=amplitude)
        found = describe_lines("gyro_x", [line], white)
        assert [finding.finding for finding in found] == names
        assert len(describe_lines("gyro_x", [line], None)) == 1
    assert found[1].value == pytest.approx(0.51)
