"""Sensors side by side: the same numbers as the library's, and an address that opens the same."""

import csv
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
from playwright.sync_api import Locator

from imubench_pipeline.estimators.estimate import COMPARED
from imubench_pipeline.navigation.ratios import Ratio, compare_deviations, compare_parameters
from imubench_pipeline.report.practical import choose_page_unit
from imubench_pipeline.settings.sensor import quantity_of
from tests.report.browser import made
from tests.report.browser.factors import ARC
from tests.report.browser.made import Report
from tests.report.browser.reader import Open, Reader, traces
from tests.report.tables import joined, recording_rows, site

NIGHT, SIMULATED, FIRST = made.NIGHT, made.SIMULATED, made.DATED[0]
SENSOR_NAMES = {"alpha": "Vendor & Sons A-1", "beta": "Other B"}
DRAWN = 2e-3
"""Relative error of limits, whose draws are kept in 16 bits of their logarithm."""

ROWS = """table => [...table.tBodies[0].rows].map((row) => ({
  figure: row.dataset.figure, texts: [...row.cells].map((cell) => cell.textContent),
  ratios: [...row.querySelectorAll(".ratio")].map(({dataset}) =>
    [dataset.ratio, dataset.lower, dataset.upper].map((text) => text === "" ? null : Number(text)))
}))"""


def address(*logs: made.Log, **more: str) -> str:
    chosen = {
        letter: f"{log.sensor}/{log.recording}" for letter, log in zip("ab", logs, strict=True)
    }
    return "compare.html#" + urlencode(chosen | more)


def table(reader: Reader, name: str) -> dict[str, dict[str, Any]]:
    rows = reader.page.locator(f"table.{name}").evaluate(ROWS)
    return {row["figure"]: row for row in rows}


def same(shown: list[float | None], ratio: Ratio, rel: float) -> None:
    for number, expected in zip(shown, (ratio.value, ratio.lower, ratio.upper), strict=True):
        assert number == (None if expected is None else pytest.approx(expected, rel=rel))


def words(ratio: Ratio, first: made.Log, second: made.Log) -> str:
    names = [SENSOR_NAMES[log.sensor] for log in (first, second)]
    if first.sensor == second.sensor:
        names = [f"{SENSOR_NAMES[log.sensor]} {log.recording}" for log in (first, second)]
    return {
        "lower": f"{names[0]} has less noise",
        "higher": f"{names[1]} has less noise",
        "not significant": "not significant",
        "not determined": "not determined",
    }[ratio.verdict]


