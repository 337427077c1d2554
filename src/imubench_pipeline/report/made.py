"""The page of commands, versions and settings of a report."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from importlib.metadata import version

from imubench_pipeline.report.plotting import read_plotting_version
from imubench_pipeline.report.shell import make_command
from imubench_pipeline.report.site import Entry, Site

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


def _make_context(site: Site) -> Mapping[str, object]:
    commands = [_RUN_COMMAND]
    for name, options, words in _COMMANDS:
        commands.append((make_command(name, site.results_name, options), words))
    if site.at_once:
        commands = [(site.at_once, "writes these pages again")]
    return {
        "commands": commands,
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("imubench_pipeline", *_LIBRARIES)},
            "plotly.js": read_plotting_version(),
        },
        "settings": {
            f"{section}.{key}": value
            for section, values in site.settings["settings"].items()
            for key, value in values.items()
        },
    }


MADE = Entry(file="made.html", title="How this was made", context=_make_context)
"""The page that the footer of every page links to."""
