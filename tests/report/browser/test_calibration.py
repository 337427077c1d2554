"""The pages of gyros on a rate table, as a reader sees them."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.report.browser.accessibility import UNFOLD, hindrances
from tests.report.browser.made import publish_some
from tests.report.browser.reader import TOO_WIDE, Open, Reader, axis_title, traces
from tests.report.tables import joined, site
from tests.report.test_calibration import some

ARC = 180.0 / math.pi * 3600.0
"""°/h in a rad/s."""

TABLE = "recordings/s/table.html"
Rows = list[dict[str, Any]]


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Rows, Rows]:
    several = some(tmp_path_factory.mktemp("kept"))
    results = tmp_path_factory.mktemp("results")
    pages = (TABLE, "earth_rate.html", "recordings/s/still.html")
    publish_some(site(joined(*several), results), results / "report", pages)
    return results / "report", several[2]["calibration_points"], several[1]["alignment"]


ALL = (TABLE, "earth_rate.html", "recordings/s/still.html")


@pytest.mark.release
@pytest.mark.parametrize(
    ("path", "width"),
    [(path, width) for path in ALL for width in (400, 1280)],
)
def test_nothing_is_too_wide(path: str, width: int, read: Open, rows: Any) -> None:
    reader: Reader = read(rows[0], path, width=width)
    if width > 400:  # the tests of the numbers draw them, too
        reader.draw_all()
    reader.page.evaluate(UNFOLD)
    assert reader.page.evaluate(TOO_WIDE) == []


@pytest.mark.release
@pytest.mark.parametrize("path", ALL)
def test_nothing_hinders_a_reader(path: str, read: Open, rows: Any) -> None:
    reader: Reader = read(rows[0], path)
    reader.draw_all()
    assert hindrances(reader.page, by_night=False) == []


@pytest.mark.release
def test_residuals_have_bars_of_two_sigma_in_the_chosen_unit(read: Open, rows: Any) -> None:
    folder, points, _ = rows
    reader: Reader = read(folder, TABLE)
    figure = reader.figure("table_residuals")
    (drawn,) = (one for one in traces(figure) if one["error_y"] is not None)
    np.testing.assert_allclose(drawn["y"], [one["residual"] * ARC for one in points], rtol=1e-5)
    bars = [2 * one["sigma"] * ARC for one in points]
    np.testing.assert_allclose(drawn["error_y"]["array"], bars, rtol=1e-5)
    assert axis_title(figure, "y") == "residual (°/h)"
    assert axis_title(figure, "x") == "rate of the table (°/s)"
    reader.page.locator("select[data-quantity=gyro]").select_option("SI: rad/s")
    assert axis_title(figure, "y") == "residual (rad/s)"


@pytest.mark.release
def test_readings_stand_against_the_rate_of_the_table(read: Open, rows: Any) -> None:
    folder, points, _ = rows
    figure = read(folder, TABLE).figure("table_line")
    (drawn,) = (one for one in traces(figure) if one["mode"] == "markers")
    np.testing.assert_allclose(
        drawn["x"], [math.degrees(one["table_rate"]) for one in points], rtol=1e-5, atol=1e-9
    )
    np.testing.assert_allclose(drawn["y"], [math.degrees(one["mean"]) for one in points], rtol=1e-5)


@pytest.mark.release
def test_alignment_over_time_is_that_of_the_tables(read: Open, rows: Any) -> None:
    folder, _, aligned = rows
    figure = read(folder, "earth_rate.html").figure("alignment", sensor="s")
    own = [row for row in aligned if (row["positions"], row["method"]) == (2, "fine")]
    (drawn,) = (one for one in traces(figure) if "heading, two positions, fine" in one["text"][0])
    known = [row for row in own if row["heading"] is not None]
    np.testing.assert_allclose(drawn["x"], [row["time"] for row in known], rtol=1e-5)
    np.testing.assert_allclose(
        drawn["y"], [math.degrees(row["heading"]) for row in known], rtol=1e-5
    )
    assert axis_title(figure, "x") == "time at rest (s)" and axis_title(figure, "y") == "σ (°)"
