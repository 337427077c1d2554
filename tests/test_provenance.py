from pathlib import Path

import pytest

from imubench_pipeline import provenance
from imubench_pipeline.provenance import source_digest


def test_a_digest_follows_imports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "a.py").write_text("from pack.b import f\nfrom pack import sub\n")
    (tmp_path / "b.py").write_text("import numpy\n")
    (tmp_path / "c.py").write_text("x = 1\n")
    (tmp_path / "sub/__init__.py").write_text("from pack.sub.d import g\n")
    (tmp_path / "sub/d.py").write_text("g = 1\n")
    monkeypatch.setattr(provenance, "_PACKAGE", tmp_path)
    monkeypatch.setattr(provenance, "_NAME", "pack")
    before = source_digest("a")
    (tmp_path / "c.py").write_text("x = 2\n")
    assert source_digest("a") == before
    (tmp_path / "sub/d.py").write_text("g = 2\n")
    assert source_digest("a") != before
    with pytest.raises(ValueError, match="no module 'e'"):
        source_digest("e")
