"""Tables of the whole catalogue, judged for requirements, with the sources of each error."""

from functools import cache
from pathlib import Path

from extensions.markdown import cell, code, table
from imubench_pipeline.model.comparisons import ShortlistRow
from imubench_pipeline.navigation.shortlist import list_shortlist_rows
from imubench_pipeline.settings.requirements import read_requirements
from imubench_pipeline.settings.sensor import read_sensors
from imubench_pipeline.words.numbers import number_text
from imubench_pipeline.words.verdicts import (
    SHORT_VERDICTS,
    condition_text,
    share_text,
    shortfall_text,
)

_ROOT = Path(__file__).parents[2]
FOLDERS = (_ROOT / "config/requirements", _ROOT / "docs/how-to/requirements")
_MAX_PARTS = 3  # sources of an error that explain it


@cache
def _judge(name: str) -> list[ShortlistRow]:
    sensors = read_sensors(_ROOT / "config/sensors")
    sold = {key: sensor for key, sensor in sensors.items() if sensor.sold}
    return list(list_shortlist_rows({name: read_requirements(FOLDERS)[name]}, sold))


def describe_requirement(name: str) -> str:
    """Return the table of all sensors for a requirement."""
    heads = ("", "sensor", "verdict", "margin in use", "noise alone", "likely", "why")
    return table(heads, [_format_row(row) for row in _judge(name)])


def _format_row(row: ShortlistRow) -> tuple[str, ...]:
    why = [shortfall_text(each) for each in row.shortfalls]
    if not why:
        why = [share_text(part) for part in row.parts[:_MAX_PARTS]]
    if row.verdict == "meets_if":
        why += map(condition_text, row.conditions)
    margins = (row.margin, row.noise_margin, row.likely_margin)
    return (
        str(row.rank or "–"),
        code(row.sensor),
        SHORT_VERDICTS[row.verdict],
        *(number_text(margin, 2) for margin in margins),
        cell("; ".join(why)),
    )
