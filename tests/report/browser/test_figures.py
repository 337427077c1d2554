"""The figures show the numbers of the tables, and the reader chooses what is drawn."""

import math
import re
from typing import Any

import numpy as np
import pytest

from tests.conftest import few
from tests.report.browser import made
from tests.report.browser.factors import ARC, DEGREES, FACTORS, MICRO_G
from tests.report.browser.made import Report
from tests.report.browser.reader import Open, Reader, axis_title, toggle, traces

LEVELS = 3e-4
"""Relative error of what a page keeps in 16 bits of its logarithm."""

NAMES = {name: f"{one.vendor} {one.model}" for name, one in made.SENSORS.items()}
A, B = NAMES["alpha"], NAMES["beta"]
NIGHT = made.NIGHT.recording
MODEL = re.compile("Model")
PLACES = """sketch => {
  const number = (one, name) => Number(one.getAttribute(name));
  const ticks = [...sketch.querySelectorAll(":scope > line")].map((tick) => {
    const upright = number(tick, "x1") === number(tick, "x2");
    const text = tick.nextElementSibling.textContent;
    return upright ? ["x", [text, number(tick, "x1")]] : ["y", [text, number(tick, "y1")]];
  });
  const of = (axis) => ticks.filter(([name]) => name === axis).map(([, tick]) => tick);
  const dots = [...sketch.querySelectorAll("svg circle")].filter((dot) => number(dot, "r") < 4);
  const at = (name) => dots.map((dot) => number(dot, name));
  return { x: of("x"), y: of("y"), "curve x": at("cx"), "curve y": at("cy") };
}"""
"""Where a sketch has its ticks, with their texts, and the dots of the measured curve."""
OF_NIGHT = f"recordings/alpha/{NIGHT}.html"
CURVE = {"mode": "lines+markers"}


def chosen(drawn: list[dict[str, Any]], **values: object) -> list[dict[str, Any]]:
    return [one for one in drawn if all(one.get(key) == value for key, value in values.items())]


def only(drawn: list[dict[str, Any]], **values: object) -> dict[str, Any]:
    (one,) = chosen(drawn, **values)
    return one


def names(drawn: list[dict[str, Any]]) -> set[str]:
    return {one["name"] for one in chosen(drawn, **CURVE)}


def column(rows: list[dict[str, Any]], name: str) -> list[float]:
    return [row[name] for row in rows]


@pytest.mark.release
def test_the_curves_of_all_sensors(start: Reader, bench: Report) -> None:
    figure = start.figure("overlay")
    drawn = traces(figure)
    of_alpha = {f"{A}, {NIGHT}", f"{A} (simulated), sim_published"}
    assert names(drawn) == of_alpha | {f"{B}, {log.recording}" for log in made.DATED}
    assert axis_title(figure, "y") == "Allan deviation (°/h)"
    for log in (made.NIGHT, made.DATED[-1]):
        rows = bench.of("allan", recording=log.recording, channel="gyro_x")
        curve = only(drawn, name=f"{NAMES[log.sensor]}, {log.recording}")
        np.testing.assert_allclose(curve["x"], column(rows, "tau"), rtol=LEVELS)
        expected = np.multiply(column(rows, "adev"), ARC)
        np.testing.assert_allclose(curve["y"], expected, rtol=LEVELS)
        # White noise alone, at the shortest time: N over the root of it, 60 degrees an hour in
        # a degree a root of an hour.
        assert curve["y"][0] == pytest.approx(0.3 * log.level * 60 / math.sqrt(0.1), rel=0.01)
    bands = chosen(drawn, fill="tonexty")
    assert len(bands) == len(names(drawn))
    upper = bench.of("allan", recording=NIGHT, channel="gyro_x")
    expected = np.multiply(column(upper, "upper"), ARC)
    np.testing.assert_allclose(bands[0]["y"], expected, rtol=LEVELS)


@pytest.mark.release
def test_sensors_and_layers_are_switched(start: Reader) -> None:
    figure = start.figure("overlay")
    count = len(traces(figure))
    toggle(figure, A).uncheck()
    assert all(name.startswith(B) for name in names(traces(figure)))
    assert len(traces(figure)) == count - 2 * 3
    toggle(figure, "95 % limits").uncheck()
    assert not chosen(traces(figure), fill="tonexty")
    toggle(figure, "model").check()
    assert len(chosen(traces(figure), mode="lines")) == len(made.DATED)
    toggle(figure, "curves").uncheck()
    assert not names(traces(figure))
    toggle(figure, B).uncheck()
    assert traces(figure) == []
    for label in ("curves", "95 % limits", A, B):
        toggle(figure, label).check()
    toggle(figure, "model").uncheck()
    assert len(traces(figure)) == count


