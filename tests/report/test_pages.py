"""The registry of the pages that a report has once: nothing of one is forgotten."""

from __future__ import annotations

import pkgutil
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pyarrow as pa
import pytest

from imubench_pipeline import registry, report
from imubench_pipeline.registry import installed_extensions
from imubench_pipeline.report import publish as publishing
from imubench_pipeline.report.pages import ENTRIES, list_pages
from imubench_pipeline.report.publish import publish
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import BY_RECORDING
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import shipped_sensors
from imubench_pipeline.steps.shortlist import list_shortlist
from tests.report.tables import ROBOT, joined, recording_rows, rejected_rows, site
from tests.report.test_boards import BOARD, of_board, some
from tests.report.test_catalogue import covered
from tests.report.test_navigated import navigation_row

pytestmark = pytest.mark.usefixtures("small_report")


EXTENSIONS = [f"imubench_pipeline.extensions.{one.name}" for one in installed_extensions()]


class Tables(dict[str, pa.Table]):
    """The tables of a site, which note who is read."""

    def __init__(self, tables: dict[str, pa.Table]) -> None:
        super().__init__(tables)
        self.read: set[str] = set()

    def __getitem__(self, name: str) -> pa.Table:
        self.read.add(name)
        return super().__getitem__(name)


@pytest.fixture(scope="module")
def whole() -> Site:
    """A site that has every page."""
    asked = {"robot": ROBOT}
    robot = {"robot": Requirement.model_validate(ROBOT)}
    catalogue = {"bmi088": shipped_sensors()["bmi088"]}
    rows = [
        *some(),
        recording_rows("asked", "day1", requirements=asked),
        rejected_rows("turned", "day1", kind="two_position"),
        {"navigation": [navigation_row("asked")], "coverage": covered("asked", {"N": "yes"})},
        {"shortlist": [row.columns() for row in list_shortlist(robot, catalogue, {})]},
    ]
    tables = joined(*rows, requirements=asked, papers=True)
    return site(tables, requirements=asked, boards={"pair": BOARD})


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.file)
def test_a_page_reads_no_table_that_it_does_not_declare(entry: Entry, whole: Site) -> None:
    tables = Tables(dict(whole.tables))
    noting = replace(whole, tables=tables)
    assert entry.exists(noting), "the site of this test lacks what the page shows"
    of_recordings = BY_RECORDING if entry.views(noting) else ()
    page = entry.page(noting)
    # What tells which recordings there are, and their names, is in the key of every page.
    assert noting.views and noting.existing and noting.names
    tables.read.clear()
    noting._rows.clear()
    assert page.context()
    undeclared = tables.read - {*entry.shown_tables, *of_recordings}
    assert not undeclared, "the page would not be written again when these change"
    publishing.make_templates(noting.system).get_template(page.template)


def test_a_page_disappears_with_what_it_shows(tmp_path: Path) -> None:
    few_rows = joined(of_board("cheap"))
    with_board = site(few_rows, boards={"pair": BOARD})
    publish(with_board, tmp_path)
    assert (tmp_path / "boards.html").is_file()
    publish(replace(with_board, settings={**with_board.settings, "boards": {}}), tmp_path)
    assert not (tmp_path / "boards.html").exists()
    assert (tmp_path / "index.html").is_file()


def test_the_menu_has_few_entries_and_leads_to_every_page(whole: Site) -> None:
    menu, *_ = (whole.shown()[name] for name in ("menu", "experiments"))
    assert isinstance(menu, list) and len(menu) <= 6
    published = {page.path: page for page in list_pages(whole)}
    templates = publishing.make_templates(whole.system)
    text = publishing._render(whole, templates, published["experiments.html"])
    assert all(f'href="{entry.file}"' in text for entry in whole.existing)


def test_every_page_that_a_module_declares_is_in_the_report(whole: Site) -> None:
    declared = [
        value
        for package in (report, *map(import_module, EXTENSIONS))
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}.")
        for value in vars(import_module(module.name)).values()
        if isinstance(value, Entry)
    ]
    assert {entry.file for entry in declared} == {entry.file for entry in ENTRIES}
    assert len({entry.file for entry in ENTRIES}) == len(ENTRIES)
    assert len({entry.title for entry in ENTRIES}) == len(ENTRIES)
    assert [entry.file for entry in whole.existing] == [entry.file for entry in ENTRIES]
    assert {entry.file for entry in ENTRIES} <= {page.path for page in list_pages(whole)}


@pytest.mark.parametrize("drawn", [True, False])
def test_figures_for_print_are_shown_if_they_are_drawn(
    drawn: bool, whole: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left = [one for one in installed_extensions() if drawn or one.name != "figures"]
    monkeypatch.setattr(registry, "installed_extensions", lambda: tuple(left))
    publish(whole, tmp_path)
    assert ("For print: " in (tmp_path / "index.html").read_text()) == drawn
    assert ("<figcaption>The characteristic" in (tmp_path / "theory.html").read_text()) == drawn
