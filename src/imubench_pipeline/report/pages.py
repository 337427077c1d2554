"""The pages of a report: single ones, and one for each recording, sensor and device."""

import platform
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import distribution, version
from pathlib import Path

from imubench_pipeline.registry import Hook
from imubench_pipeline.report import catalogue, compare, recording, shortlist, start
from imubench_pipeline.report.glossary import read_glossary
from imubench_pipeline.report.practical import System
from imubench_pipeline.report.sensor import make_device_page, make_sensor_page
from imubench_pipeline.report.site import RECORDING_PAGES, Entry, Page, Site, make_command

_SHIPPED_SCRIPT = Path(__file__).with_name("static") / "plotly.min.js"
_FACTORY_START = ": this, () => {"
_BRACKETED_FACTORY_START = ": this, (() => {"
_MAP_STYLES_PATTERN = re.compile(
    r"\(function\(\)\{if\(!document\.getElementById\(\"[0-9a-f]{64}\"\)\).{,200000}?"
    r"document\.head\.appendChild\(e\)\}\}\)\(\)",
    re.DOTALL,
)
_BANNER_LENGTH = 200
_VERSION_PATTERN = re.compile(r"plotly\.js v(\S+)")


def read_plotting_script() -> str:
    """Return plotly.js, modified so that a browser evaluates it 40 % faster.

    Brackets around its large function make V8 compile it once and in the background; the styles of
    maps are left out.
    """
    script = _MAP_STYLES_PATTERN.sub("", _find_script().read_text(encoding="utf-8"))
    head, opening, body = script.partition(_FACTORY_START)
    body, closing, tail = body.rpartition("}));")
    return f"{head}{_BRACKETED_FACTORY_START}{body}}})));{tail}" if opening and closing else script


def _find_script() -> Path:
    """Return the file in the wheel, or in a checkout the file of the package plotly."""
    if _SHIPPED_SCRIPT.is_file():
        return _SHIPPED_SCRIPT
    return Path(str(distribution("plotly").locate_file("plotly/package_data/plotly.min.js")))


_FIGURE: Hook[Callable[[System], str]] = Hook("theory_figure")


def _describe_theory(site: Site) -> Mapping[str, object]:
    figures = [encode(site.system) for encode in _FIGURE.objects()]
    return {"figures": figures, "terms": read_glossary()}


THEORY = Entry(
    file="theory.html",
    title="Theory",
    about="the numbers of this report, explained: from a log at rest to navigation errors",
    context=_describe_theory,
)

_LIBRARIES = ("numpy", "scipy", "numba", "pyarrow", "matplotlib", "snakemake")
_RUN_COMMAND = (
    "snakemake -c2",
    "runs everything; later only the steps that new logs or changed settings affect. "
    "In a folder made by imubench init, use imubench run, with further flags after --",
)
_COMMANDS: tuple[tuple[str, dict[str, str], str], ...] = (
    ("show", {}, "prints the comparison in the terminal"),
    ("figures", {"--sensor": "NAME"}, "draws the figures of channels for print, as SVG and PDF"),
    (
        "report",
        {"--one-file": "report.html"},
        "writes all pages into one file, for example to send by mail",
    ),
    ("export", {"--sensor": "NAME", "--target": "kalibr"}, "writes the noise model for a filter"),
)
"""Commands of `imubench` for the results, their options, and their effect."""


def _describe_making(site: Site) -> Mapping[str, object]:
    commands = [_RUN_COMMAND]
    for name, options, words in _COMMANDS:
        commands.append((make_command(name, site.results_name, options), words))
    if site.at_once:
        commands = [(site.at_once, "writes these pages again")]
    with _find_script().open(encoding="utf-8") as script:
        stated = _VERSION_PATTERN.search(script.read(_BANNER_LENGTH))
    return {
        "commands": commands,
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("imubench_pipeline", *_LIBRARIES)},
            "plotly.js": stated[1] if stated else "unknown",
        },
        "settings": {
            f"{section}.{key}": value
            for section, values in site.settings["settings"].items()
            for key, value in values.items()
        },
    }


MADE = Entry(
    file="made.html",
    title="How this was made",
    about="commands, versions and settings",
    context=_describe_making,
)


EXPERIMENTS = Entry(file="experiments.html", title="Experiments and method", context=lambda _: {})

_ADDED: Hook[Entry] = Hook("pages")

ENTRIES: Sequence[Entry] = (
    start.START,
    compare.COMPARE,
    shortlist.SHORTLIST,
    catalogue.DATASHEETS,
    EXPERIMENTS,
    start.RECORDINGS,
    *sorted(_ADDED.objects(), key=lambda entry: entry.place),
    THEORY,
    MADE,
)
"""The pages that exist once, in the order of the menu; the first is the start page."""


def list_pages(site: Site) -> Iterator[Page]:
    """Yield the pages of the report; the start page is last and marks a finished report."""
    for view in site.views:
        kind = "" if view.left_out else view.row.kind
        yield recording.make_recording_page(
            site, view, RECORDING_PAGES.by_key().get(kind, recording.STATIC)
        )
    for sensor in site.sensors:
        yield make_sensor_page(site, sensor)
    for path in dict.fromkeys(view.device_page for view in site.views):
        if path is not None:
            yield make_device_page(site, path)
    first, *others = site.existing
    for entry in (*others, first):
        yield entry.page(site)
