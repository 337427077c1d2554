"""Seal the outputs of steps, and find outputs that must be made again."""

import contextlib
import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from imubench_pipeline.report.folder import list_report_files
from imubench_pipeline.run.processes import Job
from imubench_pipeline.tables import seals as sealed

_MAX_NAMES = 200  # in a pattern: matching more takes longer than the jobs that it leaves out


@contextlib.contextmanager
def seal_outputs(job: Job) -> Iterator[None]:
    """Seal a job's outputs after the block, with digests of its inputs from before the block.

    Nothing is sealed if the block fails, or if ``job.results`` is None.
    """
    if job.results is None:
        yield
        return
    inputs = sealed.compute_digests(job.results, map(Path, job.input))
    yield
    place = sealed.name_place(job.name, job.wildcards.get("sensor"), job.wildcards.get("recording"))
    outputs = [Path(path) for path in job.output]
    folder = outputs[0].parent
    # Outputs that no rule can declare: pages, and a series of each channel.
    if job.name == "report":
        outputs = list_report_files(folder)
    elif job.name == "reconstruct" and (folder / "series").is_dir():
        outputs.append(folder / "series")
    sealed.seal_files(
        job.results, place, outputs, inputs, digest_settings(dict(job.params.items()))
    )


def digest_settings(params: Mapping[str, object]) -> str:
    """Return a digest of the parameters of a job, without the number of its attempt."""
    settings = {name: value for name, value in params.items() if name != "attempt"}
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def find_unsound_jobs(results: Path, jobs: Mapping[str, str]) -> Iterator[str]:
    """Yield the jobs whose outputs do not match the present inputs and settings.

    Outputs are missing or changed, have no seal or another form, or were made from other files or
    settings. The records of Snakemake are not used: results may come from a backup, or from
    another machine. A file with unchanged size and date is not read. `jobs` maps the name of each
    seal to `digest_settings`; the names are yielded.
    """
    seals: dict[str, sealed.Seal] = {}
    for place in jobs:
        with contextlib.suppress(FileNotFoundError, sealed.SealError):
            seals[place] = sealed.read_seal(results, place)
    left = {name: file.sha256 for seal in seals.values() for name, file in seal.outputs.items()}
    for place, settings in jobs.items():
        seal = seals.get(place)
        if (
            seal is None
            or (seal.settings, seal.form) != (settings, sealed.compute_form_digest())
            or any(left.get(name) != digest for name, digest in seal.inputs.items())
            or any(file.fault(results / name, whole=False) for name, file in seal.outputs.items())
        ):
            yield place


def limit_wildcards(pattern: str, jobs: Sequence[Mapping[str, str]]) -> str:
    """Restrict the wildcards in a pattern of outputs to the sensors and recordings of jobs.

    A wildcard with more than 200 names is not restricted.
    """
    for key in ("sensor", "recording"):
        names = sorted({of[key] for of in jobs if key in of})
        if len(names) <= _MAX_NAMES:
            # Braces would end the wildcard.
            listed = "|".join(re.sub(r"\\[{}]", ".", re.escape(name)) for name in names)
            pattern = pattern.replace(f"{{{key},[^/]+}}", f"{{{key},{listed or '(?!)'}}}")
    return pattern
