"""The templates of the report, with their functions and filters."""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
from jinja2.runtime import Context
from markupsafe import Markup, escape

from imubench_pipeline.registry import files_of
from imubench_pipeline.report.glossary import find_term
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.words.estimates import status_text, symbol_text
from imubench_pipeline.words.numbers import NO_VALUE, Unit, duration_text, number_text, started_text
from imubench_pipeline.words.verdicts import doubts_text


@cache  # compiling the templates takes longer than writing pages of a small report
def make_templates(system: System) -> jinja2.Environment:
    """Return the templates, with the initial units of the pages."""
    templates = jinja2.Environment(
        loader=jinja2.FileSystemLoader(
            [Path(__file__).with_name("templates"), *files_of("templates")]
        ),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        finalize=lambda value: NO_VALUE if value is None else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )

    def si(
        value: float | None, unit: str, digits: int | None = None, *, inside: bool = False
    ) -> Markup:
        """Return an SI number whose unit the reader can switch; ``inside``: without the unit."""
        if value is None or not math.isfinite(value):
            return Markup(number_text(value))
        rounded = f"{value:.7g}"
        text = _find_unit(unit, system).text(float(rounded), digits)
        of = "" if inside else f' data-unit="{unit}"'
        of += f' data-digits="{digits}"' if digits and not inside else ""
        # Escaping would be slow and is not necessary: numbers and units only.
        return Markup(f'<data value="{rounded}"{of}>{text}</data>')

    def parameter_cell(cell: Mapping[str, Any], unit: str) -> Markup:
        """Return a cell of `report.parameters` with its intervals, as compact HTML."""
        digits = cell["digits"]
        number = partial(si, unit=unit, digits=digits, inside=True)
        parts = []
        for part in cell["parts"]:
            value, status, lower, upper = (part[k] for k in ("value", "status", "lower", "upper"))
            if value is None:
                text = f"{_explain_term(status)}"
            else:
                mark = f' <span class="status">{status_text(status)}</span>' if status else ""
                text = f"{number(value)}{mark}"
            if upper is not None:
                limits = f"{number(lower)} to" if lower is not None else "below"
                text += f"<br><small>{limits} {number(upper)}</small>"
            parts.append(text)
        none = " none" if cell["value"] is None else ""
        usual = _find_unit(unit, system).digits(None, None, None)
        of_digits = f' data-digits="{digits}"' if digits != usual else ""
        # Numbers and fixed texts only, which need no escaping.
        return Markup(f'<td class="number{none}"{of_digits}>{"<br>".join(parts) or NO_VALUE}</td>')

    def sign(unit: str) -> Markup:
        """Return the sign of a unit that the reader can switch."""
        return Markup('<span data-sign="{}">{}</span>').format(unit, _find_unit(unit, system).sign)

    templates.globals |= {
        "action": lambda key: find_term(key).action or "",  # of a finding
        "si": si,
        "sign": sign,
        "parameter_cell": parameter_cell,
        "term": _link_term,
        "hint": _explain_term,
        "to": _link_to,
    }
    templates.filters |= {"duration": duration_text, "number": number_text, "json": _make_json}
    templates.filters |= {"started": started_text, "symbol_text": symbol_text, "packed": pack_text}
    templates.filters |= {"attribute": _make_compact_json, "doubts": doubts_text}
    templates.filters["status_text"] = status_text
    templates.tests["hidden_row"] = lambda row: row.partition(">")[0].endswith(" hidden")
    return templates


@cache
def _find_unit(reference: str, system: System) -> Unit:
    quantity, symbol = reference.split(".")
    return choose_page_unit(quantity, symbol, system)


@jinja2.pass_context
def _link_to(context: Context, path: str) -> str:
    """Return the relative link from this page to another page or file."""
    return str(context["root"]) + quote(path)


@jinja2.pass_context
def _link_term(context: Context, key: str, text: str | None = None) -> Markup:
    """Return a term of the glossary, with its explanation and a link to the theory."""
    entry = find_term(key)
    return Markup('<a class="term" href="{}theory.html#{}" data-term="{}">{}</a>').format(
        context["root"], entry.section, entry.key, escape(text or entry.name)
    )


@cache
def _explain_term(key: str, text: str | None = None) -> Markup:
    """Return a term with only its explanation, for tables; an empty key is `NO_VALUE`."""
    if not key:
        return Markup(NO_VALUE)
    entry = find_term(key)
    return Markup('<i data-term="{}">{}</i>').format(entry.key, escape(text or entry.name))


def _make_json(value: Any) -> Markup:
    """Return JSON that is safe inside a script element."""
    return Markup(_make_compact_json(value).replace("<", "\\u003c"))


def pack_text(text: str) -> Markup:
    """Return a compressed text, which a script unpacks when the page opens."""
    return Markup(base64.b64encode(zlib.compress(text.encode(), 6)).decode())


def _make_compact_json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
