"""The page of fusion: how many cheap sensors match one good sensor."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from imubench_pipeline.extensions.fusion.tables import FusionRow, GradeRow, PublishedFigureRow
from imubench_pipeline.report import recording
from imubench_pipeline.report.payload import pack_page
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import QUANTITY_NAMES, ChannelView, RecordingView
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words.numbers import count_digits, number_text, percent_text

_PARAMETER_TEXTS = {"N": "white noise", "B": "bias instability", "K": "random walk", "R": "ramp"}


@dataclass(frozen=True)
class PairLine:
    """A line of the table of pairs."""

    row: FusionRow
    quantity: str
    tau: str
    number: str
    limits: str
    common: str


@dataclass(frozen=True)
class PairMatrix:
    """The pairs of sensors for a quantity and a tau; cells by row sensor and column sensor."""

    name: str
    symbol: str
    sensors: list[str]
    levels: list[float]
    cells: list[list[PairLine | None]]


@dataclass(frozen=True)
class GradeLine:
    """A line of the table of classes; its cells have figure, row, number and limits."""

    row: GradeRow  # any one of its rows
    quantity: str
    simulated: bool
    cells: list[tuple[str, GradeRow | None, str, str]]


def _make_context(site: Site) -> Mapping[str, object]:
    lines = list(make_pair_lines(site.rows(FusionRow)))
    sensors = site.settings["sensors"]
    return {
        "lines": lines,
        "matrices": list(make_matrices(lines)),
        "grades": list(make_grade_lines(site.rows(GradeRow))),
        "unprinted": find_unprinted_grades(site.rows(GradeRow)),
        "filters": {
            "tau": list(dict.fromkeys(line.tau for line in lines)),
            "quantity": list(dict.fromkeys(line.quantity for line in lines)),
            "wanted": list(dict.fromkeys(site.names[line.row.other] for line in lines)),
            "sensor": list(dict.fromkeys(site.names[line.row.sensor] for line in lines)),
        },
        "shared": describe_common_errors(site.settings["settings"]["fusion"]["common"]),
        "price_classes": {name: sensors.get(name, {}).get("price_class") for name in site.sensors},
    }


FUSION = Entry(
    file="fusion.html",
    title="Fusion",
    about="how many cheap sensors match one good sensor",
    context=_make_context,
    tables=("fusion", "grades"),
    exists=lambda site: bool(site.rows(FusionRow) or site.rows(GradeRow)),
    place=2,
)


def describe_common_errors(common: Mapping[str, float]) -> str:
    """Return the assumptions on common errors; ``common``: shared fractions of the variances."""
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


def make_pair_lines(rows: Sequence[FusionRow]) -> Iterator[PairLine]:
    """Yield lines of the table of pairs: the noisier sensor is first; unknown pairs occur once."""
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
        yield PairLine(
            row=row,
            quantity=QUANTITY_NAMES[row.quantity],
            tau=f"{number_text(row.tau)} s",
            number="not possible" if row.reachable is False else number,
            limits=_format_limits(row),
            common=common,
        )


def make_matrices(lines: Sequence[PairLine]) -> Iterator[PairMatrix]:
    """Yield a matrix of pair lines for each quantity and averaging time, the quietest first."""
    for (quantity, tau), own in group_rows(lines, lambda line: (line.quantity, line.tau)).items():
        by_pair = {(line.row.sensor, line.row.other): line for line in own}
        known = [(line.row.sensor, line.row.adev) for line in own]
        known += [(line.row.other, line.row.other_adev) for line in own]
        levels = {sensor: level for sensor, level in known if level}
        sensors = sorted(levels, key=lambda sensor: (levels[sensor], sensor))
        if 1 < len(sensors) <= _MAX_MATRIX_SENSORS:
            cells = [[by_pair.get((one, other)) for other in sensors] for one in sensors]
            symbol = f"{own[0].row.quantity}.adev"
            sorted_levels = [levels[sensor] for sensor in sensors]
            yield PairMatrix(f"{quantity}, {tau}", symbol, sensors, sorted_levels, cells)


_MAX_MATRIX_SENSORS = 40  # for which a matrix is readable


def make_grade_lines(rows: Sequence[GradeRow]) -> Iterator[GradeLine]:
    """Yield a line per quantity, sensor, class (grade) and option with printed figures."""
    groups: dict[tuple[str, ...], dict[str, GradeRow]] = {}
    for row in rows:
        key = (row.quantity, row.sensor, row.grade, row.option or "")
        # A density of unknown sidedness has two rows: the first reading is shown.
        groups.setdefault(key, {}).setdefault(row.statistic, row)
    for (quantity, *_), by in groups.items():
        if not any(row.printed for row in by.values()):
            continue
        cells = []
        for name in ("N", "sigma_min"):
            one = by.get(name)
            number = "–" if one is None or one.n is None else _round_up(one.n)
            cells.append((name, one, number, _format_grade_limits(one) if one else ""))
        simulated = any(row.simulated for row in by.values())
        yield GradeLine(next(iter(by.values())), QUANTITY_NAMES[quantity], simulated, cells)


def find_unprinted_grades(rows: Sequence[GradeRow]) -> dict[str, str]:
    """Return the reason for each sensor of the class that prints no figure of a quantity."""
    groups = group_rows(rows, lambda row: (row.quantity, row.grade_name))
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


def _make_boards_context(site: Site) -> Mapping[str, object]:
    boards = []
    drawn: list[ChannelView] = []
    for name, board in site.settings["boards"].items():
        views = _select_recordings(site, name)
        sensors = []
        for view in views:
            rows = view.rows(PublishedFigureRow)
            channels = []
            for channel in view.channels():
                drawn.append(channel)
                own = (row for row in rows if row.channel == channel.channel)
                channels.append(
                    {
                        "view": channel,
                        "figures": board["sensors"][view.sensor].get(channel.channel),
                        "answer": recording.describe_thermal(channel, site.system),
                        "lines": [make_published_line(row) for row in own],
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
    return {"boards": boards, "page": pack_page(drawn, site.looks)}


def _select_recordings(site: Site, board: str) -> list[RecordingView]:
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
    about="boards with several sensors: one by one and together",
    context=_make_boards_context,
    views=lambda site: [
        view for name in site.settings["boards"] for view in _select_recordings(site, name)
    ],
    exists=lambda site: bool(site.settings.get("boards")),
    place=3,
)


@dataclass(frozen=True)
class PublishedLine:
    """A printed figure of a channel."""

    row: PublishedFigureRow
    unit: str
    digits: int
    ratio: str
    differs: bool


def make_published_line(row: PublishedFigureRow) -> PublishedLine:
    """Return the line of the table that compares a published figure with ours."""
    quantity = row.channel.split("_")[0]
    ours = row.datasheet if row.of == "datasheet" else row.value
    ratio = ours / row.means if ours and row.means else None
    return PublishedLine(
        row=row,
        unit=f"{quantity}.{_UNIT_SYMBOLS.get(row.parameter, row.parameter)}",
        digits=count_digits(row.value, row.lower, row.upper, row.parameter),
        ratio="–" if ratio is None else number_text(ratio, 3),
        differs=ratio is not None and abs(ratio - 1.0) > _MAX_AGREEING_DIFFERENCE,
    )
