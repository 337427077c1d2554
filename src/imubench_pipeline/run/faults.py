"""Records of steps that failed for one recording or sensor, in the folder ``faults``."""

import contextlib
import os
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path

from pydantic import BaseModel

from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.report.run_summary import fold_text
from imubench_pipeline.tables.failures import Cause, Failure
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.tables.seals import name_place, read_sealed_json, write_sealed_json

Of = tuple[str, str, str | None]  # step, sensor and recording; None: a step of the whole sensor
TOLD = "IMUBENCH_FAILURES_TOLD"  # environment variable: the caller reports the failures itself
_FAULT_FOLDER = "faults"


class Faults:
    """The records of the steps that failed, in the folder ``faults`` of the results.

    Each record has the number of attempts. The next run repeats failed steps, and ingests whose
    samples were changed: samples are no declared outputs, since their files depend on the log.
    """

    def __init__(self, results: Path) -> None:
        self.results = results
        self._folder = results / _FAULT_FOLDER
        self._before = dict(self._records())
        self._failed = {of[1:] for of, record in self._before.items() if record.failed}
        self._lost: dict[Of, bool] = {}

    def attempt(self, of: Of, *, again: bool = True) -> int:
        """Return the number of this run's attempt at a step, ``of``; 0 if none failed before.

        Without `again`, the step is not repeated, and the number of the last attempt is returned.
        """
        record = self._before.get(of)
        tried, failed = (record.attempt, record.failed) if record else (0, False)
        return tried + (again and (failed or self._has_lost_samples(of)))

    def repeated(self, recordings: Iterable[tuple[str, str]]) -> set[tuple[str, str | None]]:
        """Return sensor and recording (None: whole sensor) of the steps that are repeated."""
        lost: set[tuple[str, str | None]] = {
            key for key in recordings if self._has_lost_samples(("ingest", *key))
        }
        return self._failed | lost

    def _has_lost_samples(self, of: Of) -> bool:
        """Return whether outputs of an ingest were changed; reads all if another step failed."""
        step, sensor, recording = of
        if step != "ingest" or recording is None:
            return False
        if of not in self._lost:
            folder = self.results / "recordings" / sensor / recording
            whole = (sensor, recording) in self._failed
            try:
                fault = Quality.read(folder / "quality.json").fault(folder, whole=whole)
            except FileNotFoundError:  # it is made in any case
                fault = None
            except RecordingError as error:
                fault = str(error)
            self._lost[of] = fault is not None
        return self._lost[of]

    def failed(self, failure: Failure, attempt: int, log: Path) -> None:
        """Record the failure of a step at an attempt, and append it to the log of the step."""
        path = self._path((failure.step, failure.sensor, failure.recording))
        record = {"attempt": attempt, "failed": True, "log": str(log), **asdict(failure)}
        write_sealed_json(record, path)
        log.parent.mkdir(parents=True, exist_ok=True)
        with log.open("a", encoding="utf-8") as file:
            file.write(f"{failure.name}, {failure.step}: {failure.reason}\n")

    def succeeded(self, of: Of, attempt: int) -> None:
        """Record the success of a step that failed before."""
        path = self._path(of)
        if attempt or path.is_file():
            about = dict(zip(("step", "sensor", "recording"), of, strict=True))
            write_sealed_json({"attempt": attempt, "failed": False, **about}, path)

    def now(self) -> Iterator[tuple[Failure, Path]]:
        """Yield the failures of this run, each with the path of the log file of its step."""
        for of, record in self._records():
            if record.failed and record.attempt >= self.attempt(of):
                step, sensor, recording = of
                yield Failure(sensor, recording, step, record.cause, record.reason), record.log

    def left_out(self) -> str:
        """Return a message about the failures of this run; empty without any, or with `TOLD`."""
        lines = [
            "failed parts are omitted, and tried again by the next run; the report is complete "
            "otherwise"
        ]
        for failure, log in self.now():
            lines.append(f"  {fold_text(f'{failure.name}: {failure.reason}')}\n    log: {log}")
        return "" if len(lines) == 1 or TOLD in os.environ else "\n".join(lines)

    def _path(self, of: Of) -> Path:
        return self._folder / f"{name_place(*of)}.json"

    def _records(self) -> "Iterator[tuple[Of, _Record]]":
        for path in sorted(self._folder.glob("*/**/*.json")):
            with contextlib.suppress(OSError, ValueError):  # not completely written
                record = _Record.model_validate(read_sealed_json(path))
                yield (record.step, record.sensor, record.recording), record


class _Record(BaseModel):
    step: str
    sensor: str
    recording: str | None = None
    attempt: int
    failed: bool
    cause: Cause = "error"
    reason: str = ""
    log: Path = Path()
