"""Texts from logs, notes and names of folders, made safe for what opens them.

A spreadsheet takes a cell of a CSV file that begins with ``=``, ``+``, ``-`` or ``@`` for a
formula, quoted or not, and a formula can start programs and fetch pages. An apostrophe before it is
what spreadsheets themselves take for "this is text". One that expects semicolons between cells
breaks a text at them, whatever the quotes, so what follows a semicolon is treated as what begins a
cell.
"""

from __future__ import annotations

import json
import re

import pyarrow as pa

_FORMULA = re.compile(r"((?:^|;)[\s\"]*)('*[=+\-@\uff1d\uff0b\uff0d\uff20])")
"""The signs, and their full-width forms, with the apostrophes that stand before them already."""


def printable(text: str) -> str:
    r"""Return a text in which each character shows: others are escaped, as ``\x1b`` and ``\u2028``.

    Parameters
    ----------
    text : str
        May hold control characters, line ends, marks of direction and halves of surrogate pairs.
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii")
        for sign in text
    )


def as_cell(text: str) -> str:
    """Return a text as a cell of a CSV file that no spreadsheet takes for a formula.

    It is `printable`, and each sign that would begin a formula has one apostrophe more before it
    than in the text.
    """
    return _FORMULA.sub(r"\1'\2", printable(text))


def with_safe_cells(table: pa.Table) -> pa.Table:
    """Return a table with its texts as `as_cell` gives them, and lists as texts."""
    for place, field in enumerate(table.schema):
        if pa.types.is_list(field.type):
            texts = ["; ".join(map(_text_of, value or ())) for value in table[place].to_pylist()]
            table = table.set_column(place, field.name, pa.array(texts, pa.string()))
        elif pa.types.is_dictionary(field.type):
            table = table.set_column(place, field.name, table[place].cast(pa.string()))
        elif not pa.types.is_string(field.type):
            continue
        field = table.schema[place]
        column = table.column(place).combine_chunks().dictionary_encode()
        texts = column.dictionary.to_pylist()
        safe = [as_cell(text) for text in texts]
        if safe != texts:
            column = pa.DictionaryArray.from_arrays(column.indices, pa.array(safe, pa.string()))
            table = table.set_column(place, field, column.cast(pa.string()))
    return table


def _text_of(part: object) -> str:
    return part if isinstance(part, str) else json.dumps(part, ensure_ascii=False)
