"""The page of the papers, line by line: printed values, results, and reasons for differences."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from imubench_pipeline.extensions.papers.printed import Drawn, Paper, read_papers, read_terms
from imubench_pipeline.extensions.papers.tables import AccuracyRow, PublishedRow
from imubench_pipeline.report.payload import pack_page
from imubench_pipeline.report.search import Found
from imubench_pipeline.report.site import Entry, Section, Site
from imubench_pipeline.report.view import ChannelView, RecordingView
from imubench_pipeline.words.numbers import count_digits, number_text, percent_text


def _make_context(site: Site) -> dict[str, Any]:
    of_recordings = {view.page for view in site.views if not view.left_out}
    there = of_recordings | {entry.file for entry in site.existing}  # pages to link to
    rows = site.rows(PublishedRow)
    drawn = _select_curves(site)
    return {
        "bases": read_terms().bases,
        "verdicts": {name: one.meaning for name, one in read_terms().verdicts.items()},
        "panel": _describe_accuracy(site.rows(AccuracyRow)),
        "papers": [
            _describe_paper(paper, own, there)
            | {"figures": [figure for figure in drawn if figure[0] in paper.drawn]}
            for paper in read_papers()
            if (own := [row for row in rows if row.paper == paper.name])
        ],
        "page": pack_page([channel for _, _, channel in drawn], site.looks),
    }


def _select_recordings(site: Site) -> list[RecordingView]:
    names = dict.fromkeys(
        (one.sensor, one.recording) for paper in read_papers() for one in paper.drawn
    )
    views = {view.full_name: view for view in site.views if view.simulated and not view.left_out}
    return [views[name] for name in names if name in views]


PAPERS_PAGE = Entry(
    place=5,
    file="papers.html",
    title="Papers",
    about="what three papers print, with the computed values",
    context=_make_context,
    tables=("published", "accuracy"),
    views=_select_recordings,
    exists=lambda site: bool(site.rows(PublishedRow)),
)


def _select_curves(site: Site) -> list[tuple[Drawn, RecordingView, ChannelView]]:
    channels = {
        (*view.full_name, channel.channel): (view, channel)
        for view in _select_recordings(site)
        for channel in view.channels()
    }
    return [
        (one, *channels[key])
        for paper in read_papers()
        for one in paper.drawn
        if (key := (one.sensor, one.recording, one.channel)) in channels
    ]


def _describe_accuracy(rows: Sequence[AccuracyRow]) -> dict[str, Any]:
    symbols = list(dict.fromkeys(row.parameter for row in rows))
    by = {(row.method, row.parameter): row for row in rows}
    return {
        "logs": rows[0].logs if rows else 0,
        "symbols": symbols,
        "bounds": [
            percent_text(next(r.bound for r in rows if r.parameter == symbol)) for symbol in symbols
        ],
        "lines": [
            {"method": method, "cells": [_format_cell(by[method, symbol]) for symbol in symbols]}
            for method in dict.fromkeys(row.method for row in rows)
        ],
    }


def _format_cell(row: AccuracyRow) -> dict[str, str]:
    if row.rmse is None:
        return {"error": "no value", "ratio": ""}
    low, high = (number_text(end, 2) for end in (row.ratio_lower, row.ratio_upper))
    given = "" if row.given == row.logs else f", in {row.given} logs"
    return {
        "error": f"{percent_text(row.rmse)}{given}",
        "ratio": f"{number_text(row.ratio, 3)} ({low} to {high})",
    }


def _describe_paper(paper: Paper, rows: Sequence[PublishedRow], there: set[str]) -> dict[str, Any]:
    verdicts = Counter(row.verdict for row in rows)
    return {
        "about": paper,
        "lines": [
            {
                **row.columns(),
                "page": row.page if (row.page or "").split("#")[0] in there else None,
                **format_cells(row),
            }
            for row in rows
        ],
        "counts": [
            f"{count} {words.several if count > 1 else words.one}"
            for verdict, words in read_terms().verdicts.items()
            if (count := verdicts[verdict])
        ],
        "filters": {
            name: list(dict.fromkeys(getattr(row, name) for row in rows))
            for name in ("place", "verdict", "basis")
        },
    }


def format_cells(row: PublishedRow) -> dict[str, str]:
    """Return result, in the unit of the paper, ratio and tolerance of a row, as texts."""
    found = ""
    if row.found is not None:
        digits = count_digits(row.found, row.lower, row.upper)
        shown = (row.found, row.lower, row.upper)
        value, lower, upper = (
            x if x is None else number_text(x / row.scale, digits) for x in shown
        )
        unit = "" if row.printed_unit == "-" else f" {row.printed_unit}"
        found = f"{value}{unit}"
        if lower is not None and upper is not None:
            found += f" ({lower} to {upper})"
    words = "; ".join(filter(None, (found, row.found_words)))
    ratio, tolerance = "–", ""
    if row.ratio is not None:
        ratio = number_text(row.ratio, 3)
        tolerance = f"±{percent_text(row.tolerance, 2)}"
    return {"found_text": words or "–", "ratio_text": ratio, "tolerance_text": tolerance}


def find_lines(site: Site) -> Iterator[Found]:
    """Yield every line of the papers for the search index."""
    sections = {paper.name: f"papers.html#{paper.key}" for paper in read_papers()}
    for row in site.rows(PublishedRow):
        words = f"{row.paper} {row.printed_as} {row.verdict}"
        yield "paper", f"{row.place}: {row.quantity}", sections[row.paper], words


READING = Section(
    page="theory.html",
    template="reading.html.jinja",
    context=lambda site: describe_reading(site.rows(AccuracyRow)) or None,
    tables=("accuracy",),
)


def describe_reading(rows: Sequence[AccuracyRow]) -> str:
    """Return the result of reading the curve, from the table ``accuracy``; empty without rows."""
    of_curve = {row.parameter: row for row in rows if row.method == "curve"}
    if not of_curve:
        return ""
    bias, walk, off = of_curve["B"], of_curve["K"], ""
    if bias.bias is not None:
        size = number_text(100.0 * abs(bias.bias), 2)
        off = f", {size} % too {'small' if bias.bias < 0 else 'large'}"
    return (
        f"In {bias.logs} simulated logs of 10 h it finds B in {bias.given or 'none'}{off}, "
        f"and K in {walk.given or 'none'}: "
    )
