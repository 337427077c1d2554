"""`imubench calibrate`: from static logs to the input file of a filter, in one command."""

import argparse
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

from imubench_pipeline.extensions.exports import command as exports
from imubench_pipeline.recordings.drop_zone import get_recording_name
from imubench_pipeline.run.analysis import command as analysis
from imubench_pipeline.run.project import find_protected_places
from imubench_pipeline.settings import command_line
from imubench_pipeline.tables import outputs

if TYPE_CHECKING:
    import pyarrow as pa

    from imubench_pipeline.extensions.exports.imu import Imu
    from imubench_pipeline.extensions.exports.programs import Program
    from imubench_pipeline.run.analysis.compilation import Compilation

_MAX_EVENTS = 3
_MAX_NOT_USED = 3
_MAX_WIDTH = 80


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.description = (
        "Read static logs of one device, judge them, estimate the noise, and write the input file "
        "of a filter or simulator. Several logs are pooled."
    )
    analysis.add_log_arguments(parser)
    exports.add_options(parser)
    parser.add_argument(
        "--all", action="store_true", help="a file for each IMU of a bag, named by its topic"
    )
    outputs.add_output(
        parser, "--output", help="where to write; default: the name that it usually has"
    )


def run(options: argparse.Namespace) -> int:
    """Write the file, print its values and the state of the logs; return the exit status."""
    from imubench_pipeline.run.analysis.compilation import Compilation

    with Compilation(analysis.say) as compiling:
        return _run(options, compiling)


def _run(options: argparse.Namespace, compiling: "Compilation") -> int:
    from imubench_pipeline.extensions.exports.imu import ExportError

    try:
        program = exports.check_options(options)
    except ExportError as error:
        raise command_line.CommandError(str(error)) from None
    if options.output is None:
        options.output = outputs.OutputFile(Path(program.file_name))
        outputs.check_outputs(options, find_protected_places)
    output: outputs.OutputFile = options.output
    notes = [
        log.absolute().with_name(f"{get_recording_name(log.name)}.yaml") for log in options.logs
    ]
    status = 0
    for topics, path in _list_files(options, output.path):
        if path.absolute() in notes:
            raise command_line.CommandError(
                f"{path} is the path of the notes of a log; choose another file with --output"
            )
        own = output.beside(path)
        own.check()  # before the log is read
        of_imu = argparse.Namespace(**{**vars(options), "topic": list(topics), "output": own})
        status = max(status, _calibrate(of_imu, program, compiling))
    return status


def _list_files(options: argparse.Namespace, path: Path) -> Iterator[tuple[Sequence[str], Path]]:
    """Yield the topics of each IMU, and the path of its file."""
    if not options.all:
        yield options.topic, path
        return
    from imubench_pipeline.readers.contents import list_contents
    from imubench_pipeline.readers.inspection.drafting import find_imus
    from imubench_pipeline.tables.findings import RecordingError

    try:
        found = find_imus(list_contents(options.logs[0]))
    except RecordingError as error:
        raise command_line.CommandError(str(error)) from None
    if not found:
        raise command_line.CommandError(f"{options.logs[0]}: found no gyro; --all needs an IMU")
    used: list[Path] = []
    for topics in found:
        name = re.sub(r"\W+", "_", topics[0]).strip("_")
        place = path.with_name(f"{path.stem}_{name}{path.suffix}" if name else path.name)
        used.append(place)
        if (number := used.count(place)) > 1:  # /imu/a and /imu_a
            place = place.with_stem(f"{place.stem}_{number}")
        yield topics, place


def _calibrate(options: argparse.Namespace, program: "Program", compiling: "Compilation") -> int:
    from imubench_pipeline.extensions.exports.imu import ExportError
    from imubench_pipeline.extensions.exports.request import build_imu
    from imubench_pipeline.run.analysis.chain import Analysis

    with tempfile.TemporaryDirectory(prefix="imubench.") as folder:
        device = None if options.sensor else get_recording_name(options.logs[0].resolve().name)
        plan = analysis.plan_logs(options, Path(folder), device)
        sensor, _ = next(iter(plan.recordings))
        tables = Analysis(plan, compiling, options.cores, analysis.say).estimates()
        judged = list(_describe_logs(tables))
        try:
            declared = plan.sensors[sensor] if options.sensor else None
            stated = analysis.read_stated(options)
            measured = exports.read_in_use(options.in_use, declared, options.motion, stated)
            sources = sorted(plan.sensors[sensor].log.channels.items(), reverse=True)  # gyro first
            topics = [one.variable for _, one in sources if str(one.variable).startswith("/")]
            request = exports.make_request(
                options,
                sensor=sensor,
                in_use=measured,
                one_device=True,
                rate=None,  # of the log
                ros_topic=next(iter(topics), None),
            )
            imu = build_imu(tables, request, plan.run.results / "recordings")
            options.output.write(program.write(imu))
        except ExportError as error:
            print("\n".join(judged))
            raise command_line.CommandError(
                f"{options.output.path}: not written: {error}"
            ) from None
    print("\n".join([*_describe_file(imu, program, options.output.path), *judged]))
    for line in _list_not_used(options):
        print(line)
    return 0


