"""The pages of the report, with digests that show whether a page must be written again."""

import hashlib
import json
import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any

import pyarrow as pa

from imubench_pipeline.model.comparisons import CoverageRow, DriftRow, RankingRow
from imubench_pipeline.model.table import OfRecordingRow, R
from imubench_pipeline.registry import Hook
from imubench_pipeline.report.comparison import ComparedRecording, gather_recording
from imubench_pipeline.report.palette import Appearance, assign_sensor_styles
from imubench_pipeline.report.practical import System, choose_first_units, list_page_units
from imubench_pipeline.report.view import Name, RecordingView, gather_recordings
from imubench_pipeline.settings.requirements import Requirement, validate_requirements
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES


def make_command(name: str, results: str, options: Mapping[str, str] | None = None) -> str:
    """Return the command line of `imubench`, such as ``imubench figures results --sensor a``."""
    words = ["imubench", name, f"./{results}" if results.startswith("-") else results]
    for key, value in (options or {}).items():
        words += [f"{key}={value}"] if value.startswith("-") else [key, value]
    return shlex.join(words)


def make_recompute_command(target: str, overrides: Sequence[str] = ()) -> str:
    """Return the command that recomputes a file; ``overrides`` are settings, KEY=VALUE."""
    stated = ["--config", *overrides] if overrides else []
    # After the two dashes, nothing is read as an option.
    return shlex.join(["snakemake", "-c2", *stated, "--forcerun", "ingest", "--", target])


_CHANNEL_ORDER = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
_PACKAGE = "imubench_pipeline"
_FIRST_ROWS = 100  # rows of a long table that are shown at first
_PLAIN_ROWS = 30  # rows of a long table that are plain HTML, for readers without JavaScript
_MAX_COMPARED = 60  # recordings on a page that compares, so that it opens fast
_MIN_OF_SENSOR = 3  # recordings of each sensor that are compared, even if these are more
_NOT_IN_NAMES = re.compile(r"[^\w .+()-]")


@dataclass(frozen=True)
class Page:
    """A page of the report, which is made by filling the template."""

    path: str  # below the folder of the report
    template: str
    key: str  # digest of its content: the page is written again only if it changes
    context: Callable[[], Mapping[str, object]]  # returns the variables of the template

    @property
    def root(self) -> str:
        """Relative path from the page to the folder of the report."""
        return "../" * self.path.count("/")


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A page that occurs once in a report, declared in the module of its content."""

    file: str  # name of the page; the name of its template ends with ``.jinja`` in addition
    title: str
    context: "Callable[[Site], Mapping[str, object]]"  # returns the variables of the template
    # the joined tables that it shows: it is written again if one of them changes
    tables: tuple[str, ...] = ()
    # returns the recordings that it shows: it is also written again if their rows change
    views: "Callable[[Site], Sequence[RecordingView]]" = lambda _: ()
    # returns the files of recordings that it shows: it is also written again if they change
    files: "Callable[[Site], Iterable[Path]]" = lambda _: ()
    exists: "Callable[[Site], bool]" = lambda _: True  # returns whether a report has it
    about: str = ""  # what it shows, for the page of experiments; empty: it is in the menu
    place: int = 0  # among the pages of extensions

    @property
    def sections(self) -> "list[Section]":
        """The sections that extensions add to this page."""
        return [section for section in _SECTIONS.objects() if section.page == self.file]

    @property
    def shown_tables(self) -> set[str]:
        """Names of the joined tables that this page and its sections show."""
        return {*self.tables, *chain.from_iterable(section.tables for section in self.sections)}

    def page(self, site: "Site") -> Page:
        """Return this page for a report."""
        shown = (site.tables[table].to_pylist() for table in sorted(self.shown_tables))
        kept = (path.read_bytes() for path in self.files(site) if path.is_file())
        key = site.key_of([view.key for view in self.views(site)], *shown, *kept)

        def context() -> Mapping[str, object]:
            made = ((section.template, section.context(site)) for section in self.sections)
            return {**self.context(site), "sections": [one for one in made if one[1] is not None]}

        return Page(self.file, f"{self.file}.jinja", key, context)


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a page that an extension adds."""

    page: str  # the file of its `Entry`
    template: str  # gets the result of `context` as `section`
    context: "Callable[[Site], Any]"  # returns None if the section is omitted
    tables: tuple[str, ...] = ()  # further joined tables that it shows


_SECTIONS: Hook[Section] = Hook("sections")


