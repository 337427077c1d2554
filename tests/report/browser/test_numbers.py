"""Numbers in the text: those of the tables, in the units that the reader chooses."""

from importlib import resources

import numpy as np
import pytest

from imubench_pipeline.words.numbers import count_digits, digit_limits, number_text
from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.accessibility import UNFOLD
from tests.report.browser.factors import FACTORS
from tests.report.browser.made import Report
from tests.report.browser.reader import READY, Open, Reader, axis_title
from tests.report.pages import unfolded

OF_NIGHT = f"recordings/alpha/{made.NIGHT.recording}.html"
PAGES = ("index.html", "sensors/alpha.html", OF_NIGHT)
SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
LABELS = {"gyro": "Gyroscopes in", "accel": "Accelerometers in"}

NUMBERS = """root => [...root.querySelectorAll("data")].map(one => {
  const cell = one.closest("td");
  const head = cell?.closest("table").tHead.rows[0].cells[cell.cellIndex];
  return { value: Number(one.value), text: one.textContent,
    unit: one.dataset.unit ?? head.dataset.unit,
    digits: Number(one.closest("[data-digits]")?.dataset.digits ?? 3) };
})"""
SIGNS = """root => [...root.querySelectorAll("[data-sign]")]
  .map(one => [one.dataset.sign, one.textContent])"""
AS_WRITTEN = "text => new DOMParser().parseFromString(text, 'text/html')"


def number(text: str) -> float:
    """Read a number as the pages print it."""
    mantissa, _, power = text.replace("−", "-").partition("×10")
    return float(mantissa) * 10.0 ** int(power.translate(SUPERSCRIPTS) or 0)


def show_every_row(reader: Reader) -> None:
    for method in reader.page.get_by_role("combobox", name="Method").all():
        method.select_option("all")


def shown(reader: Reader) -> tuple[list[dict], list[list[str]]]:
    return reader.page.evaluate(f"[({NUMBERS})(document), ({SIGNS})(document)]")


def choose(reader: Reader, quantity: str, choice: str) -> None:
    reader.page.get_by_label(LABELS[quantity]).select_option(choice)


@pytest.mark.parametrize("path", few(PAGES[2:], PAGES[:2]))
def test_the_script_prints_what_the_page_was_written_with(
    path: str, read: Open, bench: Report
) -> None:
    reader = read(bench.folder, path)
    show_every_row(reader)
    text = unfolded((bench.folder / path).read_text(encoding="utf-8"))
    written = reader.page.evaluate(
        f"text => {{ const page = ({AS_WRITTEN})(text);"
        f" return [({NUMBERS})(page), ({SIGNS})(page)]; }}",
        text,
    )
    assert len(written[0]) > 20 and len(written[1]) > 4
    numbers, signs = shown(reader)
    assert signs == written[1]
    different = [(a, b["text"]) for a, b in zip(written[0], numbers, strict=True) if a != b]
    assert different == []


@pytest.mark.parametrize("path", few(PAGES[2:], PAGES[:2]))
def test_numbers_and_units_follow_the_reader(path: str, read: Open, bench: Report) -> None:
    reader = read(bench.folder, path)
    show_every_row(reader)
    first = shown(reader)
    for quantity, choices in FACTORS.items():
        options = reader.page.get_by_label(LABELS[quantity]).locator("option").all_inner_texts()
        assert options == list(choices)
        for choice, units in choices.items():
            choose(reader, quantity, choice)
            numbers, signs = shown(reader)
            for one, before in zip(numbers, first[0], strict=True):
                of, symbol = one["unit"].split(".")
                if of != quantity:
                    assert one == before  # the other quantity stays as it was
                    continue
                # Half of the last digit, and half of the fifth of the number in the page.
                error = 0.5 * 10.0 ** (1 - one["digits"]) + 0.5e-4
                expected = one["value"] * units[symbol][1]
                assert number(one["text"]) == pytest.approx(expected, rel=error), one
            own = {(s.split(".")[1], sign) for s, sign in signs if s.split(".")[0] == quantity}
            assert own <= {(symbol, sign) for symbol, (sign, _) in units.items()}
        choose(reader, quantity, next(iter(choices)))
        assert shown(reader) == first


def test_the_numbers_are_those_of_the_noise(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT)
    reader.page.evaluate(UNFOLD)
    used = reader.page.get_by_role("table", name="Parameters by method").first.locator(
        "tr.recommended"
    )
    cells = used.locator("td.number data").all_inner_texts()
    assert cells == [
        "0.3",
        "0.27",
        "0.34",
        "10",
        "9",
        "11.3",
        # As many digits as the intervals leave. The lowest point, at 3023 s or 0.84 h: of the root
        # of the squares of 0.3/√0.84 (white noise), 5·√(0.84/3) (random walk) and
        # 10·(0.664/0.437)·√(0.0331·0.950) °/h (process).
        "3.8",
        "3.4",
        "4.3",
        "3000",
        "2700",
        "3400",
        "10",
        "9",
        "11.3",
        "100",
        "90",
        "113",
        "5",
        "4.5",
        "5.7",
    ]
    choose(reader, "gyro", "SI: rad/s")
    assert used.locator("td.number data").first.inner_text() == "8.7×10⁻⁵"
    choose(reader, "gyro", "°/s")
    assert used.locator("td.number data").first.inner_text() == "0.005"


