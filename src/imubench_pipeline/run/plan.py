"""Plan of a run: the recordings and the settings of each step.

This is the interface of the package to the rules. A rule gets the settings on which it depends as
JSON text, so that an edit of the settings reruns only the affected rules.
"""

import hashlib
import json
import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cached_property, partial
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from imubench_pipeline.datasheets.suspicion import usual_as_text, usual_figures
from imubench_pipeline.navigation.error_budget.in_use import state_figures
from imubench_pipeline.navigation.suitability import read_abilities
from imubench_pipeline.recordings.drop_zone import Recording, account_for, find_logs
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.recordings.known_logs import plan_versions
from imubench_pipeline.registry import blocks
from imubench_pipeline.run.faults import Faults
from imubench_pipeline.settings import sensor as sensor_files
from imubench_pipeline.settings import simulated_recordings as simulations
from imubench_pipeline.settings.config import Run, given_beside, read_run
from imubench_pipeline.settings.experiments import AT_REST, Kind, kind_of, stated_experiments
from imubench_pipeline.settings.requirements import Requirement, read_requirements
from imubench_pipeline.settings.shipped import find_own_folder, list_folders
from imubench_pipeline.settings.validation import ConfigError, UnavailableSettingsError, parse
from imubench_pipeline.settings.yaml_files import read_yaml
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.tables.provenance import digest_sources
from imubench_pipeline.tables.schemas import BY_RECORDING, TABLES
from imubench_pipeline.tables.seals import compute_digest, name_place
from imubench_pipeline.units import parse_quantity

_INGEST_OUTPUTS = ("quality.json", "envelope.parquet", "histogram.parquet")
_NOT_IN_RESULTS = ("limits", "report", "samples", "tables")  # settings that change no result
_RANKING_KEYS = ("price_class", "must")  # keys of a requirement that do not affect the error budget
_REPORT_KEYS = ("title", "note", "example")  # keys of a requirement that only the report shows
_LISTING_KEYS = {"price", "interface"}  # keys of a sensor that only `imubench sensors` prints

_REPORTED_SECTIONS = {  # sections of the settings that the report shows
    *("allan", "estimate", "reconstruction", "quality"),
    *("datasheet", "error_budget", "fusion"),
    *blocks("run"),
}

_PLACEHOLDER_LOG = {"rate": "1 Hz", "channels": {"gyro_x": {"column": 1, "unit": "rad/s"}}}
"""Placeholder for the log format of a sensor where it does not matter."""

_BRACE_BEFORE_WORD = re.compile(r"\{(?=\s*\w)")  # inside a text of JSON: others precede quotes


