import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.words.estimates import estimate_text, model_text, precision_text
from imubench_pipeline.words.numbers import Unit, counted, sentence, started_text

UNIT = Unit("°/h", 2.0)
HOUR = 3600.0


def row(status: str = "ok", **values: Any) -> ParameterRow:
    return ParameterRow(sensor="s", recording="r", channel="gyro_x", method="likelihood",
                        recommended=True, model="N+K", component=1, parameter="K", unit="rad/s^1.5",
                        status=status, **values)  # fmt: skip


def test_a_value_that_is_known_needs_no_words() -> None:
    assert estimate_text(row(value=1.0), UNIT, HOUR) == ""


@pytest.mark.parametrize(
    ("given_", "sentence"),
    [
        (row("absent"), "K is not in the model: the data do not support it."),
        (
            row("absent", upper=1.234),
            "K is not in the model: the data do not support it; below 2.5 °/h.",
        ),
        (
            row("absent", lower=0.0, upper=1.0),
            "K is not in the model: the data do not support it; below 2 °/h.",
        ),
        (row("not_identified"), "K is not determined by 3 h of data."),
        (
            row("not_identified", lower=1.0, upper=50.0),
            "K is not determined by 3 h of data; 95 % interval: 2 to 100 °/h.",
        ),
        (row("not_identified", upper=50.0), "K is not determined by 3 h of data."),
        (
            row("not_identified", lower=1.0, upper=50.0, duration_needed=30 * HOUR),
            "K is not determined by 3 h of data; 95 % interval: 2 to 100 °/h; ± 10 % needs 30 h.",
        ),
        (
            # The log is long enough for one like it: that it does not tell has another reason.
            row("not_identified", duration_needed=3 * HOUR),
            "K is not determined by 3 h of data.",
        ),
        (row("not_shown", reason="the curve does not rise."), "K: the curve does not rise."),
        (row("not_shown"), "K: not determined."),
        (row("at_bound"), "K: bounded."),
        (
            row("at_bound", reason="beyond the log", duration_needed=40 * HOUR),
            "K: beyond the log; ± 10 % needs 40 h.",
        ),
    ],
)
def test_why_a_parameter_has_no_plain_value(given_: ParameterRow, sentence: str) -> None:
    assert estimate_text(given_, UNIT, 3 * HOUR) == sentence


def test_a_log_of_unknown_length_is_not_spoken_of() -> None:
    given_ = row("not_identified", duration_needed=HOUR)
    assert estimate_text(given_, UNIT, None) == "K is not determined; ± 10 % needs 60 min."
    assert estimate_text(row("not_identified"), UNIT, None) == "K is not determined."


@pytest.mark.parametrize(
    ("given_", "words"),
    [
        (row(value=10.0, lower=9.6, upper=10.4), "± 4 %"),
        (row(value=10.0, lower=9.9, upper=10.3), "± 2 %"),
        (row(value=10.0, lower=9.876, upper=10.124), "± 1.2 %"),
        (row(value=-10.0, lower=-10.4, upper=-9.6), "± 4 %"),
        (row(value=1.0, lower=0.75, upper=1.25), "± 25 %"),
        (row(value=10.0, lower=6.0, upper=20.0), "12 to 40"),
        (row(value=10.0), ""),
        (row(value=10.0, lower=9.0), ""),
        (row(value=10.0, upper=11.0), ""),
        (row(value=0.0, lower=-1.0, upper=1.0), ""),
        (row(lower=1.0, upper=2.0), ""),
    ],
)
def test_how_well_a_value_is_known(given_: ParameterRow, words: str) -> None:
    assert precision_text(given_, UNIT) == words


@given(st.floats(1e-9, 1e3), st.floats(0.001, 0.9), st.floats(0.001, 3.0))
def test_a_percentage_never_hides_that_an_interval_is_wide(
    value: float, below: float, above: float
) -> None:
    lower, upper = value * (1 - below), value * (1 + above)
    words = precision_text(row(value=value, lower=lower, upper=upper), UNIT)
    half = (below + above) / 2
    if not math.isclose(half, 0.3, rel_tol=1e-9):
        assert words.startswith("±") == (half < 0.3)
    if words.startswith("±"):
        assert float(words[2:-2]) == pytest.approx(100 * half, rel=0.051)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("N+GM+K", "N+GM+K"),
        ("N", "N"),
        ("N+F+S", "N+F + 1 spectral line"),
        ("N+F+S+S+S", "N+F + 3 spectral lines"),
    ],
)
def test_lines_of_a_model_are_counted(name: str, text: str) -> None:
    assert model_text(name) == text


def test_notes_become_sentences() -> None:
    assert sentence("the band ends at 3 Hz") == "The band ends at 3 Hz."
    assert sentence("AIC says N+F.") == "AIC says N+F."
    assert sentence("") == ""


@pytest.mark.parametrize(
    ("started", "text"),
    [
        (None, ""),
        ("", ""),
        ("2024-01-02", "2024-01-02"),
        ("2024-01-02T03:04:05.000", "2024-01-02 03:04:05"),
        ("2024-01-02T03:04:05.678", "2024-01-02 03:04:05.678"),
        ("Tue Feb 3", "Tue Feb 3"),
    ],
)
def test_date_and_time_are_easily_read(started: str | None, text: str) -> None:
    assert started_text(started) == text


@pytest.mark.parametrize(
    ("number", "words"), [(0, "0 recordings"), (1, "1 recording"), (2, "2 recordings")]
)
def test_nouns_are_counted(number: int, words: str) -> None:
    assert counted(number, "recording") == words


def test_irregular_nouns_are_counted() -> None:
    assert (counted(1, "axis", "axes"), counted(3, "axis", "axes")) == ("1 axis", "3 axes")
