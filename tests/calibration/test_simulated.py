"""Simulated recordings of a gyro on a rate table, and at rest where it points known."""

import json
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.extensions.calibration.calibration import make_calibration_tables
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.steps.simulate import write_simulated
from tests.calibration.recordings import STEPS, UP, by_parameter
from tests.earth_rate.test_simulated_turns import ENTRY, plan_of

PLAIN = {key: value for key, value in ENTRY.items() if key != "two_position"}
TABLE = {"steps": STEPS, "axis": UP, "scale_factor": 0.998}
LOST = {"latitude": "45 deg", "true_heading": "180 deg"}


@pytest.mark.parametrize(
    ("experiment", "told"),
    [
        ({"rate_table": TABLE}, ("bias", "scale_factor", "quadratic", "asymmetry")),
        ({"pointing": LOST}, ("bias",)),
    ],
)
def test_the_truth_lies_in_the_limits(
    experiment: dict[str, Any], told: tuple[str, ...], tmp_path: Path
) -> None:
    plan = plan_of(tmp_path, PLAIN | experiment)
    assert plan.of_experiment("rate_table", "positions", "pointing") == [("s", "sim_run")]
    given = json.loads(plan.simulated_settings("s", "sim_run"))
    made = SimulatedRecording.model_validate(given["recording"])
    folder = plan.recordings["s", "sim_run"].path
    write_simulated(made, LogFormat.model_validate(given["log"]), folder)
    kept = tmp_path / "kept"
    quality = ingest_as_planned(folder, plan.ingest_settings("s", "sim_run"), "s", "sim_run", kept)
    quality.write(kept / "quality.json")
    settings = plan.experiment_settings("s", "sim_run")
    found = make_calibration_tables(kept, [], "s", "sim_run", settings)["calibration"]
    rows = by_parameter([dict(row) for row in found if row["status"] == "ok"])
    for name in told:
        assert rows[name]["lower"] < rows[name]["truth"] < rows[name]["upper"], name


@pytest.mark.parametrize(
    ("experiment", "said"),
    [
        ({"rate_table": {"axis": UP}}, "rate_table: steps is missing; expected the steady rates"),
        ({"rate_table": TABLE, "pointing": LOST}, "found rate_table and pointing; expected one"),
        ({"pointing": LOST | {"channel": "gyro_z"}}, "pointing.channel: found 'gyro_z'"),
    ],
)
def test_what_cannot_be_simulated_says_why(
    experiment: dict[str, Any], said: str, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError) as error:
        plan_of(tmp_path, PLAIN | experiment)
    assert said in str(error.value)
