"""List the figures that vendors publish, and the figures that users must measure."""

from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import product
from typing import Literal

from imubench_pipeline.model.comparisons import CoverageRow, VendorCoverageRow
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, PrintedFigure, QuantityDatasheet
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor

Published = Literal["yes", "no", "other convention", "not looked up"]
"""Whether a vendor publishes a figure.

``other convention``: a related figure, such as an rms for N or a total over temperature for the
coefficient; ``no``: looked up (null), and not published; ``not looked up``: the sensor file does
not say, so it counts neither as published nor as unpublished.
"""

KEYS_OF_FIGURE: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "N": (("noise_density", "random_walk"), ("rms_noise",)),
    "B": (("bias_instability",), ("allan_deviation", "drift")),
    "K": (("rate_random_walk",), ()),
    "T_B": (("correlation_time",), ()),
    "temperature_coefficient": (
        ("temperature_coefficient",),
        ("temperature_total", "temperature_rms"),
    ),
    "offset": (("offset",), ("bias_repeatability",)),
    "scale_factor_error": (("scale_factor_error",), ()),
    "scale_factor_temperature": (("scale_factor_temperature",), ()),
    "nonlinearity": (("nonlinearity",), ()),
    "cross_axis": (("cross_axis", "misalignment"), ()),
    "g_sensitivity": (("g_sensitivity",), ()),
    "vibration_rectification": (("vibration_rectification",), ()),
    "full_scale": (("full_scale",), ()),
    "bandwidth": (("bandwidth",), ()),
}
"""Keys of a datasheet that give each figure, and keys that give it in another convention."""


def coverage(sensors: Mapping[str, Sensor]) -> list[CoverageRow]:
    """Return whether each figure is published: a row per sensor for sale, quantity and figure."""
    rows = []
    for (name, sensor), quantity in product(sensors.items(), QUANTITIES):
        datasheet = sensor.datasheet
        sheet: QuantityDatasheet | None = getattr(datasheet, quantity)
        if sheet is None or not sensor.sold:
            continue
        revision = f", revision {datasheet.revision}" if datasheet.revision else ""
        for figure, (plain, akin) in KEYS_OF_FIGURE.items():
            if not FIGURE_DIMENSIONS[quantity].keys() & plain:
                continue
            printed = [each for key in (*plain, *akin) for each in sheet.printed(key)]
            sources = dict.fromkeys(each.source or datasheet.source or "" for each in printed)
            published: Published = "not looked up"
            if any(each.kind != "derived" for key in plain for each in sheet.printed(key)):
                published = "yes"
            elif printed:
                published = "other convention"
            elif any(sheet.looked_up(key) for key in plain):
                published = "no"
            row = CoverageRow(
                sensor=name,
                vendor=sensor.vendor,
                model=sensor.model,
                quantity=quantity,
                figure=figure,
                published=published,
                as_printed=tuple(map(format_figure, printed)),
                document=f"{datasheet.document}{revision}" if datasheet.document else None,
                source=" and ".join(filter(None, sources)) or datasheet.source,
            )
            rows.append(row)
    return rows


def by_vendor(rows: Iterable[CoverageRow]) -> list[VendorCoverageRow]:
    """Count the rows of `coverage` by vendor, quantity and figure, in the order of the vendors."""
    counts: dict[tuple[str, str, str], Counter[str]] = {}
    for row in rows:
        counts.setdefault((row.vendor, row.quantity, row.figure), Counter())[row.published] += 1

    def order(item: tuple[tuple[str, str, str], Counter[str]]) -> tuple[str, int, int]:
        vendor, quantity, figure = item[0]
        place = list(QUANTITIES).index(quantity), list(KEYS_OF_FIGURE).index(figure)
        return vendor.lower(), *place

    return [
        VendorCoverageRow(
            vendor=vendor,
            quantity=quantity,
            figure=figure,
            sensors=count.total(),
            yes=count["yes"],
            other_convention=count["other convention"],
            no=count["no"],
            not_looked_up=count["not looked up"],
        )
        for (vendor, quantity, figure), count in sorted(counts.items(), key=order)
    ]


def format_figure(figure: PrintedFigure) -> str:
    """Return value, unit, kind and qualifiers of a figure as text."""
    value, numbers = figure.value, ""
    if isinstance(value, dict):
        numbers = ", ".join(f"{axes} {number:g}" for axes, number in value.items())
    elif isinstance(value, tuple):
        numbers = (" to " if figure.kind == "range" else ", ").join(f"{v:g}" for v in value)
    elif value is not None:
        numbers = f"{value:g}"
    parts = (
        numbers,
        figure.unit,
        figure.kind,
        figure.option and f"({figure.option})",
        figure.bandwidth and f"over {figure.bandwidth}",
        figure.tau and f"at {figure.tau}",
    )
    return " ".join(part for part in parts if part)
