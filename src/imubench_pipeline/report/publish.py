"""Write the report: the changed pages of a folder, or one file."""

import base64
import hashlib
import json
import math
import traceback
import zlib
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import cache, partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
import pyarrow as pa
from jinja2.runtime import Context
from markupsafe import Markup, escape

from imubench_pipeline.datasheets.class_limits import read_grade_limits
from imubench_pipeline.estimators.estimate import SHOWN
from imubench_pipeline.noise import FLOOR
from imubench_pipeline.registry import files_of
from imubench_pipeline.report.folder import KEYS, write_failed_pages
from imubench_pipeline.report.glossary import find_term, read_glossary
from imubench_pipeline.report.models import make_models
from imubench_pipeline.report.pages import ENTRIES, MADE, THEORY, list_pages, read_plotting_script
from imubench_pipeline.report.palette import AXIS_STYLES, TERM_COLOURS
from imubench_pipeline.report.practical import System, choose_page_unit, list_page_units
from imubench_pipeline.report.processes import compute_in_order
from imubench_pipeline.report.run_summary import fold_text
from imubench_pipeline.report.search import make_search_index
from imubench_pipeline.report.site import Page, Site
from imubench_pipeline.settings.sensor import QUANTITIES
from imubench_pipeline.tables.failures import describe_error
from imubench_pipeline.tables.files import locate_table, read, read_json, write_content
from imubench_pipeline.tables.provenance import digest_sources
from imubench_pipeline.tables.schemas import OF_ONE_RECORDING, TABLES
from imubench_pipeline.words.estimates import STATUS_WORDS, status_text, symbol_text
from imubench_pipeline.words.numbers import (
    NO_VALUE,
    Unit,
    digit_limits,
    duration_text,
    number_text,
    started_text,
)
from imubench_pipeline.words.verdicts import doubts_text


@cache  # compiling the templates takes longer than writing pages of a small report
def make_templates(system: System) -> jinja2.Environment:
    """Return the Jinja environment of the pages; ``system`` sets their initial units."""
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
        """Return an SI number whose unit the reader can switch; ``inside``: the cell names it."""
        if value is None or not math.isfinite(value):
            return Markup(number_text(value))
        rounded = f"{value:.7g}"
        text = _find_unit(unit, system).text(float(rounded), digits)
        of = "" if inside else f' data-unit="{unit}"'
        of += f' data-digits="{digits}"' if digits and not inside else ""
        # Escaping would be slow and is not necessary: numbers and units only.
        return Markup(f'<data value="{rounded}"{of}>{text}</data>')

    def parameter_cell(cell: Mapping[str, Any], unit: str) -> Markup:
        """Return a parameter cell of `report.comparison` as compact HTML, with intervals."""
        digits = cell["digits"]
        number = partial(si, unit=unit, digits=digits, inside=True)
        parts = []
        for part in cell["parts"]:
            value, status, lower, upper = (part[k] for k in ("value", "status", "lower", "upper"))
            limits = ""
            if upper is not None:
                is_bound = lower is None or (value is None and lower == 0.0)
                limits = f"{'below' if is_bound else f'{number(lower)} to'} {number(upper)}"
            if value is not None:
                mark = f' <span class="status">{status_text(status)}</span>' if status else ""
                text = f"{number(value)}{mark}"
                small = f"({limits})" if limits else ""
            else:
                text, small = limits and f"{limits} (95 %)", f"{_explain_term(status)}"
            text = f"{part['term']}: {text}" if part["term"] else text
            parts.append("<br>".join(filter(None, (text, small and f"<small>{small}</small>"))))
        none = " none" if cell["value"] is None else ""
        usual = _find_unit(unit, system).digits(None, None, None)
        of_digits = f' data-digits="{digits}"' if digits != usual else ""
        # Numbers and fixed texts only, which need no escaping.
        return Markup(f'<td class="number{none}"{of_digits}>{"<br>".join(parts) or NO_VALUE}</td>')

    def sign(unit: str) -> Markup:
        """Return the symbol of a unit that the reader can switch, as HTML."""
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
    return Markup(_make_compact_json(value).replace("<", "\\u003c"))


def pack_text(text: str) -> Markup:
    """Return a compressed text, which a script unpacks when the page opens."""
    return Markup(base64.b64encode(zlib.compress(text.encode(), 6)).decode())


