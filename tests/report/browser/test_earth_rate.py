"""The pages of gyros that were turned, as a reader sees them."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.tables.files import write
from tests.conftest import few
from tests.report.browser.accessibility import hindrances
from tests.report.browser.made import publish_some
from tests.report.browser.reader import TOO_WIDE, Open, Reader, axis_title, toggle, traces
from tests.report.tables import joined, site
from tests.report.test_earth_rate import some

ARC = 180.0 / math.pi * 3600.0
"""°/h in a rad/s."""

RUN = "recordings/s/run.html"


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, list[dict[str, Any]]]]:
    kept = tmp_path_factory.mktemp("kept")
    several = some(kept)
    results = tmp_path_factory.mktemp("results")
    envelope = [
        {"sensor": "s", "recording": "run", "channel": "gyro_x", "start": 1.5 * i,
         "end": 1.5 * (i + 1), "samples": 48, "low": -1e-3, "high": 2e-3, "mean": 1e-4 * (i % 7)}
        for i in range(400)
    ]  # fmt: skip
    write("envelope", envelope, results / "recordings/s/run/envelope.parquet")
    made = site(joined(*several), results)
    publish_some(made, results / "report", [RUN, "earth_rate.html", "recordings/s/unknown.html"])
    return results / "report", several[1]


def named(drawn: list[dict[str, Any]], text: str) -> dict[str, Any]:
    (one,) = (one for one in drawn if one["text"] and text in str(one["text"][0]))
    return one


@pytest.mark.release
@pytest.mark.parametrize(
    ("path", "figures", "width"),
    few(
        [(RUN, 6, 400)],
        [(RUN, 6, 1280), ("earth_rate.html", 3, 1280), ("recordings/s/unknown.html", 0, 1280)],
    ),
)
def test_every_figure_is_drawn_and_nothing_is_too_wide(
    path: str, figures: int, width: int, read: Open, rows: Any
) -> None:
    reader: Reader = read(rows[0], path, width=width)
    assert reader.draw_all() == figures
    assert reader.page.evaluate(TOO_WIDE) == []


@pytest.mark.release
@pytest.mark.parametrize("path", [RUN, "earth_rate.html"])
def test_nothing_hinders_a_reader(path: str, read: Open, rows: Any) -> None:
    reader: Reader = read(rows[0], path)
    reader.draw_all()
    assert hindrances(reader.page) == []


@pytest.mark.release
def test_the_estimates_over_time_are_those_of_the_tables(read: Open, rows: Any) -> None:
    folder, found = rows
    figure = read(folder, RUN).figure("earth_rate", part="whole")
    assert axis_title(figure, "y") == "Earth’s rate (°/h)"
    drawn = named(traces(figure), "filter, rate unknown")
    wanted = ("whole", "filter", "rate")
    series = [row for row in found["earth_rate_series"]
              if (row["part"], row["method"], row["quantity"]) == wanted]  # fmt: skip
    np.testing.assert_allclose(drawn["y"], [row["value"] * ARC for row in series], rtol=1e-5)
    np.testing.assert_allclose(drawn["x"], [row["time"] / 60 for row in series], rtol=1e-5)
    bands = [one for one in traces(figure) if one["fill"] == "tonexty"]
    upper = [(row["value"] + 2 * row["sigma"]) * ARC for row in series]
    np.testing.assert_allclose(bands[0]["y"], upper, rtol=1e-5)
    count = len(traces(figure))
    known = "bias tracking with known rate, P₀ in (°/s)² (given the rate: no estimate)"
    toggle(figure, known).uncheck()
    assert len(traces(figure)) == count - 1


@pytest.mark.release
def test_turning_points_stand_where_they_were_found(read: Open, rows: Any) -> None:
    folder, found = rows
    figure = read(folder, RUN).figure("turning")
    marks = named(traces(figure), "turn 1 at")
    times = [row["time"] / 60 for row in found["turning"] if row["what"] == "turn"]
    np.testing.assert_allclose(marks["x"], times, rtol=1e-5)
    assert axis_title(figure, "y") == "gyro x (°/s)" and axis_title(figure, "x") == "time (min)"


@pytest.mark.release
def test_the_best_dwell_is_the_least_of_the_curve(read: Open, rows: Any) -> None:
    folder, found = rows
    figure = read(folder, RUN).figure("bound", over="dwell")
    best = named(traces(figure), "best: ")
    (row,) = (one for one in found["earth_rate_prediction"] if one.get("best"))
    assert best["x"] == [pytest.approx(row["dwell"], rel=1e-5)]
    assert best["y"] == [pytest.approx(row["sigma"] * ARC, rel=1e-5)]
    assert axis_title(figure, "x") == "data in each dwell (s)"


@pytest.mark.release
def test_published_estimates_are_drawn_in_the_chosen_unit(read: Open, rows: Any) -> None:
    reader: Reader = read(rows[0], "earth_rate.html")
    figure = reader.figure("published_rates")
    assert named(traces(figure), "published")["x"] == [pytest.approx(1.745, rel=1e-5)]
    reader.page.locator("select[data-quantity=gyro]").select_option("°/s")
    assert axis_title(figure, "x") == "Earth’s rate (°/s)"
    assert named(traces(figure), "published")["x"] == [pytest.approx(1.745 / 3600, rel=1e-5)]


@pytest.mark.release
def test_a_gap_in_the_samples_is_left_open(
    read: Open, rows: Any, tmp_path_factory: pytest.TempPathFactory
) -> None:
    run = {name: [dict(row) for row in found] for name, found in rows[1].items()}
    empty = next(row for row in run["turning"] if (row["what"], row.get("number")) == ("dwell", 4))
    empty["mean"] = None
    gap = range(60, 80)
    envelope = [
        {"sensor": "s", "recording": "run", "channel": "gyro_x", "start": 1.5 * i,
         "end": 1.5 * (i + 1), "samples": 0 if i in gap else 48}
        | {name: None if i in gap else value
           for name, value in (("low", -1e-3), ("high", 2e-3), ("mean", 5e-4))}
        for i in range(400)
    ]  # fmt: skip
    results = tmp_path_factory.mktemp("gap")
    write("envelope", envelope, results / "recordings/s/run/envelope.parquet")
    publish_some(site(joined(run), results), results / "report", [RUN])
    reader: Reader = read(results / "report", RUN)
    (shape,) = (one for one in traces(reader.figure("turning")) if one["fill"] == "toself")
    ends = [k for k, at in enumerate(shape["x"]) if at is None]
    assert len(ends) == 2
    assert max(shape["x"][: ends[0]]) == pytest.approx(59.5 * 1.5 / 60)
    assert min(shape["x"][ends[0] + 1 : ends[1]]) == pytest.approx(80.5 * 1.5 / 60)
    north = named(traces(reader.figure("dwells", part="whole")), "north")
    south = named(traces(reader.figure("dwells", part="whole")), "south")
    assert len(north["x"]) + len(south["x"]) == 19
