"""Figures of datasheets, converted in the shell."""

import math

import pytest

from imubench_pipeline.run.cli import main


@pytest.mark.parametrize(
    ("arguments", "value", "unit"),
    [
        (["0.005 deg/s/sqrt(Hz)", "--to=deg/sqrt(h)"], 0.3, "deg/sqrt(h)"),
        (["0.005 deg/s/sqrt(Hz)", "--to=deg/sqrt(h)", "--one-sided"], 0.3 / math.sqrt(2), ""),
        (["40 ug", "--to=m/s^2"], 40e-6 * 9.80665, "m/s^2"),
        # At its own time, sqrt(tau / 3) times the walk is the bias instability.
        (["3 deg/h", "--to=deg/h/sqrt(h)", "--horizon=3 h"], 3.0, "(K: bias instability"),
        (["5 ug", "--to=ug/sqrt(s)", "--horizon=300 s"], 0.5, "x sqrt(3 / 300 s))"),
        (["0.1 deg/s", "--to=deg/s/sqrt(Hz)", "--rate=100 Hz"], 0.01, "sqrt(100 Hz)"),
        (["262 LSB", "--to=deg/s", "--sensitivity=131 LSB/(deg/s)"], 2.0, "at 131"),
    ],
)
def test_a_figure_is_converted(
    arguments: list[str], value: float, unit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", *arguments]) == 0
    figure, _, result = capsys.readouterr().out.partition(" = ")
    assert figure == arguments[0] and unit in result
    assert float(result.split()[0].replace("×10⁻", "e-")) == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["0.1 deg/s", "--to=ug"], "no unit of"),
        (["many", "--to=ug"], "is not a number with its unit"),
        (["1 deg/h", "--to=deg/s", "--one-sided"], "is no density"),
        (["1 s", "--to=deg/s/sqrt(Hz)", "--rate=9 Hz"], "expected one such as deg/s or mg"),
        (["1 LSB", "--to=deg/s", "--sensitivity=3 LSB"], "expected a figure in LSB"),
    ],
)
def test_units_that_do_not_belong_together_are_refused(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["convert", *arguments]) == 2
    assert words in capsys.readouterr().err
