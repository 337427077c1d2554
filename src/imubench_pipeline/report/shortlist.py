"""The page that judges all sensors of the catalogue, logged or not."""

from collections.abc import Iterator, Mapping, Sequence

from imubench_pipeline.model.comparisons import CoverageRow, ShortlistRow
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.words.numbers import join_names, number_text
from imubench_pipeline.words.verdicts import (
    SHORT_VERDICTS,
    condition_text,
    origins_text,
    share_text,
    shortfall_text,
    subject_text,
)


def _make_context(site: Site) -> Mapping[str, object]:
    asked = site.settings["requirements"]
    names = {row.sensor: f"{row.vendor} {row.model}" for row in site.rows(CoverageRow)} | site.names
    boards: dict[str, list[Mapping[str, object]]] = {}
    for row in site.rows(ShortlistRow):
        margins = (row.margin, row.noise_margin, row.likely_margin)
        line = row.columns() | {
            "code": row.verdict,
            "word": SHORT_VERDICTS[row.verdict],
            "shortfalls": list(map(shortfall_text, row.shortfalls)),
            "conditions": list(_list_conditions(row)),
            "parts": list(map(share_text, row.parts)),
            "origins": origins_text(row.parts),
            "name": names.get(row.sensor, row.sensor),
            "logged": row.sensor in site.sensors,
            "margins": [(number_text(margin, 3), margin) for margin in margins],
        }
        boards.setdefault(row.requirement, []).append(line)
    return {
        "boards": [
            {
                "name": name,
                "title": asked[name]["title"],
                "note": asked[name].get("note"),
                "rows": lines,
            }
            for name, lines in boards.items()
        ]
    }


def _list_conditions(row: ShortlistRow) -> Iterator[str]:
    """Yield the conditions of a verdict; a sensor that fails does so with the best properties."""
    if row.verdict == "meets_if":
        yield from map(condition_text, row.conditions)
    elif row.verdict == "not_enough_data":
        yield from row.reasons
    elif row.conditions:
        yield f"not ranked: {join_names(list(map(subject_text, row.conditions)))} not known"


SHORTLIST = Entry(
    file="shortlist.html",
    title="Before buying",
    context=_make_context,
    tables=("coverage", "shortlist"),
    exists=lambda site: bool(site.rows(ShortlistRow)),
)


def format_shortlist_row(row: ShortlistRow) -> list[str]:
    """Return rank, sensor, verdict, margins (in use, noise, likely), and limit or reason."""
    return [
        str(row.rank or "–"),
        row.sensor + " *" * (row.basis != "printed"),
        SHORT_VERDICTS[row.verdict],
        *(number_text(margin, 3) for margin in (row.margin, row.noise_margin, row.likely_margin)),
        row.decides or "; ".join(row.reasons) or "; ".join(map(shortfall_text, row.shortfalls)),
    ]


def list_remarks(rows: Sequence[ShortlistRow]) -> Iterator[str]:
    """Yield a line per sensor with its shortfalls or conditions, and the sources of its error."""
    for row in rows:
        remarks = [*map(shortfall_text, row.shortfalls), *_list_conditions(row), *row.reasons]
        if not row.shortfalls and row.parts:
            remarks.append(origins_text(row.parts))
        if remarks:
            yield f"{row.sensor}: {'; '.join(dict.fromkeys(remarks))}"
