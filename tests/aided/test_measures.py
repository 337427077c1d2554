"""What is measured at the end of an outage is of its very length, whatever the rate of the log."""

import numpy as np
import pytest

from imubench_pipeline.extensions.aided.runs import (
    Drive,
    Outcome,
    compute_mean_squares,
    predict_root_mean_square,
    schedule_outages,
    select_epochs,
)
from imubench_pipeline.extensions.aided.trajectories import simulate_trajectory


@pytest.mark.parametrize("rate", [10.0, 12.5, 125.0 / 3.0, 119.0 / 3.0, 50.0, 104.0 / 3.0])
@pytest.mark.parametrize("length", [10.0, 10.7, 30.0])
def test_an_outage_is_as_long_as_it_says(rate: float, length: float) -> None:
    drive = Drive(simulate_trajectory("rest", 400.0, rate), schedule_outages(400.0, (length,)))
    # What errs by the time since the last fix, and expects to.
    since = np.zeros(len(drive.times))
    for place in range(1, len(since)):
        since[place] = 0.0 if drive.available[place] else since[place - 1] + drive.period
    errors = np.zeros((2, len(since), 9))
    errors[:, :, 0] = since
    outcome = Outcome(errors, errors**2, np.ones((2, len(since), 6)), 15)
    assert np.sqrt(compute_mean_squares(drive, outcome, "position", length)) == pytest.approx(
        length, rel=2e-3
    )
    assert predict_root_mean_square(drive, outcome, "position", length) == pytest.approx(
        length, rel=2e-3
    )
    assert (select_epochs(drive, length) == ~drive.available).all()
    assert len(drive.of_outages(length)) >= 3
