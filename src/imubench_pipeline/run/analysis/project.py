"""Make a temporary project of the logs of a command line: links to them, and sensor files."""

import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from imubench_pipeline.readers.bounded import BoundError, run_bounded
from imubench_pipeline.readers.inspection import Inspection, inspect
from imubench_pipeline.readers.inspection.draft import UNKNOWN, Entry
from imubench_pipeline.recordings.drop_zone import get_recording_name, get_sensor_name
from imubench_pipeline.settings.sensor import CHANNELS, QUANTITIES, Sensor, quantity_of
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.settings.yaml_files import list_files, read_settings
from imubench_pipeline.tables.files import write_json
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.units import UnitError, find_conversion

INSPECTED_S, INSPECTED_BYTES = 10.0, 1 << 29  # for the inspection of a log, s and bytes


@dataclass(frozen=True)
class Stated:
    """Properties of logs that the command line states, where the logs do not."""

    rate: str | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    topics: tuple[str, ...] = ()  # of a bag; empty: all

    def unit_of(self, channel: str) -> str | None:
        """Return the unit that is stated for a channel; None: the log must state it."""
        return self.gyro_unit if quantity_of(channel) == "gyro" else self.accel_unit

    def __bool__(self) -> bool:
        return any((self.rate, self.gyro_unit, self.accel_unit, self.topics))


class UnfilledError(ConfigError):
    """Raised if neither the log nor the user states a required property."""


def lay_out(
    logs: Sequence[Path],
    sensor: Path | None,
    stated: Stated,
    catalogue: Sequence[Path],
    folder: Path,
    device: str | None = None,
) -> dict[str, str | None]:
    """Make a project of logs in an existing folder: a drop zone of links, and their sensor files.

    `logs`: files, or folders of recordings. `sensor`: the sensor file of all logs, or its name in
    the folders `catalogue`; None: a draft for each log, as by `imubench inspect`, completed by
    `stated`. `device`: one sensor for all logs, drafted from the first; None: one for each log.
    Return the paths in the configuration of the run.

    Raise a ConfigError if a log is missing, two logs have the same name, the sensor file cannot be
    used, or a log does not state a required property (`UnfilledError`).
    """
    missing = [log for log in logs if not log.exists()]
    if missing:
        raise ConfigError(f"{missing[0]}: no such file; expected a log file or a folder of one log")
    declared = None if sensor is None else _find_sensor_file(sensor, catalogue)
    if declared is not None and stated:
        raise ConfigError(
            "--rate, --gyro-unit, --accel-unit and --topic cannot be used with --sensor; write the "
            "rate, the units and the topic into the sensor file"
        )
    (folder / "sensors").mkdir()
    for log, name in zip(logs, _name_recordings(logs), strict=True):
        path = log.resolve()
        if declared is not None:
            of, described = get_sensor_name(declared.with_suffix("")), declared
            target = folder / "sensors" / f"{of}.yaml"
            if not target.is_symlink():
                target.symlink_to(described.resolve())
        else:
            of = device or name
            target = folder / "sensors" / f"{of}.yaml"
            if not target.exists():
                write_json(draft_sensor(log, stated), target)  # which is YAML, too
        place = folder / "logs" / of
        place.mkdir(parents=True, exist_ok=True)
        (place / (name + path.name.removeprefix(get_recording_name(path.name)))).symlink_to(path)
        notes = path.with_name(f"{get_recording_name(path.name)}.yaml")
        if notes.is_file() and (declared is None or notes != declared.resolve()):
            (place / f"{name}.yaml").symlink_to(notes)
    return {
        "logs": str(folder / "logs"),
        "sensors": str(folder / "sensors"),
        "results": str(folder / "results"),
        "simulated": None,
        "requirements": None,
    }


def _find_sensor_file(sensor: Path, catalogue: Sequence[Path]) -> Path:
    """Return the file of a sensor that is given by its path, or by its name in the catalogue."""
    if not sensor.is_file():
        named = list_files(catalogue, "sensor").get(str(sensor))
        if named is None:
            places = " or ".join(map(str, catalogue))
            raise ConfigError(
                f"{sensor}: no such sensor file, and no sensor of this name in {places}; correct "
                "the name, or draft a sensor file with imubench inspect LOG --output FILE"
            )
        sensor = named
    read_settings(Sensor, sensor)
    return sensor