def _make_compact_json(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


_SETTINGS_FILE = "settings.json"
_REQUIRED_SETTINGS = {"report", "settings", "sensors", "boards", "requirements"}
_PAGE_FOLDERS = ("recordings", "sensors", "devices")
_STATIC_FOLDER = Path(__file__).with_name("static")
_SCRIPT_NAMES = (
    *("address", "numbers", "terms", "tables", "tools", "plot", "sketch", "overlay", "ratios"),
    *("comparison", "side_by_side", "tabs", "search", "channel", "trend", "requirement", "card"),
    *("mine", "start"),
)


def publish(
    site: Site, folder: Path, say: Callable[[str], None] = lambda _: None, processes: int = 1
) -> list[str]:
    """Write the pages of the report whose data changed; return their paths below ``folder``.

    Obsolete pages are removed. A page that fails is replaced by a page with the reason, is named in
    `Site.failed`, and is made again by the next call. ``say`` is called with each path before the
    page is written. ``processes`` is the number of processes that make pages.
    """
    written = []
    # A page opened from disk may not read files, but it may run scripts.
    loaded = {
        "assets/search.js": f"imubenchSearch({make_search_index(site)});\n",
        "assets/models.js": f"imubenchModels({make_models(site)});\n",
    }
    for path, content in (_make_assets() | loaded).items():
        written += _put(folder, path, content)
    # Pages of many recordings take longest; the start page is the last.
    begun = {entry.file for entry in site.existing[1:]}
    every = sorted(list_pages(site), key=lambda page: page.path not in begun)
    keys = {page.path: page.key for page in every}
    before = _read_keys(folder / KEYS)
    unchanged = {
        path: key
        for path, key in before.items()
        if path in keys
        and (folder / path).is_file()
        and key == _make_key(keys[path], (folder / path).read_bytes())
    }
    # A killed run must not leave the digests of pages that it has already replaced.
    if unchanged != before:
        _put(folder, KEYS, _format_json(unchanged))
    templates = make_templates(site.system)
    shown = dict(unchanged)
    changed = [page for page in every if not page.key or page.path not in unchanged]

    def make(place: int) -> tuple[bytes, str | None]:
        rendered = _make_page(site, templates, changed[place]).encode()
        return rendered, site.failed.get(changed[place].path)

    made = compute_in_order(make, len(changed), processes)
    for page, (rendered, failure) in zip(changed, made, strict=True):
        say(page.path)
        if failure is None:
            shown[page.path] = _make_key(page.key, rendered)
        else:
            site.failed[page.path] = failure
        written += _put(folder, page.path, rendered)
    existing = [file for of in _PAGE_FOLDERS for file in (folder / of).rglob("*.html")]
    existing += [file for entry in site.entries if (file := folder / entry.file).is_file()]
    for file in existing:
        if file.relative_to(folder).as_posix() not in keys:
            file.unlink()
    _put(folder, _SETTINGS_FILE, _format_json(site.settings))
    _put(folder, KEYS, _format_json(shown))
    write_failed_pages(site.failed, folder)
    return written


def remove_old_pages(folder: Path, made: Path) -> None:
    """Remove, from ``folder``, pages of an earlier report that the report in ``made`` lacks."""
    gone = _read_keys(folder / KEYS).keys() - _read_keys(made / KEYS).keys()
    for path in folder.rglob("*.html"):
        if path.relative_to(folder).as_posix() in gone and not path.is_symlink():
            path.unlink()


def _format_json(data: object) -> str:
    return json.dumps(data, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


def _make_key(key: str, content: bytes) -> str:
    """Return the digest of the data and of the file of a page."""
    return f"{key} {hashlib.sha256(content).hexdigest()}"


def _read_keys(path: Path) -> dict[str, str]:
    try:
        return {page: str(key) for page, key in read_json(path).items()}
    except (OSError, ValueError, AttributeError):
        return {}


def _put(folder: Path, path: str, content: str | bytes) -> list[str]:
    """Write a file if its content has changed; return its path if so."""
    data = content.encode() if isinstance(content, str) else content
    target = folder / path
    if target.is_file() and target.read_bytes() == data:
        return []
    write_content(data, target)
    return [path]


def _make_page(
    site: Site, templates: jinja2.Environment, page: Page, base: str = "base.html.jinja"
) -> str:
    """Return a page; if it fails, a page with the reason."""
    try:
        return _render(site, templates, page, base)
    except OSError:  # such as a full disk, which is no fault of the page
        raise
    except Exception as error:
        traceback.print_exc()
        reason = fold_text(describe_error(error))
        site.failed[page.path] = reason
        about = {"title": page.path, "reason": reason}
        instead = replace(page, template="failed.html.jinja", context=lambda: about)
        return _render(site, templates, instead, base)


def _render(
    site: Site, templates: jinja2.Environment, page: Page, base: str = "base.html.jinja"
) -> str:
    alone = base != "base.html.jinja"
    template = templates.get_template(page.template)
    of_page = {"base": base, "path": page.path, "root": page.root}
    return template.render(site=site.shown(alone=alone), **of_page, **page.context()) + "\n"


def _make_assets() -> dict[str, str]:
    # All scripts of the pages as one, with units, status names and terms
    units = {
        quantity: {
            choice: {
                symbol: [unit.sign, unit.per_si, digit_limits(symbol)]
                for symbol, unit in symbols.items()
            }
            for choice, symbols in choices.items()
        }
        for quantity, choices in list_page_units().items()
    }
    *own, last = (_STATIC_FOLDER / f"{name}.js" for name in _SCRIPT_NAMES)
    added = (path for folder in files_of("static") for path in sorted(folder.glob("*.js")))
    parts = [path.read_text(encoding="utf-8") for path in (*own, *added, last)]
    head = "".join(
        f"const {name} = {json.dumps(value, ensure_ascii=False)};\n"
        for name, value in (
            ("UNITS", units),
            ("DIGITS", digit_limits()),
            ("STATUS_NAMES", STATUS_WORDS),
            ("SYMBOL_TEXTS", {symbol: symbol_text(symbol) for symbol in SHOWN}),
            ("TERMS", {key: entry.short for key, entry in read_glossary().items()}),
            ("TERM_COLOURS", TERM_COLOURS),
            ("AXIS_LOOKS", {axis: asdict(look) for axis, look in AXIS_STYLES.items()}),
            ("GRADES", {quantity: read_grade_limits(quantity) for quantity in QUANTITIES}),
            ("FLOOR", FLOOR),
        )
    )
    return {
        "assets/report.css": "".join(
            (_STATIC_FOLDER / name).read_text(encoding="utf-8")
            for name in ("report.css", "decisions.css")
        ),
        "assets/report.js": ('(() => {\n"use strict";\n' + head + "\n".join(parts) + "})();\n"),
        "assets/plotly.min.js": read_plotting_script(),
    }


def render_one_file(site: Site) -> str:
    """Return the whole report as one page that needs no other file."""
    templates = make_templates(site.system)
    pages = list(list_pages(site))
    if site.is_single:
        explained = [page for page in pages if page.path in (THEORY.file, MADE.file)]
        pages = [replace(pages[0], path="index.html"), *explained]
    shown = [
        {"path": page.path, "content": _make_page(site, templates, page, "fragment.html.jinja")}
        for page in pages
    ]
    assets = _make_assets()
    scripts = (assets[f"assets/{name}.js"] for name in ("report", "plotly.min"))
    return templates.get_template("one_file.html.jinja").render(
        pages=shown,
        css=assets["assets/report.css"],
        scripts=[script.replace("</script", "<\\/script") for script in scripts],
        search="[]" if site.is_single else make_search_index(site).replace("<", "\\u003c"),
        models=make_models(site).replace("<", "\\u003c"),
        site=site.shown(alone=True),
        path="index.html",
        root="",
    )


def make_site(tables: Mapping[str, pa.Table], settings: str, results: Path) -> Site:
    """Return the data of the report of a run; ``settings`` is JSON of `Plan.report_settings`."""
    return Site(tables, json.loads(settings), results, ENTRIES, digest_sources("report.publish"))


def load_site(results: Path) -> Site:
    """Return the data of the report of a finished run.

    Raises FileNotFoundError if there are no results, ValueError if they cannot be read.
    """
    path = results / "report" / _SETTINGS_FILE
    settings = path.read_text(encoding="utf-8")
    try:
        missing = _REQUIRED_SETTINGS - json.loads(settings).keys()
    except (ValueError, AttributeError) as error:
        raise ValueError(f"{path}: is no JSON object; remove it, and run snakemake -c2") from error
    if missing:
        raise ValueError(
            f"{path}: was made by another version of imubench_pipeline, without "
            f"{', '.join(sorted(missing))}; run snakemake -c2 again, with the same options"
        )
    names = sorted(set(TABLES) - set(OF_ONE_RECORDING))
    paths = {name: locate_table(results, name) for name in names}
    for path in paths.values():
        path.stat()  # its error names the missing file, unlike the error of Parquet
    return make_site({name: read(name, [path]) for name, path in paths.items()}, settings, results)