@pytest.mark.release  # every day those of one channel and of a pair are asked for
def test_lines_of_the_datasheet_among_sensors(start: Reader) -> None:
    figure = start.figure("overlay")
    before = len(traces(figure))
    toggle(figure, "datasheet").check()
    added = traces(figure)[before:]
    toggle(figure, "datasheet").uncheck()
    assert {one["line"]["dash"] for one in added} == {"dot"}
    # 0.007 °/s/√Hz is 0.42 °/√h, or that over √2 if it is one-sided; and 8 °/h.
    at_start = sorted(one["y"][0] for one in added)
    noise = 0.42 * 60 / math.sqrt(0.1)
    assert at_start == pytest.approx([8.0, noise / math.sqrt(2), noise], rel=LEVELS)
    assert all(A in one["text"] for one in added)


@pytest.mark.release
def test_axis_method_and_recordings_are_chosen(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    figure, page = reader.figure("overlay"), reader.page
    page.get_by_label("gyro y", exact=True).check()
    assert names(traces(figure)) == {f"{A}, {NIGHT}"}
    assert toggle(figure, B).is_hidden() and toggle(figure, A).is_visible()
    page.get_by_label("accel x", exact=True).check()
    assert axis_title(figure, "y") == "Allan deviation (µg)"
    rows = bench.of("allan", recording=NIGHT, channel="accel_x")
    curve = only(traces(figure), name=f"{A}, {NIGHT}")
    expected = np.multiply(column(rows, "adev"), MICRO_G)
    np.testing.assert_allclose(curve["y"], expected, rtol=LEVELS)

    page.get_by_label("gyro x", exact=True).check()
    page.get_by_role("combobox", name="Recordings").select_option("latest of each sensor")
    last = made.DATED[-1].recording
    assert names(traces(figure)) == {f"{A} (simulated), sim_published", f"{B}, {last}"}


@pytest.mark.release
def test_the_model_of_the_curves_is_chosen(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    figure, page = reader.figure("overlay"), reader.page
    toggle(figure, "95 % limits").uncheck()
    toggle(figure, "model").check()
    best = chosen(traces(figure), mode="lines")[0]["y"]
    page.get_by_role("combobox", name=MODEL).select_option("weighted")
    other = chosen(traces(figure), mode="lines")[0]["y"]
    assert other[0] / best[0] == pytest.approx(1 + 0.02 * made.METHODS.index("weighted"), rel=1e-3)


@pytest.mark.release  # every day the same figure is asked for on the start page
def test_the_recordings_of_one_sensor(read: Open, bench: Report) -> None:
    reader = read(bench.folder, "sensors/beta.html")
    figure = reader.figure("overlay")
    assert names(traces(figure)) == {f"{B}, {log.recording}" for log in made.DATED}
    looks = {
        (one["line"]["color"], one["marker"]["symbol"]) for one in chosen(traces(figure), **CURVE)
    }
    assert len(looks) == len(made.DATED)
    toggle(figure, "run_2").uncheck()
    assert f"{B}, run_2" not in names(traces(figure))
    assert len(names(traces(figure))) == len(made.DATED) - 1
    # What is chosen among the curves holds for the parameters.
    assert len(traces(reader.figure("forest", symbol="B"))) == len(made.DATED) - 1


@pytest.mark.release
def test_sketch_matches_the_curve_before_the_script_loads(read: Open, bench: Report) -> None:
    reader = read(bench.folder, OF_NIGHT)  # which waits with what draws
    sketch = reader.page.locator("figure[data-sketched] .canvas > svg.sketch").first
    sketch.wait_for()
    places = sketch.evaluate(PLACES)
    rows = bench.of("allan", recording=NIGHT, channel="gyro_x")
    for axis, values in (
        ("x", column(rows, "tau")),
        ("y", np.multiply(column(rows, "adev"), ARC)),
    ):
        ticks = {float(text): at for text, at in places[axis] if re.fullmatch(r"[\d.]+", text)}
        assert len(ticks) >= 2
        slope, begin = np.polyfit(np.log10([*ticks]), [*ticks.values()], 1)
        expected = begin + slope * np.log10(values)
        dots = places[f"curve {axis}"][: len(rows)]  # of the first axis
        np.testing.assert_allclose(dots, expected, atol=0.6)  # pixels
    assert reader.figure("allan", channel="gyro_x").locator("svg.sketch").count() == 0


@pytest.mark.release
def test_ticks_follow_the_zoom(night: Reader) -> None:
    figure = night.figure("allan", channel="gyro_x")
    canvas = figure.locator(".canvas")
    ticks = "canvas => canvas.layout.xaxis.tickvals"
    whole = canvas.evaluate("canvas => [...canvas.layout.xaxis.range]")
    assert {0.1, 1, 10, 100} <= set(canvas.evaluate(ticks))
    canvas.evaluate("canvas => Plotly.relayout(canvas, {'xaxis.range': [1, Math.log10(30)]})")
    inside = canvas.evaluate(ticks)
    assert len(inside) >= 3 and all(10 <= tick <= 30 for tick in inside)
    shown = figure.locator(".xaxislayer-above .xtick").all_text_contents()
    assert [float(text) for text in shown] == pytest.approx(inside)
    canvas.evaluate("(canvas, range) => Plotly.relayout(canvas, {'xaxis.range': range})", whole)


def test_parameters_of_all_sensors(start: Reader, bench: Report) -> None:
    figure = start.figure("forest", symbol="N")
    shown = sorted(one["x"][0] for one in traces(figure))
    best = {"recommended": True, "channel": "gyro_x", "parameter": "N"}
    rows = sorted(bench.of("parameters", **best), key=lambda row: row["value"])
    assert shown == pytest.approx([row["value"] * 60 * DEGREES for row in rows], rel=1e-4)
    assert shown[0] == pytest.approx(0.3, rel=1e-4)
    bar = min(traces(figure), key=lambda one: one["x"][0])["error_x"]
    assert (bar["arrayminus"], bar["array"]) == (
        pytest.approx([0.03], rel=1e-3), pytest.approx([0.039], rel=1e-3)
    )  # fmt: skip
    model = start.page.get_by_role("combobox", name=MODEL)
    before = model.input_value()
    model.select_option("likelihood_gm")
    assert min(one["x"][0] for one in traces(figure)) == pytest.approx(0.3 * 1.02, rel=1e-4)
    model.select_option(before)


@pytest.mark.release
def test_a_parameter_without_a_value_has_another_mark(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    reader.page.get_by_label("gyro y", exact=True).check()
    absent = only(traces(reader.figure("forest", symbol="K")))
    assert absent["marker"]["symbol"] == "triangle-left"
    assert absent["x"] == pytest.approx([1e-7 * 60 * ARC], rel=1e-4)
    reader.page.get_by_label("accel x", exact=True).check()
    times = traces(reader.figure("forest", symbol="T_B"))
    hollow = [one for one in times if one["marker"]["color"] != one["marker"]["line"]["color"]]
    unsure = only(hollow)
    assert unsure["x"] == pytest.approx([math.sqrt(20 * 500)])
    assert len(times) == 2


def test_the_curve_of_a_channel_with_its_methods(read: Open, bench: Report) -> None:
    figure = read(bench.folder, OF_NIGHT).figure("allan", channel="gyro_x")
    drawn = traces(figure)
    rows = bench.of("allan", recording=NIGHT, channel="gyro_x")
    measured = only(drawn, mode="lines+markers")
    np.testing.assert_allclose(measured["y"], np.multiply(column(rows, "adev"), ARC), rtol=LEVELS)
    model = only(drawn, name="likelihood")
    np.testing.assert_allclose(model["y"], measured["y"], rtol=2 * LEVELS)
    assert not chosen(drawn, name="white noise N")
    toggle(figure, "white noise N").check()
    white = only(traces(figure), name="white noise N")
    np.testing.assert_allclose(white["y"], 0.3 * 60 / np.sqrt(made.TAU), rtol=LEVELS)
    printed = [one for one in drawn if "noise density" in str(one["name"])]
    assert len(printed) == 2
    for one, noise in zip(printed, (0.42 / math.sqrt(2), 0.42), strict=True):
        np.testing.assert_allclose(one["y"], noise * 60 / np.sqrt(made.TAU), rtol=2 * LEVELS)
    toggle(figure, "datasheet: bias instability 8 deg/h (max)").uncheck()
    assert not [one for one in traces(figure) if "bias instability" in str(one["name"])]
    figure.get_by_role("button", name="all off").click()
    assert traces(figure) == []
    figure.get_by_role("button", name="all on").click()
    # Every method, every term of its model, every line of the datasheet.
    assert len({one["name"] for one in chosen(traces(figure), mode="lines")} - {None}) == 5 + 3 + 3


@pytest.mark.release
def test_the_spectrum(night: Reader, bench: Report) -> None:
    figure = night.figure("spectrum", channel="gyro_x")
    drawn = traces(figure)
    fit = only(drawn, name="fit N+GM+K")
    marks = chosen(drawn, mode="markers")
    rows = bench.of("spectrum", recording=NIGHT, channel="gyro_x")
    for used, symbol in ((True, "circle"), (False, "x-thin-open")):
        own = [row for row in rows if row["used"] is used]
        points = only([one for one in marks if one["marker"]["symbol"] == symbol])
        np.testing.assert_allclose(points["x"], column(own, "frequency"), rtol=LEVELS)
        density = np.sqrt(column(own, "density")) * DEGREES
        np.testing.assert_allclose(points["y"], density, rtol=LEVELS)
    line = only(drawn, x=[2, 2])
    assert line["text"] == "sinusoid, 2 Hz"
    # White noise of 0.3 °/√h has a root density of 0.3/60 °/s/√Hz.
    assert fit["y"][-1] == pytest.approx(0.005, rel=0.01)
    toggle(figure, "line").uncheck()
    assert len(traces(figure)) == len(drawn) - 1
    toggle(figure, "line").check()


@pytest.mark.release
def test_the_log_over_time_with_its_events_and_temperature(night: Reader) -> None:
    figure = night.figure("timeline")
    drawn = traces(figure)
    mean = only(drawn, name="gyro x")
    assert abs(np.mean(mean["y"])) < 1e-6  # less the mean of the log
    warmth = only(drawn, name="temperature")
    minutes = made.SAMPLES / made.RATE / 60
    assert (mean["x"][0], mean["x"][-1]) == pytest.approx((0.0, minutes), abs=minutes / 400)
    assert axis_title(figure, "x") == "time (min)"
    assert (warmth["y"][0], warmth["y"][-1]) == pytest.approx((20.0, 35.0), abs=0.1)
    canvas = figure.locator(".canvas")
    assert canvas.evaluate("canvas => canvas.layout.shapes.map(one => [one.x0, one.x1])") == [
        [5.0, 7.0]
    ]
    whole = canvas.evaluate("canvas => canvas.layout.xaxis.range")
    figure.get_by_role("button", name=re.compile("step")).press("Enter")
    low, high = canvas.evaluate("canvas => canvas.layout.xaxis.range")
    assert (low, high) == pytest.approx((3.0, 9.0))
    assert "was moved" in figure.get_by_role("status").inner_text()
    figure.get_by_role("button", name="all", exact=True).click()
    assert canvas.evaluate("canvas => canvas.layout.xaxis.range") == pytest.approx(whole)
    assert figure.get_by_role("status").inner_text() == ""


@pytest.mark.release
def test_bias_over_time_and_against_temperature(night: Reader) -> None:
    (over_time,) = traces(night.figure("bias", channel="gyro_x", over="time"))
    assert np.mean(over_time["y"]) == pytest.approx(0.2, rel=0.02)  # °/s
    (warm,) = traces(night.figure("bias", channel="gyro_x", over="temperature"))
    np.testing.assert_allclose(warm["y"], over_time["y"])
    assert (min(warm["x"]), max(warm["x"])) == pytest.approx((20.0, 35.0), abs=0.1)


@pytest.mark.release
def test_the_histogram(night: Reader) -> None:
    figure = night.figure("histogram", channel="gyro_x")
    bars, normal = traces(figure)
    share = np.multiply(bars["y"], bars["width"])
    assert share.sum() == pytest.approx(1.0)
    # White noise of 0.005 °/s/√Hz, 10 samples a second.
    spread = 0.005 * math.sqrt(10)
    middle = np.sum(share * bars["x"])
    assert middle == pytest.approx(0.2, rel=0.02)
    assert np.sqrt(np.sum(share * (bars["x"] - middle) ** 2)) == pytest.approx(spread, rel=0.1)
    assert max(normal["y"]) == pytest.approx(1 / (spread * math.sqrt(2 * math.pi)), rel=0.1)


@pytest.mark.release
def test_a_device_over_time(read: Open, bench: Report) -> None:
    reader = read(bench.folder, bench.page("devices/"))
    reader.draw_all()
    # Three times the noise is outside of what four recordings predict, and yet no change
    # among seven figures: p is 0.0018, and 0.01 / 7 the limit. Of the mean it is 1e-6.
    for number, factor, sign, last in (
        (0, 60 * DEGREES, "N (°/√h)", "circle"),
        (6, DEGREES, "fixed bias (°/s)", "star"),
    ):
        figure = reader.figure("trend", trend=str(number))
        assert axis_title(figure, "y") == sign
        name = {"N": "N", "f": "bias"}[sign[0]]
        rows = bench.of("drift", parameter=name)
        *band, values = traces(figure)
        assert values["x"] == [log.started for log in made.DATED]
        assert values["y"] == pytest.approx([row["value"] * factor for row in rows])
        assert values["marker"]["symbol"] == ["circle"] * 4 + [last]
        highest = rows[-1]["expected_upper"] * factor
        assert band[1]["y"][-1] == pytest.approx(highest) and highest < values["y"][-1]
    captions = reader.page.locator("figcaption").all_inner_texts()
    assert captions[0] == (
        "N: no change. run_5 lies outside the band, which may be chance among so many parameters."
    )
    assert captions[5:] == ["T_B: no change.", "fixed bias: changed in run_5."]


def focused(reader: Reader) -> dict[str, Any]:
    return reader.page.evaluate(
        """() => {
          const [one, style] = [document.activeElement, getComputedStyle(document.activeElement)];
          const {width, height, top, bottom} = one.getBoundingClientRect();
          return { role: one.type ?? one.localName, text: (one.closest("label") ?? one).innerText,
            outline: style.outlineStyle === "none" ? 0 : parseFloat(style.outlineWidth),
            seen: width > 0 && height > 0 && bottom > 0 && top < innerHeight };
        }"""
    )


def tab_to(reader: Reader, pattern: str) -> None:
    """Press the tabulator until the focus is there; it can be seen all the way."""
    for _ in range(80):
        reader.page.keyboard.press("Tab")
        at = focused(reader)
        assert at["outline"] >= 2 and at["seen"], at
        if re.search(pattern, f"{at['role']} {at['text']}"):
            return
    pytest.fail(f"no focus on {pattern}")


def test_the_focus_is_seen_and_leads_to_the_content(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    tab_to(reader, "Skip to the content")
    reader.page.keyboard.press("Enter")
    assert reader.page.evaluate("document.activeElement.id") == "main"
    tab_to(reader, "button|select-one|searchbox|a ")


@pytest.mark.release  # long; every day the focus is followed to the content, and tables are sorted
def test_everything_is_done_by_the_keyboard(read: Open, bench: Report) -> None:
    reader = read(bench.folder)
    figure, keys = reader.figure("overlay"), reader.page.keyboard
    reader.page.evaluate("scrollTo(0, 0)")
    tab_to(reader, "Skip to the content")
    keys.press("Enter")
    assert reader.page.evaluate("document.activeElement.id") == "main"
    tab_to(reader, "radio .*gyro x")
    keys.press("ArrowRight")
    assert names(traces(figure)) == {f"{A}, {NIGHT}"}
    keys.press("ArrowLeft")
    count = len(traces(figure))
    tab_to(reader, "select-one Model")
    keys.press("End")
    tab_to(reader, f"checkbox .*{A}")
    keys.press("Space")
    assert len(traces(figure)) == count - 2 * 3
    keys.press("Space")
    assert len(traces(figure)) == count
    assert reader.page.get_by_role("combobox", name=MODEL).input_value() == made.METHODS[-1]


@pytest.mark.release
@pytest.mark.parametrize(
    "choices", few([["SI: rad/s"]], [[*FACTORS["gyro"]]]), ids=lambda some: str(len(some))
)
def test_the_units_of_the_figures_follow_the_reader(
    choices: list[str], night: Reader, bench: Report
) -> None:
    reader = night
    rows = bench.of("allan", recording=NIGHT, channel="gyro_x")
    for choice in choices:
        units = FACTORS["gyro"][choice]
        reader.page.get_by_label("Gyroscopes in").select_option(choice)
        for kind, symbol in (("allan", "adev"), ("spectrum", "psd"), ("bias", "signal")):
            figure = reader.figure(kind, channel="gyro_x")
            assert f"({units[symbol][0]})" in axis_title(figure, "y")
        measured = only(traces(reader.figure("allan", channel="gyro_x")), mode="lines+markers")
        expected = np.multiply(column(rows, "adev"), units["adev"][1])
        np.testing.assert_allclose(measured["y"], expected, rtol=LEVELS)
    # The unit of the other quantity stays.
    assert "(µg)" in axis_title(reader.figure("allan", channel="accel_x"), "y")
    reader.page.get_by_label("Gyroscopes in").select_option(next(iter(FACTORS["gyro"])))


def test_the_plotting_script_is_compiled_once_and_has_no_styles_of_maps(bench: Report) -> None:
    # Where plotly is bundled otherwise, `plotting_script` must be looked at again.
    script = (bench.folder / "assets/plotly.min.js").read_text(encoding="utf-8")
    assert ": this, (() => {" in script and script.endswith("return Plotly;\n})));")
    assert ".maplibregl-map{" not in script
