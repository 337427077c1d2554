"""Runs the steps of the workflow; what one of them does to one recording ends nothing else."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from imubench_pipeline.run.faults import Of
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.run.processes import StepError, Steps
from imubench_pipeline.run.step_modules import OF_ALONE
from imubench_pipeline.tables.failures import Failure


@dataclass(frozen=True)
class Limit:
    """How long a step may take.

    Attributes
    ----------
    seconds : float
    words : str
        Where it is set.
    """

    seconds: float
    words: str


Limits = Callable[[str, Mapping[str, str]], Limit]
"""Takes the name of a step and the wildcards of its job."""


class BoundedSteps:
    """Runs scripts, and leaves out the recording or the sensor for which one of them fails.

    One that is killed, as the system does where memory is short, is run once more. What the run
    as a whole must have fails as any script does, and so does a step that is stopped with the run,
    meets a full disk, or cannot be imported.

    Parameters
    ----------
    steps : Steps
    plan : Plan
    limits : callable
        How long a step of one recording or sensor may take.
    """

    def __init__(self, steps: Steps, plan: Plan, limits: Limits) -> None:
        self._steps = steps
        self._plan = plan
        self._limits = limits

    def run(self, name: str, input: Any, output: Any, params: Any, wildcards: Any) -> None:
        """Run a script to its end (see `Steps.run`), or leave its outputs empty.

        Parameters
        ----------
        name : str
        input, output, params, wildcards : object
            As Snakemake has them.

        Raises
        ------
        StepError
            If the run cannot go on without the script.
        """
        if name not in OF_ALONE:
            self._steps.run(name, input, output, params, wildcards)
            return
        of: Of = (name, wildcards["sensor"], wildcards.get("recording"))
        outputs = list(_named(output))
        if before := _before(input, outputs[0][1].parent):
            _leave_out(of, outputs, params, before)
            return
        attempt, limit = self._plan.attempt(*of), self._limits(name, wildcards)
        try:
            self._tried(name, (input, output, params, wildcards), limit)
        except StepError as error:
            if error.cause is None:
                raise
            words = f" ({limit.words})" * (error.cause == "time")
            reason = f"the step {name} {_VERBS[error.cause]}{error.reason}{words}"
            failure = Failure(of[1], of[2], name, error.cause, reason)
            print(f"{failure.name} is left out: {reason}", file=sys.stderr, flush=True)
            self._plan.faults.failed(failure, attempt, error.trace)
            _leave_out(of, outputs, params, failure)
        else:
            self._plan.faults.succeeded(of, attempt)

    def _tried(self, name: str, given: tuple[Any, Any, Any, Any], limit: Limit) -> None:
        try:
            self._steps.run(name, *given, seconds=limit.seconds)
        except StepError as error:
            if error.cause != "killed":
                raise
            print(f"{error}: it is run once more", file=sys.stderr, flush=True)
            self._steps.run(name, *given, seconds=limit.seconds)


_VERBS = {"error": "failed: ", "killed": "was killed twice: ", "time": ""}


def _named(files: Any) -> Iterator[tuple[str | None, Path]]:
    """Yield name, if any, and path of the outputs of a job."""
    names = {path: name for name, path in files.items()}
    for path in files:
        yield names.get(path), Path(path)


def _before(inputs: Any, folder: Path) -> Failure | None:
    """Return which earlier step of the same recording failed, by the inputs of a job."""
    from imubench_pipeline.tables.failures import failure_of

    own = (Path(path) for path in inputs if Path(path).parent == folder)
    return next((found for path in own if (found := failure_of(path))), None)


def _leave_out(
    of: Of, outputs: list[tuple[str | None, Path]], params: Any, failure: Failure
) -> None:
    from imubench_pipeline.tables.failures import QUALITY, write_empty

    tables = [(name, path) for name, path in outputs if path.name != QUALITY]
    write_empty(tables, failure)
    for _, path in outputs:
        if path.name == QUALITY:
            from imubench_pipeline.recordings.ingest import write_failed

            write_failed(params.settings, failure, path)
