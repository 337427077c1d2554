"""`imubench export`: write the input file of a filter or simulator."""

import argparse
import tempfile
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from imubench_pipeline.run import sensors_command as sensors
from imubench_pipeline.settings import command_line
from imubench_pipeline.settings.config import Run
from imubench_pipeline.settings.sensor import IngestPlan, RecordingNotes, Sensor, read_sensors
from imubench_pipeline.settings.shipped import list_folders
from imubench_pipeline.tables import outputs

if TYPE_CHECKING:
    from imubench_pipeline.extensions.exports.imu import Imu
    from imubench_pipeline.extensions.exports.in_use import InUseNoise
    from imubench_pipeline.extensions.exports.programs import Program
    from imubench_pipeline.run.analysis.project import Stated

NOT_MEASURED = Path()  # --in-use without a log


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.add_argument(
        "results",
        type=Path,
        nargs="?",
        help="folder of the results of a run, or what `analyse --output` wrote",
    )
    parser.add_argument("--sensor", help="name of the sensor file; default: the only one")
    parser.add_argument(
        "--datasheet",
        metavar="NAME",
        help="instead of results: a sensor of the catalogue, such as bmi088, by its printed "
        "figures; what it does not print is the worst of its class",
    )
    add_options(parser)
    parser.add_argument(
        "--rate",
        type=command_line.make_number_type(1e-6, 1e9, "a rate above 0, in Hz", float),
        metavar="HZ",
        help="default: the recording's",
    )
    outputs.add_output(parser, "--output", help="where to write; default: the terminal")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of an exported file, for `imubench export` and `imubench calibrate`."""
    parser.add_argument(
        "--target", required=True, help="program, such as kalibr; a wrong name lists them all"
    )
    mode = parser.add_mutually_exclusive_group()
    for name, words in (
        ("bench", "the noise at rest; default, but not for programs that fly"),
        (
            "bounded",
            "the smallest model above the upper 95 %% limit of the measured curve, from 1 s to "
            "--horizon",
        ),
    ):
        mode.add_argument(f"--{name}", dest="mode", action="store_const", const=name, help=words)
    mode.add_argument(
        "--in-use",
        type=Path,
        nargs="?",
        const=NOT_MEASURED,
        metavar="LOG",
        help="at least the broadband noise of this log with motors on or on the way; without LOG "
        "what the authors of the program use or recommend",
    )
    parser.add_argument(
        "--motion",
        type=command_line.make_number_type(1e-3, 1e6, "a frequency above 0, in Hz", float),
        default=10.0,
        metavar="HZ",
        help="of the log in use: below it all is motion; default: 10",
    )
    parser.add_argument(
        "--axis", default="worst", help="worst, median, a device or a recording; default: worst"
    )
    parser.add_argument(
        "--horizon",
        type=command_line.make_number_type(
            1e-9, command_line.LONGEST, "a time above 0, such as 60 s", command_line.parse_seconds
        ),
        default="60 s",
        metavar="TIME",
        help="time of coasting, for the replacement of terms that the program does not support; "
        "default: 60 s",
    )
    parser.add_argument(
        "--inflate",
        dest="inflation",
        type=command_line.make_number_type(1e-6, 1e6, "a factor of 1e-6 to 1e6", float),
        default=1.0,
        metavar="FACTOR",
        help="multiplies every deviation",
    )
    parser.add_argument("--because", help="reason of --inflate, or of the use of unfit recordings")
    parser.add_argument(
        "--excess",
        dest="most_excess",
        type=command_line.make_number_type(1.0, 1e6, "a factor of 1 to 1e6", float),
        default=3.0,
        metavar="FACTOR",
        help="largest permitted ratio of the Allan deviation of a bound to its limit; default: 3",
    )
    parser.add_argument("--method", help="of the estimates; default: the recommended one")


def run(options: argparse.Namespace) -> int:
    """Write the input file of a program; return the exit status."""
    from imubench_pipeline.extensions.exports.imu import ExportError

    try:
        program = check_options(options)
        imu = _build_from_datasheet(options) if options.datasheet else _build_from_results(options)
        content = program.write(imu)
    except ExportError as error:
        raise command_line.CommandError(str(error)) from None
    if options.output is not None:
        options.output.write(content)
        print(f"{options.output.path}: {imu.mode}")
    elif isinstance(content, bytes):
        raise command_line.CommandError(f"files of {options.target} are binary; add --output FILE")
    else:
        print(content, end="")
    return 0


def check_options(options: argparse.Namespace) -> "Program":
    """Return the program that ``--target`` names; set the mode if ``--in-use`` is given.

    Raises CommandError for an inflation without a reason, ExportError for an unknown program.
    """
    from imubench_pipeline.extensions.exports.of_models import find_target

    if options.inflation != 1.0 and not options.because:
        raise command_line.CommandError("--inflate needs a reason; add --because '...'")
    if options.in_use is not None:
        options.mode = "in-use"
    return find_target(options.target)


def make_request(options: argparse.Namespace, **values: Any) -> Any:
    """Return the `Request` from the options of a command; ``values`` replace options."""
    from imubench_pipeline.extensions.exports.request import Request

    own = vars(options) | values
    return Request(**{each.name: own[each.name] for each in fields(Request) if each.name in own})


def _build_from_results(options: argparse.Namespace) -> "Imu":
    from imubench_pipeline.extensions.exports.imu import ExportError
    from imubench_pipeline.extensions.exports.request import build_imu, load, recordings_of

    if options.results is None:
        raise command_line.CommandError("found no folder of results; add it, or --datasheet NAME")
    tables, folder = load(options.results), recordings_of(options.results)
    sensor = options.sensor
    if sensor is None:
        names = sorted(set(tables["recordings"]["sensor"].to_pylist()))
        if len(names) != 1:
            raise ExportError(
                f"the results have {len(names)} sensors; add --sensor NAME; there are: "
                f"{', '.join(names)}"
            )
        (sensor,) = names
    known = _read_catalogue().get(sensor) if options.in_use else None
    measured = read_in_use(options.in_use, known, options.motion)
    return build_imu(tables, make_request(options, sensor=sensor, in_use=measured), folder)


def _read_catalogue() -> Mapping[str, Sensor]:
    return read_sensors(list_folders(Run().sensors, "sensors"))


def _build_from_datasheet(options: argparse.Namespace) -> "Imu":
    from imubench_pipeline.extensions.exports.from_datasheet import build_printed_imu
    from imubench_pipeline.extensions.exports.imu import ExportError
    from imubench_pipeline.extensions.exports.modes import apply_mode, choose_mode
    from imubench_pipeline.extensions.exports.targets import TARGETS

    if options.results is not None:
        raise command_line.CommandError("found results and --datasheet; omit one of the two")
    if options.mode == "bounded":
        raise ExportError("--bounded needs a log; omit it, or give results instead of --datasheet")
    found = sensors.find_sensors(_read_catalogue(), options.datasheet)
    name = options.datasheet.lower()
    if name not in found:
        near = f"; there are: {', '.join(found)}" if found else "; `imubench sensors` lists all"
        if len(found) != 1:
            raise ExportError(f"no sensor {options.datasheet!r}{near}")
        (name,) = found
    keys = ("horizon", "inflation", "because", "rate")
    imu = build_printed_imu(name, found[name], **{key: getattr(options, key) for key in keys})
    measured = read_in_use(options.in_use, None, options.motion)
    mode = choose_mode(options.mode, options.target)
    return apply_mode(imu, TARGETS[options.target], mode, measured)


def read_in_use(
    path: Path | None, sensor: Sensor | None, cutoff: float, stated: "Stated | None" = None
) -> "Mapping[str, InUseNoise] | None":
    """Return the noise of each channel of a log in use; None without a log.

    ``sensor``: its sensor file; None: a draft, completed by ``stated``. Below ``cutoff``, Hz, noise
    is taken as motion. Raises ExportError if the log cannot be read, or is too short.
    """
    from imubench_pipeline.extensions.exports.imu import ExportError
    from imubench_pipeline.extensions.exports.in_use import measure_in_use
    from imubench_pipeline.recordings.ingest import ingest_as_planned
    from imubench_pipeline.recordings.recording import open_channel_logs, place_on_grid
    from imubench_pipeline.run.analysis.project import Stated, UnfilledError, draft_sensor
    from imubench_pipeline.settings.quality import QualitySettings
    from imubench_pipeline.settings.sensor import merged_log
    from imubench_pipeline.settings.validation import parse

    if path in (None, NOT_MEASURED):
        return None
    if not path.exists():
        raise ExportError(f"{path}: no such file; expected a log in use, with motors on")
    if sensor is None:
        try:
            drafted = draft_sensor(path, Stated())
        except UnfilledError:
            if not stated:
                raise ExportError(
                    f"{path}: the header does not state units or rate; name columns such as "
                    "'gyro_x [deg/s]', or use a log in the format of the sensor file"
                ) from None
            drafted = draft_sensor(path, stated)
        sensor = parse(Sensor, drafted, f"drafted from {path}")
    notes = RecordingNotes()
    plan = IngestPlan(
        kind="in_use",  # knocks are vibration, and stay
        notes=notes,
        log=merged_log(sensor, notes, str(path)),
        quality=QualitySettings(),
    )
    with tempfile.TemporaryDirectory(prefix="imubench.") as folder:
        kept = Path(folder)
        found = ingest_as_planned(path, plan.model_dump_json(), "in_use", path.stem, kept)
        if found.recording.status != "ok":
            raise ExportError(str(found.recording.reason))
        try:
            return {
                channel: measure_in_use(place_on_grid(log.blocks(), log.grid), log.rate, cutoff)
                for channel, log in open_channel_logs(kept).items()
            }
        except ExportError as error:
            raise ExportError(f"{path}: {error}") from None


COMMAND = command_line.Command(
    "write the input file of a filter or simulator",
    add_arguments,
    run,
    ("written", "", "the program cannot hold it, or " + command_line.NO_RESULTS),
)
