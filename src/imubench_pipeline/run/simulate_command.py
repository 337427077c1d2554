"""`imubench simulate`: simulate a log of a sensor, for example to test a filter."""

import argparse
import math
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from imubench_pipeline.run.long_work import show_progress
from imubench_pipeline.settings.command_line import MOST_WHOLE, make_number_type
from imubench_pipeline.settings.shipped import list_folders
from imubench_pipeline.settings.validation import ConfigError, cut, parse
from imubench_pipeline.settings.yaml_files import list_files, read_settings, read_yaml
from imubench_pipeline.tables.outputs import OutputFile, add_output
from imubench_pipeline.units import add_key_to_errors, parse_quantity

if TYPE_CHECKING:
    from imubench_pipeline.simulate.models import Origin
    from imubench_pipeline.simulate.profiles import Profile

_YAML_SUFFIXES = (".yaml", ".yml")
_MAX_SAMPLES = 1 << 36
_MIN_EXPONENT_FORMAT = 1e15
_MIN_REPORTED_FOLDING = 1.02
_MIN_TEMPERATURE, _MAX_TEMPERATURE = -273.15, 1000.0  # range of sensor temperatures, degC


_LOG_PATH_DEPTH = 2  # path components from the drop zone to a log: sensor and recording


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command to its parser."""
    parser.add_argument(
        "sensor", help="name of a sensor file, whose datasheet is taken, or a file of models"
    )
    add_output(
        parser,
        "--out",
        partial(OutputFile, adds_to={"logs"}),
        required=True,
        help="log to write: .parquet or .csv",
    )
    length = parser.add_mutually_exclusive_group(required=True)
    length.add_argument("--hours", type=float, help="length of the log")
    length.add_argument("--duration", metavar="TIME", help="length with its unit, such as 90 s")
    parser.add_argument("--rate", metavar="FREQUENCY", help="default: rate of the sensor file")
    parser.add_argument(
        "--temperature",
        metavar="PROFILE",
        help="a temperature such as '25 degC', a YAML file with a formula, or a CSV or Parquet "
        "file with columns 'time [s]' and 'temperature [degC]'",
    )
    parser.add_argument(
        "--motion",
        metavar="PROFILE",
        type=Path,
        help="a YAML file with a formula for each channel, or a CSV or Parquet file with columns "
        "'time [s]' and 'gyro_x [deg/s]' to 'accel_z [m/s^2]'; default: at rest, and no gravity",
    )
    parser.add_argument(
        "--seed",
        type=make_number_type(0, MOST_WHOLE, "a whole number, 0 or more", int),
        default=1,
        help="of the noise; default: 1",
    )
    parser.add_argument(
        "--results", type=Path, help="folder of a run: its estimates replace printed figures"
    )
    parser.add_argument("--recording", help="of --results; default: the longest of the sensor")
    parser.add_argument(
        "--sensors",
        type=Path,
        help="folder of the sensor files; default: the catalogue of the package and config/sensors",
    )
    parser.add_argument("--channels", help="comma between them; default: all of the sensor")


def run(options: argparse.Namespace) -> int:
    """Simulate the log; return the exit status."""
    # Numerics are loaded for this command only: the others answer at once.
    from imubench_pipeline.readers.text.header import SIMULATED
    from imubench_pipeline.settings.sensor import TEMPERATURE
    from imubench_pipeline.simulate.imu import simulate_imu
    from imubench_pipeline.simulate.writing import check_notes, layout, notes_text, write_log

    origin, sensor = _origin(options)
    log = None if sensor is None else sensor.log
    rate = _rate(options.rate, log)
    duration = _duration(options.duration, options.hours, rate)
    samples = round(duration * rate)
    motion, temperature = _profiles(options, origin)
    columns = [*origin.imu.axes, *([TEMPERATURE] if temperature is not None else [])]
    out: OutputFile = options.out
    form = layout(out.path, columns, rate, log)
    notes = out.beside(out.path.with_suffix(".yaml"))
    check_notes(notes.path, out.path)
    notes.check()
    _check_depth(out)
    if temperature is None and any(axis.drift for axis in origin.imu.axes.values()):
        origin.assume("drift", "no drift with temperature: none is given (--temperature)")
    for text in (
        *_list_short_files(duration, motion, temperature),
        *_describe_aliasing(origin, rate),
    ):
        origin.assume("log", text)
    if not motion:
        origin.assume("log", "at rest, and no gravity (--motion)")
    remarks = [f"from {origin.source}"]
    figures = {
        name: [figure.text for figure in of_channel] for name, of_channel in origin.figures.items()
    }
    assumed = [assumption.text for assumption in origin.assumed]
    remarks += [f"{name}: {line}" for name, lines in figures.items() for line in lines]
    remarks += [f"assumed: {line}" for line in _merge_lines(assumed)]
    print(f"{SIMULATED}: {samples:,} samples of {', '.join(columns)} at {rate:g} Hz")
    print("\n".join(_merge_lines(remarks)), flush=True)
    sensor_name = origin.sensor or Path(options.sensor).stem
    about = {
        "from": origin.source,
        "figures": figures,
        "assumed": assumed,
        "seed": options.seed,
        "model": {channel: repr(axis) for channel, axis in origin.imu.axes.items()},
        "temperature": options.temperature,
        "motion": None if options.motion is None else str(options.motion),
    }
    kind = "static" if not motion else "in_motion"
    metadata = {
        "sensor": sensor_name,
        "device": "simulated",
        "recording": out.path.stem,
        "kind": kind,
        "simulated": True,
        "sources": [],
        "reader": None,
        "begins": 0.0,
        "started": None,
        "rate": rate,
        "rate_from": "stated",
        "uniform": True,
        "holes": dict.fromkeys(columns, False),
        "unusable": [],
    } | {"simulation": about}
    # The name is a part of the random stream: with one seed, each sensor has different noise.
    blocks = simulate_imu(
        origin.imu,
        rate,
        samples,
        options.seed,
        (sensor_name,),
        motion=motion,
        temperature=temperature,
        threads=os.cpu_count() or 1,
    )
    # The notes are there before the log, which cannot be read without them.
    with out.replacing() as temporary:
        with show_progress(samples, "simulated") as advance:
            write_log(temporary, blocks, columns, form, metadata, remarks, advance)
        notes.write(notes_text(out.path.name, form, log, f"from {origin.source}"))
    size = out.path.stat().st_size / 1e6
    print(f"{out}: {size:.1f} MB; {notes} says how it is written")
    return 0


def _check_depth(out: OutputFile) -> None:
    """Raise `ConfigError` if the log would become a part of another recording."""
    real = out.check()
    for place in out.places(real):
        logs = Path(os.path.realpath(place.path))
        if place.kind == "logs" and real.is_relative_to(logs):
            parts = real.relative_to(logs).parts
            if len(parts) != _LOG_PATH_DEPTH:
                raise ConfigError(
                    f"{out} would be {'/'.join(parts)} in the folder of logs {logs}; expected "
                    "<sensor>/<recording> in this folder, or a path outside: change --out"
                )


def _declared(name: str, stated: Path | None) -> Any:
    from imubench_pipeline.settings.config import Run
    from imubench_pipeline.settings.sensor import Sensor

    places = list_folders(stated or Run().sensors, "sensors")
    files = list_files(places, "sensor")
    if name not in files:
        raise ConfigError(
            f"{places[-1] / name}.yaml: no such sensor file; there are: "
            f"{', '.join(files) or 'none'}; or give a YAML file of models"
        )
    return read_settings(Sensor, files[name])


def _origin(options: argparse.Namespace) -> "tuple[Origin, Any]":
    from imubench_pipeline.settings.sensor import CHANNELS
    from imubench_pipeline.simulate import models
    from imubench_pipeline.simulate.from_datasheet import from_datasheet
    from imubench_pipeline.simulate.from_estimates import with_estimates
    from imubench_pipeline.simulate.imu import ImuModel

    text: str | None = options.channels
    asked = None if text is None else [name.strip() for name in text.split(",")]
    if unknown := [name for name in asked or [] if name not in CHANNELS]:
        expected = ", ".join(CHANNELS)
        raise ConfigError(f"--channels: found {cut(unknown[0])}; expected some of {expected}")
    if asked and (twice := [name for name in asked if asked.count(name) > 1]):
        raise ConfigError(f"--channels: found {twice[0]} twice; expected each channel once")
    path = Path(options.sensor)
    if path.suffix in _YAML_SUFFIXES:
        if options.results:
            raise ConfigError(f"--results cannot be used with the file of models {path}: omit them")
        origin = models.read_model_file(path)
        sensor = _declared(origin.sensor, options.sensors) if origin.sensor else None
    else:
        sensor = _declared(options.sensor, options.sensors)
        try:
            origin = from_datasheet(options.sensor, sensor, options.seed)
        except ConfigError:
            if not options.results:
                raise
            origin = models.Origin(ImuModel(axes={}), "", sensor=options.sensor)
        if options.results:
            origin = with_estimates(origin, options.results, options.sensor, options.recording)
    if asked:
        origin = models.select_channels(origin, asked)
    return origin, sensor


def _rate(text: str | None, log: Any) -> float:
    if text is not None:
        with add_key_to_errors("--rate: "):
            rate = parse_quantity(text, "frequency")
        if rate <= 0:
            raise ConfigError(f"--rate {text}: expected a frequency above 0")
        return rate
    if log is None or log.rate_hz is None:
        raise ConfigError("the sensor file states no rate; add an option such as --rate '100 Hz'")
    return float(log.rate_hz)


def _duration(text: str | None, hours: float | None, rate: float) -> float:
    option = f"--hours {hours:g}" if text is None else f"--duration {text}"
    with add_key_to_errors("--duration: "):
        duration = 3600.0 * (hours or 0.0) if text is None else parse_quantity(text, "time")
    samples = duration * rate
    if not 0.5 < samples <= _MAX_SAMPLES:
        shown = f"{samples:.0f}" if abs(samples) < _MIN_EXPONENT_FORMAT else f"{samples:g}"
        raise ConfigError(
            f"{option}: {duration:g} s at {rate:g} Hz are {shown} samples; expected 1 to "
            f"{_MAX_SAMPLES}"
        )
    return duration


def _profiles(
    options: argparse.Namespace, origin: "Origin"
) -> "tuple[dict[str, Profile], Profile | None]":
    from imubench_pipeline.settings.profile_forms import Surroundings
    from imubench_pipeline.simulate.profiles import FileSeries, profiles_of

    forms: dict[str, Any] = {}
    folder = Path()
    if options.motion is not None:
        if options.motion.suffix in _YAML_SUFFIXES:
            forms["motion"] = _section(options.motion, "motion")
            folder = options.motion.parent
        else:
            columns = FileSeries(options.motion).names
            names = [name for name in columns if name.startswith(("gyro_", "accel_"))]
            if not names:
                raise ConfigError(f"{options.motion}: no column such as 'gyro_x [deg/s]'; add one")
            form = {"form": "file", "file": str(options.motion)}
            forms["motion"] = {name: form for name in names}
    motion, _ = profiles_of(parse(Surroundings, forms, str(options.motion)), folder)
    if options.temperature is None:
        return motion, None
    path, folder = Path(options.temperature), Path()
    if path.suffix in _YAML_SUFFIXES:
        warm = _section(path, "temperature")
        folder = path.parent
    elif path.suffix in (".csv", ".parquet", ".txt"):
        warm = {"form": "file", "file": str(path)}
    else:
        with add_key_to_errors("--temperature: "):
            celsius = parse_quantity(options.temperature, "temperature")
        if not _MIN_TEMPERATURE <= celsius <= _MAX_TEMPERATURE:
            raise ConfigError(
                f"--temperature {options.temperature}: expected {_MIN_TEMPERATURE:g} "
                f"to {_MAX_TEMPERATURE:g} degC"
            )
        warm = options.temperature
    around = parse(Surroundings, {"temperature": warm}, options.temperature)
    _, temperature = profiles_of(around, folder)
    return motion, temperature


def _section(path: Path, key: str) -> Any:
    content = read_yaml(path)
    return content.get(key, content) if isinstance(content, dict) else content


def _list_short_files(
    duration: float, motion: "Mapping[str, Profile]", temperature: "Profile | None"
) -> list[str]:
    from imubench_pipeline.simulate.profiles import FileColumn

    profiles = [*motion.values(), *([] if temperature is None else [temperature])]
    spans = {
        profile.path: (profile.times[0], profile.times[-1])
        for profile in profiles
        if isinstance(profile, FileColumn)
    }
    return [
        f"{path} is from {first:g} to {last:g} s: its ends are held before and after"
        for path, (first, last) in spans.items()
        if first > 0 or last < 0.999 * duration
    ]


def _describe_aliasing(origin: "Origin", rate: float) -> list[str]:
    from imubench_pipeline.simulate.model import folding

    statements = []
    for channel, axis in origin.imu.axes.items():
        more = folding(axis, rate)
        if more > _MIN_REPORTED_FOLDING:
            statements.append(
                f"{channel}: N is the density before the low-pass; sampled at {rate:g} Hz the log "
                f"shows {math.sqrt(more):.3g} N, for noise beyond {rate / 2:g} Hz is folded into it"
            )
    return statements


def _merge_lines(lines: list[str]) -> list[str]:
    channels: dict[str, list[str]] = {}
    for line in lines:
        name, colon, rest = line.partition(": ")
        if colon and name.startswith(("gyro_", "accel_")) and " " not in name:
            channels.setdefault(rest, []).append(name)
        else:
            channels[line] = []
    return [f"{', '.join(names)}: {line}" if names else line for line, names in channels.items()]
