"""What a run consists of: the recordings found and the settings of each step.

This is all that the Snakefile asks of the package. Settings are handed to a rule as JSON text
of what the rule depends on, so that an edit runs again what it touches and nothing else.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from pydantic import BaseModel

from imubench_pipeline.config import Run, read_run, read_simulated
from imubench_pipeline.provenance import source_digest
from imubench_pipeline.readers import log_files
from imubench_pipeline.requirements import Requirement, read_requirements
from imubench_pipeline.sensor import RecordingNotes, Sensor, merged_log, read_sensors
from imubench_pipeline.units import quantity_to_si
from imubench_pipeline.validation import ConfigError, parse, read_yaml

PARTIAL = frozenset({".part", ".tmp", ".filepart", ".crdownload"})
"""How the names of files end that are still being transferred."""

_NOT_LOGS = {".yaml", ".yml", ".md"} | PARTIAL
_OF_INGEST = ("quality.json", "envelope.parquet", "histogram.parquet")
_COMPRESSED = {".gz", ".zst", ".xz", ".bz2", ".zip"}
_UNUSABLE_IN_NAMES = re.compile(r"[^\w .+()-]")
_LONGEST_NAME = 120

STEPS: Mapping[str, tuple[str, ...]] = {
    "simulate": ("simulated_logs",),
    "ingest": ("ingest", "overview", "results"),
    "allan": ("allan", "recording", "results"),
    "estimate": ("estimation",),
    "reconstruct": ("reconstruction",),
    "datasheet": ("datasheet", "results"),
    "error_budget": ("expected_errors", "results"),
    "ranking": ("selection", "results"),
    "coverage": ("coverage", "results"),
    "exports": ("export.of_run",),
    "tables": ("results",),
    "figures": ("report.static_figures.of_run",),
    "report": ("report.publish",),
}
"""The modules that each step runs: their edit runs the step again."""


@dataclass(frozen=True)
class Recording:
    """One recording that was found, or is to be simulated.

    Attributes
    ----------
    sensor, name : str
    path : Path
        The log file, or the folder of a recording that has several.
    notes : Path or None
        The file of notes beside it.
    simulated : bool
    error : str or None
        Why the file cannot be used, where its name or its place says so already.
    held_back : bool
        The log is not read in this run: the results that are there stay.
    """

    sensor: str
    name: str
    path: Path
    notes: Path | None
    simulated: bool
    error: str | None = None
    held_back: bool = False

    @property
    def files(self) -> list[Path]:
        """What the recording depends on."""
        if self.held_back:
            # No such file, but what would be made of it is there: Snakemake takes that as it is,
            # whatever became of the log, the settings or the code since.
            return [self.path / "held back"]
        if self.error:
            return []
        logs = [self.path] if self.simulated else log_files(self.path)
        return logs + ([self.notes] if self.notes else [])


class Plan:
    """The plan of a run.

    Raises
    ------
    ConfigError
        If the configuration, a sensor file or the list of simulated recordings cannot be used,
        or two logs would make one recording.
    """

    def __init__(self, config: Mapping[str, object]) -> None:
        self.run: Run = read_run(config)
        self.sensors: dict[str, Sensor] = read_sensors(self.run.sensors)
        self.requirements: dict[str, Requirement] = read_requirements(self.run.requirements)
        self._simulated = {
            (entry.sensor, entry.recording): entry
            for entry in read_simulated(self.run.simulated, self.sensors)
        }
        self.recordings: dict[tuple[str, str], Recording] = {}
        for found in [*self._found_logs(), *self._to_simulate()]:
            other = self.recordings.setdefault((found.sensor, found.name), found)
            if other is not found:
                raise ConfigError(
                    f"{other.path} and {found.path} would both be the recording "
                    f"{found.sensor}/{found.name}; rename or remove one"
                )

    def _found_logs(self) -> list[Recording]:
        if not self.run.logs.is_dir():
            if self.run.simulated is None:
                raise ConfigError(
                    f"logs: found {str(self.run.logs)!r}, which is no folder; expected the folder "
                    "that holds <sensor>/<recording>"
                )
            return []
        found: dict[str, list[Recording]] = {}
        for log in found_logs(self.run.logs):
            found.setdefault(f"{log.sensor}/{log.name}", []).append(log)
        for key in self.run.held_back:
            found[key] = self._as_it_is(key, found.get(key, []))
        return sorted(chain.from_iterable(found.values()), key=lambda log: log.path)

    def _as_it_is(self, key: str, logs: list[Recording]) -> list[Recording]:
        """Return a recording that is held back, if its results are there; its log may be not."""
        sensor, _, name = key.partition("/")
        folder = self.run.results / "recordings" / sensor / name
        if (sensor, name) in self._simulated or not all(
            (folder / file).is_file() for file in _OF_INGEST
        ):
            return []
        path = logs[0].path if logs else self.run.logs / sensor / name
        return [Recording(sensor, name, path, None, simulated=False, held_back=True)]

    def _to_simulate(self) -> list[Recording]:
        return [
            Recording(
                sensor, name, self.run.results / "simulated" / sensor / name, None, simulated=True
            )
            for sensor, name in self._simulated
        ]

    def ingest_settings(self, sensor: str, name: str) -> str:
        """Return what the ingest of a recording depends on, its error where it cannot be read."""
        recording = self.recordings[sensor, name]
        settings: dict[str, object] = {
            "simulated": recording.simulated,
            "quality": self.run.quality.model_dump(mode="json"),
            "sizes": [path.stat().st_size for path in recording.files if path.is_file()],
        }
        try:
            if recording.error:
                raise ConfigError(recording.error)
            notes = RecordingNotes()
            if recording.notes:
                notes = parse(
                    RecordingNotes, read_yaml(recording.notes) or {}, str(recording.notes)
                )
            if sensor not in self.sensors:
                expected = self.run.sensors / f"{sensor}.yaml"
                raise ConfigError(
                    f"no sensor file {expected} for the logs in {self.run.logs / sensor}; write "
                    "one, or move the logs to the folder of their sensor"
                )
            log = merged_log(self.sensors[sensor], notes, str(recording.notes or sensor))
            layout = log.model_dump(mode="json")
            if recording.simulated:
                made = self._simulated[sensor, name].channels
                layout["channels"] = {channel: layout["channels"][channel] for channel in made}
            settings |= {"notes": notes.model_dump(mode="json"), "log": layout}
        except ConfigError as error:
            settings["error"] = str(error)
        return _text(settings)

    def estimate_settings(self, sensor: str, name: str) -> str:
        """Return what the estimates of a recording depend on."""
        return _text(
            {
                "estimate": self.run.estimate.model_dump(mode="json"),
                "bandwidth": self.bandwidth(sensor, name),
            }
        )

    def bandwidth(self, sensor: str, name: str) -> float | None:
        """Return the stated cut-off of the sensor's own filter, Hz."""
        log = json.loads(self.ingest_settings(sensor, name)).get("log") or {}
        stated = log.get("bandwidth")
        return quantity_to_si(stated, "frequency") if stated else None

    def simulated_settings(self, sensor: str, name: str) -> str:
        """Return the parameters of a simulated recording and the layout that it is written in."""
        return _text(
            {
                "recording": self._simulated[sensor, name].model_dump(mode="json"),
                "log": self.sensors[sensor].log.model_dump(mode="json"),
            }
        )

    def settings(self, section: str) -> str:
        """Return one section of the run's configuration."""
        value = getattr(self.run, section)
        return _text(value.model_dump(mode="json") if isinstance(value, BaseModel) else value)

    def datasheet_settings(self, sensor: str) -> str:
        """Return what the comparison with the datasheet of a sensor depends on."""
        known = self.sensors.get(sensor)
        return _text(
            {
                "datasheet": known.datasheet.model_dump(mode="json") if known else {},
                "tolerance": self.run.datasheet.tolerance,
                "longest": self.run.estimate.longest,
            }
        )

    def error_budget_settings(self) -> str:
        """Return the errors that are asked of every recording."""
        return _text(
            {
                "error_budget": self.run.error_budget.model_dump(mode="json"),
                "requirements": self._requirements(),
            }
        )

    def ranking_settings(self) -> str:
        """Return what the ranking depends on: requirements, and what is said of the sensors."""
        return _text(
            {
                "requirements": self._requirements(),
                "sensors": self._described("vendor", "model", "price_class"),
            }
        )

    def _requirements(self) -> dict[str, object]:
        return {name: one.model_dump(mode="json") for name, one in self.requirements.items()}

    def _described(self, *keys: str) -> dict[str, object]:
        """Return what the files of the sensors that have recordings say."""
        used = {sensor for sensor, _ in self.recordings}
        return {
            name: sensor.model_dump(mode="json", include=set(keys))
            for name, sensor in self.sensors.items()
            if name in used
        }

    def report_settings(self) -> str:
        """Return what the report shows beside the tables."""
        return _text(
            {
                "report": self.run.report.model_dump(mode="json"),
                "results": str(self.run.results),
                "settings": {
                    section: getattr(self.run, section).model_dump(mode="json")
                    for section in (
                        "allan",
                        "estimate",
                        "reconstruction",
                        "quality",
                        "datasheet",
                        "error_budget",
                    )
                },
                "sensors": self._described("vendor", "model", "price_class"),
                "requirements": self._requirements(),
            }
        )

    def catalogue(self) -> str:
        """Return all sensor files."""
        return _text(
            {name: sensor.model_dump(mode="json") for name, sensor in self.sensors.items()}
        )

    def truths(self) -> str:
        """Return the true parameters of the simulated recordings."""
        return _text([entry.model_dump(mode="json") for entry in self._simulated.values()])

    def summary(self) -> str:
        """Return what a finished run says."""
        # Tables are read at the end of a run alone: a run should begin at once.
        from imubench_pipeline.run_summary import summary

        return summary(self.run.results)

    def failure(self, logs: Sequence[str]) -> str:
        """Return what a run says in which a step failed, from the logs of Snakemake."""
        from imubench_pipeline.run_summary import failure

        return failure(logs, self.run.results)

    @staticmethod
    def code(step: str) -> str:
        """Return the digest of the code that a step runs."""
        return source_digest(*STEPS[step])