@dataclass
class Site:
    """The data of a report, for all of its pages."""

    tables: Mapping[str, pa.Table]  # all joined tables
    settings: Mapping[str, Any]  # from `imubench_pipeline.run.plan.Plan.report_settings`
    results: Path  # folder of the results, for the tables of each recording
    entries: Sequence[Entry]  # pages that exist once, in the order of the menu
    code: str = ""  # digest of the code that makes the pages
    failed: dict[str, str] = field(default_factory=dict)  # pages that could not be made, and why
    _rows: dict[str, list[Any]] = field(default_factory=dict, init=False)
    _compared: dict[Name, ComparedRecording] = field(default_factory=dict, init=False)

    @property
    def title(self) -> str:
        """Title of the report; if it is about a single log, the name of that log."""
        if self.is_single:
            (view,) = self.views
            name = self.names[view.sensor]
            return view.name if name.endswith(f" {view.name}") else f"{name}: {view.name}"
        return str(self.settings["report"]["title"])

    @property
    def is_single(self) -> bool:
        """Whether the report is about one log, made without a run: then only one page has data."""
        return self.at_once is not None and len(self.views) == 1

    @property
    def system(self) -> System:
        """Initial units of the pages."""
        return self.settings["report"]["units"]

    @property
    def results_name(self) -> str:
        """The folder of the results for the commands on the pages."""
        return str(self.settings.get("results", "results"))

    @property
    def at_once(self) -> str | None:
        """The command that made the report without a folder of results; None if a run made it."""
        return self.settings.get("at_once")

    def on_purpose(self, view: RecordingView) -> Mapping[str, str]:
        """Return, by finding, why a simulated recording has it; empty if none is intended."""
        return self.settings.get("on_purpose", {}).get(f"{view.sensor}/{view.name}", {})

    def again(self, view: RecordingView, table: str) -> str:
        """Return the command that recomputes the results of a recording, up to a table."""
        return self.at_once or make_recompute_command(
            f"{self.results_name}/recordings/{view.sensor}/{view.name}/{table}.parquet",
            self.settings.get("given", []),
        )

    @cached_property
    def views(self) -> list[RecordingView]:
        """The recordings that have a page."""
        views = gather_recordings(self.tables)
        together = Counter((view.sensor, view.row.device, view.simulated) for view in views)
        for view in views:
            view.page = f"recordings/{view.sensor}/{view.name}.html"
            device = view.row.device
            if together[view.sensor, device, view.simulated] > 1 or device != view.name:
                safe = _NOT_IN_NAMES.sub("_", device)[:60]  # a file name cannot have all characters
                if safe != device:
                    safe += "-" + hashlib.sha256(device.encode()).hexdigest()[:8]
                folder = f"devices/{view.sensor}/{'simulated/' if view.simulated else ''}"
                view.device_page = f"{folder}{safe}.html"
        return views

    def compared(self, views: Iterable[RecordingView]) -> Iterator[ComparedRecording]:
        """Yield the data of recordings that pages compare, gathered once for all pages."""
        for view in views:
            if view.full_name not in self._compared:
                self._compared[view.full_name] = gather_recording(view, self.system)
            yield self._compared[view.full_name]

    def select_compared(self, views: Sequence[RecordingView]) -> list[RecordingView]:
        """Return the recordings that a page compares: all, or if too many, some of each sensor.

        Recordings that decide a ranking, and the longest usable one, come first; then the latest.
        """
        most = max(_MIN_OF_SENSOR, _MAX_COMPARED // max(1, len({view.sensor for view in views})))
        deciding = {(row.sensor, row.recording) for row in self.rows(RankingRow) if row.decides}
        chosen: set[Name] = set()
        for own in group_rows(views, lambda view: view.sensor).values():
            longest = max(own, key=lambda v: (v.row.decides is not False, v.row.duration or 0.0))
            first = {longest.full_name, *(v.full_name for v in own if v.full_name in deciding)}
            own.sort(key=lambda v: (v.full_name in first, v.row.started or ""), reverse=True)
            chosen.update(view.full_name for view in own[:most])
        return [view for view in views if view.full_name in chosen]

    def named_in(self, of: type[OfRecordingRow]) -> set[Name]:
        """Return sensor and name of recordings with rows in the joined table of class ``of``."""
        return {(row.sensor, row.recording) for row in self.rows(of)}

    @cached_property
    def existing(self) -> list[Entry]:
        """The entries that this report has, in the order of the menu."""
        return [entry for entry in self.entries if entry.exists(self)]

    @cached_property
    def sensors(self) -> list[str]:
        """The sensors that have recordings."""
        return sorted({view.sensor for view in self.views})

    @cached_property
    def names(self) -> dict[str, str]:
        """Vendor and model of each sensor."""
        return name_sensors(self.sensors, self.settings["sensors"])

    @cached_property
    def requirements(self) -> dict[str, Requirement]:
        """The requirements of applications, by name."""
        return validate_requirements(self.settings["requirements"])

    def is_sold(self, sensor: str) -> bool:
        """Return whether a sensor can be bought; True if it has no sensor file."""
        return self.settings["sensors"].get(sensor, {}).get("sold", True)

    @cached_property
    def looks(self) -> dict[str, Appearance]:
        """The appearance of each sensor in all figures."""
        return assign_sensor_styles(self.sensors)

    @cached_property
    def channel_names(self) -> list[str]:
        """The channels that occur in the recordings."""
        present = set(self.tables["allan"]["channel"].unique().to_pylist())
        return [name for name in _CHANNEL_ORDER if name in present]

    def sensor_page(self, sensor: str) -> str:
        """Return the path of the page of a sensor."""
        return f"sensors/{sensor}.html"

    def rows(self, of: type[R]) -> list[R]:
        """Return the rows of the joined table of class ``of``."""
        if of.table not in self._rows:
            self._rows[of.table] = of.rows_of(self.tables[of.table])
        return self._rows[of.table]

    @cached_property
    def coverage(self) -> dict[tuple[str, str, str], str]:
        """Whether a figure is published (table ``coverage``), by sensor, quantity and figure."""
        rows = self.rows(CoverageRow)
        return {(row.sensor, row.quantity, row.figure): row.published for row in rows}

    def changed_devices(self) -> list[Mapping[str, object]]:
        """Return the recordings in which a device has changed, with the changed parameters."""
        devices: dict[Name, tuple[DriftRow, list[str]]] = {}
        for row in self.rows(DriftRow):
            if row.verdict != "changed":
                continue
            name = "fixed bias" if row.parameter == "bias" else row.parameter
            devices.setdefault((row.sensor, row.recording), (row, []))[1].append(
                f"{name} of {row.channel.replace('_', ' ')}"
            )
        views = {view.full_name: view for view in self.views}
        return [
            row.columns()
            | {"channels": ", ".join(what), "simulated": views[name].simulated}
            | {"page": views[name].device_page}
            for name, (row, what) in devices.items()
        ]

    @cached_property
    def common(self) -> str:
        """Digest of the common content of all pages: settings, names, code."""
        # The models are a file of their own.
        settings = {key: value for key, value in self.settings.items() if key != "models"}
        files = [entry.file for entry in self.existing]
        return _make_digest(settings, self.names, files, self.code, version(_PACKAGE))

    def key_of(self, *parts: object) -> str:
        """Return the digest of the content of a page: ``parts``, and what all pages have."""
        return _make_digest(self.common, *parts)

    def shown(self, *, alone: bool = False) -> Mapping[str, object]:
        """Return the data of the site for all templates; ``alone``: for a report of one file."""
        return {
            "title": self.title,
            "menu": [] if self.is_single else [entry for entry in self.existing if not entry.about],
            "experiments": [entry for entry in self.existing if entry.about],
            "single": self.is_single,
            "units": {quantity: list(choices) for quantity, choices in list_page_units().items()},
            "first_units": choose_first_units(self.system),
            "names": self.names,
            "tables": [] if alone else sorted(set(TABLES) - set(OF_ONE_RECORDING)),
            "csv": [] if alone else self.settings.get("csv", [*TABLES]),
            "alone": alone,
            "version": version(_PACKAGE),
            "first_rows": _FIRST_ROWS,
            "plain_rows": _PLAIN_ROWS,
            "kinds": {kind: page.words for kind, page in RECORDING_PAGES.by_key().items()},
        }


@dataclass(frozen=True)
class RecordingPage:
    """The template and its variables for recordings of one kind, such as static ones."""

    template: str
    # returns the variables of the template; the path is the folder of the recording
    context: Callable[[Site, RecordingView, Path], Mapping[str, object]]
    words: str = ""  # name of the kind in lists of recordings


RECORDING_PAGES: Hook[RecordingPage] = Hook("recording_pages")
"""The pages of recordings that are not static, by their kind."""


def _make_digest(*parts: object) -> str:
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, bytes):
            digest.update(hashlib.sha256(part).digest() + b"\0")
        else:
            digest.update(json.dumps(part, sort_keys=True, default=str).encode() + b"\0")
    return digest.hexdigest()


def name_sensors(
    sensors: Iterable[str], described: Mapping[str, Mapping[str, str]]
) -> dict[str, str]:
    """Return vendor and model of each sensor, with the name of its file if two are equal.

    A sensor that is not in ``described`` has the name of its file.
    """
    names = {sensor: sensor for sensor in sensors}
    names |= {of: f"{x['vendor']} {x['model']}" for of, x in described.items() if of in names}
    times = Counter(names.values())
    return {of: f"{name} ({of})" if times[name] > 1 else name for of, name in names.items()}
