"""How far the limits of a noise model let the standard deviations of the Earth's rate go."""

import math
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.earth_rate.bound import (
    compute_cramer_rao_bounds,
    compute_final_bound,
)
from imubench_pipeline.extensions.earth_rate.published import compute_sigma_ranges
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.tables.files import write
from imubench_pipeline.tables.keys import Key
from tests.earth_rate.recordings import put, put_at_rest, run, turned_log
from tests.earth_rate.runs import PAPER

RUN = Experiment.regular(dwell=28.0, turning=2.0, dwells=12, rate=32.0, latitude=0.4)
BLOCKS = RUN.blocks(224)


@pytest.mark.parametrize("bias", [math.inf, 1e-4])
def test_the_bound_is_that_of_all_blocks_and_of_the_filter(bias: float) -> None:
    assert compute_final_bound(BLOCKS, PAPER, bias) == pytest.approx(
        compute_cramer_rao_bounds(BLOCKS, PAPER, bias)[-1]
    )
    if math.isfinite(bias):
        filtered = RateFilter(BLOCKS, PAPER, turn_on_bias=bias).rate_sigma[-1]
        assert compute_final_bound(BLOCKS, PAPER, bias) == pytest.approx(filtered, rel=1e-6)


def test_of_white_noise_sigma_goes_as_its_density() -> None:
    model = NoiseModel(N=2e-4)
    drawn = [NoiseModel(N=2e-4 * factor) for factor in np.linspace(0.8, 1.2, 41)]
    for method, found in compute_sigma_ranges(BLOCKS, drawn, None).items():
        sigma = compute_final_bound(BLOCKS, model)
        if method in ("filter", "smoother"):
            assert found["sigma_lower"] == pytest.approx(0.81 * sigma, rel=1e-6)
            assert found["sigma_upper"] == pytest.approx(1.19 * sigma, rel=1e-6)
        assert found["sigma_upper"] / found["sigma_lower"] == pytest.approx(1.19 / 0.81)


def test_two_dwells_have_no_triples() -> None:
    two = Experiment.regular(dwell=28.0, turning=2.0, dwells=2, rate=32.0, latitude=0.4)
    found = compute_sigma_ranges(two.blocks(224), [PAPER], None)
    assert set(found) == {"pairs", "filter", "smoother"}
    assert compute_sigma_ranges(BLOCKS, [], None) == {}


def put_with_limits(folder: Path, spread: float) -> Path:
    """Keep a static recording whose estimates have limits."""
    put_at_rest(folder)
    known = {
        name: Parameter(value, lower=value / spread, upper=value * spread)
        for name in ("N", "B", "T_B", "K")
        if (value := getattr(PAPER, name))
    }
    key = Key("s", folder.name, "gyro_x")
    rows = list(make_parameter_rows(key, Estimate("likelihood", known), recommended=True))
    write("parameters", rows, folder / "parameters.parquet")
    write("draws", [], folder / "draws.parquet")
    return folder


@pytest.mark.release
def test_a_run_says_how_sure_its_sigma_is(tmp_path: Path) -> None:
    turned = put(tmp_path / "run", turned_log())
    widths = []
    # What is predicted takes longest, and is not looked at.
    asked = {"goals": (1.0,), "run_time": "2 min"}
    for spread in (1.1, 2.0):
        rest = put_with_limits(tmp_path / f"night{spread}", spread)
        rows = {row["method"]: row for row in run(turned, [rest], asked=asked)["earth_rate"]}
        for method in ("pairs", "triples", "filter", "smoother"):
            row = rows[method]
            assert row["sigma_lower"] < row["sigma"] < row["sigma_upper"]
        assert rows["known_rate"]["sigma_lower"] is None
        widths.append(rows["filter"]["sigma_upper"] / rows["filter"]["sigma_lower"])
    # The limits of each parameter are apart by 4 at most; 60 draws give their ends to a fifth.
    assert 1.0 < widths[0] < widths[1] < 1.2 * 4.0
    plain = run(turned, [put_at_rest(tmp_path / "plain")], asked=asked)["earth_rate"]
    filtered = next(row for row in plain if row["method"] == "filter")
    assert filtered["sigma_lower"] == filtered["sigma_upper"] == pytest.approx(filtered["sigma"])
