"""The page that says how a report was made: commands, versions, settings."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import Any

from imubench_pipeline.report.plotting import plotting_version
from imubench_pipeline.report.shell import imubench
from imubench_pipeline.report.site import Entry, Site

_LIBRARIES = (
    "imubench_pipeline",
    "numpy",
    "scipy",
    "numba",
    "pyarrow",
    "matplotlib",
    "snakemake",
)

_RUN = (
    "snakemake -c2",
    "makes everything, and afterwards only what new logs or changed settings ask for; "
    "in a folder that imubench init has made it is imubench run, with further flags after --",
)
_COMMANDS: tuple[tuple[str, dict[str, str], str], ...] = (
    ("show", {}, "prints the comparison in the terminal"),
    ("figures", {"--sensor": "NAME"}, "draws the figures of channels for print, as SVG and PDF"),
    (
        "report",
        {"--one-file": "report.html"},
        "puts all of these pages into one file, to send by mail",
    ),
    ("export", {"--sensor": "NAME", "--target": "kalibr"}, "writes what a filter loads"),
)
"""Commands of `imubench` for the results, their options, and what they do."""


def _context(site: Site) -> dict[str, Any]:
    return {
        "commands": [(site.at_once, "makes these pages again")]
        if site.at_once
        else [
            _RUN,
            *(
                (imubench(name, site.results_name, options), words)
                for name, options, words in _COMMANDS
            ),
        ],
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in _LIBRARIES},
            "plotly.js": plotting_version(),
        },
        "settings": {
            f"{section}.{key}": value
            for section, values in site.settings["settings"].items()
            for key, value in values.items()
        },
    }


MADE = Entry(file="made.html", title="How this was made", context=_context)
"""The page that every other leads to at its foot."""
