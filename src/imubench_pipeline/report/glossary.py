"""The terms of the report, each with a short explanation and a section of the theory page."""

import difflib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from pydantic import RootModel

from imubench_pipeline.settings.validation import ConfigError, Strict, parse
from imubench_pipeline.settings.yaml_files import read_yaml
from imubench_pipeline.words.estimates import STATUS_WORDS
from imubench_pipeline.words.verdicts import VERDICT_WORDS

_FILE = Path(__file__).with_name("glossary.yaml")

_NAMES: Mapping[str, str] = {
    **dict(STATUS_WORDS.items()),
    **{f"verdict_{code}": words for code, words in VERDICT_WORDS.items()},
    "verdict_meets_if": f"{VERDICT_WORDS['meets']} if …",
}
"""Names of terms whose wording is in `words`."""


class _Entry(Strict):
    name: str | None = None
    short: str
    action: str | None = None


class _Sections(RootModel[dict[str, dict[str, _Entry]]]):
    """The file: sections of the theory page, and their terms."""


@dataclass(frozen=True)
class Term:
    """A term that the report explains, such as a status, a verdict or a finding."""

    key: str
    name: str  # as it is shown
    short: str  # one plain sentence: definition and relevance
    section: str  # anchor on the theory page
    action: str | None = None  # advice; for findings only


class UnknownTermError(KeyError):
    """Raised for a key that is not in the glossary."""

    def __str__(self) -> str:
        return str(self.args[0])


class _Glossary(dict[str, Term]):
    def __missing__(self, key: str) -> Term:
        close = difflib.get_close_matches(str(key), self, n=3)
        hint = f"; did you mean {' or '.join(close)}?" if close else ""
        raise UnknownTermError(f"{key!r} is not in {_FILE.name}{hint}")


@lru_cache(maxsize=1)
def read_glossary() -> dict[str, Term]:
    """Return all terms by key, in the order of the file; do not change them: they are cached.

    Looking up an unknown key in the result raises UnknownTermError, with similar keys. Raises
    ConfigError if the file cannot be used, or a key is in two sections.
    """
    terms = _Glossary()
    for section, entries in parse(_Sections, read_yaml(_FILE), str(_FILE)).root.items():
        for key, entry in entries.items():
            if key in terms:
                raise ConfigError(f"{_FILE}: {key!r} is in {section!r} and above it; remove one")
            anchor = f"finding-{key}" if entry.action else section
            name = entry.name or _NAMES.get(key, key.replace("_", " "))
            terms[key] = Term(key, name, entry.short, anchor, entry.action)
    return terms


def find_term(value: str, kind: str = "") -> Term:
    """Return the term that explains a value of a table, such as ``not comparable (condition)``.

    ``kind`` is a prefix of the key, for values that are ambiguous without it: ``verdict``,
    ``published``, ``kind`` (of a printed figure or recording), ``line``, ``axis``, ``rate_from``,
    ``recording`` (status). Raises UnknownTermError if the glossary does not have the term.
    """
    return read_glossary()["_".join(re.findall(r"\w+", f"{kind} {value}"))]
