from collections.abc import Iterator
from pathlib import Path

import pytest

from imubench_pipeline.registry import FOLDER
from imubench_pipeline.tables import provenance
from imubench_pipeline.tables.provenance import digest_sources


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package of which `a` uses `b` and the package `sub`, and `c` nothing.

    `sub.d` has texts, and imports `late` and all of `many` by their names.
    """
    (tmp_path / "sub/texts").mkdir(parents=True)
    (tmp_path / "many/inner").mkdir(parents=True)
    for file in ("__init__.py", "any.py", "inner/__init__.py", "inner/deep.py"):
        (tmp_path / "many" / file).write_text("w = 1\n")
    (tmp_path / "a.py").write_text("from pack.b import f\nfrom pack import sub\n")
    (tmp_path / "b.py").write_text("import numpy\n")
    (tmp_path / "c.py").write_text("x = 1\n")
    (tmp_path / "sub/__init__.py").write_text("from pack.sub.d import g\n")
    (tmp_path / "sub/d.py").write_text("g = 1, 'texts', 'pack.late', 'pack.many.*'\n")
    (tmp_path / "late.py").write_text("y = 1\n")
    (tmp_path / "sub/unused.py").write_text("h = 1\n")
    (tmp_path / "sub/texts/page.html").write_text("<p>")
    (tmp_path / "beside.txt").write_text("1")
    monkeypatch.setattr(provenance, "_PACKAGE", tmp_path)
    monkeypatch.setattr(provenance, "_NAME", "pack")
    yield tmp_path
    provenance._used.cache_clear()


def test_a_digest_follows_imports(package: Path) -> None:
    before = digest_sources("a")
    (package / "c.py").write_text("x = 2\n")
    (package / "sub/unused.py").write_text("h = 2\n")
    assert digest_sources("a") == before
    (package / "sub/d.py").write_text("g = 2\n")
    assert digest_sources("a") != before
    with pytest.raises(ValueError, match="no module 'e'"):
        digest_sources("e")


@pytest.mark.parametrize(("file", "known"), [("sub/texts/page.html", True), ("late.py", True),
                                             ("many/any.py", True),
                                             ("many/inner/__init__.py", True),
                                             ("many/inner/deep.py", False),
                                             ("beside.txt", False)])  # fmt: skip
def test_a_digest_knows_what_the_texts_of_a_module_name(
    package: Path, file: str, known: bool
) -> None:
    of_a, of_c = digest_sources("a"), digest_sources("c")
    (package / file).write_text("z = 1")
    assert (digest_sources("a") != of_a) == known
    assert digest_sources("c") == of_c


def test_a_digest_is_the_same_wherever_the_package_lies(
    package: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = digest_sources("a", "c")
    moved = tmp_path_factory.mktemp("elsewhere") / "pack"
    package.rename(moved)
    monkeypatch.setattr(provenance, "_PACKAGE", moved)
    assert digest_sources("c", "a") == before


def test_logs_are_read_again_when_a_format_of_any_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = provenance._PACKAGE / "readers"
    added = FOLDER / "formats"
    files = [packed / "formats.py", packed / "arrays/hdf5.py"]
    files += [added / "declarations.py", added / "ubx.py", added / "rosbag/version_2.py"]
    before, whole = digest_sources("steps.ingest"), Path.read_bytes
    for path in files:
        with monkeypatch.context() as patch:
            patch.setattr(Path, "read_bytes", lambda one, of=path: whole(one) + b" " * (one == of))
            assert digest_sources("steps.ingest") != before, path.name


@pytest.mark.parametrize(
    "file",
    ["templates/index.html.jinja", "static/report.css", "static/plot.js", "glossary.yaml"],
)
def test_the_report_is_made_again_when_its_texts_change(
    file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = provenance._PACKAGE / "report" / file
    of_figures = "extensions.figures.figures"
    before = digest_sources("report.publish"), digest_sources("allan", of_figures)
    whole = Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda one: whole(one) + b" " * (one == path))
    assert digest_sources("report.publish") != before[0]
    assert digest_sources("allan", of_figures) == before[1]
