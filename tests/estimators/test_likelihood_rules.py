"""What a fit by likelihood is made of, one by one."""

from __future__ import annotations

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import FAMILY, Estimate, JointDraws, Parameter
from imubench_pipeline.estimators.likelihood import _with_one_more
from imubench_pipeline.estimators.rows import make_draw_rows, make_estimate, make_parameter_rows
from imubench_pipeline.estimators.whittle import Maximum, Terms, make_noise_model
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.tables.keys import Key


@pytest.mark.parametrize(
    ("terms", "wider"),
    [
        (Terms("N"), [Terms("NK"), Terms("NF"), Terms("N", 1)]),
        (Terms("QNK"), [Terms("QNFK"), Terms("QNK", 1)]),
        (Terms("N", 1), [Terms("NK", 1)]),
        (Terms("NF"), [Terms("NFK")]),
        (Terms("NK", 0, True), [Terms("NFK"), Terms("NK", 1)]),
        (Terms("NFK"), []),
    ],
)
def test_one_more_is_a_walk_or_a_bias_instability(terms: Terms, wider: list[Terms]) -> None:
    assert _with_one_more(terms) == wider


def test_each_term_of_a_draw_has_its_component() -> None:
    first = np.zeros((2, len(FAMILY)))
    first[:, FAMILY.index("N")] = 1.0, 2.0
    further = np.array([[[3.0, 30.0], [4.0, 40.0]], [[5.0, 50.0], [0.0, np.nan]]])
    estimate = Estimate("likelihood", {}, draws=JointDraws(first, further))
    rows = list(make_draw_rows(Key("s", "r", "gyro_x"), estimate))
    found = [
        (row["draw"], row["component"], row.get("N"), row.get("B"), row.get("T_B")) for row in rows
    ]
    assert found == [
        (0, 1, 1.0, None, None),
        (0, 2, None, 3.0, 30.0),
        (0, 3, None, 4.0, 40.0),
        (1, 1, 2.0, None, None),
        (1, 2, None, 5.0, 50.0),
    ]


def test_rows_stand_for_an_estimate() -> None:
    one, other = Parameter(1.0, "ok", None, 0.5, 2.0, 9.0), Parameter(None, "absent", "none")
    estimate = Estimate(
        "likelihood",
        {"N": one, "B": one, "T_B": other},
        [{"B": one, "T_B": one}, {"B": other, "T_B": one}],
        [{"amplitude": one, "frequency": one}, {"amplitude": other, "frequency": one}],
        {"B_curve": other, "sigma_min": one},
    )
    rows = list(make_parameter_rows(Key("s", "r", "accel_x"), estimate, recommended=True))
    assert [row["component"] for row in rows] == [1, 1, 1, 1, 1, 2, 2, 3, 3, 1, 1, 2, 2]
    assert make_estimate("likelihood", rows) == estimate


def test_flicker_noise_comes_first_and_processes_by_their_times() -> None:
    times = np.array([3.0, 70.0])
    powers = np.array([1.0, 4.0, 9.0, 16.0])
    two = make_noise_model(Maximum(Terms("NK", 2), powers, times, 0.5, 0.0))
    assert two == NoiseModel(N=1.0, K=2.0, B=3.0, T_B=3.0, R=0.5, further=[GaussMarkov(4.0, 70.0)])
    flicker = make_noise_model(Maximum(Terms("NF", 2), powers, times, 0.0, 0.0))
    further = [GaussMarkov(3.0, 3.0), GaussMarkov(4.0, 70.0)]
    assert flicker == NoiseModel(N=1.0, B=2.0, further=further)
    none = make_noise_model(Maximum(Terms("QN", 2), powers * [1, 1, 1, 0], times, 0.0, 0.0))
    assert none == NoiseModel(Q=1.0, N=2.0, B=3.0, T_B=3.0, further=[])
