"""The pages by the rules of accessibility that a program can check."""

import pytest

from tests.conftest import few
from tests.report.browser.accessibility import hindrances
from tests.report.browser.made import Report
from tests.report.browser.reader import Open
from tests.report.browser.visit import KINDS, Seen

ALIKE = (
    "index", "compare", "recordings/alpha/night 1", "made", "theory", "sensors/alpha",
    "sensors/gamma", "recordings/alpha/night 2", "datasheets", "devices/",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_hinders_a_reader(kind: str, seen: Seen, bench: Report) -> None:
    assert seen.hindrances[bench.page(kind)] == []


@pytest.mark.parametrize("kind", few([], (*KINDS, *ALIKE)))
def test_nothing_hinders_a_reader_of_a_page_alike(kind: str, read: Open, bench: Report) -> None:
    reader = read(bench.folder, bench.page(kind))
    reader.draw_all()
    assert hindrances(reader.page) == []


@pytest.mark.release  # long: every line of every table, and every part of a figure
@pytest.mark.parametrize("kind", (*KINDS, *ALIKE[:3], "datasheets", "devices/"))
def test_nothing_hinders_a_reader_of_what_is_alike(kind: str, read: Open, bench: Report) -> None:
    reader = read(bench.folder, bench.page(kind))
    reader.draw_all()
    assert hindrances(reader.page, whole=True) == []
