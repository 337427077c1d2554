"""Which tests one worker of pytest-xdist runs one after the other, and which begin first."""

from __future__ import annotations

from xdist.scheduler import LoadScopeScheduling

FIRST = (
    "tests/verification",  # a folder: one finished project, spoilt and changed in every way
    "tests/report/browser",  # a folder: one browser, and one report that is looked at in all of it
    "tests/test_corpus.py",  # logs of every format, together and one by one
    # From here on the kernels of a run are compiled: two runs at once would both do so.
    "tests/workflow/test_workflow.py",  # runs of one project, each upon those before
    "tests/workflow/test_nightly.py",  # so are these
    "tests/workflow/test_failures.py",  # waits for a step that takes too long
    "tests/workflow/test_deployed.py",  # three runs of one log, and a wheel
    "tests/workflow/test_earth_rate.py",  # a run, and lists of jobs
    "tests/test_fuzz.py",  # waits for readers that hang
    "tests/thermal/test_fit.py",  # the longest of those that only compute, and else among the last
    "tests/aided",  # a folder: its kernels take long to compile, each worker would do so
)
"""What takes longest begins first, and what is short fills the rest. A file is run by one worker,
so that what its tests share is made once; so is a folder that stands here."""


def unit(test: str) -> str:
    """What one worker runs whole, of the test with this id: its file, or a folder of `FIRST`."""
    path = test.partition("::")[0]
    return next((one for one in FIRST if path == one or path.startswith(f"{one}/")), path)


def place(test: str) -> int:
    """Where a test stands in the order in which they begin."""
    found = unit(test)
    return FIRST.index(found) if found in FIRST else len(FIRST)


class ByUnit(LoadScopeScheduling):
    """Gives a worker the tests of one unit after the other."""

    def _split_scope(self, nodeid: str) -> str:
        return unit(nodeid)
