"""The plan and the ingest of a run, in this process, with faults at any point of them."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.processes import Job, Processes, StepError
from imubench_pipeline.run.resources import Limit
from imubench_pipeline.run.scripts import Scripts
from imubench_pipeline.run.sealing import digest_settings, find_unsound_jobs, seal_outputs
from imubench_pipeline.steps.ingest import write_recording
from imubench_pipeline.tables.failures import describe_error
from imubench_pipeline.tables.seals import name_place
from tests.workflow.project import put_sensor

OUTPUTS = ("quality.json", "envelope.parquet", "histogram.parquet")


class KilledError(BaseException):
    """Stands for a signal that ends a run wherever it is."""


class DiskFullError(Exception):
    """A run stopped because a disk was full."""


class Params(dict[str, Any]):
    """Parameters of a job, as Snakemake has them."""

    def __getattr__(self, name: str) -> Any:
        return self[name]


class InThisProcess(Processes):
    """Runs the ingest here, so that a fault can be placed in it."""

    def run(self, job: Job, seconds: float | None = None) -> None:
        folder = Path(job.output[0]).parent
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with seal_outputs(job):
                write_recording(
                    Path(job.params.source),
                    job.params.settings,
                    *(job.wildcards[name] for name in ("sensor", "recording")),
                    folder,
                )
        except Exception as error:
            if isinstance(error, OSError) and error.errno == 28:
                raise StepError("ingest.py failed") from error
            raise StepError("ingest.py failed", "error", describe_error(error)) from error


class Project:
    """A drop zone of the sensor ``s``, and the results of runs on it."""

    def __init__(self, folder: Path, results: str = "results") -> None:
        self.folder = folder
        self.logs = folder / "logs"
        self.results = folder / results
        self._attempts: dict[str, int] = {}
        (self.logs / "s").mkdir(parents=True, exist_ok=True)
        put_sensor(folder / "sensors/s.yaml")

    def plan(self) -> Plan:
        """Plan a run."""
        places = {name: str(self.folder / name) for name in ("logs", "sensors")}
        return Plan({**places, "results": str(self.results), "simulated": "false"})

    def run(self) -> list[str]:
        """Ingest what a run would ingest now; return the recordings."""
        plan = self.plan()
        settings = {
            key: {"source": str(log.path), "settings": plan.ingest_settings(*key), "code": "x"}
            for key, log in plan.recordings.items()
        }
        places = {name_place("ingest", *key): key for key in settings}
        digests = {place: digest_settings(settings[key]) for place, key in places.items()}
        changed = set(find_unsound_jobs(self.results, digests))
        scripts = Scripts(plan.faults, lambda *_: Limit(10**9, 60.0, ""))
        scripts._processes = InThisProcess()
        done = []
        for place, key in places.items():
            attempt = plan.attempt("ingest", *key)
            if place in changed or attempt != self._attempts.get(place, 0):
                self._ingest(scripts, key, settings[key] | {"attempt": attempt})
                self._attempts[place] = attempt
                done.append("/".join(key))
        return done

    def _ingest(self, scripts: Scripts, key: tuple[str, str], params: dict[str, Any]) -> None:
        folder = self.results.joinpath("recordings", *key)
        for name in OUTPUTS:  # as Snakemake does before a job
            (folder / name).unlink(missing_ok=True)
        job = Job(
            Path("ingest.py"),
            [],
            [str(folder / name) for name in OUTPUTS],
            Params(params),
            dict(zip(("sensor", "recording"), key, strict=True)),
            self.folder / "ingest.log",
            results=self.results,
        )
        assert scripts._limits is not None
        try:
            scripts._bounded(job, params["attempt"], scripts._limits)
        except StepError as error:
            raise DiskFullError from error

    def outcome(self) -> dict[str, Any]:
        """Return what the results say of each recording, and of each file in the drop zone."""
        plan = self.plan()
        told: dict[str, Any] = {"files": json.loads(plan.files())}
        for sensor, name in plan.recordings:
            quality = Quality.read(self.results / "recordings" / sensor / name / "quality.json")
            assert quality.fault(self.results / "recordings" / sensor / name, whole=True) is None
            told[f"{sensor}/{name}"] = (quality.recording, quality.findings, quality.channels)
        return told

    def from_nothing(self) -> dict[str, Any]:
        """Return the outcome of a run that finds no results."""
        results = "fresh"
        shutil.rmtree(self.folder / results, ignore_errors=True)
        fresh = Project(self.folder, results)
        fresh.run()
        return fresh.outcome()

    def failed(self) -> set[str]:
        """Return the recordings of which the ingest failed."""
        told = self.outcome()
        return {
            name for name, of in told.items() if name != "files" and of[0]["status"] == "failed"
        }


_hooks: list[Callable[[str, Path, int], None]] = []


def _pass_on(event: str, arguments: tuple[Any, ...]) -> None:
    if _hooks and event in ("open", "os.listdir", "os.scandir") and arguments:
        path = arguments[0]
        if isinstance(path, bytes | str | Path):
            flags = arguments[2] if event == "open" and isinstance(arguments[2], int) else 0
            hook = _hooks.pop()  # what it does itself is no event
            try:
                hook(event, Path(str(path)), flags)
            finally:
                _hooks.append(hook)


_added: list[bool] = []


@contextmanager
def on_access(hook: Callable[[str, Path, int], None]) -> Iterator[None]:
    """Call a function before each file is opened and each folder is listed.

    It is given what is done, the path, and the flags; what it raises stops that.
    """
    if not _added:
        sys.addaudithook(_pass_on)
        _added.append(True)
    _hooks.append(hook)
    try:
        yield
    finally:
        _hooks.clear()
