"""Check that every page and command of a run gives one verdict, margin and rank to a question.

python .ci/check_one_verdict.py RESULTS

The table `ranking` is compared with the start page, the page of the sensor, Side by side, Before
buying, `imubench shortlist` and `imubench show`.
"""

import base64
import contextlib
import html
import io
import json
import re
import sys
import zlib
from pathlib import Path

import pyarrow.parquet as pq

from imubench_pipeline.model.comparisons import RankingRow, ShortlistRow
from imubench_pipeline.run.cli import main as imubench
from imubench_pipeline.words.numbers import number_text
from imubench_pipeline.words.verdicts import (
    SHORT_VERDICTS,
    VERDICT_WORDS,
    other_margins_text,
)


def read_text(page: str) -> str:
    """Return the text of a piece of HTML."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page)).split())


def unpack(page: str) -> str:
    """Return a page with the rows of its tables that are packed."""
    script = r'<script type="text/html"[^>]*data-packed>([^<]*)</script>'
    return re.sub(script, lambda one: zlib.decompress(base64.b64decode(one[1])).decode(), page)


def run(*arguments: str) -> str:
    """Return the output of a command on one line."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        imubench([*arguments])
    return " ".join(said.getvalue().split())


def describe(row: RankingRow | ShortlistRow) -> str:
    """Return the verdict of a row with all margins, to the last digit."""
    return f"{row.verdict} {row.margin} {row.noise_margin} {row.likely_margin}"


def main() -> int:
    """Print the counts and the differences; return 1 if there are any."""
    results = Path(sys.argv[1])
    report, tables = results / "report", results / "tables"
    ranking = RankingRow.rows_of(pq.read_table(tables / "ranking.parquet"))
    shortlist = ShortlistRow.rows_of(pq.read_table(tables / "shortlist.parquet"))
    listed = {(row.requirement, row.sensor): row for row in shortlist}
    start = (report / "index.html").read_text()
    buying = unpack((report / "shortlist.html").read_text())
    packed = re.search(
        r'<script[^>]*class="page"[^>]*>(.*?)</script>', (report / "compare.html").read_text(), re.S
    )
    assert packed is not None
    page = json.loads(zlib.decompress(base64.b64decode(packed[1])))
    titles = {each["title"]: each["sensors"] for each in page["requirements"]}
    checked: dict[str, int] = {}
    wrong: list[str] = []

    def check(where: str, row: RankingRow | ShortlistRow, found: str, *expected: str) -> None:
        checked[where] = checked.get(where, 0) + 1
        if not all(each in found for each in expected):
            wrong.append(f"{row.requirement}/{row.sensor}: {where} has {found[:200]!r}")

    for row in (row for row in ranking if row.decides):
        word, margin = SHORT_VERDICTS[row.verdict], number_text(row.margin, 3)
        judged = row.margin is not None and row.verdict != "excluded"
        link = rf'sensors/{row.sensor}\.html#requirement-{row.requirement}"'
        cell = re.search(rf'<td class="cell[^>]*>\s*<a href="{link}(.*?)</td>', start, re.S)
        other = other_margins_text(row) if judged else ""
        check("start page", row, read_text(cell[1]) if cell else "", word, other)
        own = (report / "sensors" / f"{row.sensor}.html").read_text()
        begin = rf'<section[^>]*aria-labelledby="requirement-{row.requirement}">'
        section = re.search(rf"{begin}(.*?)</section>", own, re.S)
        rank = f"rank {row.rank} of" if row.rank else ""
        check("sensor page", row, read_text(section[1]) if section else "", word, rank, other)
        beside = " | ".join(each.get(row.sensor, "") for each in titles.values())
        check("side by side", row, beside, word, margin if judged else "", other)
        entry = listed.get((row.requirement, row.sensor))
        if entry is not None and judged:
            check("table shortlist", row, describe(entry), describe(row))
            check("before buying", row, buying, margin)
    for name in dict.fromkeys(row.requirement for row in ranking):
        shown = run("show", str(results), "--requirement", name, "--width", "200")
        of_catalogue = run("shortlist", name, "--results", str(results))
        for row in ranking:
            if row.decides and row.requirement == name and row.margin is not None:
                check("show", row, shown, VERDICT_WORDS[row.verdict])
        for entry in shortlist:
            if entry.requirement == name and entry.margin is not None:
                check("shortlist", entry, of_catalogue, number_text(entry.margin, 3))
    print("verdicts checked:", ", ".join(f"{where} {n}" for where, n in checked.items()))
    print("\n".join(wrong))
    return int(bool(wrong) or not checked)


if __name__ == "__main__":
    sys.exit(main())
