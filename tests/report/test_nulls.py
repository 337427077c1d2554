"""Nothing that is not there stops the report: every nullable column, null in all rows or in one.

The columns are those of the schemas, so that a new one is tried, too.
"""

import random
import re
import traceback
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from functools import cache
from io import StringIO
from pathlib import Path

import pyarrow as pa
import pytest
from rich.console import Console

from imubench_pipeline.extensions.nightly import summary as nightly
from imubench_pipeline.report import publish as publishing
from imubench_pipeline.report import run_summary, terminal
from imubench_pipeline.report.pages import list_pages
from imubench_pipeline.report.publish import make_templates
from imubench_pipeline.report.site import Page, Site
from imubench_pipeline.tables.files import build, make_schema, write_arrow
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from tests.report import (
    test_boards,
    test_calibration,
    test_earth_rate,
    test_navigated,
    test_papers,
    test_shortlist,
)
from tests.report.pages import unfolded
from tests.report.tables import ROBOT, joined, recording_rows, rejected_rows, site

pytestmark = [pytest.mark.usefixtures("small_report"), pytest.mark.release]

Tables = Mapping[str, pa.Table]

JOINED = sorted(set(TABLES) - set(OF_ONE_RECORDING))
COLUMNS = [(name, one.name) for name in JOINED for one in TABLES[name] if not one.required]
ASKED = {"robot": ROBOT}
ABSENT = re.compile(r"(?<![\w.])(?:None|nan|NaN|inf)(?![\w(])")
"""What Python writes where it should be a dash."""


NAMED = {"sensor": "one", "recording": "day", "channel": "gyro_x", "requirement": "robot",
         "error": "attitude", "quantity": "gyro", "statistic": "N", "parameter": "N",
         "figure": "N", "status": "ok", "severity": "warning", "finding": "step", "code": "step",
         "fitness": "unfit", "published": "yes"}  # fmt: skip
"""Values of columns that name something which the report has."""


@cache
def a_row(table: str) -> dict[str, object]:
    """A row of a table that no other fixture has rows of."""
    values = {"string": "gyro_x", "double": 1.5, "float": 1.5, "int64": 1, "bool": True}
    row: dict[str, object] = {}
    for one in TABLES[table]:
        named = NAMED.get(one.name)
        if one.is_list:
            row[one.name] = ()
        elif one.values:
            row[one.name] = named if named in one.values else one.values[0]
        else:
            text = str(one.type) == "string"
            row[one.name] = named if named and text else values[str(one.type)]
    return row


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Tables:
    """Tables of which each has rows, and of which the report has every page."""
    turned, calibrated = (tmp_path_factory.mktemp(name) for name in ("turned", "calibrated"))
    names = {"sensor": "one", "recording": "day", "device": "unit"}
    drift = names | {"channel": "gyro_x", "parameter": "N", "position": 1, "value": 1e-5,
                     "expected": 9e-6, "expected_lower": 8e-6, "expected_upper": 1e-5,
                     "change": 0.1, "p_value": 1e-3, "unit": "rad/s/sqrt(Hz)",
                     "verdict": "changed", "reasons": ["of a test"]}  # fmt: skip
    rows = [
        *test_boards.some(),
        *test_earth_rate.some(turned),
        *test_calibration.some(calibrated),
        recording_rows("asked", "day1", requirements=ASKED, temperature="followed"),
        recording_rows("one", "day", device="unit"),
        rejected_rows("asked", "bad"),
        {"navigation": [test_navigated.navigation_row("asked")]},
        recording_rows("lined", "day", found=(2.0,)),
    ]
    found = joined(*rows, requirements=ASKED, papers=True)
    made = {
        "drift": [drift],
        "failures": [{"sensor": "asked", "recording": "bad", "step": "estimate",
                      "cause": "killed", "reason": "twice"}],
        "shortlist": [test_shortlist.ROW, *test_shortlist.OTHERS],
        "repeatability": [test_shortlist.REPEATED],
        "accuracy": test_papers.PANEL,
        "published": [test_papers.LINE, test_papers.OTHER],
    }  # fmt: skip
    for name in JOINED:
        if not (found[name].num_rows or name in made):
            made[name] = [a_row(name)]
    return dict(found) | {name: build(name, own) for name, own in made.items()}


