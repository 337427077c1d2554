"""Differences between two runs in words."""

from collections.abc import Mapping, Sequence
from typing import Any

from imubench_pipeline.extensions.nightly.difference_rows import (
    DifferenceKind,
    Result,
    RunDifference,
)
from imubench_pipeline.words.estimates import STATUS_WORDS, symbol_text
from imubench_pipeline.words.events import FITNESS_WORDS
from imubench_pipeline.words.numbers import NO_VALUE, Unit, counted, number_text
from imubench_pipeline.words.verdicts import SHORT_VERDICTS

_KIND_WORDS: Mapping[DifferenceKind, str] = {
    "recording_status": "Recordings with another status",
    "value_lost": "Values lost",
    "verdict": "Verdicts changed",
    "beyond_intervals": "Values changed beyond their intervals",
    "new_finding": "New findings",
    "finding_gone": "Findings gone",
    "parameter_status": "Parameters with another status",
    "value_gained": "Values gained",
    "only_in_a": "Recordings only in A",
    "only_in_b": "Recordings only in B",
    "within_intervals": "Values changed within their intervals",
}
_STATE_WORDS: Mapping[str, Mapping[Any, str]] = {
    "recordings": FITNESS_WORDS,
    "parameters": STATUS_WORDS,
    "ranking": SHORT_VERDICTS,
    "findings": {},
}


def count_text(kind: DifferenceKind, differences: Sequence[RunDifference]) -> str:
    """Return the number of differences of a kind, with the number of regressions among them."""
    worse = sum(each.regression for each in differences)
    text = f"{_KIND_WORDS[kind]}: {len(differences)}"
    text += f" ({counted(worse, 'regression')})" * bool(worse)
    factors = [max(each.ratio, 1.0 / each.ratio) for each in differences if each.ratio]
    return text + f", by a factor of up to {number_text(max(factors, default=1))}" * bool(factors)


def difference_text(difference: RunDifference, unit: Unit) -> str:
    """Return a difference in words; ``unit``: for the values of a parameter."""
    key, a, b = difference.key, difference.a, difference.b
    name = symbol_text(key.name or "").replace("_" if key.table != "parameters" else "\0", " ")
    place = " ".join(
        filter(None, ("/".join(filter(None, (key.sensor, key.recording))), key.channel, name))
    )
    place += f" {key.component}" * ((key.component or 1) > 1)
    texts = [_result_text(key.table, result, unit) for result in (a, b)]
    ratio = f" ({number_text(difference.ratio)} times)" * (difference.ratio is not None)
    detail = f": {b.detail}" if b is not None and b.detail else ""
    return f"{place}: {texts[0]}, now {texts[1]}{ratio}{detail}"


def _result_text(table: str, result: Result | None, unit: Unit) -> str:
    if result is None:
        return "none"
    words = _STATE_WORDS[table].get(result.state, result.state)
    if result.value is None:
        return words
    value, interval = unit.estimate_texts(result.value, result.lower, result.upper)
    about = [interval] * (interval != NO_VALUE) + [words] * (result.state != "ok")
    return f"{value} {unit.sign}" + f" ({'; '.join(about)})" * bool(about)
