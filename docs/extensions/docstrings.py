"""Docstrings, which are written to be read in an editor, as Sphinx takes them."""

from __future__ import annotations

import re

from sphinx.application import Sphinx

_CODE = re.compile(r"(`+[^`]*`+)")


def _escape(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    """Let bars of formulas be bars, and references of a module be no section to refer to."""
    for place, line in enumerate(lines):
        parts = _CODE.split(line)
        parts[::2] = [part.replace("|", "\\|") for part in parts[::2]]
        lines[place] = "".join(parts)
    if what == "module" and "References" in lines:
        place = lines.index("References")
        lines[place : place + 2] = [".. rubric:: References", ""]


def setup(app: Sphinx) -> dict[str, bool]:
    """Do so before napoleon reads them."""
    app.connect("autodoc-process-docstring", _escape, priority=400)
    return {"parallel_read_safe": True}
