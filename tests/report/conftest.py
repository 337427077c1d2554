from collections.abc import Iterator

import pytest

from imubench_pipeline.report import publish as publishing
from imubench_pipeline.report import theory


@pytest.fixture(scope="module")
def small_report() -> Iterator[None]:
    """What is large and the same in every report is left out."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(theory, "figure_text", lambda figure: "data:image/svg+xml;base64,PHN2Zy8+")
        patch.setattr(theory, "theory_figure", lambda system: None)
        patch.setattr(publishing, "plotting_script", lambda: "var Plotly = {};")
        yield
