"""Labels of a figure cover neither each other nor the labels of its axes, in any unit."""

import pytest

from tests.report.browser.made import NIGHT, Report
from tests.report.browser.reader import Open

OVERLAPS = """canvas => {
  const kinds = ".annotation-text, .xtick text, .ytick text, .xtitle, .ytitle";
  const texts = [...canvas.querySelectorAll(kinds)].filter((one) => one.textContent.trim());
  const boxes = texts.map((one) => [one.textContent, one.getBoundingClientRect()]);
  const cross = (a, b) => a.left < b.right - 1 && b.left < a.right - 1
    && a.top < b.bottom - 1 && b.top < a.bottom - 1;
  const found = boxes.flatMap(([text, box], i) => boxes.slice(i + 1)
    .filter(([, other]) => cross(box, other)).map(([other]) => `${text} / ${other}`));
  return [found, canvas.querySelectorAll(".annotation-text").length];
}"""
"""Pairs of texts of a figure that overlap, and the number of labels."""


def test_labels_do_not_overlap_in_a_window_that_shrinks(read: Open, bench: Report) -> None:
    reader = read(bench.folder, f"recordings/alpha/{NIGHT.recording}.html", width=1400)
    canvas = reader.figure("axes", quantity="gyro").locator(".canvas")
    before = canvas.evaluate("canvas => canvas.layout.datarevision")
    reader.page.set_viewport_size({"width": 390, "height": 900})
    reader.page.wait_for_function(
        "([canvas, before]) => canvas.layout.datarevision !== before",
        arg=[canvas.element_handle(), before],
    )
    assert canvas.evaluate(OVERLAPS)[0] == []


@pytest.mark.parametrize("width", [390, 768, 1400])
def test_labels_do_not_overlap_in_any_unit(read: Open, bench: Report, width: int) -> None:
    reader = read(bench.folder, f"recordings/alpha/{NIGHT.recording}.html", width=width)
    figure = reader.figure("axes", quantity="gyro")
    units = reader.page.locator("select[data-quantity=gyro]")
    for choice in units.locator("option").all_inner_texts():
        units.select_option(choice)
        overlaps, labels = figure.locator(".canvas").evaluate(OVERLAPS)
        assert overlaps == []
        assert labels >= 3  # some of N, B and K, and two or more grades
