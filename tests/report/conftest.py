from collections.abc import Iterator
from functools import cache

import pytest

from imubench_pipeline.extensions.figures import figures
from imubench_pipeline.report import pages, site
from imubench_pipeline.report import publish as publishing

ONCE = {
    (module, name): cache(getattr(module, name))
    for module, names in {
        publishing: ("make_templates", "digest_sources"),
        pages: ("version",),
        figures: ("encode_theory",),
        site: ("version",),
    }.items()
    for name in names
}
"""What takes long and is the same in every report of a process: templates are compiled, the source
is read, what a page of every report shows is drawn."""


@pytest.fixture(autouse=True, scope="package")
def _once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for (module, name), kept in ONCE.items():
            patch.setattr(module, name, kept)
        # A page that fails is written as one that says so; here it fails the test.
        patch.setattr(publishing, "_make_page", publishing._render)
        yield


@pytest.fixture(scope="module")
def small_report() -> Iterator[None]:
    """What is large and the same in every report is left out."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "encode_theory", lambda system: "data:image/svg+xml;base64,PHN2Zy8+")
        patch.setattr(publishing, "read_plotting_script", lambda: "var Plotly = {};")
        yield
