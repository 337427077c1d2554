"""Published estimates beside what the noise of the same source allows."""

import math

import pytest

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.earth_rate.published import (
    compute_allowed_sigmas,
    judge_error,
    thin,
)
from imubench_pipeline.extensions.earth_rate.simulation import (
    ASSUMED_LATITUDE,
    PAPER_MODEL,
    design_paper_run,
)
from imubench_pipeline.run.plan import Plan


@pytest.mark.parametrize(
    ("minutes", "published", "off"),
    [(120, 0.004396, 1.3), (12, 0.0004846, -6.9), (25, 0.002483, -4.6), (60, -0.000193, -18.6),
     (13, 0.001132, -6.0)],
)  # fmt: skip
def test_the_runs_of_the_paper(minutes: float, published: float, off: float) -> None:
    allowed = compute_allowed_sigmas(design_paper_run(minutes), PAPER_MODEL)
    found = (math.radians(published) - EARTH_RATE) / allowed.sigma
    assert found == pytest.approx(off, abs=0.06)
    assert judge_error(found) == ("within the noise" if minutes == 120 else "beyond the noise")


def test_white_noise_is_the_least() -> None:
    found = compute_allowed_sigmas(design_paper_run(12.0), PAPER_MODEL)
    # 24 dwells of 28 s.
    white = math.radians(0.0122) / math.sqrt(24 * 28.0) / math.cos(ASSUMED_LATITUDE)
    assert found.white == pytest.approx(white)
    assert found.white < found.sigma_filter < found.sigma


def test_the_demonstration_has_the_runs_of_the_paper() -> None:
    plan = Plan({})
    runs = [name for sensor, name in plan.of_experiment("two_position") if sensor == "sirrs01_03"]
    assert runs == ["sim_run_1", "sim_run_2", "sim_run_3", "sim_run_4"]
    assert plan.static_of("sirrs01_03") == ["sim_published", "sim_pointing_east"]
    calibrated = [
        name
        for sensor, name in plan.of_experiment("rate_table", "positions", "pointing")
        if sensor == "sirrs01_03"
    ]
    assert calibrated == ["sim_rate_table", "sim_pointing_east"]


def test_a_course_is_shown_on_few_points_with_both_ends() -> None:
    assert list(thin(5)) == [0, 1, 2, 3, 4]
    some = list(thin(100_000))
    assert some[0] == 0 and some[-1] == 99_999 and 300 < len(some) <= 400
    assert some == sorted(set(some)) and some[1] <= 2
