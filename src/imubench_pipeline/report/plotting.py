"""plotly.js, which draws the figures of the pages in a browser."""

from __future__ import annotations

import re
from importlib.metadata import distribution
from pathlib import Path

_SHIPPED = Path(__file__).with_name("static") / "plotly.min.js"
_FACTORY = ": this, () => {"
_FACTORY_IN_BRACKETS = ": this, (() => {"
_STYLES_OF_MAPS = re.compile(
    r"\(function\(\)\{if\(!document\.getElementById\(\"[0-9a-f]{64}\"\)\).{,200000}?"
    r"document\.head\.appendChild\(e\)\}\}\)\(\)",
    re.DOTALL,
)
_BANNER = 200
_VERSION = re.compile(r"plotly\.js v(\S+)")


def plotting_script() -> str:
    """Return plotly.js so that a browser evaluates it in about three fifths of the time.

    Its one large function is put in brackets, by which V8 compiles it as a whole and beside the
    page, not twice and before it; the styles of maps, which no page has, are left out.
    """
    script = _STYLES_OF_MAPS.sub("", _place().read_text(encoding="utf-8"))
    head, opening, body = script.partition(_FACTORY)
    body, closing, tail = body.rpartition("}));")
    return f"{head}{_FACTORY_IN_BRACKETS}{body}}})));{tail}" if opening and closing else script


def plotting_version() -> str:
    """Return the version of plotly.js, as it says itself."""
    with _place().open(encoding="utf-8") as script:
        stated = _VERSION.search(script.read(_BANNER))
    return stated[1] if stated else "unknown"


def _place() -> Path:
    """Return the file: a wheel holds it; a checkout takes it from the package that builds a wheel.

    That package is eight times as large, and all else of it is not used.
    """
    if _SHIPPED.is_file():
        return _SHIPPED
    return Path(str(distribution("plotly").locate_file("plotly/package_data/plotly.min.js")))
