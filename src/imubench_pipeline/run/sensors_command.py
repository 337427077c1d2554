"""`imubench sensors`: the catalogue in the terminal."""

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from imubench_pipeline.report.show import show
from imubench_pipeline.settings.command_line import CommandError, add_units
from imubench_pipeline.tables.outputs import add_output

if TYPE_CHECKING:
    from rich.console import RenderableType

    from imubench_pipeline.report.practical import System
    from imubench_pipeline.settings.sensor import Sensor

_LISTED = (("gyro", "N"), ("gyro", "B"), ("accel", "N"), ("accel", "B"))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.description = (
        "List the sensors of the catalogue, or those whose name, vendor or product contains a "
        "text; show all figures of one, with the place where each was read."
    )
    parser.add_argument(
        "text", nargs="?", default="", help="part of a name or product, such as bmi or d435i"
    )
    parser.add_argument(
        "--sensors",
        type=Path,
        metavar="FOLDER",
        help="of the sensor files; default: the catalogue of the package and config/sensors",
    )
    add_units(parser)
    add_output(
        parser,
        "--class-limits",
        help="write the limits of each class, from all sensors, into this CSV file",
    )
    add_output(
        parser,
        "--csv",
        help="write every figure of the sensors found, also as SI, into this CSV file",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print the catalogue or a sensor, or write figures or limits; return the exit status."""
    # Loaded here, so that other commands answer at once.
    from imubench_pipeline.datasheets.catalogue import list_catalogue
    from imubench_pipeline.datasheets.class_limits import derive_class_limits, write_class_limits
    from imubench_pipeline.settings.config import Run
    from imubench_pipeline.settings.sensor import read_sensors
    from imubench_pipeline.settings.shipped import list_folders
    from imubench_pipeline.tables.files import build, write_csv

    sensors = read_sensors(list_folders(arguments.sensors or Run().sensors, "sensors"))
    found = find_sensors(sensors, arguments.text)
    if not found:
        raise CommandError(
            f"no sensor {arguments.text!r} among {len(sensors)}; `imubench sensors` lists all"
        )
    if arguments.class_limits:
        limits = derive_class_limits(sensors)
        arguments.class_limits.write(write_class_limits(limits))
        print(f"{len(limits)} limits of {len(sensors)} sensors")
    if arguments.csv:
        figures = build("catalogue", list_catalogue(found))
        with arguments.csv.replacing() as temporary, temporary.open("wb") as file:
            write_csv(figures, file)
        print(f"{figures.num_rows} rows of {len(found)} sensors")
    if arguments.class_limits or arguments.csv:
        return 0
    exact = arguments.text.lower() in found
    if arguments.text and (len(found) == 1 or exact):
        name = arguments.text.lower() if exact else next(iter(found))
        show(lambda width: _render_sensor(name, sensors[name]))
    else:
        show(lambda width: _render_list(found, arguments.units, width))
    return 0


def find_sensors(sensors: Mapping[str, "Sensor"], text: str) -> dict[str, "Sensor"]:
    """Return the sensors whose file, model, vendor or product contains a text, in order."""
    asked = "".join(letter for letter in text.lower() if letter.isalnum())
    return {
        name: sensor
        for name, sensor in sorted(sensors.items())
        if any(
            asked in "".join(letter for letter in known.lower() if letter.isalnum())
            for known in (name, sensor.model, sensor.vendor, *sensor.aliases)
        )
    }


def _render_list(
    sensors: Mapping[str, "Sensor"], system: "System", width: int
) -> Iterator["RenderableType"]:
    from imubench_pipeline.datasheets.class_limits import read_sigma
    from imubench_pipeline.report.practical import choose_page_unit
    from imubench_pipeline.report.terminal import fit_table

    units = {key: choose_page_unit(*key, system) for key in _LISTED}
    heads = ["sensor", "grade", *(f"{q} {s}\n{unit.sign}" for (q, s), unit in units.items())]
    lines = [
        [
            name,
            sensor.grade or "–",
            *(unit.text(read_sigma(sensor, *key), 3) for key, unit in units.items()),
        ]
        for name, sensor in sensors.items()
    ]
    title = f"{len(lines)} sensors: worst axis, one standard deviation; –: not printed"
    yield fit_table(title, heads, lines, width, names=0)


def _render_sensor(name: str, sensor: "Sensor") -> Iterator["RenderableType"]:
    from rich.text import Text

    from imubench_pipeline.datasheets.coverage import format_figure
    from imubench_pipeline.settings.printed import QuantityDatasheet
    from imubench_pipeline.settings.sensor import QUANTITIES

    sheet = sensor.datasheet
    about = {
        "also": ", ".join(sensor.aliases),
        "grade": sensor.grade,
        "technology": ", ".join(sensor.technology),
        "price": sensor.price or sensor.price_class,
        "mass": sensor.mass,
        "power": sensor.power,
        "temperature": sensor.temperature_range and " to ".join(sensor.temperature_range),
        "rate": sensor.rate,
        "interface": sensor.interface,
        "document": ", ".join(filter(None, (sheet.document, sheet.revision, sheet.source))),
        "missing": sheet.missing,
    }
    yield Text(f"{name}: {sensor.vendor} {sensor.model}", style="bold")
    yield from (Text(f"  {key}: {value}") for key, value in about.items() if value)
    for quantity in QUANTITIES:
        figures: QuantityDatasheet | None = getattr(sheet, quantity)
        if figures is None:
            yield Text(f"no {quantity}")
            continue
        yield Text(f"{quantity}", style="bold")
        for key in QuantityDatasheet.model_fields:
            for figure in figures.printed(key):
                remarks = [figure.condition, figure.place, figure.evidence]
                remarks += [f"{figure.source} source"] if figure.source is not None else []
                about_it = "; ".join(filter(None, remarks))
                yield Text(f"  {key}: {format_figure(figure)}" + f" ({about_it})" * bool(about_it))
            if figures.looked_up(key) and not figures.printed(key):
                places = {one.place for one in getattr(figures, key) or () if one.place}
                yield Text(f"  {key}: not published" + "".join(f" ({p})" for p in sorted(places)))
