"""Simulated recordings of a gyro that is turned."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from imubench_pipeline.extensions.earth_rate.earth_rotation import make_earth_rate_tables
from imubench_pipeline.extensions.earth_rate.turning import find_turning
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.recording import open_channel_logs
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.steps.simulate import write_simulated
from tests.earth_rate.recordings import PRINTED, SENSOR

TURNS: dict[str, Any] = {
    "latitude": "-23.3 deg",
    "dwell": "30 s",
    "first": "south",
    "transient": "4 deg/s",
    "last": ["2 min"],
    "assumed": ["latitude"],
    "published": [
        {"where": "section 6", "printed": "0.0004846 deg/s"},
        {"where": "section 6", "printed": "15 deg/h", "part": "last 2 min"},
    ],
}
ENTRY: dict[str, Any] = {
    "sensor": "s",
    "recording": "sim_run",
    "duration": "12 min",
    "rate": "32 Hz",
    "seed": 1,
    "source": "a paper",
    "channels": {"gyro_x": {"N": "0.0122 deg/sqrt(s)", "bias": "0.1 deg/s"}},
    "two_position": TURNS,
}


def plan_of(tmp_path: Path, entry: dict[str, Any]) -> Plan:
    (tmp_path / "sensors").mkdir()
    (tmp_path / "simulated.yaml").write_text(yaml.safe_dump({"recordings": [entry]}))
    log = SENSOR["log"] | {"position": {"column": 2}}
    sensor = SENSOR | {"datasheet": PRINTED, "log": log}
    (tmp_path / "sensors/s.yaml").write_text(yaml.safe_dump(sensor))
    folders = {name: str(tmp_path / name) for name in ("logs", "sensors", "results")}
    return Plan(folders | {"simulated": str(tmp_path / "simulated.yaml")})


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, Path]:
    """A simulated recording as the ingest keeps it."""
    tmp_path = tmp_path_factory.mktemp("simulated")
    plan = plan_of(tmp_path, ENTRY)
    given = json.loads(plan.simulated_settings("s", "sim_run"))
    recording = SimulatedRecording.model_validate(given["recording"])
    write_simulated(recording, LogFormat.model_validate(given["log"]), tmp_path / "log")
    kept = tmp_path / "kept"
    settings = plan.ingest_settings("s", "sim_run")
    quality = ingest_as_planned(tmp_path / "log", settings, "s", "sim_run", kept)
    quality.write(kept / "quality.json")
    assert (quality.recording.status, quality.recording.kind) == ("ok", "two_position")
    assert quality.recording.simulated and quality.findings == []
    return plan, kept


def test_it_is_turned_by_the_clock(made: tuple[Plan, Path]) -> None:
    (log,) = open_channel_logs(made[1]).values()
    samples = np.concatenate(list(log.blocks()))
    assert len(samples) == 720 * 32
    found = find_turning(samples, 32.0, 30.0, first_sense=-1)
    assert len(found.turns) == 23
    np.testing.assert_allclose(
        [turn.time for turn in found.turns], 29.0 + 30.0 * np.arange(23), atol=0.5
    )
    peaks = np.degrees([turn.peak or 0.0 for turn in found.turns])
    assert 2.5 < peaks.min() < peaks.max() < 5.6


@pytest.mark.release
def test_what_is_published_stands_beside_what_noise_allows(made: tuple[Plan, Path]) -> None:
    plan, kept = made
    settings = plan.experiment_settings("s", "sim_run", "earth_rate")
    found = make_earth_rate_tables(kept, [], "s", "sim_run", settings)
    rate = {(row["part"], row["method"]): row["value"] for row in found["earth_rate"]}
    whole, last = found["earth_rate_published"]
    assert whole["published"] == pytest.approx(np.radians(0.0004846))
    assert whole["duration"] == 720.0 and last["duration"] == 120.0
    assert whole["verdict"] == "beyond the noise" and last["verdict"] == "within the noise"
    assert whole["assumed"] == "latitude"
    assert whole["simulated"] == rate["whole", "pairs"]
    assert last["simulated_filter"] == rate["last 2 min", "filter"]
    assert abs(whole["simulated"] - whole["truth"]) < 3.0 * whole["sigma"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"latitude": None}, "two_position: latitude is missing"),
        ({"transient": "4 s"}, "two_position.transient: found '4 s'"),
        ({"published": [{"where": "x", "printed": "3 m"}]}, "printed: found '3 m'"),
        (
            {"published": [{"where": "x", "printed": "1 deg/h", "part": "last 9 min"}]},
            "part is 'last 9 min'; expected one of",
        ),
        (
            {"channel": "gyro_y"},
            "two_position.channel: found 'gyro_y'; expected a gyro of the log: gyro_x",
        ),
    ],
)
def test_turns_that_cannot_be_simulated_name_file_and_key(
    tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    turns = {key: value for key, value in (TURNS | changes).items() if value is not None}
    with pytest.raises(ConfigError) as error:
        plan_of(tmp_path, ENTRY | {"two_position": turns})
    assert "simulated.yaml: recordings.0" in str(error.value) and said in str(error.value)