def test_a_value_that_is_not_known_says_why(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT)
    reader.page.evaluate(UNFOLD)
    reader.page.get_by_role("button", name="all channels").click()
    tables = reader.page.get_by_role("table", name="Parameters by method")
    # Without a random walk the curve falls on: it has no lowest point.
    *lowest, absent = tables.nth(1).locator("tr.recommended td.none").all()
    assert [one.inner_text() for one in lowest] == ["not determined", "not determined"]
    falls = "the Allan deviation of the fitted noise has no minimum: it still falls at 4000 s, "
    falls += "the longest τ that is used."
    assert reader.page.locator("ul.untold").first.locator("li").all_inner_texts() == [
        f"σ_min and τ_min: {falls}",
        "K is not in the model: the data do not support it; below 1.2 °/h/√h.",
    ]
    # 1e-7 rad/s/√s are 1.24 °/h/√h.
    assert absent.inner_text().split("\n") == ["below 1.2 (95 %)", "not in the model"]
    unsure = tables.nth(2).locator("tr.recommended td.none")
    assert unsure.inner_text().split("\n") == ["20 to 500 (95 %)", "not determined"]
    assert "± 10 % needs 10 h" in reader.page.locator("ul.untold").last.inner_text()


@pytest.mark.parametrize("drawn", few([False], [True]))
def test_the_choice_lasts_from_page_to_page(drawn: bool, read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    choose(reader, "gyro", "°/s")
    reader.page.get_by_role("link", name=made.NIGHT.recording).first.click()
    reader.page.wait_for_function(f"document.querySelector('section.channel') && {READY}")
    assert reader.page.get_by_label(LABELS["gyro"]).input_value() == "°/s"
    assert shown(reader)[1][0] == ["gyro.N", "°/s/√Hz"]
    if drawn:  # every day test_figures.py asks for the unit of this figure
        figure = reader.figure("allan", channel="gyro_x")
        assert axis_title(figure, "y") == "Allan deviation (°/s)"


@pytest.mark.parametrize(
    ("left", "drawn"), few([("furlongs", False)], [("furlongs", True), ("", True)])
)
def test_a_choice_that_is_no_more_does_no_harm(
    left: str, drawn: bool, read: Open, bench: Report
) -> None:
    stored = {"imubench gyro": left, "imubench accel": "SI: m/s²"}
    reader = read(bench.folder, stored=stored)
    assert reader.page.get_by_label(LABELS["gyro"]).input_value() == next(iter(FACTORS["gyro"]))
    assert reader.page.get_by_label(LABELS["accel"]).input_value() == "SI: m/s²"
    assert {tuple(one) for one in shown(reader)[1]} >= {("gyro.N", "°/√h"), ("accel.B", "m/s²")}
    if drawn:
        assert axis_title(reader.figure("overlay"), "y") == "Allan deviation (°/h)"


def test_the_browser_rounds_10_000_numbers_as_the_tables_are_printed(
    read: Open, bench: Report
) -> None:
    rng = np.random.default_rng(7)
    values = rng.choice([-1.0, 1.0], 10_000) * 10.0 ** rng.uniform(-12, 12, 10_000)
    values[:2_000] = np.round(values[:2_000], 3) + 0.5  # halves, and numbers near a power of ten
    values[2_000:2_010] = [0.0, 1e-4, 9.99995e-5, 1e6, 999_999.5, 0.1, 1.0, 10.0, 1e-12, -1e6]
    widths = np.abs(values) * 10.0 ** rng.uniform(-7, 1, 10_000)
    cases = [
        (value, value - width, value + width, digits)
        for value, width, digits in zip(
            values.tolist(), widths.tolist(), rng.integers(1, 8, 10_000).tolist(), strict=True
        )
    ]
    reader = read(bench.folder, PAGES[0])
    script = resources.files("imubench_pipeline") / "report/static/numbers.js"
    digits = f"const DIGITS = {list(digit_limits())};\n"
    reader.page.add_script_tag(content=digits + script.read_text(encoding="utf-8"))
    printed = reader.page.evaluate(
        "cases => cases.map(([v, low, high, d]) =>"
        " [numberText(v, d), countDigits(v, low, high), countDigits(null, low, high)])",
        cases,
    )
    expected = [
        [number_text(v, d), count_digits(v, low, high), count_digits(None, low, high)]
        for v, low, high, d in cases
    ]
    different = [
        (case, *pair)
        for case, *pair in zip(cases, printed, expected, strict=True)
        if pair[0] != pair[1]
    ]
    assert different == []
