"""What is installed: one version of each package, and a digest of every file of it."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.conftest import PROJECT

FILES = sorted((PROJECT / "requirements").glob("*.txt"))
_DIGEST = re.compile(r"--hash=sha256:[0-9a-f]{64}")


def pins(path: Path) -> dict[str, Requirement]:
    """The requirements of a file by name, each checked to have a digest."""
    found = {}
    for entry in path.read_text().replace("\\\n", " ").splitlines():
        words = entry.partition("--hash")[0].strip()
        if not words or words.startswith("#"):
            continue
        one = Requirement(words)
        if path.parent.name == "requirements":
            assert _DIGEST.search(entry), words
        found[canonicalize_name(one.name)] = one
    return found


def project() -> dict:
    return tomllib.loads((PROJECT / "pyproject.toml").read_text())


def test_there_is_a_file_for_each_use() -> None:
    assert [path.stem for path in FILES] == ["dev", "docs", "run", "test"]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_what_is_installed_is_what_was_tested(path: Path) -> None:
    constraints, found = pins(PROJECT / "constraints.txt"), pins(path)
    builds = (PROJECT / "requirements/build.in").read_text().split()
    least = {one.name: one for one in map(Requirement, project()["build-system"]["requires"])}
    assert least.keys() == {Requirement(one).name for one in builds}
    for one in map(Requirement, builds):
        (version,) = one.specifier
        assert least[one.name].specifier.contains(version.version), one
        assert found[one.name].specifier == one.specifier
    del found["setuptools"]  # which constraints are not for
    for name, one in found.items():
        assert one.specifier == constraints[name].specifier, name


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_all_that_is_asked_for_is_there(path: Path) -> None:
    about = project()["project"]
    asked = [*about["dependencies"], *about["optional-dependencies"].get(path.stem, ())]
    names = {canonicalize_name(Requirement(one).name) for one in asked}
    assert names - {canonicalize_name(about["name"])} <= pins(path).keys()


def test_the_smaller_versions_are_others_of_the_same_packages() -> None:
    usual, small = (pins(PROJECT / f"constraints{which}.txt") for which in ("", "-small"))
    assert small.keys() == usual.keys()
    other = {name for name, one in small.items() if one.specifier != usual[name].specifier}
    assert other == {"numpy", "numba", "llvmlite", "pyarrow", "pulp"}
    for one in map(Requirement, project()["project"]["dependencies"]):
        (version,) = small[canonicalize_name(one.name)].specifier
        assert one.specifier.contains(version.version), one


def test_no_requirement_of_the_package_is_pinned() -> None:
    # conda-forge and Debian have one version of each package.
    about = project()
    asked = [*about["build-system"]["requires"], *about["project"]["dependencies"]]
    asked += [one for extra in about["project"]["optional-dependencies"].values() for one in extra]
    assert not [one for one in asked if "==" in one.partition(";")[0]]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_no_host_is_named(path: Path) -> None:
    assert not re.search(r"://|^--?[a-z]|index", path.read_text(), re.MULTILINE)
