"""What extensions declare is there, and is what the core takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import pytest

from imubench_pipeline import registry
from imubench_pipeline.readers.file_format import FileFormat
from imubench_pipeline.registry import FOLDER, Extension, Hook, installed_extensions
from imubench_pipeline.report.site import Entry, RecordingPage, Section
from imubench_pipeline.settings.command_line import Command
from imubench_pipeline.settings.validation import Strict
from imubench_pipeline.simulate.models import Simulation
from imubench_pipeline.tables.provenance import digest_sources

EXTENSIONS = installed_extensions()
HOOKS: dict[str, type | None] = {  # None: a function
    "tables": ModuleType,
    "motions": None,
    "simulations": Simulation,
    "formats": FileFormat,
    "limits": None,
    "sensor_tables": None,
    "drawings": None,
    "theory_figure": None,
    "commands": Command,
    "library": None,
    "listings": None,
    "sensor_commands": None,
    "pages": Entry,
    "recording_pages": RecordingPage,
    "sections": Section,
    "recording_sections": None,
    "search": None,
}


def test_each_package_is_an_extension_of_its_name() -> None:
    packages = sorted(path.parent.name for path in FOLDER.glob("*/__init__.py"))
    assert [one.name for one in EXTENSIONS] == packages


def test_each_field_is_tested_here() -> None:
    others = {"name", "needs", "blocks", "rules", "templates", "static"}
    assert {field.name for field in fields(Extension)} == HOOKS.keys() | others


@pytest.mark.parametrize("hook", HOOKS)
def test_each_reference_names_what_the_core_takes(hook: str) -> None:
    found = Hook[object](hook).by_key()
    assert found, "no extension uses it"
    kind = HOOKS[hook]
    assert all(isinstance(one, kind) if kind else callable(one) for one in found.values())


def test_each_block_of_settings_is_strict_and_each_file_there() -> None:
    for one in EXTENSIONS:
        for block in one.blocks:
            assert issubclass(registry.load(block.model), Strict), block
        assert set(one.needs) <= {other.name for other in EXTENSIONS}
        for file in filter(None, (one.rules, one.templates, one.static)):
            assert (FOLDER / one.name / file).exists()


def test_no_key_is_of_two_extensions() -> None:
    for hook in HOOKS:
        stated = [getattr(one, hook) for one in EXTENSIONS]
        keys = [key for one in stated if isinstance(one, Mapping) for key in one]
        assert len(keys) == len(set(keys)), hook
    places = [(block.place, block.key) for one in EXTENSIONS for block in one.blocks]
    assert len(places) == len(set(places))


def test_an_extension_without_one_that_it_needs_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "papers").mkdir()
    (tmp_path / "papers/__init__.py").touch()
    monkeypatch.setattr(registry, "FOLDER", tmp_path)
    assert installed_extensions.__wrapped__() == ()


@pytest.mark.parametrize(
    ("step", "file"),
    [
        ("steps.ingest", "formats/rosbag/version_2.py"),
        ("steps.ranking", "aided/limits.py"),
        ("steps.simulate", "earth_rate/simulation.py"),
        ("steps.sensor_tables", "fusion/published_figures.py"),
        ("settings.config", "aided/settings.py"),
        ("settings.simulated_recordings", "fusion/settings.py"),
        ("steps.report", "papers/templates/papers.html.jinja"),
        ("steps.report", "earth_rate/static/earth_rate.js"),
        ("steps.report", "calibration/pages.py"),
    ],
)
def test_code_that_an_extension_adds_is_of_the_step(
    step: str, file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, whole = digest_sources(step), Path.read_bytes
    of_allan = digest_sources("steps.allan")
    changed = FOLDER / file
    monkeypatch.setattr(Path, "read_bytes", lambda one: whole(one) + b" " * (one == changed))
    assert digest_sources(step) != before
    if file.endswith(("limits.py", "jinja", "js", "pages.py")):
        assert digest_sources("steps.allan") == of_allan
