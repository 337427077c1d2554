from itertools import pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.settings.profile_forms import Surroundings
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.simulate.profiles import profiles_of
from imubench_pipeline.units import UnitError, parse_difference


def profiles(settings: dict, folder: Path = Path()):
    return profiles_of(parse(Surroundings, settings, "board.yaml"), folder)


def test_no_times_have_no_values(tmp_path: Path) -> None:
    (tmp_path / "turn.csv").write_text("time,gyro_z\n0,1\n1,2\n")
    motion, _ = profiles({"motion": {"gyro_z": {"form": "file", "file": "turn.csv"}}}, tmp_path)
    assert motion["gyro_z"](np.empty(0)).shape == (0,)
    assert motion["gyro_z"](np.array([0.5])) == pytest.approx([1.5])


def test_formulas_are_what_they_say_in_si() -> None:
    t = np.array([0.0, 59.0, 60.0, 3600.0, 21600.0])
    motion, _ = profiles(
        {
            "motion": {
                "gyro_z": {
                    "form": "steps",
                    "times": ["0 s", "1 min"],
                    "values": ["0 deg/s", "180 deg/s"],
                },
                "accel_z": "1 g",
            }
        }
    )
    np.testing.assert_allclose(motion["gyro_z"](t), [0, 0, np.pi, np.pi, np.pi])
    np.testing.assert_allclose(motion["accel_z"](t), 9.80665)
    _, day = profiles(
        {
            "temperature": {
                "form": "day_cycle", "mean": "20 degC", "amplitude": "5 degC", "highest": "6 h"
            }
        }
    )  # fmt: skip
    np.testing.assert_allclose(day(t)[[0, 4]], [20.0, 25.0])
    warm = {"form": "warm_up", "start": "293.15 K", "end": "40 degC", "time_constant": "1 h"}
    _, warming = profiles({"temperature": warm | {"begin": "60 s"}})
    found = warming(t)
    np.testing.assert_allclose(found[:3], 20.0)
    assert found[3] == pytest.approx(40 - 20 * np.exp(-3540 / 3600))


def test_a_difference_of_temperatures_has_no_zero() -> None:
    assert parse_difference("5 degC", "temperature") == pytest.approx(5.0)
    assert parse_difference("5 K", "temperature") == pytest.approx(5.0)
    with pytest.raises(UnitError, match="no unit of temperature"):
        parse_difference("5 m", "temperature")


def test_a_sum_is_a_value_and_what_is_added_to_it() -> None:
    t = np.array([0.0, 100.0, 600.0, 21600.0])
    warm = {"form": "warm_up", "start": "26 degC", "end": "298.15 K", "time_constant": "200 s"}
    day = {"form": "day_cycle", "mean": "0 K", "amplitude": "0.4 degC", "highest": "6 h"}
    step = {"form": "steps", "times": ["0 s", "600 s"], "values": ["0 K", "-3 degC"]}
    _, total = profiles({"temperature": {"form": "sum", "parts": [warm, day, step]}})
    expected = 25 + np.exp(-t / 200) + 0.4 * np.cos(2 * np.pi * (t - 21600) / 86400)
    expected[2:] -= 3
    np.testing.assert_allclose(total(t), expected, rtol=1e-12)


def test_a_sum_of_differences_does_not_depend_on_their_unit() -> None:
    t = np.linspace(0.0, 1000.0, 7)

    def total(first: str, added: str) -> np.ndarray:
        parts = [{"form": "constant", "value": value} for value in (first, added)]
        _, found = profiles({"temperature": {"form": "sum", "parts": parts}})
        return found(t)

    np.testing.assert_allclose(total("20 degC", "5 K"), 25.0)
    np.testing.assert_allclose(total("293.15 K", "5 degC"), 25.0)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"temperature": "20 m"}, "temperature"),
        ({"temperature": {"form": "wave"}}, "temperature"),
        ({"motion": {"gyro_w": "1 deg/s"}}, "gyro_w"),
        (
            {"temperature": {"form": "steps", "times": ["1 s", "1 s"], "values": ["1 K", "2 K"]}},
            "ascend",
        ),
        ({"temperature": {"form": "steps", "times": ["1 s"], "values": ["1 K", "2 K"]}}, "as many"),
        (
            {
                "temperature": {
                    "form": "warm_up", "start": "1 K", "end": "2 K", "time_constant": "0 s"
                }
            },
            "time_constant",
        ),
    ],
)  # fmt: skip
def test_a_profile_that_makes_no_sense_is_refused(settings: dict, said: str) -> None:
    with pytest.raises((ConfigError, UnitError), match=said):
        profiles(settings)


@given(
    st.integers(2, 400),
    st.lists(st.integers(1, 90), min_size=1, max_size=30),
    st.integers(0, 2**32 - 1),
)
def test_a_file_is_interpolated_in_blocks_of_any_size(
    tmp_path_factory, rows: int, sizes: list[int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    path = tmp_path_factory.mktemp("series") / "warm.parquet"
    t, v = np.cumsum(rng.uniform(0.01, 3, rows)) - 2, rng.standard_normal(rows)
    pq.write_table(pa.table({"time [min]": t / 60, "gyro_x [deg/s]": v}), path, row_group_size=7)
    motion, _ = profiles({"motion": {"gyro_x": {"form": "file", "file": path.name}}}, path.parent)
    times = np.cumsum(rng.uniform(0, 2, sum(sizes)))
    ends = np.cumsum([0, *sizes])
    parts = [motion["gyro_x"](times[a:b]) for a, b in pairwise(ends)]
    wanted = np.interp(times, t, np.radians(v))
    np.testing.assert_allclose(np.concatenate(parts), wanted, atol=1e-11)
    np.testing.assert_allclose(motion["gyro_x"](times[:3]), wanted[:3], atol=1e-11)  # back


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,temperature\n0,1\n", "no column 'time'"),
        ("time,warmth\n0,1\n", "no column 'temperature'"),
        ("time,temperature [m]\n0,1\n", "no unit of temperature"),
        (
            "time,temperature\n0,1\n0,2\n",
            "ascend in row 2: 0 s after 0 s; expected each row later .*; put the rows in order",
        ),
        ("time,temperature\n0,1\n1,\n", "missing in row 2; expected one in each row"),
        ("time [s];temperature [degC]\n0;1\n", "names 'time .*'; expected commas between columns"),
        ("time;temperature\n0,5;1,5\n1,5;2,5\n", "; expected commas .*, points before decimals"),
        ("time,temperature\n0,1\n1,x\n", "cannot be read"),
        ("time,temperature\n", "no rows"),
        ("", "cannot be read"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "warm.csv").write_text(text)
    settings = {"temperature": {"form": "file", "file": "warm.csv"}}
    with pytest.raises(ConfigError, match=said):
        _, warm = profiles(settings, tmp_path)
        warm(np.array([0.0, 5.0]))
