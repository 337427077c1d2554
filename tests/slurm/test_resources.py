from pathlib import Path

import pytest
import yaml

from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.resources import (
    Extent,
    compute_resources,
    estimate_text_size,
    make_resource_functions,
)
from tests.conftest import PROJECT
from tests.workflow.project import put_log, put_sensor
from tests.workflow.rules import costs

MB = 1_000_000

# MB and s that the steps took (docs/how-to/cluster.md): millions of samples, channels.
MEASURED = {
    (8.64, 6): {
        "simulate": (217, 9),
        "ingest": (312, 7),
        "allan": (351, 11),
        "estimate": (271, 7),
        "reconstruct": (277, 26),
    },
    (60, 1): {
        "ingest": (277, 9),
        "allan": (658, 3),  # overlap: full
        "estimate": (308, 4),
        "reconstruct": (676, 24),
    },
    (20, 3): {
        "ingest": (232, 6),
        "allan": (509, 3),  # overlap: full
        "estimate": (278, 7),
        "reconstruct": (364, 23),
    },
}
OF_A_HUNDRED = {"tables": (241, 2), "figures": (361, 9), "exports": (219, 1), "report": (289, 8)}
BESIDE = 550  # MB of the two Snakemakes on the node and of the process that forks


@pytest.mark.parametrize("size", MEASURED)
def test_a_recording_gets_more_than_was_measured(size: tuple[float, int]) -> None:
    for rule, (memory, seconds) in MEASURED[size].items():
        given = compute_resources(costs()[rule], Extent(*size))
        assert memory + BESIDE < given["mem_mb"] < 4 * (memory + BESIDE)
        assert 5 * seconds < 60 * given["runtime"] < 1200


def test_a_hundred_recordings_get_more_than_was_measured() -> None:
    for rule, (memory, seconds) in OF_A_HUNDRED.items():
        given = compute_resources(costs()[rule], Extent(recordings=100))
        assert memory + BESIDE < given["mem_mb"] < 3 * (memory + BESIDE)
        assert 5 * seconds < 60 * given["runtime"] < 1200


def test_every_step_asks_for_more_of_a_larger_log_and_when_it_is_tried_again() -> None:
    grows = set()
    for rule in costs():
        first, second = (
            compute_resources(costs()[rule], Extent(10, 3, 10), attempt) for attempt in (1, 2)
        )
        larger = compute_resources(costs()[rule], Extent(100, 3, 1000))
        assert second == {what: 2 * amount for what, amount in first.items()}
        assert larger["mem_mb"] >= first["mem_mb"] and larger["runtime"] >= first["runtime"]
        grows |= {rule} if larger != first else set()
    assert set(costs()) - grows == {"datasheet", "catalogue"}


def test_packed_samples_count_for_more(tmp_path: Path) -> None:
    for name, factor in {"a.csv": 1, "a.npy": 3, "a.csv.gz": 6}.items():
        (tmp_path / name).write_bytes(b"x" * 1000)
        assert estimate_text_size(tmp_path / name) == factor * 1000
    assert estimate_text_size(tmp_path / "no such file") == 0


def test_the_jobs_of_a_plan_ask_for_what_their_own_log_needs(tmp_path: Path) -> None:
    put_sensor(tmp_path / "sensors/one.yaml")  # of two channels
    put_log(tmp_path / "logs/one/a.csv", 1, samples=100)
    put_log(tmp_path / "logs/unknown/a.csv", 1, samples=100)
    (tmp_path / "logs/one/b").mkdir()
    for part in ("gyro.csv", "accel.csv"):
        with (tmp_path / "logs/one/b" / part).open("wb") as file:
            file.truncate(350 * MB)
    made = {"sensor": "one", "recording": "sim_a", "duration": "24 h", "rate": "100 Hz", "seed": 1}
    channels = {"gyro_x": {"N": "0.3 deg/sqrt(h)"}, "accel_x": {"N": "60 ug/sqrt(Hz)"}}
    simulated = {"recordings": [made | {"source": "test", "channels": channels}]}
    (tmp_path / "simulated.yaml").write_text(yaml.safe_dump(simulated))
    config = yaml.safe_load((PROJECT / "config/config.yaml").read_text())
    paths = {name: str(tmp_path / name) for name in ("logs", "sensors", "results")}
    plan = Plan(config | paths | {"simulated": str(tmp_path / "simulated.yaml")})
    cost = costs()["reconstruct"]
    functions = make_resource_functions(plan)(cost)

    def given(name: str, attempt: int = 1, sensor: str = "one") -> dict[str, int]:
        wildcards = {"sensor": sensor, "recording": name}
        return {w: f(wildcards, attempt) for w, f in functions.items()}

    assert given("a") == given("a", sensor="unknown") == compute_resources(cost, Extent(0, 2))
    assert given("b") == compute_resources(cost, Extent(50, 2))
    assert given("sim_a", 2) == compute_resources(cost, Extent(8.64, 2), 2)
    assert (
        make_resource_functions(plan)(costs()["report"])["runtime"]({}, 1)
        == compute_resources(costs()["report"], Extent(recordings=4))["runtime"]
    )
