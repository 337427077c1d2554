"""The pages by the rules of accessibility that a program can check."""

import pytest

from tests.report.browser.accessibility import hindrances
from tests.report.browser.made import Report
from tests.report.browser.reader import Open

KINDS = (
    "recordings.html", "index", "compare", "recordings/alpha/night 1", "made", "theory",
    "sensors/alpha", "sensors/gamma", "recordings/alpha/night 2", "datasheets", "devices/",
)  # fmt: skip


@pytest.mark.release  # axe takes longer over a page than all other tests of it
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_hinders_a_reader(kind: str, read: Open, bench: Report) -> None:
    reader = read(bench.folder, bench.page(kind))
    reader.draw_all()
    assert hindrances(reader.page) == []


@pytest.mark.release  # long: every line of every table, and every part of a figure
@pytest.mark.parametrize("kind", (*KINDS[:4], "datasheets", "devices/"))
def test_nothing_hinders_a_reader_of_what_is_alike(kind: str, read: Open, bench: Report) -> None:
    reader = read(bench.folder, bench.page(kind))
    reader.draw_all()
    assert hindrances(reader.page, whole=True) == []
