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
from collections.abc import Callable
from pathlib import Path

import pyarrow.parquet as pq

from imubench_pipeline.model.comparisons import RankingRow, ShortlistRow
from imubench_pipeline.run.cli import main as imubench
from imubench_pipeline.words.numbers import number_text
from imubench_pipeline.words.verdicts import SHORT_VERDICTS, VERDICT_WORDS


def read_text(page: str) -> str:
    """Return the text of a piece of HTML."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", page)).split())


def run(*arguments: str) -> str:
    """Return the output of a command on one line."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        imubench([*arguments])
    return " ".join(said.getvalue().split())


def main() -> int:
    """Print the counts and the differences; return 1 if there are any."""
    results = Path(sys.argv[1])
    report, tables = results / "report", results / "tables"
    ranking = RankingRow.rows_of(pq.read_table(tables / "ranking.parquet"))
    shortlist = ShortlistRow.rows_of(pq.read_table(tables / "shortlist.parquet"))
    listed = {(row.requirement, row.sensor): row for row in shortlist}
    start, buying = ((report / name).read_text() for name in ("index.html", "shortlist.html"))
    packed = re.search(
        r'<script[^>]*class="page"[^>]*>(.*?)</script>', (report / "compare.html").read_text(), re.S
    )
    assert packed is not None
    page = json.loads(zlib.decompress(base64.b64decode(packed[1]), -15))
    titles = {
        re.sub(r"\s+", " ", each["title"]): each["sensors"] for each in page["requirements"]
    }
    checked: dict[str, int] = {}
    wrong: list[str] = []

    def check(where: str, row: RankingRow, found: str, test: Callable[[str], bool]) -> None:
        checked[where] = checked.get(where, 0) + 1
        if not test(found):
            wrong.append(f"{row.requirement}/{row.sensor}: {where} has {found[:200]!r}")

    for row in ranking:
        if not row.decides:
            continue
        word, margin = SHORT_VERDICTS[row.verdict], number_text(row.margin, 2)
        judged = row.margin is not None and row.verdict != "excluded"
        link = rf'sensors/{row.sensor}\.html#requirement-{row.requirement}"'
        cell = re.search(rf'<td class="cell[^>]*>\s*<a href="{link}>(.*?)</td>', start, re.S)
        text = read_text(cell[1]) if cell else ""
        check("start page", row, text, lambda t, w=word, m=margin, j=judged: w in t and (not j or m[:3] in t))  # type: ignore[misc]
        own = (report / "sensors" / f"{row.sensor}.html").read_text()
        section = re.search(
            rf'<section[^>]*aria-labelledby="requirement-{row.requirement}">(.*?)</section>', own, re.S
        )
        text = read_text(section[1]) if section else ""
        check("sensor page", row, text, lambda t, w=word: w in t)  # type: ignore[misc]
        if row.rank:
            check("rank on it", row, text, lambda t, r=row.rank: f"rank {r} of" in t)  # type: ignore[misc]
        beside = next((own[row.sensor] for own in titles.values() if row.sensor in own), "")
        every = [own.get(row.sensor, "") for own in titles.values()]
        check("side by side", row, " | ".join(every), lambda t, w=word: w in t)  # type: ignore[misc]
        assert beside or not titles
        other = listed.get((row.requirement, row.sensor))
        if other is not None and judged:
            same = (other.verdict, other.margin, other.noise_margin) == (
                row.verdict, row.margin, row.noise_margin
            )  # fmt: skip
            check("table shortlist", row, str(other), lambda _, s=same: s)  # type: ignore[misc]
            check("before buying", row, buying, lambda t, w=number_text(row.margin, 3): w in t)  # type: ignore[misc]
    for name in dict.fromkeys(row.requirement for row in ranking):
        shown = run("show", str(results), "--requirement", name, "--width", "200")
        of_catalogue = run("shortlist", name, "--results", str(results))
        for row in ranking:
            if row.decides and row.requirement == name and row.margin is not None:
                words = VERDICT_WORDS[row.verdict]
                check("show", row, shown, lambda t, w=words: w in t)  # type: ignore[misc]
                if (name, row.sensor) in listed and row.verdict != "excluded":
                    margin = number_text(row.margin, 3)
                    check("shortlist", row, of_catalogue, lambda t, m=margin: m in t)  # type: ignore[misc]
    print("verdicts checked:", ", ".join(f"{where} {n}" for where, n in checked.items()))
    print("\n".join(wrong))
    return int(bool(wrong) or not checked)


if __name__ == "__main__":
    sys.exit(main())
