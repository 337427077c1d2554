"""What the search of the pages finds is there."""

import json
from pathlib import Path
from urllib.parse import unquote

import pytest

from imubench_pipeline.report.publish import publish
from imubench_pipeline.report.search import make_search_index
from tests.report.browser.made import publish_some
from tests.report.pages import Read, read_pages
from tests.report.tables import ROBOT, joined, recording_rows, rejected_rows, site

pytestmark = pytest.mark.usefixtures("small_report")


def there(pages: dict[str, Read], path: str) -> bool:
    file, _, section = path.partition("#")
    return file in pages and (not section or section in pages[file].ids)


def test_everything_that_has_a_name_is_found_and_is_there(tmp_path: Path) -> None:
    asked = {"robot": ROBOT}
    rows = recording_rows("one", "day1", device="unit 7"), rejected_rows("two", "torn")
    made = site(joined(*rows, requirements=asked, papers=True), requirements=asked)
    publish(made, tmp_path)
    found = json.loads(make_search_index(made))
    kinds = {kind for kind, *_ in found}
    assert kinds == {
        "sensor", "recording", "device", "requirement", "page", "term", "paper"
    }  # fmt: skip
    titles = {title: path for _, title, path, _ in found}
    assert titles[made.names["one"]] == "sensors/one.html"
    assert titles[f"{made.names['two']}: torn"] == "recordings/two/torn.html"
    assert titles["angle random walk"].startswith("theory.html#")
    assert {file for kind, _, file, _ in found if kind == "page"} == {
        entry.file for entry in made.existing
    }
    pages = read_pages(tmp_path)
    lost = [path for _, _, path, _ in found if not there(pages, unquote(path))]
    assert lost == []


def test_the_file_of_the_search_is_written_anew_when_a_name_changes(tmp_path: Path) -> None:
    script = tmp_path / "assets/search.js"
    publish_some(site(joined(recording_rows("one", "day1"))), tmp_path, ())
    assert "day2" not in script.read_text(encoding="utf-8")
    rows = recording_rows("one", "day1"), recording_rows("one", "day2")
    publish_some(site(joined(*rows)), tmp_path, ())
    assert "day2" in script.read_text(encoding="utf-8")
