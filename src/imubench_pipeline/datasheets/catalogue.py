"""List every figure of the sensor files as rows of the table ``catalogue``."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import product

from imubench_pipeline.datasheets.coverage import format_figure
from imubench_pipeline.model.comparisons import CatalogueRow
from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, PrintedFigure, QuantityDatasheet
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor
from imubench_pipeline.units import SI_UNITS, convert_to_si, find_dimension

_OF_SENSOR = {"vendor", "model", "aliases", "grade", "technology"}
_OF_FIGURE = {"unit", "option", "condition", "place", "evidence"}
"""Keys of a sensor file, and of a figure in it, with a column of the same name."""


def list_catalogue(sensors: Mapping[str, Sensor]) -> Iterator[CatalogueRow]:
    """Yield a row for each number of each figure of all sensors, in the order of the files."""
    for (name, sensor), quantity in product(sensors.items(), QUANTITIES):
        datasheet = sensor.datasheet
        sheet: QuantityDatasheet | None = getattr(datasheet, quantity)
        if sheet is None:
            continue
        for key in QuantityDatasheet.model_fields:
            if key not in FIGURE_DIMENSIONS[quantity]:
                continue
            make = partial(
                CatalogueRow,
                sensor=name,
                **sensor.model_dump(include=_OF_SENSOR),
                quantity=quantity,
                figure=key,
                document=datasheet.document,
                revision=datasheet.revision,
            )
            if not sheet.looked_up(key):
                yield make(state="not looked up")
                continue
            for figure in getattr(sheet, key) or (PrintedFigure(value=None),):
                yield from _list_numbers(
                    partial(
                        make,
                        **figure.model_dump(include=_OF_FIGURE),
                        source=figure.source or datasheet.source,
                    ),
                    figure,
                    FIGURE_DIMENSIONS[quantity][key],
                )


def _list_numbers(
    make: Callable[..., CatalogueRow], figure: PrintedFigure, dimensions: tuple[str, ...]
) -> Iterator[CatalogueRow]:
    """Yield a row for each number of a figure: by axis, or of a choice; a range is one row."""
    value, unit = figure.value, figure.unit or ""
    if value is None:
        yield make(state="not published")
        return
    dimension = find_dimension(unit, dimensions)
    numbers: list[tuple[str | None, float, float | None]]
    if isinstance(value, dict):
        numbers = [(axes, number, None) for axes, number in value.items()]
    elif isinstance(value, tuple):
        is_range = figure.kind == "range"
        numbers = [(None, value[0], value[1])] if is_range else [(None, v, None) for v in value]
    else:
        numbers = [(None, value, None)]
    for axes, number, end in numbers:
        yield make(
            state="derived" if figure.kind == "derived" else "published",
            value=number,
            value_to=end,
            value_si=convert_to_si(number, unit, dimension),
            value_to_si=None if end is None else convert_to_si(end, unit, dimension),
            unit_si=SI_UNITS[dimension],
            kind=figure.kind,
            axes=axes,
            sidedness=figure.sidedness if "density" in dimension else None,
            bandwidth=figure.bandwidth,
            tau=figure.tau,
            as_printed=format_figure(figure),
        )
