"""Run the scripts of the rules; a failure of one recording does not end the run."""

import sys
from dataclasses import replace
from inspect import signature
from pathlib import Path
from typing import Any

from snakemake.script import script as script_of_snakemake
from snakemake.sourcecache import LocalSourceFile, SourceCache, infer_source_file

from imubench_pipeline.run.faults import Faults, Of
from imubench_pipeline.run.processes import Job, Processes, StepError
from imubench_pipeline.run.recovery import remove_unfinished
from imubench_pipeline.run.resources import Limits
from imubench_pipeline.run.sealing import seal_outputs
from imubench_pipeline.tables.failures import QUALITY, Failure, read_failure, write_empty

_SCRIPT_SIGNATURE = signature(script_of_snakemake)


class Scripts:
    """Replaces Snakemake's function `script`, which each rule with a script calls.

    A rule with the parameter ``attempt`` belongs to a recording or a sensor, which is left out if
    the script fails. A killed script, for example for lack of memory, is run once more. The job
    fails as usual if the run is stopped, the disk is full, or the script cannot be imported.
    Without `limits`, each failure ends the job. Outputs are sealed unless ``sealed`` is False, as
    in an object store.
    """

    def __init__(self, faults: Faults, limits: Limits | None, *, sealed: bool = True) -> None:
        self._faults = faults
        self._sealed = sealed
        self._limits = limits
        self._processes = Processes()

    def __call__(self, *values: Any, **named: Any) -> None:
        """Run a script; if its recording or sensor fails, write empty outputs, else `StepError`."""
        given = _SCRIPT_SIGNATURE.bind(*values, **named).arguments
        source = infer_source_file(given["path"], infer_source_file(given["basedir"]))
        if isinstance(source, LocalSourceFile):
            script = source.get_path_or_uri(secret_free=True)
        else:  # of a workflow from elsewhere
            cache = SourceCache(given["sourcecache_path"], given["runtime_sourcecache_path"])
            script = cache.get_path(source)
        parts = {
            name: given[name] for name in ("input", "output", "params", "wildcards", "threads")
        }
        log, results = Path(given["log"][0]), self._faults.results if self._sealed else None
        job = Job(Path(script), **parts, log=log, results=results)
        job.log.unlink(missing_ok=True)
        attempt = job.params.get("attempt")
        try:
            if self._limits is None or attempt is None:
                self._processes.run(job)
            else:
                self._bounded(job, attempt, self._limits)
        except StepError as error:
            remove_unfinished(map(Path, job.output))
            sys.stderr.write(error.trace)
            raise

    def _bounded(self, job: Job, attempt: int, limits: Limits) -> None:
        """Run a script; write empty outputs if its recording or sensor makes it fail."""
        of: Of = (job.name, job.wildcards["sensor"], job.wildcards.get("recording"))
        outputs = [Path(path) for path in job.output]
        own = (Path(path) for path in job.input if Path(path).parent == outputs[0].parent)
        if before := next((failure for path in own if (failure := read_failure(path))), None):
            with seal_outputs(job):
                _leave_out(outputs, job.params, before)
            return
        limit = limits(*of[1:])
        job = replace(job, memory=limit.memory)
        try:
            try:
                self._processes.run(job, limit.seconds)
            except StepError as error:
                if error.cause != "killed":
                    raise
                print(f"{error}: it is run once more", file=sys.stderr, flush=True)
                self._processes.run(job, limit.seconds)
        except StepError as error:
            if error.cause is None:
                raise
            words = f" ({limit.words})" * (error.cause == "time")
            reason = f"the step {job.name} {_CAUSE_VERBS[error.cause]}{error.reason}{words}"
            failure = Failure(of[1], of[2], job.name, error.cause, reason)
            remove_unfinished(outputs)
            sys.stderr.write(error.trace)
            print(f"{failure.name} is left out: {reason}", file=sys.stderr, flush=True)
            self._faults.failed(failure, attempt, job.log)
            with seal_outputs(job):
                _leave_out(outputs, job.params, failure)
        else:
            self._faults.succeeded(of, attempt)


_CAUSE_VERBS = {"error": "failed: ", "killed": "was killed twice: ", "time": ""}


def _leave_out(outputs: list[Path], params: Any, failure: Failure) -> None:
    write_empty((path for path in outputs if path.name != QUALITY), failure)
    for path in outputs:
        if path.name == QUALITY:
            from imubench_pipeline.recordings.ingest import write_failed

            write_failed(params.settings, failure, path)
