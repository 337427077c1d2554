import math
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.extensions.fusion.board import Board
from imubench_pipeline.extensions.fusion.equivalence import equivalence_rows
from imubench_pipeline.extensions.fusion.fusion import yield_fusion_rows
from imubench_pipeline.extensions.fusion.prediction import fused_allan
from imubench_pipeline.navigation.ratios import (
    ComparedChannel,
    TemperaturePart,
    compute_number_needed,
)
from imubench_pipeline.settings.config import FusionSettings
from imubench_pipeline.tables.files import build
from tests.fusion.boards import FLICKER
from tests.report.tables import joined, recording_rows, rejected_rows

HOURS = 3600.0


def known(spread: float = 1.1, **values: float) -> dict[str, Parameter]:
    return {
        name: Parameter(value, lower=value / spread, upper=value * spread)
        for name, value in values.items()
    }


def candidate(sensor: str, parameters: dict[str, Parameter], **about: Any) -> ComparedChannel:
    given = {"recording": "r", "channel": "gyro_x", "simulated": False, "duration": 10 * HOURS}
    return ComparedChannel(
        sensor, estimate=Estimate("likelihood", parameters), **{**given, **about}
    )


def rows_of(
    *candidates: ComparedChannel,
    tau: float = 10.0,
    common: dict[str, float] | None = None,
    draws: int = 400,
) -> dict[tuple[str, str], dict[str, Any]]:
    rows = equivalence_rows(candidates, [tau], common or {}, longest=1 / 9, draws=draws, seed=1)
    table = build("fusion", rows).to_pylist()
    return {(row["sensor"], row["other"]): row for row in table}


def test_what_temperature_adds_is_not_averaged_away() -> None:
    tau = np.array([1.0, 100.0])
    warm = TemperaturePart(tau, np.array([1e-6, 1e-4]), relative_error=0.05)
    assert warm.variance(10.0) == pytest.approx(1e-10)  # straight lines on logarithmic axes
    noise = known(N=3e-5 * math.sqrt(10.0))  # 9e-10 at 10 s
    good = candidate("good", known(N=math.sqrt(4e-10 * 10.0)))
    row = rows_of(candidate("bad", noise, temperature=warm), good)["bad", "good"]
    assert row["adev"] == pytest.approx(math.sqrt(1e-9))
    assert (row["common_share"], row["temperature_share"]) == pytest.approx((0.1, 0.1))
    assert row["n"] == pytest.approx(9.0 / (4.0 - 1.0))
    assert row["lower"] < row["n"] < row["upper"]
    better = candidate("good", known(N=math.sqrt(0.9e-10 * 10.0)))
    row = rows_of(candidate("bad", noise, temperature=warm), better)["bad", "good"]
    assert not row["reachable"] and "common part" in "; ".join(row["reasons"])


def test_a_run_takes_temperature_from_its_tables() -> None:
    made = joined(recording_rows("one", temperature="followed"), recording_rows("two"))
    rows = build(
        "fusion", yield_fusion_rows(made, FusionSettings(tau=["100 s"], draws=100))
    ).to_pylist()
    (row,) = (row for row in rows if row["sensor"] == "one")
    # Three quarters of what was measured, beside the model that the tables have of the rest.
    added = 0.75 * row["other_adev"] ** 2
    assert row["floor"] == pytest.approx(math.sqrt(added), rel=0.02)
    assert row["temperature_share"] == pytest.approx(row["common_share"])
    assert row["adev"] == pytest.approx(row["other_adev"], rel=0.02)


def test_without_a_common_part_it_is_the_ratio_of_the_variances() -> None:
    assert compute_number_needed(9.0, 0.0, [1.0, 18.0]) == pytest.approx([9.0, 0.5])


def test_a_floor_takes_more_and_at_last_no_number() -> None:
    assert compute_number_needed(9.0, 1.0, [10.0, 2.0, 1.0, 0.5]).tolist() == [
        1.0,
        9.0,
        math.inf,
        math.inf,
    ]


@pytest.mark.parametrize("common", [{}, {"N": 0.02, "B": 0.01, "K": 0.01}])
def test_that_many_on_a_board_reach_the_better_sensor(common: dict[str, float]) -> None:
    wanted = float(FLICKER.allan_variance(30.0)) / 7.3
    board = Board.alike(FLICKER, 1, 1000.0, common)
    own, floor = (float(part[0]) for part in board.allan_parts([30.0]).of_sum(np.ones(1)))
    n = float(compute_number_needed(own, floor, wanted))
    assert n >= 7.3 * (1 - 1e-9)
    for number, enough in ((math.floor(n), False), (math.ceil(n), True)):
        of_board = Board.alike(FLICKER, number, 1000.0, common)
        found = fused_allan(of_board, np.full(number, 1.0 / number), [30.0]).variance[0]
        assert bool(found <= wanted) == enough


def test_a_pair_is_compared_both_ways() -> None:
    rows = rows_of(candidate("a", known(N=3e-4)), candidate("b", known(N=1e-4)))
    assert set(rows) == {("a", "b"), ("b", "a")}
    one = rows["a", "b"]
    assert one["n"] == pytest.approx(9.0)
    assert one["adev"] == pytest.approx(3e-4 / math.sqrt(10))
    assert (one["reachable"], one["reasons"], one["common_share"]) == (True, [], 0.0)
    assert rows["b", "a"]["n"] == pytest.approx(1 / 9)
    # log n is normal with 2 sqrt(2) times the spread of log N.
    assert one["upper"] / 9 == pytest.approx(1.1 ** (2 * math.sqrt(2)), rel=0.1)
    assert 9 / one["lower"] == pytest.approx(1.1 ** (2 * math.sqrt(2)), rel=0.1)


