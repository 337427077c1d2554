"""The page of fusion: how many cheap sensors match one good sensor."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from imubench_pipeline.extensions.fusion.tables import FusionRow, GradeRow, PublishedFigureRow
from imubench_pipeline.report import thermal
from imubench_pipeline.report.payload import Arrays, pack_channel, pack_styles
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import QUANTITY_NAMES, RecordingView
from imubench_pipeline.words.numbers import limit_digits, number_text, percent_text

_PARAMETER_TEXTS = {"N": "white noise", "B": "bias instability", "K": "random walk", "R": "ramp"}


def _make_context(site: Site) -> dict[str, Any]:
    lines = list(make_pair_lines(site.rows(FusionRow)))
    sensors = site.settings["sensors"]
    return {
        "lines": lines,
        "matrices": list(make_matrices(lines)),
        "grades": list(make_grade_lines(site.rows(GradeRow))),
        "unprinted": find_unprinted_grades(site.rows(GradeRow)),
        "filters": {
            "tau": list(dict.fromkeys(line["tau"] for line in lines)),
            "quantity": list(dict.fromkeys(line["quantity"] for line in lines)),
            "wanted": list(dict.fromkeys(site.names[line["other"]] for line in lines)),
            "sensor": list(dict.fromkeys(site.names[line["sensor"]] for line in lines)),
        },
        "shared": describe_common_errors(site.settings["settings"]["fusion"]["common"]),
        "price_classes": {name: sensors.get(name, {}).get("price_class") for name in site.sensors},
    }


FUSION = Entry(
    file="fusion.html", title="Fusion", context=_make_context, tables=("fusion", "grades"), place=2
)


def describe_common_errors(common: Mapping[str, float]) -> str:
    """Return the assumptions on common errors: the common shares of the variance of N, B, K, R."""
    named = [
        f"{percent_text(share)} of the variance of the {_PARAMETER_TEXTS[name]} ({name})"
        for name, share in common.items()
        if share > 0.0
    ]
    shared = "The noise of each unit is assumed to be independent."
    if named:
        shared = f"The units of one sensor are assumed to share {', '.join(named)}."
    return (
        f"{shared} The effect of a logged temperature counts as common to all units. Other common "
        "influences (supply, motion, a temperature that is not logged) make the numbers too small."
    )


def make_pair_lines(rows: Sequence[FusionRow]) -> Iterator[dict[str, Any]]:
    """Yield the lines of the table: pairs whose first sensor is the noisier one, or unknown."""
    for row in rows:
        if row.adev is not None and row.other_adev is not None:
            if row.adev <= row.other_adev:
                continue
        elif row.sensor > row.other:
            continue  # an unknown pair is listed once
        number = "–" if row.n is None else _round_up(row.n)
        common = percent_text(row.common_share) if row.common_share is not None else "–"
        if row.common_share is not None and row.temperature_share:
            common += f" (temperature {percent_text(row.temperature_share)})"
        yield {
            **row.columns(),
            "reason": "; ".join(row.reasons),
            "quantity": QUANTITY_NAMES[row.quantity],
            "symbol": f"{row.quantity}.adev",
            "tau": f"{number_text(row.tau)} s",
            "seconds": row.tau,
            "number": "not possible" if row.reachable is False else number,
            "limits": _format_limits(row),
            "common": common,
        }


def make_matrices(lines: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield a matrix of pair lines for each quantity and averaging time, the quietest first."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for line in lines:
        groups.setdefault((line["quantity"], line["tau"]), []).append(line)
    for (quantity, tau), own in groups.items():
        by_pair = {(line["sensor"], line["other"]): line for line in own}
        levels = {line[of]: line[adev] for line in own for of, adev in _PAIR_COLUMNS if line[adev]}
        sensors = sorted(levels, key=lambda sensor: (levels[sensor], sensor))
        if 1 < len(sensors) <= _MAX_MATRIX_SENSORS:
            cells = [[by_pair.get((row, column)) for column in sensors] for row in sensors]
            yield {
                "name": f"{quantity}, {tau}",
                "symbol": own[0]["symbol"],
                "sensors": sensors,
                "levels": [levels[sensor] for sensor in sensors],
                "cells": cells,
            }


_PAIR_COLUMNS = (("sensor", "adev"), ("other", "other_adev"))
_MAX_MATRIX_SENSORS = 40  # for which a matrix is readable


def make_grade_lines(rows: Sequence[GradeRow]) -> Iterator[dict[str, Any]]:
    """Yield the lines of the table of classes: one per sensor and option with printed figures."""
    groups: dict[tuple[str, ...], dict[str, GradeRow]] = {}
    for row in rows:
        key = (row.quantity, row.sensor, row.grade, row.option or "")
        # A density of unknown sidedness has two rows: the first reading is shown.
        groups.setdefault(key, {}).setdefault(row.statistic, row)
    for (quantity, sensor, _, option), by in groups.items():
        if not any(row.printed for row in by.values()):
            continue
        yield {
            "quantity": QUANTITY_NAMES[quantity],
            "sensor": sensor,
            "simulated": any(row.simulated for row in by.values()),
            "grade": next(row.grade_name for row in by.values()),
            "option": option,
            "symbol": quantity,
            "cells": [
                {
                    "name": name,
                    "value": row.value if row else None,
                    "printed": row.printed if row else None,
                    "n": row.n if row else None,
                    "number": "–" if row is None or row.n is None else _round_up(row.n),
                    "limits": "" if row is None else _format_grade_limits(row),
                    "reason": (row.reason or "") if row else "",
                }
                for name in ("N", "sigma_min")
                for row in (by.get(name),)
            ],
        }


def find_unprinted_grades(rows: Sequence[GradeRow]) -> dict[str, str]:
    """Return the sensors of the class without printed figures of a quantity, and the reasons."""
    groups: dict[tuple[str, str], list[GradeRow]] = {}
    for row in rows:
        groups.setdefault((row.quantity, row.grade_name), []).append(row)
    return {
        f"{name}, {QUANTITY_NAMES[quantity].lower()}": own[0].reason or ""
        for (quantity, name), own in groups.items()
        if not any(row.printed for row in own)
    }


def _format_grade_limits(row: GradeRow) -> str:
    if row.n_upper is None:
        return ""
    upper = _round_up(row.n_upper)
    if row.n is None or row.n_lower is None:
        return f"at most {upper}"
    lower = _round_up(row.n_lower)
    return "" if lower == upper else f"{lower} to {upper}"


def _format_limits(row: FusionRow) -> str:
    if row.lower is None:
        return ""
    if row.upper is None:
        return f"{_round_up(row.lower)} or more"
    lower, upper = _round_up(row.lower), _round_up(row.upper)
    return lower if lower == upper else f"{lower} to {upper}"


def _round_up(number: float) -> str:
    # Tolerate rounding errors just above a whole number.
    return number_text(max(math.ceil(number * (1.0 - 1e-9)), 1), 4)


_MAX_AGREEING_DIFFERENCE = 0.05  # relative, up to which result and printed figure agree
_UNIT_SYMBOLS = {"bias": "signal"}  # of a parameter, where it is not its own


def _make_boards_context(site: Site) -> dict[str, Any]:
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
    context=_make_boards_context,
    views=lambda site: [
        view for name in site.settings["boards"] for view in _select_recordings(site, name)
    ],
    exists=lambda site: bool(site.settings.get("boards")),
    place=3,
)


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