class Plan:
    """The recordings of a run, and the settings of each step, from the configuration.

    A ConfigError is raised if the configuration or the list of simulated recordings cannot be used,
    or if a log has the name of a simulated recording. ``stored``: the logs are in an object store,
    and their dates there determine whether they are read again.
    """

    def __init__(self, config: Mapping[str, object], *, stored: bool = False) -> None:
        self._stored = stored
        self.run: Run = read_run(config)
        _check_places(self.run)
        self.faults = Faults(self.run.results)
        declared = sensor_files.read_sensor_files(list_folders(self.run.sensors, "sensors"))
        self.sensors: dict[str, sensor_files.Sensor] = {}
        self.unusable: dict[str, ConfigError] = {}
        """Error of each unusable sensor file, by sensor: all logs of these sensors are rejected."""
        for name, sensor in declared.items():
            if isinstance(sensor, ConfigError):
                self.unusable[name] = sensor
            else:
                self.sensors[name] = sensor
        self.requirements: dict[str, Requirement] = read_requirements(
            self.run.requirements and list_folders(self.run.requirements, "requirements")
        )
        simulated = simulations.read_simulated(self.run.to_simulate, declared)
        self.boards: dict[str, simulations.Board] = simulated.boards
        self.simulated = {(entry.sensor, entry.recording): entry for entry in simulated.recordings}
        self._of_ingest: dict[tuple[str, str], str] = {}
        self._of_error_budget: dict[str, str] = {}
        self._read_notes: dict[Path, object] = {}
        self._still_written: list[Recording] = []
        self.recordings: dict[tuple[str, str], Recording] = {}
        made = self.run.results / "simulated"
        to_simulate = [
            Recording(sensor, name, made / sensor / name, None, simulated=True)
            for sensor, name in self.simulated
        ]
        for recording in [*self._found_logs(), *to_simulate]:
            other = self.recordings.setdefault((recording.sensor, recording.name), recording)
            if other is not recording:
                fault = (
                    f"{other.path} and {recording.path} would both be the recording "
                    f"{recording.sensor}/{recording.name}; rename or remove one"
                )
                if recording.simulated or recording.held_back:
                    raise ConfigError(fault)
                self._reject_one_name(other, recording, fault)

    def _reject_one_name(self, first: Recording, second: Recording, fault: str) -> None:
        """Reject two logs of one name, or only the log that has another error anyway."""
        if first.error and not second.error:
            first, second = second, first
        error = first.error or (None if second.error else fault)
        self.recordings[first.sensor, first.name] = replace(first, error=error)
        number = 2
        while (second.sensor, name := f"{second.name} ({number})") in self.recordings:
            number += 1
        left_out = replace(second, name=name, error=second.error or fault)
        self.recordings[second.sensor, name] = left_out

    def _found_logs(self) -> list[Recording]:
        if not self.run.logs.is_dir():
            if self.run.to_simulate is None:
                raise ConfigError(
                    f"logs: found {str(self.run.logs)!r}, which is no folder; expected a folder "
                    "with the logs as <sensor>/<recording>"
                )
            return []
        by_name: dict[str, list[Recording]] = {}
        results = self.run.results.resolve()
        for log in find_logs(self.run.logs):
            if log.path.is_symlink() and Path(os.path.realpath(log.path)).is_relative_to(results):
                log = replace(log, error=f"{log.path.name} links to the results of runs; remove it")
            by_name.setdefault(f"{log.sensor}/{log.name}", []).append(log)
        for key in self.run.held_back:
            found = by_name.get(key, [])
            by_name[key] = self._as_it_is(key, found)
            self._still_written += found if not by_name[key] else []
        return sorted(chain.from_iterable(by_name.values()), key=lambda log: log.path)

    def _as_it_is(self, key: str, logs: list[Recording]) -> list[Recording]:
        """Return a postponed recording, if its results exist; its log may be missing."""
        sensor, _, name = key.partition("/")
        folder = self.run.results / "recordings" / sensor / name
        if (sensor, name) in self.simulated or not all(
            (folder / file).is_file() for file in _INGEST_OUTPUTS
        ):
            return []
        path = logs[0].path if logs else self.run.logs / sensor / name
        notes = logs[0].notes if logs else path.with_name(f"{name}.yaml")
        readable = notes if notes and notes.is_file() else None
        return [Recording(sensor, name, path, readable, simulated=False, held_back=True)]

    def files(self) -> str:
        """Return, as JSON, every file in the drop zone, with its recording or why it is skipped."""
        found = [log for log in self.recordings.values() if not log.simulated]
        files = account_for(self.run.logs, found, self._still_written)
        return to_json([asdict(file) for file in files])

    def attempt(self, step: str, sensor: str, name: str | None = None) -> int:
        """Return the number of the attempt at a step; of the last one if the step is postponed."""
        held_back = name is not None and self.recordings[sensor, name].held_back
        return self.faults.attempt((step, sensor, name), again=not held_back)

    def repeated_jobs(self) -> list[dict[str, str]]:
        """Return the wildcards (sensor, perhaps recording) of the steps that are repeated."""
        ready = [key for key, log in self.recordings.items() if not log.held_back]
        return [
            {"sensor": sensor} | ({"recording": name} if name else {})
            for sensor, name in self.faults.repeated(ready)
        ]

    def list_ingests_without_samples(
        self, jobs: Iterable[Mapping[str, str]]
    ) -> dict[str, Mapping[str, str]]:
        """Return the jobs whose ingested samples were removed, by the name of the ingest's seal."""
        again = {}
        for job in jobs:
            key = (job.get("sensor", ""), job.get("recording", ""))
            if key in self.recordings and not self.recordings[key].held_back:
                folder = self.run.results.joinpath("recordings", *key)
                with suppress(OSError, RecordingError):  # it is made in any case
                    if Quality.read(folder / "quality.json").has_removed_samples(folder):
                        again[name_place("ingest", *key)] = job
        return again

    def ingest_settings(self, sensor: str, name: str) -> str:
        """Return, as JSON, the ingest settings of a recording, or why it cannot be read."""
        if (sensor, name) not in self._of_ingest:
            self._of_ingest[sensor, name] = to_json(
                self._ingest(self.recordings[sensor, name]).to_json()
            )
        return self._of_ingest[sensor, name]

    def _ingest(self, recording: Recording) -> sensor_files.IngestPlan:
        plan = partial(
            sensor_files.IngestPlan,
            simulated=recording.simulated,
            kind=self.kind(recording.sensor, recording.name),
            quality=self.run.quality,
        )
        try:
            log, notes = self._written(recording)
            if recording.simulated:
                log = simulations.layout(self.simulated[recording.sensor, recording.name], log)
            else:
                try:
                    notes.check_gyro(log)
                except ValueError as error:
                    raise ConfigError(f"{recording.notes}: {error}") from None
            folder = self.run.results / "recordings" / recording.sensor / recording.name
            unread = self._stored or recording.simulated
            files = {} if unread else plan_versions(recording.path, folder)
            return plan(log=log, notes=notes, files=files)
        except UnavailableSettingsError as error:
            return plan(unavailable=self._without_folders(str(error)))
        except ConfigError as error:
            return plan(error=self._without_folders(str(error)))

    def _without_folders(self, reason: str) -> str:
        """Return a reason without absolute paths, for tables."""
        sensors = self.run.sensors
        for folder in (sensors,) if isinstance(sensors, Path) else sensors:
            if folder.is_absolute():
                reason = reason.replace(str(folder), "sensors")
        return reason.replace(str(self.run.logs), "logs") if self.run.logs.is_absolute() else reason

    def kind(self, sensor: str, name: str) -> Kind:
        """Return the kind of experiment of a recording, even if its notes are invalid."""
        recording = self.recordings[sensor, name]
        if recording.simulated:
            return self.simulated[sensor, name].kind
        return kind_of(self._readable_notes(recording))

    def _readable_notes(self, recording: Recording) -> object:
        try:
            return self._notes(recording)
        except ConfigError:
            return {}

    def _notes(self, recording: Recording) -> object:
        """Return the content of the notes of a log; each file is read once per run."""
        if recording.notes is None:
            return {}
        if recording.notes not in self._read_notes:
            self._read_notes[recording.notes] = read_yaml(recording.notes) or {}
        return self._read_notes[recording.notes]

    def of_experiment(self, *keys: str) -> list[tuple[str, str]]:
        """Return sensor and name of each recording of one of these experiments."""
        return [key for key in self.recordings if self._experiment(*key) in keys]

    def _experiment(self, sensor: str, name: str) -> str | None:
        """Return the key of the experiment of a recording; None: the sensor was at rest."""
        recording = self.recordings[sensor, name]
        if recording.simulated:
            return next(iter(stated_experiments(self.simulated[sensor, name])), None)
        notes = self._readable_notes(recording)
        stated = notes if isinstance(notes, Mapping) else {}
        return next((key for key in blocks("notes") if stated.get(key) is not None), None)

    @property
    def on_boards(self) -> list[tuple[str, str]]:
        """Sensor and name of the simulated recordings of boards."""
        return [
            (sensor.sensor, f"sim_{name}")
            for name, board in self.boards.items()
            for sensor in board.sensors
        ]

    def static_of(self, sensor: str) -> list[str]:
        """Return the static recordings of a sensor."""
        return self.at_rest.get(sensor, [])

    @cached_property
    def at_rest(self) -> dict[str, list[str]]:
        """The static recordings of each sensor that has some."""
        by_sensor: dict[str, list[str]] = {}
        for sensor, name in self.recordings:
            if self.kind(sensor, name) == AT_REST:
                by_sensor.setdefault(sensor, []).append(name)
        return by_sensor

    def experiment_settings(self, sensor: str, name: str, *sections: str) -> str:
        """Return, as JSON, sections of the configuration, the sensor, and a recording's notes."""
        recording = self.recordings[sensor, name]
        declared = self.sensors.get(sensor)
        settings: dict[str, object] = {
            **{section: getattr(self.run, section) for section in sections},
            "sensor": declared.model_dump(mode="json", exclude_unset=True) if declared else None,
        }
        if recording.simulated:
            made = _dump_for_samples(self.simulated[sensor, name])
            return to_json(settings | {"simulated": made})
        try:
            notes = self._written(recording)[1]
        except ConfigError:
            return to_json(settings)  # it is rejected, and says why
        experiments = notes.model_dump(mode="json", include=set(blocks("notes")), exclude_none=True)
        return to_json(settings | experiments)

    def _written(
        self, recording: Recording
    ) -> tuple[sensor_files.LogFormat, sensor_files.RecordingNotes]:
        """Return the format and the notes of a log; ConfigError if it cannot be used."""
        if recording.error:
            raise ConfigError(recording.error)
        if recording.unavailable:
            raise UnavailableSettingsError(recording.unavailable)
        notes = sensor_files.RecordingNotes()
        if recording.notes:
            notes = parse(sensor_files.RecordingNotes, self._notes(recording), str(recording.notes))
        if recording.sensor in self.unusable:
            raise self.unusable[recording.sensor]
        if recording.sensor not in self.sensors:
            expected = find_own_folder(self.run.sensors) / f"{recording.sensor}.yaml"
            raise ConfigError(
                f"no sensor file {expected} for the logs in {self.run.logs / recording.sensor}; "
                "write one, or move the logs to the folder of their sensor"
            )
        return sensor_files.merged_log(
            self.sensors[recording.sensor], notes, str(recording.notes or recording.sensor)
        ), notes

    def estimate_settings(self, sensor: str, name: str) -> str:
        """Return, as JSON, the settings that the estimates of a recording depend on."""
        bandwidth = self.bandwidth(sensor, name)
        settings: dict[str, object] = {"estimate": self.run.estimate, "bandwidth": bandwidth}
        if (sensor, name) in self.simulated:
            channels = self.simulated[sensor, name].channels.items()
            read = {str(key): axis.read.si(key) for key, axis in channels if axis.read is not None}
            settings |= {"authors": read} if read else {}
        return to_json(settings)

    def bandwidth(self, sensor: str, name: str) -> float | None:
        """Return the stated cut-off of the sensor's filter, Hz; None if it is not stated."""
        try:
            stated = self._written(self.recordings[sensor, name])[0].bandwidth
        except ConfigError:
            return None
        return parse_quantity(stated, "frequency") if stated else None

    def simulated_settings(self, sensor: str, name: str) -> str:
        """Return, as JSON, the parameters and the log format of a simulated recording."""
        recording = self.simulated[sensor, name]
        written = simulations.layout(recording, self.sensors[sensor].log)
        try:
            profiles = {
                str(path): compute_digest(path) for path in simulations.profile_files(recording)
            }
        except OSError as error:
            raise ConfigError(
                f"{sensor}/{name}: {error.filename} cannot be read "
                f"({error.strerror}); expected a file with a profile of temperature or motion"
            ) from None
        return to_json(
            {
                "recording": _dump_for_samples(recording),
                "log": written.model_dump(mode="json", exclude={"bandwidth"}),
                "profiles": profiles,
            }
        )

    def settings(self, section: str) -> str:
        """Return, as JSON, one section of the run's configuration."""
        return to_json(getattr(self.run, section))

    def datasheet_settings(self, sensor: str) -> str:
        """Return, as JSON, the settings of the comparison of a sensor with its datasheet."""
        declared = self.sensors.get(sensor)
        return to_json(
            {
                "datasheet": declared.datasheet if declared else {},
                "tolerance": self.run.datasheet.tolerance,
                "longest": self.run.estimate.longest,
            }
        )

    def error_budget_settings(self, sensor: str) -> str:
        """Return, as JSON, the settings of a sensor's error budget, with its printed figures."""
        if sensor not in self._of_error_budget:
            self._of_error_budget[sensor] = to_json(
                {
                    "error_budget": self.run.error_budget,
                    "fusion": self.run.fusion.model_dump(include={"longest", "draws", "seed"}),
                    "requirements": self._requirements(*_RANKING_KEYS, *_REPORT_KEYS),
                    "figures": state_figures(self.sensors.get(sensor)),
                }
            )
        return self._of_error_budget[sensor]

    def ranking_settings(self) -> str:
        """Return, as JSON, the settings of the ranking: requirements, and sensors for sale."""
        sensors = self._for_sale()
        return to_json({"requirements": self._requirements(*_REPORT_KEYS), "sensors": sensors})

    def _for_sale(self) -> dict[str, dict[str, object]]:
        return {
            name: about | {"abilities": read_abilities(self.sensors[name]).model_dump(mode="json")}
            for name, about in self._described("price_class").items()
            if self.sensors[name].sold
        }

    def _requirements(self, *unused: str) -> dict[str, object]:
        """Return the requirements of applications, without keys that a step does not use."""
        return {
            name: {"title": name} | requirement.model_dump(mode="json", exclude=set(unused))
            for name, requirement in self.requirements.items()
        }

    def _described(self, *keys: str) -> dict[str, dict[str, object]]:
        used = {sensor for sensor, _ in self.recordings}
        return {
            name: sensor.model_dump(mode="json", include=set(keys))
            for name, sensor in self.sensors.items()
            if name in used
        }

    def report_settings(self) -> str:
        """Return, as JSON, the settings of the report."""
        return to_json(
            {
                "report": self.run.report,
                "results": str(self.run.results),
                "logs": str(self.run.logs),
                "csv": sorted(filter(self.writes_csv, TABLES)),
                "given": given_beside(self.run, Path("config/config.yaml")),
                "settings": self.run.model_dump(mode="json", include=_REPORTED_SECTIONS),
                "sensors": self._described("vendor", "model", "price_class", "sold"),
                "boards": {name: _describe_board(board) for name, board in self.boards.items()},
                "requirements": self._requirements(),
                "models": {
                    "drawn": self.run.error_budget.model_dump(include={"draws", "seed"}),
                    "sensors": {
                        name: about | {"figures": state_figures(self.sensors[name])}
                        for name, about in self._for_sale().items()
                    },
                },
                "on_purpose": {
                    f"{sensor}/{name}": dict(entry.shows)
                    for (sensor, name), entry in self.simulated.items()
                    if entry.shows
                },
            }
        )

    def writes_csv(self, table: str) -> bool:
        """Return whether a joint table is also written as CSV."""
        csv = self.run.tables.csv
        return csv == "all" or (csv == "sensors" and table not in BY_RECORDING)

    def has_parts(self, table: str) -> bool:
        """Return whether a joint table is a folder with a file for each sensor and month."""
        return table in BY_RECORDING and len(self.recordings) > self.run.tables.parts_above

    def remove_unused_csv(self) -> None:
        """Remove CSV files of joint tables that an earlier run wrote and the settings now omit."""
        for path in (self.run.results / "tables").glob("*.csv"):
            if path.stem in TABLES and not self.writes_csv(path.stem):
                path.unlink(missing_ok=True)

    def catalogue(self, *more: str, sensor: str | None = None) -> str:
        """Return, as JSON, the datasheets of all sensors or one, with vendor and ``more`` keys."""
        names = self.sensors if sensor is None else {sensor} & self.sensors.keys()
        keys = {"vendor", "model", "grade", "temperature_range", "datasheet", *more}
        return to_json(
            {
                name: self.sensors[name].model_dump(mode="json", include=keys)
                | {"log": _PLACEHOLDER_LOG}
                for name in names
            }
        )

    @cached_property
    def usual(self) -> str:
        """Usual figures of sensors, as JSON, from the catalogue that the package ships."""
        return usual_as_text(usual_figures(sensor_files.shipped_sensors()))

    def truths(self, sensor: str) -> str:
        """Return, as JSON, the true parameters of the simulated recordings of a sensor."""
        entries = (entry for (of, _), entry in self.simulated.items() if of == sensor)
        return to_json([*map(_dump_for_tables, entries)])

    def describe_software(self) -> str:
        """Return, as JSON, the program's version, and a digest of settings that affect results."""
        ignored = {"logs", "results", "sensors", "requirements", "simulated", "held_back"}
        used = {sensor for sensor, _ in self.recordings} & self.sensors.keys()
        settings = [
            self.run.model_dump(mode="json", exclude={*ignored, *_NOT_IN_RESULTS}),
            {
                name: self.sensors[name].model_dump(mode="json", exclude=_LISTING_KEYS)
                for name in used
            },
            self._requirements(*_REPORT_KEYS),
            [*map(_dump_for_tables, self.simulated.values())],
        ]
        digest = hashlib.sha256(to_json(settings).encode()).hexdigest()
        return to_json({"version": version("imubench_pipeline"), "settings": digest[:16]})

    @staticmethod
    def code(step: str, package: str = "steps") -> str:
        """Return a digest of the module ``step`` in a package, and of all code that it uses."""
        return digest_sources(f"{package}.{step}")


