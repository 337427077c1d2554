"""The benchmark of real logs has the figures of the judge that lies beside the project."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from itertools import islice
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import real_logs
from tests.conftest import PROJECT, few

JUDGE = PROJECT.parent / "shared/judge/real_logs.py"
WITH_JUDGE = pytest.mark.skipif(not JUDGE.is_file(), reason="no judge lies beside the project")


@pytest.fixture(scope="module")
def judge() -> ModuleType:
    specification = importlib.util.spec_from_file_location("judge_of_real_logs", JUDGE)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@WITH_JUDGE
@pytest.mark.parametrize("number", few([1], [6]))
def test_every_piece_has_the_level_and_the_errors_of_the_judge(
    judge: ModuleType, number: int
) -> None:
    levels = 0
    theirs = zip(real_logs.recordings(real_logs.LOGS), judge.recordings(), strict=number == 6)
    for recording, (name, samples, rate, _) in islice(theirs, number):
        assert recording.name == name
        np.testing.assert_allclose(recording.samples, samples, rtol=1e-12)
        length = len(samples) // 4
        for column in samples[:length].T:
            tau, deviation, error = judge.curve(column, rate)
            own, found = real_logs.measured(column, rate)
            np.testing.assert_allclose(own.tau, tau, rtol=1e-9)
            np.testing.assert_allclose(own.deviation, deviation, rtol=1e-6)
            np.testing.assert_allclose(own.error, error, rtol=1e-9)
            level = judge.white_level(tau, deviation, error, rate)
            assert found == (level and pytest.approx(level, rel=1e-6))
            levels += level is not None
    assert levels > 2 * number


positive = st.floats(1e-3, 1e3)
figure = st.one_of(
    st.tuples(positive, positive, positive).map(sorted),
    st.tuples(st.none(), st.just(0.0), positive),
    st.just((None, None, None)),
)


@WITH_JUDGE
@given(figure, figure)
def test_two_figures_are_compared_as_by_the_judge(judge_pair, first, second) -> None:
    def own(parts):
        lower, value, upper = parts if parts[0] is not None else (parts[1], None, parts[2])
        numbers = (np.nan if each is None else each for each in (value, lower, upper))
        return real_logs.Figure(*numbers, "ok"), (value, lower, upper, "ok")

    (a, judged_a), (b, judged_b) = own(first), own(second)
    expected = judge_pair(judged_a, judged_b)
    found = real_logs.compare(a, b)
    if isinstance(expected, float):
        assert found == pytest.approx(expected, rel=1e-9)
    else:
        assert found is expected


@pytest.fixture(scope="module")
def judge_pair(judge: ModuleType):
    return judge.pair


@WITH_JUDGE
@pytest.mark.parametrize(("part", "number"), [(0, 0), (0, 5), (5, 5), (3, 7)])
def test_shares_are_those_of_the_judge(judge: ModuleType, part: int, number: int) -> None:
    assert real_logs.share(part, number) == judge.share(part, number)


@WITH_JUDGE
@pytest.mark.release  # of a whole recording; the parts that it is made of are compared every day
def test_the_table_of_a_recording_is_that_of_the_judge() -> None:
    def printed(script: Path, *more: str) -> list[str]:
        command = [sys.executable, str(script), "--only", "mpu6050/gyro", "--pieces", "2", *more]
        text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        return [line for line in text.splitlines() if line and not line.startswith("==")]

    assert printed(PROJECT / "benchmarks/real_logs.py") == printed(JUDGE)


def test_n_off_the_curve_fails_the_check(monkeypatch: pytest.MonkeyPatch) -> None:
    def piece(value: float) -> real_logs.Piece:
        white = real_logs.Figure(value, 0.9 * value, 1.1 * value, "ok")
        unknown = real_logs.Figure(np.nan, np.nan, np.nan, "absent")
        figures = dict.fromkeys(real_logs.PARAMETERS, unknown) | {"N": white}
        return real_logs.Piece("log", "gyro_x", "likelihood", 1, 0, figures, 1.0, 9.0, 1.0, {})

    rows = np.zeros((10, 1))
    recording = real_logs.Recording("log", rows, 1.0, ("gyro_x",))
    monkeypatch.setattr(real_logs, "recordings", lambda *_: [recording])
    monkeypatch.setattr(sys, "argv", ["real_logs.py", "--check", "--pieces", "1"])
    for values, status in (([1.01] * 9 + [1.05], 0), ([1.01] * 8 + [1.05] * 2, 1), ([1.08], 1)):
        made = [piece(value) for value in values]
        monkeypatch.setattr(real_logs, "pieces_of", lambda *_, made=made: made)
        assert real_logs.main() == status
