"""Rules that the sentences of all findings follow."""

import json
import math
import re
from types import ModuleType

from imubench_pipeline.tables.findings import find
from imubench_pipeline.words.findings.base import FINDINGS, FindingData

_MAX_WORDS = 25


def check_sentences(data: FindingData, channel: str) -> str:
    """Return the text of a finding that follows the rules."""
    finding = find(data, "warning", 1.0, channel or None)
    text = finding.detail
    assert data.code not in text or "_" not in data.code
    assert not channel or channel not in text, "the channel is named in words"
    assert not re.search(r"\bnan\b|\binf\b|∞|–|None|\{|\(\)", text), text
    assert text == text.strip() and not text.endswith(".") and "  " not in text
    for sentence in re.split(r"[.?] ", text):
        assert len(sentence.split()) <= _MAX_WORDS, sentence
    assert finding.data is not None
    assert all(math.isfinite(x) for x in _numbers(json.loads(finding.data).values()))
    return text


def _numbers(values: object) -> list[float]:
    assert hasattr(values, "__iter__")
    flat = [x for value in values for x in (value if isinstance(value, list) else [value])]
    return [x for x in flat if isinstance(x, (int, float))]


def declared(module: ModuleType) -> set[type[FindingData]]:
    """Return the findings that a module declares."""
    return {kind for kind in FINDINGS.values() if kind.__module__ == module.__name__}
