"""A few kills at random moments; `tests.release.kills` has many, and full disks."""

import contextlib
import shutil
from pathlib import Path

import pytest

from tests.release.kills import Killer
from tests.release.small import NIGHTLY, SNAKEMAKE, Undisturbed

pytestmark = [pytest.mark.release, pytest.mark.workflow]

KILLS = (
    ("all", SNAKEMAKE),
    ("snakemake", NIGHTLY),
    ("step", NIGHTLY),
    ("step server", SNAKEMAKE),
    ("nightly", NIGHTLY),
)


def test_a_run_that_was_killed_five_times_ends_as_an_undisturbed_one(tmp_path: Path) -> None:
    expected = Undisturbed(tmp_path, states=1, samples=4000)
    with contextlib.closing(Killer(tmp_path, expected, seed=3)) as killer:
        for kind, run in KILLS:
            # What a kill does not reach comes to its end: there must be something left to do.
            shutil.rmtree(killer.project.results / "tables", ignore_errors=True)
            assert killer.kill(kind, run, latest=0.4), f"no {kind} of {run} was there to be killed"
        killer.complete(NIGHTLY, killer.kills)
    assert killer.faults() == []
    print(*(kill.row("") for kill in killer.kills), sep="\n")