def test_where_the_common_part_is_a_floor_no_number_is_enough() -> None:
    poor, good = candidate("a", known(N=3e-4, K=1e-5)), candidate("b", known(N=1e-4))
    short = rows_of(poor, good, tau=1.0, common={"K": 0.5})["a", "b"]
    assert short["reachable"] and 9.0 < short["n"] < 10.0
    long = rows_of(poor, good, tau=1000.0, common={"K": 0.5})["a", "b"]
    assert (long["n"], long["lower"], long["upper"]) == (None, None, None)
    assert long["reachable"] is False
    reason = "no number of them reaches it at 1000 s, because the common part remains"
    assert long["reasons"] == [reason]
    assert long["floor"] == pytest.approx(1e-5 * math.sqrt(1000 / 6))
    assert long["common_share"] == pytest.approx(0.5, abs=0.01)


def test_near_a_floor_the_upper_limit_is_open() -> None:
    poor, good = candidate("a", known(1.5, N=1e-3)), candidate("b", known(N=3.3e-4))
    row = rows_of(poor, good, common={"N": 0.1})["a", "b"]
    assert row["n"] is not None and row["upper"] is None and row["lower"] < row["n"]
    assert (
        "; ".join(row["reasons"]) == "within the limits of the parameters, no number may reach it"
    )


def test_beyond_what_the_logs_tell_there_is_no_number() -> None:
    short = candidate("a", known(N=3e-4), duration=90.0)
    row = rows_of(short, candidate("b", known(N=1e-4)), tau=11.0)["a", "b"]
    assert (row["n"], row["adev"]) == (None, None) and row["other_adev"] is not None
    assert "; ".join(row["reasons"]) == "the logs of a tell tau up to 10 s alone"


def test_a_parameter_that_is_not_known_leaves_no_number_where_it_matters() -> None:
    K = Parameter(None, "not_identified", lower=1e-6, upper=1e-5, fitted=3e-6)
    vague = {**known(N=3e-4), "K": K}
    other = candidate("b", known(N=1e-4))
    short = rows_of(candidate("a", vague), other, tau=1.0)["a", "b"]
    assert short["n"] == pytest.approx(9.0, rel=1e-3) and not short["reasons"]
    long = rows_of(candidate("a", vague), other, tau=1000.0)["a", "b"]
    assert long["n"] is None
    assert "; ".join(long["reasons"]) == "in recording a/r, K of gyro x is not determined"
    assert long["upper"] > 1.5 * long["lower"] > 9.0


def test_an_unknown_correlation_time_is_a_matter_of_its_process() -> None:
    vague = {**known(N=3e-4, B=1e-4), "T_B": Parameter(None, "at_bound", fitted=100.0)}
    other = candidate("b", known(N=1e-4))
    assert rows_of(candidate("a", vague), other, tau=1.0)["a", "b"]["n"] is not None
    row = rows_of(candidate("a", vague), other, tau=100.0)["a", "b"]
    assert "; ".join(row["reasons"]) == "in recording a/r, T_B of gyro x is bounded"


def test_the_median_measured_channel_answers() -> None:
    channels = [
        candidate("a", known(N=N), channel=f"gyro_{axis}", recording=recording, simulated=made)
        for N, axis, recording, made in (
            (1e-4, "x", "one", False),
            (9e-4, "y", "one", False),
            (3e-4, "z", "one", False),
            (5e-4, "x", "two", False),
            (8e-3, "x", "sim_p", True),
        )
    ]
    made = candidate("b", known(N=1e-4), recording="sim_q", simulated=True)
    row = rows_of(*channels, made)["a", "b"]
    assert (row["recording"], row["channel"], row["simulated"]) == ("two", "gyro_x", False)
    assert (row["other_recording"], row["other_simulated"]) == ("sim_q", True)


def test_what_has_no_noise_model_has_no_number() -> None:
    nothing = {"N": Parameter(None, "not_shown")}
    row = rows_of(candidate("a", nothing), candidate("b", known(N=1e-4)))["a", "b"]
    assert (row["n"], "; ".join(row["reasons"])) == (None, "no noise model of a")


def test_quantities_are_not_mixed() -> None:
    gyro = candidate("a", known(N=1e-4))
    accel = candidate("b", known(N=1e-4), channel="accel_x")
    assert rows_of(gyro, accel) == {}


def test_it_does_not_matter_what_else_is_compared() -> None:
    a, b = candidate("a", known(N=3e-4)), candidate("b", known(N=1e-4))
    alone = rows_of(a, b)["a", "b"]
    assert rows_of(candidate("c", known(N=2e-4)), b, a)["a", "b"] == alone


def test_the_tables_of_a_run_give_its_rows() -> None:
    made = joined(recording_rows("one"), recording_rows("two"), rejected_rows("three"))
    how = FusionSettings(tau=("1 s", "100 s", "1 h"), draws=100)
    rows = build("fusion", yield_fusion_rows(made, how)).to_pylist()
    assert [(row["sensor"], row["other"], row["tau"]) for row in rows] == [
        (a, b, tau) for tau in (1.0, 100.0, 3600.0) for a, b in (("one", "two"), ("two", "one"))
    ]
    assert rows[0]["n"] == pytest.approx(1.0)
    assert rows[0]["lower"] < 1.0 < rows[0]["upper"]
    assert rows[-1]["n"] is None and "tell tau up to 800 s alone" in "; ".join(rows[-1]["reasons"])