def _name_recordings(logs: Sequence[Path]) -> list[str]:
    """Return the names of the recordings, with the folder name where two are equal."""
    names = [get_recording_name(log.resolve().name) for log in logs]
    times = Counter(names)
    longer = [
        f"{get_recording_name(log.resolve().parent.name)}_{name}" if times[name] > 1 else name
        for log, name in zip(logs, names, strict=True)
    ]
    for name, count in Counter(longer).items():
        if count > 1:
            alike = [str(log) for log, other in zip(logs, longer, strict=True) if other == name]
            raise ConfigError(
                f"{' and '.join(alike)} would have the same name, {name}; give each log once, "
                "and rename one of two different logs"
            )
    return longer


def draft_sensor(log: Path, stated: Stated) -> Mapping[str, object]:
    """Return the sensor file drafted from a log, completed by the stated properties.

    Raises ConfigError if the log cannot be read, and UnfilledError if a property is missing.
    """
    inspected = inspect_log(log, stated.topics).draft
    draft = inspected.with_units(lambda key, _: stated.unit_of(key) if key in CHANNELS else None)
    for channel, entry in inspected.channels.items():
        unit, own = entry.value.unit, draft.channels[channel].value.unit
        stated_by_log = unit not in (None, UNKNOWN) and not entry.comment.startswith("guessed")
        if stated_by_log and not _is_same_unit(str(unit), str(own), channel):
            raise ConfigError(
                f"{log}: the log states {unit} for {channel}, but the option states {own}; omit "
                "the option, or write a sensor file if the log is wrong"
            )
    if stated.rate and draft.time is None:
        draft.rate = Entry(stated.rate)
    open_keys = ["rate"] * (draft.rate is not None and draft.rate.value == UNKNOWN)
    for channel, entry in draft.channels.items():
        columns = (("column", entry.value.column), ("unit", entry.value.unit))
        open_keys += [f"{quantity_of(channel)} {key}" for key, one in columns if one == UNKNOWN]
    if open_keys:
        keys = list(dict.fromkeys(open_keys))
        # Describe the missing properties of a log, and how to state them
        options = {
            "rate": "--rate '100 Hz'",
            "gyro unit": "--gyro-unit deg/s (or rad/s, dps, ...: see the logger's manual)",
            "accel unit": "--accel-unit g (or m/s^2, mg, ...)",
        }
        lines = [f"{log}: the log does not state: {', '.join(keys)}"]
        if all(key in options for key in keys):
            lines += [f"  add {options[key]}" for key in keys]
            lines.append("or write a sensor file once, for all logs of this sensor:")
        else:
            lines.append("its column names do not identify the channels; write a sensor file:")
        command = shlex.join(["imubench", "inspect", str(log), "--output", "mine.yaml"])
        lines.append(f"  {command}, fill it in, then --sensor mine.yaml")
        raise UnfilledError("\n".join(lines))
    return parse(Sensor, draft.sensor(), f"drafted from {log}").model_dump(
        mode="json", exclude_unset=True
    )


def _is_same_unit(unit: str, other: str, channel: str) -> bool:
    dimension = QUANTITIES[quantity_of(channel)]
    try:
        return find_conversion(unit, dimension) == find_conversion(other, dimension)
    except UnitError as error:
        raise ConfigError(str(error)) from None


def inspect_log(log: Path, topics: Sequence[str] = (), model: str | None = None) -> Inspection:
    """List the content of a log and draft its sensor file, within limits of time and memory.

    ``topics``: of a bag; empty: all. ``model``: sensor name; None: log name. May raise ConfigError.
    """
    try:
        return run_bounded(INSPECTED_S, INSPECTED_BYTES, inspect, log, model, topics)
    except BoundError as error:
        raise ConfigError(
            f"{log.name}: the inspection {error}; expected a log of an inertial sensor: copy the "
            "inertial samples into a separate file"
        ) from None
    except (RecordingError, OSError) as error:
        raise ConfigError(str(error)) from None
