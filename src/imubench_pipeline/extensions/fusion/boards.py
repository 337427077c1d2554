"""The page of the boards: sensors that share a place, compared with the figures of a paper."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from imubench_pipeline.extensions.fusion.tables import PublishedFigureRow
from imubench_pipeline.report import thermal
from imubench_pipeline.report.payload import Arrays, pack_channel, pack_styles
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import RecordingView
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
        sensors = []
        for view in views:
            rows = view.rows(PublishedFigureRow)
            channels = []
            for channel in view.channels():
                payloads.append(pack_channel(channel, arrays))
                own = (row for row in rows if row.channel == channel.channel)
                channels.append(
                    {
                        "view": channel,
                        "figures": board["sensors"][view.sensor].get(channel.channel),
                        "answer": thermal.describe_thermal(channel, site.system),
                        "lines": list(make_published_lines(own)),
                    }
                )
            sensors.append({"view": view, "name": site.names[view.sensor], "channels": channels})
        shared = ["one temperature"] * board["temperature"] + ["one motion"] * bool(board["motion"])
        boards.append(
            {
                "name": name,
                "title": board["title"],
                "note": board["note"],
                "shared": f"All sensors of the board share {' and '.join(shared)}."
                if shared
                else "The sensors share only their place.",
                "sensors": sensors,
                "lost": sorted(set(board["sensors"]) - {view.sensor for view in views}),
            }
        )
    used = {channel["sensor"]: site.looks[channel["sensor"]] for channel in payloads}
    page = {"looks": pack_styles(used), "channels": payloads, "arrays": arrays.texts}
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


def make_published_lines(rows: Iterable[PublishedFigureRow]) -> Iterator[dict[str, Any]]:
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