def found_logs(logs: Path) -> list[Recording]:
    """Return the recordings of a drop zone, in order; two logs of one name are there twice."""
    found = []
    for folder in sorted(path for path in logs.iterdir() if path.is_dir()):
        for path in sorted(folder.iterdir()):
            if path.name.startswith(".") or path.name.endswith("~"):
                continue
            if path.is_file() and path.suffix.lower() in _NOT_LOGS:
                continue
            name = path.name if path.is_dir() else _stem(path)
            notes = folder / f"{name}.yaml"
            found.append(
                Recording(
                    folder.name,
                    _usable(name),
                    path,
                    notes if notes.is_file() else None,
                    simulated=False,
                    error=_fault(path, name),
                )
            )
    return found


def name_of(file: str) -> str:
    """Return the name of the recording whose log has this file name."""
    return _usable(_stem(Path(file)))


def _usable(name: str) -> str:
    return _UNUSABLE_IN_NAMES.sub("_", name)[:_LONGEST_NAME]


def _fault(path: Path, name: str) -> str | None:
    """Return why a file of the drop zone cannot be used, if its name or place says so."""
    shown = ascii(path.name)
    if _UNUSABLE_IN_NAMES.search(name) or len(name) > _LONGEST_NAME:
        return (
            f"the file name {shown} cannot be used; expected at most {_LONGEST_NAME} letters, "
            "digits, spaces and . _ - + ( ) in it: rename the file"
        )
    try:
        if not log_files(path):
            return f"the folder {shown} has no files"
        for file in log_files(path):
            file.stat()
            with file.open("rb"):
                pass
    except OSError as error:
        return f"{shown} cannot be read ({error.strerror})"
    return None


def _stem(path: Path) -> str:
    name = path.name
    for suffix in path.suffixes[::-1]:
        if suffix.lower() in _COMPRESSED:
            name = name[: -len(suffix)]
    return name.rsplit(".", maxsplit=1)[0] if "." in name else name


def _text(value: object) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False)
