"""The pages of a sensor and of a device: agreement and change of its recordings."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from typing import Any
from urllib.parse import urlencode

from imubench_pipeline.model import comparisons
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.navigation.drift import SIGNIFICANCE_LEVEL
from imubench_pipeline.registry import Hook
from imubench_pipeline.report import meaning
from imubench_pipeline.report.comparison import Comparison
from imubench_pipeline.report.datasheets import compare_with_datasheet, format_repeatability
from imubench_pipeline.report.log_screen import group_events
from imubench_pipeline.report.palette import make_recording_styles
from imubench_pipeline.report.payload import FOREST, pack_styles
from imubench_pipeline.report.picture import draw_picture
from imubench_pipeline.report.practical import System, format_temperature
from imubench_pipeline.report.site import Page, Site
from imubench_pipeline.report.start import explain_missing_rank, summarise_recordings
from imubench_pipeline.report.view import QUANTITY_NAMES, RecordingView
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.findings import LEFT_OUT
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words import verdicts
from imubench_pipeline.words.estimates import symbol_text
from imubench_pipeline.words.events import events_text, missing_axes_texts
from imubench_pipeline.words.numbers import NO_VALUE, count_digits, counted, number_text, sentence

_TREND_COLUMNS = ("value", "lower", "upper", "expected_lower", "expected_upper", "verdict")
_UNIT_SYMBOLS = {"bias": "signal"}
_MAX_EVENTS = 3
_COMMANDS: Hook[Callable[[str, str], tuple[str, Iterable[tuple[str, str]]]]] = Hook(
    "sensor_commands"
)
"""Commands for a sensor that extensions add, by the folder of the results: label, then lines."""

_MAX_DETAILED_RECORDINGS = 12
"""With more recordings the page of a sensor has no budgets and no comparison with the datasheet."""


def make_sensor_page(site: Site, sensor: str) -> Page:
    """Return the page of a sensor."""
    own = [view for view in site.views if view.sensor == sensor]
    key = site.key_of(
        *(view.key for view in own),
        *(view.device_page for view in own),
        [row for row in site.rows(comparisons.PooledRow) if row.sensor == sensor],
        [row for row in site.rows(comparisons.RepeatabilityRow) if row.sensor == sensor],
        [row for row in site.rows(comparisons.RankingRow) if row.decides or row.sensor == sensor],
        [row for row in site.rows(comparisons.CoverageRow) if row.sensor == sensor],
        site.looks[sensor],
    )
    context = partial(_make_sensor_context, site, sensor, own)
    return Page(site.sensor_page(sensor), "sensor.html.jinja", key, context)


def _make_sensor_context(
    site: Site, sensor: str, own: Sequence[RecordingView]
) -> Mapping[str, object]:
    compared = site.select_compared(own)
    together = Comparison(site.compared(compared), site.names)
    pooled = [
        row.columns()
        | {
            "axis": row.channel.replace("_", " "),
            "digits": count_digits(row.value, row.lower, row.upper, row.parameter),
            "ref": f"{quantity_of(row.channel)}.{_UNIT_SYMBOLS.get(row.parameter, row.parameter)}",
            "name": symbol_text(row.parameter),
        }
        for row in site.rows(comparisons.PooledRow)
        if row.sensor == sensor
    ]
    shown = own if len(own) <= _MAX_DETAILED_RECORDINGS else []
    deltas = []
    for channel in (channel for view in shown for channel in view.channels()):
        rows = list(compare_with_datasheet(channel, site.coverage, site.system))
        if any(row["published"] for row in rows):
            deltas.append({"view": channel, "rows": rows})
    by_device = group_rows(own, lambda view: (view.row.device, view.device_page))
    price_class = site.settings["sensors"].get(sensor, {}).get("price_class")
    simulated = {view.full_name: view.simulated for view in own}
    budget = [row for view in shown for row in view.budget]
    chosen = _choose_recording(site, sensor, own)
    return {
        "name": site.names[sensor],
        "simulated": all(view.simulated for view in own),
        "summary": (f"Class, price: {price_class}. " if price_class else "")
        + summarise_recordings(own, several=False),
        "answer": verdicts.sensor_answer_text(_list_verdicts(site, sensor)),
        "verdicts": list(trace_verdicts(site, sensor, own)),
        "card": chosen and _describe_card(chosen, site.system),
        "missing": _list_missing(own),
        "events": list(_list_events(own, site.system)),
        "commands": {
            label: list(lines)
            for add in _COMMANDS.objects()
            for label, lines in [add(sensor, site.results_name)]
        }
        if any(view.static for view in own) and not site.at_once
        else {},
        "beside": urlencode({"a": sensor}) if any(view.static for view in own) else "",
        "devices": [
            {"name": name, "page": page, "views": of, "count": counted(len(of), "recording")}
            for (name, page), of in by_device.items()
        ],
        "forest": FOREST,
        "several": sum(view.static for view in own) > 1,
        "parameter_tables": list(together.tables()),
        "pooled": pooled,
        "pooled_filters": {
            "axis": list(dict.fromkeys(row["axis"] for row in pooled)),
            "parameter": list(dict.fromkeys(row["name"] for row in pooled)),
        },
        "budgets": list(meaning.make_budget_tables(budget, simulated, site.system)),
        "budget_words": meaning.explain_budget(site.settings["settings"]["error_budget"]),
        "latest": len(compared) < len(own),
        "too_many": len(own) > _MAX_DETAILED_RECORDINGS,
        "deltas": deltas,
        "repeated": list(
            format_repeatability(site.rows(comparisons.RepeatabilityRow), sensor, site.system)
        ),
        "page": {
            "grouped": "recording",
            "recordings": [view.name for view in compared],
            "looks": pack_styles({sensor: site.looks[sensor]})
            | {"places": [asdict(look) for look in make_recording_styles(site.looks[sensor])]},
            "names": site.names,
            "budgets": [
                meaning.make_budget_bars(view.budget, site.system) for view in shown if view.budget
            ],
            **together.page,
        },
    }


def _list_verdicts(site: Site, sensor: str) -> Iterator[tuple[str, Verdict]]:
    rows = site.rows(comparisons.RankingRow)
    deciding = {row.requirement: row for row in rows if row.sensor == sensor and row.decides}
    for name in site.settings["requirements"] if rows else ():
        title, row = name.replace("_", " "), deciding.get(name)
        if row and row.shortfalls:
            title += f" ({'; '.join(map(verdicts.shortfall_text, row.shortfalls))})"
        yield title, row.verdict if row else "not_enough_data"


def _choose_recording(
    site: Site, sensor: str, own: Sequence[RecordingView]
) -> RecordingView | None:
    """Return the recording of a card: the one that decides, else the longest, if used if any."""
    deciding = {
        row.recording
        for row in site.rows(comparisons.RankingRow)
        if row.sensor == sensor and row.decides
    }
    drawn = [view for view in own if view.static and view.channel_names]

    def preference(view: RecordingView) -> tuple[bool, bool, int, float]:
        used = view.row.decides is not False
        return view.name in deciding, used, len(view.channel_names), view.row.duration or 0.0

    return max(drawn, key=preference, default=None)


def _describe_card(view: RecordingView, system: System) -> Mapping[str, object]:
    drawn = {key: [one for one in view.channels() if one.quantity == key] for key in QUANTITY_NAMES}
    quantities = [
        (key, QUANTITY_NAMES[key], draw_picture(channels, system))
        for key, channels in drawn.items()
        if channels
    ]
    return {"recording": view.name, "quantities": quantities}


def _list_missing(own: Sequence[RecordingView]) -> list[str]:
    static = [view for view in own if view.static]
    shown = {name for view in static for name in view.channel_names}
    named = {row.channel for view in static for row in view.findings if row.channel}
    return missing_axes_texts(shown, named) if shown else []


def _list_events(own: Sequence[RecordingView], system: System) -> Iterator[str]:
    found = [row for view in own for row in view.findings if row.finding not in LEFT_OUT]
    for event in group_events(found)[:_MAX_EVENTS]:
        yield sentence(events_text(event.findings, system, event.factors()))


def make_device_page(site: Site, page: str) -> Page:
    """Return the page of a device, its recordings by date; ``page`` is the path of the page."""
    own = [view for view in site.views if view.device_page == page]
    named = {view.full_name for view in own}
    rows = [row for row in site.rows(comparisons.DriftRow) if (row.sensor, row.recording) in named]
    key = site.key_of(*(view.key for view in own), rows)

    def make_context() -> Mapping[str, object]:
        sensor, simulated = own[0].sensor, own[0].simulated
        # As in `navigation.drift.order_of`: equal time stamps give no order.
        stamps = {row.started for row in rows}
        dated = None not in stamps and len(stamps) > 1
        trends, payload = _list_trends(rows, dated=dated, simulated=simulated)
        changed = [row for row in rows if row.verdict == "changed"]
        return {
            "sensor_page": site.sensor_page(sensor),
            "name": site.names[sensor],
            "device": own[0].row.device,
            "views": own,
            "summary": summarise_recordings(own, several=False),
            "changes": [describe_change(row, simulated=simulated) for row in changed],
            "order": "Recordings are plotted at their start times."
            if dated
            else "Some logs have no start time, so the recordings are plotted in the order of "
            "their names.",
            "trends": list(trends.items()),
            "page": {"trends": payload, "arrays": []},
        }

    return Page(page, "device.html.jinja", key, make_context)


def _list_trends(
    rows: Sequence[comparisons.DriftRow], *, dated: bool, simulated: bool
) -> tuple[dict[str, list[dict[str, Any]]], list[dict[str, Any]]]:
    trends: dict[str, list[dict[str, Any]]] = {}
    payload: list[dict[str, Any]] = []
    mark = " (simulated)" * simulated
    by_parameter = group_rows(rows, lambda row: (row.channel, row.parameter))
    for (channel, parameter), series in by_parameter.items():
        series.sort(key=lambda row: row.position)
        if all(row.value is None for row in series):
            continue
        quantity, axis = channel.split("_")
        title = f"{QUANTITY_NAMES[quantity]} {axis}"
        name = symbol_text(parameter)
        changes = [row.recording + mark for row in series if row.verdict == "changed"]
        words = f"changed in {', '.join(changes)}." if changes else "no change."
        if outside := [
            row.recording + mark
            for row in series
            if row.verdict == "as before"
            and row.p_value is not None
            and row.p_value < SIGNIFICANCE_LEVEL
        ]:
            lie = f"{', '.join(outside)} {'lies' if len(outside) == 1 else 'lie'}"
            words += f" {lie} outside the band, which may be chance among so many parameters."
        trends.setdefault(channel, []).append(
            {
                "title": title,
                "number": len(payload),
                "label": f"{name} of {title} in {counted(len(series), 'recording')}",
                "caption": f"{name}: {words}",
            }
        )
        payload.append(
            {
                "channel": channel,
                "parameter": parameter,
                "dated": dated,
                "started": [row.started for row in series],
                "recordings": [row.recording for row in series],
                **{name: [getattr(row, name) for row in series] for name in _TREND_COLUMNS},
            }
        )
    return trends, payload


def describe_change(row: comparisons.DriftRow, *, simulated: bool) -> str:
    """Return the change of a parameter of a device in words, with its p-value."""
    name = symbol_text(row.parameter)
    by = "" if row.change is None else f" by {100 * row.change:+.0f} %".replace("-", "−")
    chance = f"{row.p_value:.1g}" if row.p_value is not None else "–"
    where = row.channel.replace("_", " ")
    recording = row.recording + (" (simulated)" if simulated else "")
    return f"{recording}, {where}: {name} changed{by} (p = {chance})."


def _describe_margins(row: comparisons.RankingRow) -> str:
    if row.verdict == "excluded":
        return "; ".join(map(verdicts.shortfall_text, row.shortfalls))
    if row.margin is None:
        return ""
    parts = [f"margin in use {number_text(row.margin, 3)}", verdicts.other_margins_text(row)]
    return ", ".join(filter(None, parts))


def trace_verdicts(
    site: Site, sensor: str, own: Sequence[RecordingView]
) -> Iterator[Mapping[str, object]]:
    """Yield, per requirement, the verdict on a sensor, and the numbers and recordings behind it."""
    rows = site.rows(comparisons.RankingRow)
    own_rows = [row for row in rows if row.sensor == sensor]
    totals = [
        (view, [row for row in view.rows(comparisons.ErrorBudgetRow) if row.source == "total"])
        for view in own
        if view.static
    ]
    simulated = {view.full_name: view.simulated for view in own}
    requirements = site.requirements if rows else {}
    for name, groups in meaning.format_rankings(own_rows, requirements, simulated, site.system):
        requirement = requirements[name]
        about = {
            "name": name,
            "title": requirement.title,
            "asked": verdicts.requirement_text(requirement),
        }
        if not groups:
            word, why = verdicts.SHORT_VERDICTS["not_enough_data"], explain_missing_rank(own)
            nothing = {"row": None, "verdict": "not_enough_data", "margins": ""}
            yield {**about, **nothing, "word": word, "why": why}
            continue
        (group,) = groups
        row = group.row
        reasons = {limit.reason for limit in group.limits}
        judged = sum(r.rank is not None and r.decides for r in rows if r.requirement == name)
        window = "turn-on biases, not calibrated" if requirement.turn_on else ""
        if requirement.static_window:
            window = f"{requirement.static_window} at rest right before"
        alternatives = (
            ("As logged", "logged_margin", row.logged_margin, row.logged_verdict),
            (
                "With the unit corrected",
                "corrected_margin",
                row.corrected_margin,
                row.corrected_verdict,
            ),
        )
        yield about | {
            "row": row,
            "verdict": row.verdict,
            "word": verdicts.SHORT_VERDICTS[row.verdict],
            "stated": verdicts.verdict_text(row.verdict)
            if row.conditions
            else verdicts.stated_verdict(row),
            "group": group,
            "place": f"rank {row.rank} of {judged}" if row.rank else "",
            "margins": _describe_margins(row),
            "known": any(limit.sigma != NO_VALUE for limit in group.limits),
            "same_reason": reasons.pop() if len(reasons) == 1 else "",
            "conditions": [verdicts.condition_text(each) for each in row.conditions],
            "spread": verdicts.spread_text(row),
            "left_out": verdicts.doubts_text(row.left_out, named=True),
            "alternatives": [
                (
                    words,
                    verdicts.verdict_text(verdict) if verdict else "",
                    meaning.source_number(row, column, number_text(size, 3)),
                )
                for words, column, size, verdict in alternatives
                if size is not None
            ],
            "window": window,
            "limits": [
                meaning.describe_limit(each)
                for each in own_rows
                if each.requirement == name and each.trajectory is None
            ],
            "recordings": [
                {
                    "view": view,
                    "axes": counted(len(view.recommended()), "axis", "axes"),
                    "temperature": format_temperature(view.row),
                    "errors": [
                        meaning.format_recording_error(total, site.system)
                        for total in of_view
                        if total.requirement == name
                    ],
                }
                for view, of_view in totals
            ],
        }
