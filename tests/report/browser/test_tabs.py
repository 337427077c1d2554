"""The channels of a recording are tabs: by pointer, keyboard and link, and all of them on paper."""

import pytest

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.words.verdicts import source_text
from tests.report.browser import made
from tests.report.browser.made import Report
from tests.report.browser.reader import Open, Reader, traces

OF_NIGHT = f"recordings/alpha/{made.NIGHT.recording}.html"
VISIBLE = """() => [...document.querySelectorAll("section.channel")]
  .filter((one) => !one.hidden).map((one) => one.querySelector("h2").id)"""


def test_tabs_of_a_recording(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT)
    page = reader.page
    assert page.evaluate(VISIBLE) == ["gyro_x"]
    first = page.get_by_role("tab", name="Gyroscope x")
    first.press("ArrowRight")
    assert page.evaluate(VISIBLE) == ["gyro_y"]
    assert page.get_by_role("tab", selected=True).inner_text() == "Gyroscope y"
    assert page.get_by_role("tab", name="Gyroscope y").evaluate(
        "one => one === document.activeElement"
    )
    assert page.url.endswith("#channel=gyro_y")
    # The values of an axis lead to its channel.
    page.get_by_role("table", name="Gyroscope").first.get_by_role("link", name="x").click()
    assert page.evaluate(VISIBLE) == ["gyro_x"]
    page.get_by_role("button", name="all channels").click()
    assert page.evaluate(VISIBLE) == ["gyro_x", "gyro_y", "accel_x"]


@pytest.mark.parametrize("link", ["#accel_x", "#channel=accel_x"])
def test_a_link_opens_its_channel(link: str, read: Open, bench: Report) -> None:
    page = read(bench.folder, OF_NIGHT + link).page
    assert page.evaluate(VISIBLE) == ["accel_x"]


def test_every_channel_is_printed(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT)
    reader.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert reader.page.evaluate(VISIBLE) == ["gyro_x", "gyro_y", "accel_x"]
    reader.page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert reader.page.evaluate(VISIBLE) == ["gyro_x"]


def test_bars_of_a_budget_are_its_parts(night: Reader, bench: Report) -> None:
    figure = night.figure("budget")
    names = figure.locator(".canvas").evaluate("canvas => canvas.layout.yaxis.ticktext")
    rows = {
        source_text(ErrorBudgetRow(**row | {"reasons": tuple(row["reasons"])})): row["sigma"]
        for row in bench.of("error_budget", recording=made.NIGHT.recording, requirement=None)
        if (row["axis"], row["error"], row["time"]) == ("worst", "heading", 60.0)
    }
    (place,) = (i for i, name in enumerate(names) if name.startswith("heading 60 s"))
    shown = {bar["name"]: bar["x"][place] for bar in traces(figure)}
    assert sum(shown.values()) == pytest.approx(100.0, abs=1.0)
    parts = {
        source: 100 * (sigma / rows["total"]) ** 2
        for source, sigma in rows.items()
        if source != "total" and (sigma / rows["total"]) ** 2 > 0.02
    }
    assert len(parts) > 1 and "gyro N in the static window" in parts
    for source, part in parts.items():
        name = "gyro GM" if "GM" in source else source
        assert shown[name] == pytest.approx(part, rel=0.01)
