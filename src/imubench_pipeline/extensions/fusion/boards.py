"""The page of the boards: sensors that share a place, compared with the figures of a paper."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from imubench_pipeline.extensions.fusion.tables import PublishedFigureRow
from imubench_pipeline.report import thermal
from imubench_pipeline.report.payload import Arrays, channel_payload, looks
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import ChannelView, RecordingView
from imubench_pipeline.words.numbers import limit_digits, number_text

_MAX_AGREEING_DIFFERENCE = 0.05
"""Relative difference up to which result and printed figure agree."""

_UNIT_SYMBOLS = {"bias": "signal"}
"""Symbol of the unit of a parameter, where it differs from that of the parameter."""


def _make_context(site: Site) -> dict[str, Any]:
    arrays = Arrays()
    boards = []
    payloads: list[dict[str, Any]] = []
    for name, board in site.settings["boards"].items():
        views = _select_recordings(site, name)
        channels = {view.sensor: view.channels() for view in views}
        payloads += (
            channel_payload(channel, channel.rate, arrays)
            for view in views
            for channel in channels[view.sensor]
        )
        boards.append(
            {
                "name": name,
                "title": board["title"],
                "note": board["note"],
                "shared": _describe_shared(board),
                "sensors": [
                    {
                        "view": view,
                        "name": site.names[view.sensor],
                        "channels": [
                            _describe_channel(site, view, channel, board["sensors"][view.sensor])
                            for channel in channels[view.sensor]
                        ],
                    }
                    for view in views
                ],
                "lost": sorted(set(board["sensors"]) - {view.sensor for view in views}),
            }
        )
    used = {channel["sensor"]: site.looks[channel["sensor"]] for channel in payloads}
    page = {"looks": looks(used), "channels": payloads, "arrays": arrays.texts}
    return {"boards": boards, "page": page}


def _select_recordings(site: Site, board: str) -> list[RecordingView]:
    """Return the recordings of a board that could be analysed."""
    of_board = site.settings["boards"][board]["sensors"]
    return [
        view
        for view in site.views
        if view.simulated
        and view.name == f"sim_{board}"
        and view.sensor in of_board
        and not view.left_out
    ]


BOARDS = Entry(
    file="boards.html",
    title="Boards",
    context=_make_context,
    views=lambda site: [
        view for name in site.settings["boards"] for view in _select_recordings(site, name)
    ],
    exists=lambda site: bool(site.settings.get("boards")),
    place=3,
)
"""The page that shows every board."""


def _describe_shared(board: Mapping[str, Any]) -> str:
    shared = ["one temperature"] * board["temperature"] + ["one motion"] * bool(board["motion"])
    if not shared:
        return "The sensors share only their place."
    return f"All sensors of the board share {' and '.join(shared)}."


def _describe_channel(
    site: Site, view: RecordingView, channel: ChannelView, figures: Mapping[str, str | None]
) -> dict[str, Any]:
    rows = view.rows(PublishedFigureRow)
    return {
        "view": channel,
        "figures": figures.get(channel.channel),
        "answer": thermal.answer(channel, site.system),
        "lines": list(published_lines(row for row in rows if row.channel == channel.channel)),
    }


def published_lines(rows: Iterable[PublishedFigureRow]) -> Iterator[dict[str, Any]]:
    """Yield the lines of the printed figures of a channel, from rows of ``published_figures``."""
    for row in rows:
        quantity = row.channel.split("_")[0]
        ours = row.datasheet if row.of == "datasheet" else row.value
        ratio = ours / row.means if ours and row.means else None
        yield {
            **row.columns(),
            "unit": f"{quantity}.{_UNIT_SYMBOLS.get(row.parameter, row.parameter)}",
            "digits": limit_digits(row.lower, row.upper, 4),
            "ratio": "–" if ratio is None else number_text(ratio, 3),
            "differs": ratio is not None and abs(ratio - 1.0) > _MAX_AGREEING_DIFFERENCE,
        }
