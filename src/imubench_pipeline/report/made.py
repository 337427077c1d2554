"""The page that says how a report was made: commands, versions, settings."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import Any

from imubench_pipeline.report.site import Entry, Site

_LIBRARIES = (
    "imubench_pipeline",
    "numpy",
    "scipy",
    "numba",
    "pyarrow",
    "matplotlib",
    "plotly",
    "snakemake",
)


def _context(site: Site) -> dict[str, Any]:
    return {
        "results": site.results_name,
        "versions": {"python": platform.python_version()} | {n: version(n) for n in _LIBRARIES},
        "settings": {
            f"{section}.{key}": value
            for section, values in site.settings["settings"].items()
            for key, value in values.items()
        },
    }


MADE = Entry(file="made.html", title="How this was made", context=_context)
"""The page that every other leads to at its foot."""