def _describe_file(imu: "Imu", program: "Program", path: Path) -> Iterator[str]:
    from imubench_pipeline.extensions.exports.mapping import map_to_family
    from imubench_pipeline.extensions.exports.reasons import value_kind
    from imubench_pipeline.report.practical import choose_page_unit

    yield f"{path}: for {program.title}"
    yield from wrap(imu.mode, _MAX_WIDTH, max_lines=4, placeholder=" ...")
    for quantity, axis in imu.axes.items():
        mapped = map_to_family(axis.model, program.family, imu.horizon, imu.rate)
        values = []
        for symbol in ("N", "B", "T_B", "K"):
            value = getattr(mapped.model, symbol)
            if value:
                unit = choose_page_unit(quantity, symbol, "practical")
                values.append(f"{symbol} {unit.text(value, 3)} {unit.sign}")
        kind = value_kind(axis.model.name, mapped.model.name, axis.slow_limited)
        yield f"  {quantity:5}  {', '.join(values)}" + f" ({kind})" * bool(kind)


def _describe_logs(tables: "Mapping[str, pa.Table]") -> Iterator[str]:
    from imubench_pipeline.model.estimates import AllanRow, ParameterRow
    from imubench_pipeline.model.recordings import FindingRow, RecordingRow
    from imubench_pipeline.report import terminal
    from imubench_pipeline.report.log_screen import group_events
    from imubench_pipeline.tables.findings import LEFT_OUT
    from imubench_pipeline.words.events import events_text, reason_text, state_text

    findings = FindingRow.rows_of(tables["findings"])
    parameters = ParameterRow.rows_of(tables["parameters"])
    allan = AllanRow.rows_of(tables["allan"])
    rows = RecordingRow.rows_of(tables["recordings"])
    shown = max(_MAX_EVENTS // len(rows), 1)
    for row in rows:
        estimated = [each for each in terminal.select_of(row, parameters) if each.recommended]
        length = terminal.describe_length(row, estimated, terminal.select_of(row, allan))
        found = terminal.select_of(row, findings)
        moved = any(each.finding in ("motion", "turning") for each in found)
        yield from wrap(state_text(row, length, moved=moved), _MAX_WIDTH)
        yield from wrap(reason_text(row), _MAX_WIDTH)
        own = [each for each in found if each.finding not in LEFT_OUT]
        for number, event in enumerate(group_events(own)[:shown], start=1):
            text = f"{number}. {events_text(event.findings, 'practical', event.factors())}"
            yield from wrap(
                text, _MAX_WIDTH, subsequent_indent="   ", max_lines=2, placeholder=" ..."
            )


def _list_not_used(options: argparse.Namespace) -> Iterator[str]:
    """Yield what the first log holds, and is not in the file."""
    from imubench_pipeline.run.analysis.project import inspect_log
    from imubench_pipeline.settings.validation import ConfigError

    if options.sensor:
        return
    try:
        left = inspect_log(options.logs[0], options.topic).draft.left_over
    except ConfigError:
        return
    named = [line for line in left if line.startswith("not ")]
    for line in named[:_MAX_NOT_USED]:
        short = re.sub(r"(\w+)\.x, \1\.y, \1\.z", r"\1", line)
        yield from wrap(short[0].upper() + short[1:], _MAX_WIDTH, max_lines=1, placeholder=" ...")
    if len(named) > _MAX_NOT_USED:
        yield f"{len(named) - _MAX_NOT_USED} more: imubench inspect {options.logs[0]}"
    if not options.topic and any("another gyro" in line for line in named):
        yield "A further IMU: --topic NAME, or --all for a file of each"


COMMAND = command_line.Command(
    "estimate the noise in logs, and write the file of a filter, such as Kalibr's imu.yaml",
    add_arguments,
    run,
    ("written", "", "a log cannot be used, or is incomplete, or the program cannot hold it"),
)
