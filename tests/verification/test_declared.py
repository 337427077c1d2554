"""Each step reads nothing but what its rule declares, and writes nothing else."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from imubench_pipeline.run.processes import Job, Processes
from tests.verification.finished import Finished

pytestmark = pytest.mark.release

RESULTS = Path("results")


def files(folder: Path) -> set[Path]:
    """The files below a folder; what is hidden is none of them."""
    found = {path.relative_to(folder) for path in folder.rglob("*") if not path.is_dir()}
    return {path for path in found if not any(part.startswith(".") for part in path.parts)}


def declared(paths: list[str], results: Path) -> Iterator[Path]:
    """The files that a rule names, those of a folder, and the samples, which quality.json names."""
    for path in map(Path, paths):
        there = results / path.relative_to(RESULTS)
        if there.is_dir():
            yield from (path.relative_to(RESULTS) / file for file in files(there))
        else:
            yield path.relative_to(RESULTS)
        if path.name == "quality.json":
            yield from (file.relative_to(results) for file in there.parent.glob("log*.parquet"))


def undeclared(job: Job, name: Path) -> bool:
    """Whether a step may leave a file that no rule can name, since it does not know the log."""
    if job.name == "ingest":
        return name.name == "log.json"
    return job.name == "report" and name.parts[:2] != ("report", "figures")


def test_each_step_knows_what_its_rule_declares_and_nothing_else(
    done: Finished, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in done.project.folder.iterdir():
        if path.name not in ("results", ".snakemake"):
            (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    steps = Processes()
    kinds = {job.name: job for job in done.jobs}  # one of each
    assert len(kinds) >= 17
    try:
        for job in kinds.values():
            shutil.rmtree(RESULTS, ignore_errors=True)
            given = set(declared(list(map(str, job.input)), done.results))
            for name in given:
                (RESULTS / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(done.results / name, RESULTS / name)
            of = "_".join([job.name, *map(str, job.wildcards)])
            steps.run(replace(pickle.loads(pickle.dumps(job)), results=None, log=Path("log")))
            left = files(RESULTS) - given
            due = set(declared(list(map(str, job.output)), done.results)) - given
            assert due <= left, of
            assert {name for name in left - due if not undeclared(job, name)} == set(), of
            for name in sorted(given | left - {name for name in left if name.name == "log.json"}):
                # The same without the rest: it is not read where it happens to be there, either.
                assert (RESULTS / name).read_bytes() == (done.results / name).read_bytes(), name
    finally:
        steps.close()
