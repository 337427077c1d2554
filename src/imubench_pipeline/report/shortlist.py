"""The page that judges sensors by their data sheets alone."""

from collections.abc import Iterator, Mapping, Sequence

from imubench_pipeline.model.comparisons import ShortlistRow
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.words.numbers import number_text
from imubench_pipeline.words.verdicts import SHORT_VERDICTS, SHORTLIST_WORDS, shortfall_text


def _make_context(site: Site) -> Mapping[str, object]:
    asked = site.settings["requirements"]
    boards: dict[str, list[Mapping[str, object]]] = {}
    for row in site.rows(ShortlistRow):
        sensor, verdict, best, worst, measured, _ = format_shortlist_row(row)
        line = row.columns() | {
            "code": row.verdict,
            "shortfalls": list(map(shortfall_text, row.shortfalls)),
            "measured_verdict": SHORT_VERDICTS[row.measured_verdict]
            if row.measured_verdict
            else "",
            "name": site.names.get(row.sensor, sensor),
            "logged": row.sensor in site.sensors,
            "verdict": verdict,
            "best": best,
            "worst": worst,
            "measured": measured,
        }
        boards.setdefault(row.requirement, []).append(line)
    return {
        "boards": [
            {"title": asked[name]["title"], "note": asked[name].get("note"), "rows": lines}
            for name, lines in boards.items()
        ]
    }


SHORTLIST = Entry(
    file="shortlist.html", title="Before buying", context=_make_context, tables=("shortlist",)
)
"""The page of all sensors of the catalogue, for every requirement."""


def format_shortlist_row(row: ShortlistRow) -> list[str]:
    """Return sensor, verdict, margins (best, worst, measured) and deciding limit, as texts."""
    measured = number_text(row.measured_margin, 3)
    if row.measured_margin_of == "simulated logs":
        measured += " (simulated)"
    return [
        row.sensor,
        SHORTLIST_WORDS[row.verdict],
        number_text(row.best_margin, 3),
        number_text(row.worst_margin, 3) if row.best_margin is not None else "–",
        measured,
        row.decides or "; ".join(row.reasons) or "; ".join(map(shortfall_text, row.shortfalls)),
    ]


def list_assumptions(rows: Sequence[ShortlistRow]) -> Iterator[str]:
    """Yield a line per sensor with its assumptions, or the reason why it is not judged."""
    for row in rows:
        remarks = [*map(shortfall_text, row.shortfalls), *row.reasons, *row.assumed]
        if remarks:
            yield f"{row.sensor}: {'; '.join(remarks)}"