def without(tables: Tables, table: str, columns: list[str], row: int | None = None) -> Tables:
    """The tables with null in columns of one of them: in all rows, or in one."""
    changed = tables[table]
    for name in columns:
        place = changed.column_names.index(name)
        values = changed[name].to_pylist()
        values = [None] * len(values) if row is None else values
        if row is not None:
            values[row] = None
        field = make_schema(table).field(place)
        changed = changed.set_column(place, field, pa.array(values, field.type))
    return dict(tables) | {table: changed}


class Reports:
    """Reports that differ from a whole one: of each the pages that differ are made."""

    def __init__(self, tables: Tables) -> None:
        self.tables = tables
        self.before = {page.path: page for page in list_pages(self.site(tables))}
        self.absent = {path: _absent(self.text(page)) for path, page in self.before.items()}

    @staticmethod
    def site(tables: Tables) -> Site:
        return site(tables, requirements=ASKED, boards={"pair": test_boards.BOARD})

    def text(self, page: Page) -> str:
        made = self.site(self.tables)
        return publishing._render(made, make_templates(made.system), page)

    def check(self, tables: Tables) -> None:
        """Make what differs: every page comes, and shows nothing as Python writes it."""
        made = {page.path: page for page in list_pages(self.site(tables))}
        assert made.keys() == self.before.keys()
        for path, page in made.items():
            if page.key != self.before[path].key:
                assert _absent(self.text(page)) <= self.absent[path], path


def _absent(source: str) -> set[str]:
    text = re.sub(r"<(script|style)[^>]*>.*?</\1>", "", unfolded(source), flags=re.DOTALL)
    return {text[max(found.start() - 20, 0) : found.end() + 9] for found in ABSENT.finditer(text)}


@pytest.fixture(scope="module")
def reports(whole: Tables) -> Reports:
    return Reports(whole)


def test_every_table_has_rows_here(whole: Tables) -> None:
    assert [name for name in JOINED if not whole[name].num_rows] == []


@pytest.mark.parametrize("table", JOINED)
def test_a_report_comes_where_a_table_has_nothing_that_it_may_lack(
    table: str, reports: Reports
) -> None:
    reports.check(without(reports.tables, table, [one for name, one in COLUMNS if name == table]))


def _cells(whole: Tables, seed: int) -> Iterator[tuple[str, str, int | None]]:
    """Each nullable column whole, and one cell of it that has a value."""
    rng = random.Random(seed)
    for table, column in COLUMNS:
        values = whole[table][column].to_pylist()
        present = [place for place, value in enumerate(values) if value is not None]
        yield table, column, None
        if present:
            yield table, column, rng.choice(present)


def test_a_report_comes_whatever_is_not_there(whole: Tables, reports: Reports) -> None:
    for table, column, row in random.Random(1).sample([*_cells(whole, 1)], 10):
        reports.check(without(whole, table, [column], row))


@pytest.mark.parametrize("seed", range(3))
def test_a_report_comes_whichever_value_is_not_there(
    seed: int, whole: Tables, reports: Reports
) -> None:
    failures = {}
    for table, column, row in _cells(whole, seed):
        try:
            reports.check(without(whole, table, [column], row))
        except Exception as error:  # all of them are named at once
            failures[table, column, row] = "".join(traceback.format_exception(error)[-2:])
    assert not failures


TERMINAL = ("recordings", "findings", "failures", "ranking", "next_steps", "parameters")


@pytest.mark.parametrize("table", TERMINAL)
def test_the_terminal_and_the_summaries_come(table: str, whole: Tables, tmp_path: Path) -> None:
    for name in (*TERMINAL, "fixed_bias", "drift"):
        write_arrow(whole[name], tmp_path / f"tables/{name}.parquet")
    expected = _absent(_terminal(whole, tmp_path))
    for name, column in COLUMNS:
        if name == table:
            changed = without(whole, table, [column])
            write_arrow(changed[table], tmp_path / f"tables/{table}.parquet")
            assert _absent(_terminal(changed, tmp_path)) <= expected, column


def _terminal(tables: Tables, results: Path) -> str:
    asked = {"requirement": None, "channel": None, "method": None}
    console = Console(file=StringIO(), width=120)
    for part in terminal.render_comparison(tables, system="practical", width=120, **asked):
        console.print(part)
    found = nightly.load_tables(results)
    nightly.make_state(found, datetime(2026, 1, 1, tzinfo=UTC), {}, {})
    assert isinstance(console.file, StringIO)
    return console.file.getvalue() + run_summary.summarise_run(results)
