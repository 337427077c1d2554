"""The page of datasheets: measured against printed figures, and the figures of all sensors."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import get_args

from imubench_pipeline.datasheets.coverage import KEYS_OF_FIGURE
from imubench_pipeline.model.comparisons import CatalogueRow, CoverageRow
from imubench_pipeline.report.datasheets import UNIT_SYMBOLS, compare_sensors_with_datasheets
from imubench_pipeline.report.payload import Json
from imubench_pipeline.report.practical import System, choose_figure_unit
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.settings.printed import Kind, convert_density, convert_power_density
from imubench_pipeline.units import SI_UNITS
from imubench_pipeline.words.numbers import join_names, percent_text

_TITLES = {"gyro": "Gyroscopes", "accel": "Accelerometers"}
_PUBLISHED = ("yes", "other convention")
_SWITCHED = UNIT_SYMBOLS | {"B": "B"}
_NAMES = {"cross_axis": "cross-axis or misalignment"}
_PAPER_FIGURES = ("N", "B", "K", "T_B")
_FILTERS = ("vendor", "grade", "technology")


def make_catalogue_tables(
    covered: Sequence[CoverageRow], rows: Iterable[CatalogueRow], system: System
) -> Iterator[Json]:
    """Yield a table of datasheet figures per quantity: a line per sensor, a column per figure."""
    printed: dict[tuple[str, str, str], list[CatalogueRow]] = {}
    about = {}
    for one in rows:
        printed.setdefault((one.sensor, one.quantity, one.figure), []).append(one)
        about[one.sensor] = one
    for quantity, title in _TITLES.items():
        own = [row for row in covered if row.quantity == quantity]
        figures = list(dict.fromkeys(row.figure for row in own))
        lines: dict[str, Json] = {}
        for row in own:
            of = about.get(row.sensor)
            line = lines.setdefault(
                row.sensor,
                {
                    "sensor": row.sensor,
                    "name": f"{row.vendor} {row.model}",
                    "vendor": row.vendor,
                    "grade": of and of.grade,
                    "technology": ", ".join(of.technology) if of else "",
                    "aliases": ", ".join(of.aliases) if of else "",
                    "document": row.document or "–",
                    "cells": {},
                },
            )
            keys = chain.from_iterable(KEYS_OF_FIGURE[row.figure])
            found = [one for key in keys for one in printed.get((row.sensor, quantity, key), [])]
            line["cells"][row.figure] = _make_cell(row, found)
        if not lines:
            continue
        shown = [
            line | {"cells": [line["cells"][figure] for figure in figures]}
            for line in sorted(lines.values(), key=lambda line: str(line["name"]).lower())
        ]
        yield {
            "title": title,
            "heads": [_make_head(quantity, figure, system) for figure in figures],
            "lines": shown,
            "counts": [
                format_counts([row.published for row in own if row.figure == figure])
                for figure in figures
            ],
            "filters": {
                key: sorted({line[key] for line in shown if line[key]}) for key in _FILTERS
            },
        }


def _make_head(quantity: str, figure: str, system: System) -> Json:
    """Return the name of a figure, and the reference of its unit, or else the unit."""
    symbol = _SWITCHED.get(figure)
    return {
        "name": _NAMES.get(figure, figure if symbol == figure else figure.replace("_", " ")),
        "ref": symbol and f"{quantity}.{symbol}",
        "unit": None if symbol else choose_figure_unit(quantity, figure, system),
    }


def _make_cell(row: CoverageRow, found: Sequence[CatalogueRow]) -> Json:
    """Return the range of the values of each kind, SI, and the sources in full."""
    ends: dict[str, list[float]] = {}
    for one in found:
        if one.kind and one.figure in KEYS_OF_FIGURE[row.figure][0]:
            values = (one.value_si, one.value_to_si)
            ends.setdefault(one.kind, []).extend(
                _convert_to_figure(one, value) for value in values if value is not None
            )
    ends = {kind: ends[kind] for kind in get_args(Kind) if kind in ends}
    first = next(iter(ends.values()), [])
    # Figures that cannot be converted, as printed, with their conditions.
    akin = [f"{one.as_printed}{f', {one.condition}' * bool(one.condition)}"
            for one in found if one.as_printed and not ends]  # fmt: skip
    return {
        "published": row.published,
        "parts": _list_ranges(ends),
        "value": max(map(abs, first), default=None),
        "akin": "; ".join(dict.fromkeys(akin)),
        "sources": list(
            dict.fromkeys(_describe_source(one) for one in found if one.state != "not looked up")
        ),
    }


def _list_ranges(ends: Mapping[str, Sequence[float]]) -> list[tuple[float, float, str]]:
    """Return each range of values with all of its kinds."""
    kinds: dict[tuple[float, float], list[str]] = {}
    for kind, values in ends.items():
        kinds.setdefault((min(values), max(values)), []).append(kind.replace("sigma", "σ"))
    return [(low, high, join_names(names)) for (low, high), names in kinds.items()]


def _convert_to_figure(row: CatalogueRow, value: float) -> float:
    """Return N of a noise density, one-sided if it is unknown, and any other figure itself."""
    if row.figure != "noise_density":
        return value
    is_power = row.unit_si == SI_UNITS[f"{row.quantity}_power_density"]
    convert = convert_power_density if is_power else convert_density
    return convert(value, "two-sided" if row.sidedness == "two-sided" else "one-sided")


def _describe_source(row: CatalogueRow) -> str:
    secondary = "secondary source" * (row.source == "secondary")
    parts = (row.as_printed or row.state, row.condition, row.place, secondary)
    return f"{row.figure.replace('_', ' ')}: {'; '.join(filter(None, parts))}"


def format_counts(published: Iterable[str]) -> str:
    """Return how many sensors publish a figure as text, such as ``5 of 8 (not checked: 2)``."""
    counts = Counter(published)
    unknown = counts["not looked up"]
    text = f"{sum(counts[one] for one in _PUBLISHED)} of {counts.total() - unknown}"
    return f"{text} (not checked: {unknown})" if unknown else text


def _make_share(rows: Sequence[CoverageRow]) -> Json:
    published = sum(row.published in _PUBLISHED for row in rows)
    whole = sum(row.published != "not looked up" for row in rows)
    share = published / whole if whole else None
    return {"value": share, "text": percent_text(share, 2), "of": f"{published} of {whole}"}


def compare_with_paper(rows: Sequence[CoverageRow]) -> str:
    """Return how the catalogue supports Maia et al., who find datasheets incomplete, in words."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        published = found.setdefault((row.sensor, row.quantity), [])
        if row.figure in _PAPER_FIGURES and row.published in _PUBLISHED:
            published.append(row.figure)
    complete = sum(len(published) == len(_PAPER_FIGURES) for published in found.values())
    counts = [
        f"{_make_share([row for row in rows if row.figure == figure])['of']} print {figure}"
        for figure in _PAPER_FIGURES
    ]
    return (
        "Maia et al. state that most manufacturers document stochastic errors incompletely. "
        f"{complete} of the {len(found)} gyroscopes and accelerometers below have all of "
        f"{join_names(_PAPER_FIGURES)} published. Of those whose "
        f"documents were checked, {join_names(counts)}."
    )


def _make_context(site: Site) -> Mapping[str, object]:
    lines = list(compare_sensors_with_datasheets(site.views, site.system))
    covered = site.rows(CoverageRow)
    return {
        "lines": lines,
        "filters": {
            "figure": list(dict.fromkeys(line["quantity"] for line in lines)),
            "sensor": list(dict.fromkeys(site.names[line["sensor"]] for line in lines)),
        },
        "tables": list(make_catalogue_tables(covered, site.rows(CatalogueRow), site.system)),
        "claim": compare_with_paper(covered) if covered else "",
    }


DATASHEETS = Entry(
    file="datasheets.html",
    title="Datasheets",
    context=_make_context,
    tables=("catalogue", "coverage"),
    exists=lambda site: bool(site.rows(CoverageRow)),
    views=lambda site: site.views,
)
