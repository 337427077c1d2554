"""A project with many short recordings, to run it in other places than on this computer's disk."""

import os
from pathlib import Path

from tests.workflow.project import Project, linked, put_bad_logs, put_log, put_sensor

RECORDINGS = int(os.environ.get("IMUBENCH_TEST_RECORDINGS", "200"))
SENSORS = 10
SETTINGS = ['reconstruction={"seed": 7}', 'estimate={"methods": ["weighted"]}']


def put_many(folder: Path) -> None:
    """Write the sensor files and the logs; three further logs cannot be used."""
    for number in range(SENSORS):
        put_sensor(folder / f"sensors/sensor_{number}.yaml")
    for number in range(RECORDINGS):
        sensor, night = number % SENSORS, number // SENSORS
        put_log(folder / f"logs/sensor_{sensor}/night_{night:03d}.csv", number, samples=3000)
    put_bad_logs(folder / "logs/sensor_0")


def run_local(folder: Path) -> Project:
    """Run the project on this computer's disk."""
    project = Project(folder, folder / "local/results", linked(folder / "local/place"), SETTINGS)
    done = project.run("report", time_limit=3600)
    assert done.returncode == 0, done.stdout + done.stderr
    assert len(project.table("recordings")) == RECORDINGS + 3
    return project


def read_tables(project: Project) -> dict[str, bytes]:
    """Return the content of each table of all sensors."""
    return {path.name: path.read_bytes() for path in (project.results / "tables").iterdir()}
