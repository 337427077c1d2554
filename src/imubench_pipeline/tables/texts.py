"""Escape texts from logs, notes and folder names for the programs that open them.

A spreadsheet takes a cell that begins with ``=``, ``+``, ``-`` or ``@``, also after a semicolon,
for a formula, quoted or not. An apostrophe before it marks it as text.
"""

import json
import re

import pyarrow as pa

_FORMULA = re.compile(r"((?:^|;)[\s\"]*)('*[=+\-@\uff1d\uff0b\uff0d\uff20])")
"""The signs, and their full-width forms, with the apostrophes that stand before them already."""


def escape_invisible(text: str) -> str:
    r"""Return a text with all invisible characters escaped, as ``\x1b`` and ``\u2028``."""
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() else sign.encode("unicode_escape").decode("ascii")
        for sign in text
    )


def escape_cell(text: str) -> str:
    """Return a text with invisible characters and formulas escaped, for a spreadsheet's cell."""
    return _FORMULA.sub(r"\1'\2", escape_invisible(text))


def escape_cells(table: pa.Table) -> pa.Table:
    """Return a table with texts escaped by `escape_cell`, and lists as texts."""
    for place, field in enumerate(table.schema):
        if pa.types.is_list(field.type):
            texts = [
                "; ".join(
                    part if isinstance(part, str) else json.dumps(part, ensure_ascii=False)
                    for part in value or ()
                )
                for value in table[place].to_pylist()
            ]
            table = table.set_column(place, field.name, pa.array(texts, pa.string()))
        elif pa.types.is_dictionary(field.type):
            table = table.set_column(place, field.name, table[place].cast(pa.string()))
        elif not pa.types.is_string(field.type):
            continue
        field = table.schema[place]
        column = table.column(place).combine_chunks().dictionary_encode()
        texts = column.dictionary.to_pylist()
        safe = [escape_cell(text) for text in texts]
        if safe != texts:
            column = pa.DictionaryArray.from_arrays(column.indices, pa.array(safe, pa.string()))
            table = table.set_column(place, field, column.cast(pa.string()))
    return table