def _dump_for_tables(recording: simulations.SimulatedRecording) -> dict[str, Any]:
    """Return the settings of a simulated recording without the texts that only the report shows."""
    return recording.model_dump(mode="json", exclude={"shows"})


def _dump_for_samples(recording: simulations.SimulatedRecording) -> dict[str, Any]:
    """Return the settings of a simulated recording that affect its samples."""
    of_source = {"published", "figures", "read"}
    without: dict[str, Any] = {"channels": {"__all__": of_source}, "shows": True}
    return recording.model_dump(mode="json", exclude=without)


def _describe_board(board: simulations.Board) -> dict[str, object]:
    return {
        "title": board.title,
        "note": board.note,
        "sensors": {
            sensor.sensor: {name: channel.figures for name, channel in sensor.channels.items()}
            for sensor in board.sensors
        },
        "temperature": board.temperature is not None,
        "motion": sorted(board.motion),
    }


def _check_places(run: Run) -> None:
    logs, results = run.logs.resolve(), run.results.resolve()
    declared = (run.sensors,) if isinstance(run.sensors, Path) else run.sensors
    if results in [folder.resolve() for folder in declared]:
        raise ConfigError(
            f"results: found {str(run.results)!r}, the folder of the sensor files; expected a "
            "separate folder"
        )
    if logs.is_relative_to(results) or results.is_relative_to(logs):
        raise ConfigError(
            f"logs: found {str(run.logs)!r}, and results: found {str(run.results)!r}; expected two "
            "folders, neither inside the other: choose another folder for the results"
        )


def to_json(value: object) -> str:
    """Return a value as JSON, without braces that Snakemake would read as a wildcard."""
    dump = partial(BaseModel.model_dump, mode="json")
    text = json.dumps(value, sort_keys=True, ensure_ascii=False, default=dump)
    return _BRACE_BEFORE_WORD.sub(r"\\u007b", text)
