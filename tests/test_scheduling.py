from tests.conftest import PROJECT
from tests.scheduling import FIRST, place, unit


def test_what_begins_first_is_there() -> None:
    assert [one for one in FIRST if not (PROJECT / one).exists()] == []


def test_a_worker_has_whole_files_and_the_browser_for_itself() -> None:
    browser = "tests/report/browser"
    assert unit(f"{browser}/test_looks.py::test_a") == unit(f"{browser}/test_pages.py::test_b[x/y]")
    assert unit("tests/report/test_pages.py::test_a[tests/slurm]") == "tests/report/test_pages.py"
    assert place(f"{FIRST[0]}::test_a") < place(f"{FIRST[1]}::test_a") < place("tests/test_a.py::b")
