"""Puts what the code declares where a page has a line `%generated <name>`, when pages are made."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial

from sphinx.application import Sphinx

from extensions import commands, declared, models, shortlists

PARTS: dict[str, Callable[[], str]] = {
    "configuration": models.configuration,
    "sensor-file": models.sensor_file,
    "notes": models.notes,
    "requirement": models.requirement,
    "simulated": models.simulated,
    "tables": declared.tables,
    "statuses": declared.statuses,
    "verdicts": declared.verdicts,
    "findings": declared.findings,
    "glossary": declared.terms_of_the_report,
    "formats": declared.formats,
    "targets": declared.targets,
    "which-numbers": declared.which_numbers,
    "noise-terms": declared.noise_terms,
    "commands": commands.commands,
    "exit-statuses": commands.exit_statuses,
    **{
        f"shortlist-{file.stem}": partial(shortlists.describe_requirement, file.stem)
        for folder in shortlists.FOLDERS
        for file in folder.glob("*.yaml")
    },
}
"""Markdown of each part, made when a page that names it is read."""

_LINE = re.compile(r"^%generated ([\w-]+)$", re.MULTILINE)


def _fill(app: Sphinx, docname: str, content: list[str]) -> None:
    content[0] = _LINE.sub(lambda line: PARTS[line[1]](), content[0])
    if names := _LINE.findall(content[0]):
        raise ValueError(f"{docname}: {names} stand within generated text")


def setup(app: Sphinx) -> dict[str, bool]:
    """Fill pages when they are read."""
    app.connect("source-read", _fill)
    return {"parallel_read_safe": True}