@pytest.mark.release
def test_ratios_and_verdicts_are_those_of_the_library(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    for first, second, channel in (
        (NIGHT, SIMULATED, "gyro_x"), (NIGHT, SIMULATED, "accel_x"), (FIRST, NIGHT, "gyro_x"),
    ):  # fmt: skip
        reader.open(address(first, second, axis=channel))
        rows = table(reader, "verdicts")
        a, b = (log.recommended(channel) for log in (first, second))
        for symbol in COMPARED:
            own, other = ({**one.parameters, **one.curve}[symbol] for one in (a, b))
            ratio = compare_parameters(own, other)
            same(rows[symbol]["ratios"][0], ratio, 1e-5)
            assert words(ratio, first, second) in rows[symbol]["texts"][1]
            # With the digits that other pages print of it.
            unit = choose_page_unit(quantity_of(channel), symbol, "practical")
            shown = (own.value, own.lower, own.upper)
            kept = (float(f"{number:.7g}") for number in shown)
            value, *ends = (unit.text(number, unit.digits(*shown)) for number in kept)
            assert rows[symbol]["texts"][3] == f"{value} {unit.sign}({' to '.join(ends)})"
        for tau in (1.0, 10.0, 100.0):
            pair = (made.fused(log, channel) for log in (first, second))
            ratio = compare_deviations(*pair, tau, longest=1 / 9, **made.DRAWN)
            same(rows[f"adev {tau:g}"]["ratios"][0], ratio, DRAWN)
            assert words(ratio, first, second) in rows[f"adev {tau:g}"]["texts"][1]
    # Three times the noise, and no doubt of it.
    assert "Other B has less noise" not in reader.page.locator(".answer").inner_text()
    assert "N (factor 3)" in reader.page.locator(".answer").inner_text()


@pytest.mark.release
def test_the_curves_and_their_ratio(read: Open, bench: Report) -> None:
    reader = read(bench.folder, address(NIGHT, FIRST, axis="gyro_x"))
    figure = reader.figure("pair")
    drawn = {one["name"]: one for one in traces(figure) if one["name"]}
    rows = bench.of("allan", recording=NIGHT.recording, channel="gyro_x")
    curve = drawn["Vendor & Sons A-1"]
    np.testing.assert_allclose(curve["y"], [ARC * row["adev"] for row in rows], rtol=3e-4)
    assert drawn["Other B"]["line"]["color"] != curve["line"]["color"]
    ratio = drawn["Vendor & Sons A-1 / Other B"]
    np.testing.assert_allclose(ratio["y"], 1 / 3, rtol=0.02)
    assert ratio["x"] == pytest.approx([10 ** (step / 2) for step in range(-2, 5)])
    # 0.42 °/√h is 25.2 °/h at 1 s, and half of it if it is one-sided; and 8 °/h.
    printed = sorted(one["y"][1] for name, one in drawn.items() if "datasheet" in name)
    assert printed == pytest.approx([8.0, 25.2 / math.sqrt(2), 25.2], rel=1e-3)
    slider, said = figure.get_by_label("Crosshair at τ"), figure.locator("output").first
    slider.focus()
    before = said.inner_text()
    for _ in range(5):
        slider.press("ArrowRight")
    assert said.inner_text() != before
    nearest = min(rows, key=lambda row: abs(math.log(row["tau"] / 10**1.5)))
    assert float(re.search(r"A-1 ([\d.]+) °/h", said.inner_text())[1]) == pytest.approx(
        ARC * nearest["adev"], rel=1e-2
    )
    assert "tau=31.6" in reader.page.url


@pytest.mark.release
def test_errors_grow_as_the_budget_has_it(read: Open, bench: Report) -> None:
    reader = read(bench.folder, address(NIGHT, SIMULATED, window="60", time="10"))
    budget = {
        (row["recording"], row["error"]): row
        for row in bench.of("error_budget", time=10.0, requirement=None, axis="worst")
        if row["source"] == "total"
    }
    for error, row in table(reader, "errors").items():
        own, other = (budget[log.recording, error] for log in (NIGHT, SIMULATED))
        assert row["ratios"][0][0] == pytest.approx(own["sigma"] / other["sigma"], rel=DRAWN)
        below, above = row["ratios"][0][1:]
        spread = math.hypot(
            math.log(own["sigma"] / own["lower"]), math.log(other["upper"] / other["sigma"])
        )
        assert math.log(row["ratios"][0][0] / below) == pytest.approx(spread, abs=DRAWN)
        assert below < row["ratios"][0][0] < above
    figure = reader.figure("growth")
    curve = next(one for one in traces(figure) if one["mode"] == "lines+markers")
    at = curve["x"].index(10.0)
    expected = math.degrees(budget[NIGHT.recording, "heading"]["sigma"])
    assert curve["y"][at] == pytest.approx(expected, rel=DRAWN)
    reader.page.get_by_label("Time at rest").press("End")
    after = next(one for one in traces(figure) if one["mode"] == "lines+markers")
    growth = made.growth_of(NIGHT)
    (rested,) = (
        row
        for row in growth
        if row["source"] == "total"
        and row["axis"] == "worst"
        and (row["error"], row["window"], row["time"]) == ("heading", 600.0, 10.0)
    )
    assert after["y"][at] == pytest.approx(math.degrees(rested["sigma"]), rel=DRAWN)
    assert abs(after["y"][at] / curve["y"][at] - 1.0) > 0.1
    assert "window=600" in reader.page.url
    sources = reader.figure("sources")
    bars = traces(sources)
    total = np.sum([one["x"] for one in bars], axis=0)
    np.testing.assert_allclose(total, 100.0, atol=1.0)
    # A part that the first figure had not is switched as the others, and is in no address.
    reader.page.locator("form.growth select").first.select_option("position")
    later = {one["name"] for one in traces(sources)}
    assert later - {one["name"] for one in bars}
    offered = sources.locator(".controls .toggle:not([hidden])").all_inner_texts()
    assert {text.strip() for text in offered} == later
    assert "source" not in reader.page.url


@pytest.mark.release
def test_errors_of_the_chosen_axis_are_those_of_their_table(read: Open, bench: Report) -> None:
    reader = read(bench.folder, address(NIGHT, SIMULATED, axis="gyro_x", window="60", time="10"))
    kept = {
        (row["axis"], row["error"]): row
        for row in made.growth_of(NIGHT)
        if (row["source"], row["window"], row["time"]) == ("total", 60.0, 10.0)
    }
    (other,) = (
        row
        for row in made.growth_of(SIMULATED)
        if (row["source"], row["window"], row["time"], row["error"])
        == ("total", 60.0, 10.0, "heading")
    )
    assert kept["x", "heading"]["sigma"] < kept["worst", "heading"]["sigma"]
    caption = reader.page.locator("table.errors caption")
    for axis, words in (
        ("x", "noise alone (1σ, axis x)"),
        ("worst", "noise alone (1σ, the worst axis)"),
    ):
        if axis == "worst":
            reader.page.locator("form.growth select").last.select_option("worst")
            assert "of=worst" in reader.page.url
        assert words in caption.inner_text()
        expected = kept[axis, "heading"]["sigma"]
        shown = table(reader, "errors")["heading"]["ratios"][0][0]
        assert shown == pytest.approx(expected / other["sigma"], rel=DRAWN)
        curve = next(
            one for one in traces(reader.figure("growth")) if one["mode"] == "lines+markers"
        )
        at = curve["x"].index(10.0)
        assert curve["y"][at] == pytest.approx(math.degrees(expected), rel=DRAWN)
    # Of a time at rest for which no errors are stored, the nearest is shown and stated.
    reader.open(address(NIGHT, SIMULATED, window="45", time="10"))
    stated = reader.page.locator("form.growth output").first.inner_text()
    assert stated == "60 s" and "60 s at rest" in caption.inner_text()


@pytest.mark.release
def test_what_is_chosen_stands_in_the_address(
    read: Open, bench: Report, download: Callable[[Locator], bytes]
) -> None:
    reader = read(bench.folder, "compare.html#a=alpha&b=beta")
    page = reader.page
    assert "first" not in page.locator(".unfound").inner_text()
    # The default of a sensor is its longest usable measured recording; others can be chosen.
    said = page.locator(".stands").inner_text()
    assert f"{NIGHT.recording} is shown" in said and "1 more above" in said
    page.get_by_role("button", name="Add a sensor").click()
    page.locator("select[data-letter=c]").select_option(f"alpha/{SIMULATED.recording}")
    page.get_by_label("Gyroscopes in").select_option("SI: rad/s")
    figure = reader.figure("pair")
    figure.get_by_label("datasheet").uncheck()
    figure.locator(".canvas").evaluate(
        "canvas => Plotly.relayout(canvas, {'xaxis.range[0]': 0, 'xaxis.range[1]': 1})"
    )
    whole = figure.get_by_role("button", name="Reset the zoom")
    assert whole.is_visible()
    link, curves = page.url, traces(figure)
    reader.open("compare.html#" + link.partition("#")[2])
    again = reader.figure("pair")
    assert [one["y"] for one in traces(again)] == [one["y"] for one in curves]
    assert "(rad/s)" in again.locator(".canvas svg .ytitle").text_content()
    assert again.locator(".canvas").evaluate("canvas => canvas.layout.xaxis.range") == [0, 1]
    again.get_by_role("button", name="Reset the zoom").click()
    assert not again.get_by_role("button", name="Reset the zoom").is_visible()
    assert "z0=" not in page.url
    again.get_by_role("button", name="Values of the figure as a table").click()
    values = again.get_by_role("region", name="Values of")
    rows = list(
        csv.DictReader(download(again.get_by_role("button", name="as CSV")).decode().splitlines())
    )
    shown = values.locator("tbody tr")
    assert shown.count() == min(len(rows), 400) > 100
    own = [row for row in rows if row["series"].startswith("Other B") and row["lower 95 %"]]
    table_rows = bench.of("allan", recording=made.DATED[-1].recording, channel="gyro_x")
    assert len(own) == len(table_rows)
    assert download(again.get_by_role("button", name="as PNG")).startswith(b"\x89PNG")
    assert b"<svg" in download(again.get_by_role("button", name="as SVG"))[:200]


@pytest.mark.release
def test_what_nobody_can_buy_is_told_where_it_is_chosen(read: Open, tmp_path: Path) -> None:
    tables = joined(recording_rows("bought"), recording_rows("made"))
    made.publish_some(site(tables, not_sold=["made"]), tmp_path, ["compare.html"])
    first = read(tmp_path, "compare.html").page.locator("select[data-letter=a]")
    assert first.locator("option").all_inner_texts() == ["V & Co bought", "V & Co made (not sold)"]


@pytest.mark.release
def test_what_is_not_there_is_said(read: Open, bench: Report) -> None:
    reader = read(bench.folder, "compare.html#a=alpha&b=nobody&axis=gyro_y")
    assert "nobody" in reader.page.locator(".unfound").inner_text()
    # Beta has no such axis.
    assert "no gyro y" in reader.page.locator(".answer").inner_text()
