"""Seal the outputs of steps, and find outputs that must be made again."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from imubench_pipeline.report.folder import files_of_report
from imubench_pipeline.run.processes import Job
from imubench_pipeline.tables.seals import (
    Seal,
    SealError,
    digests,
    form,
    place_of,
    read_seal,
    seal_files,
)


@contextlib.contextmanager
def sealed(job: Job) -> Iterator[None]:
    """Seal the outputs and inputs of a job when the block ends without error.

    A job without ``results`` is not sealed.
    """
    if job.results is None:
        yield
        return
    inputs = digests(job.results, map(Path, job.input))
    yield
    place = place_of(job.name, job.wildcards.get("sensor"), job.wildcards.get("recording"))
    outputs = left_by(job.name, [Path(path) for path in job.output])
    seal_files(job.results, place, outputs, inputs, settings_digest(dict(job.params.items())))


def settings_digest(params: Mapping[str, object]) -> str:
    """Return a digest of the parameters of a job, without the number of its attempt."""
    settings = {name: value for name, value in params.items() if name != "attempt"}
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def left_by(step: str, outputs: Sequence[Path]) -> list[Path]:
    """Return the outputs of a step, including outputs that no rule can declare."""
    folder = outputs[0].parent
    if step == "report":  # as many pages as there are recordings
        return files_of_report(folder)
    series = folder / "series"
    return [*outputs, *([series] if step == "reconstruct" and series.is_dir() else [])]


def unsound(results: Path, jobs: Mapping[str, str]) -> Iterator[str]:
    """Yield the jobs whose outputs are not those that they left, of what is there now.

    They are missing or changed, have no seal, are of another form, or were made of other files or
    with other settings. That does not rest on what Snakemake has noted: results may come from a
    backup, or from a run elsewhere. A file that has its size and its date is taken as it is:
    `imubench verify` reads all of it.

    A job is named by the place of its seal; `jobs` has the `settings_digest` of each.
    """
    seals: dict[str, Seal] = {}
    for place in jobs:
        with contextlib.suppress(FileNotFoundError, SealError):
            seals[place] = read_seal(results, place)
    left = {name: file.sha256 for seal in seals.values() for name, file in seal.outputs.items()}
    for place, settings in jobs.items():
        seal = seals.get(place)
        if seal is None or seal.settings != settings or not _sound(results, seal, left):
            yield place


def _sound(results: Path, seal: Seal, left: Mapping[str, str]) -> bool:
    return (
        seal.form == form()
        and all(left.get(name) == digest for name, digest in seal.inputs.items())
        and not any(file.fault(results / name, whole=False) for name, file in seal.outputs.items())
    )
