import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.figures.comparison import (
    draw_comparison_figure,
    draw_forest_figure,
    make_mark,
)
from imubench_pipeline.extensions.figures.curves import (
    CHARACTERISTIC,
    draw_allan_figure,
    draw_datasheet_figure,
    draw_methods_figure,
    draw_spectrum_figure,
    draw_terms_figure,
    draw_theory_figure,
)
from imubench_pipeline.extensions.figures.figures import (
    list_channel_figures,
    list_cross_figures,
    save,
)
from imubench_pipeline.noise import FLOOR, PEAK_TAU, NoiseModel
from imubench_pipeline.report.practical import choose_page_unit
from imubench_pipeline.report.view import ChannelView, gather_recordings
from imubench_pipeline.run.cli import main
from imubench_pipeline.tables.files import write
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.tables.schemas import TABLES
from tests.conftest import few
from tests.report.tables import tables_of

DEGREE = math.pi / 180
HOUR = DEGREE / 3600  # of a degree an hour
RATE = 100.0
TAU = np.geomspace(0.01, 1e4, 40)
MODEL = NoiseModel(N=20 * HOUR, B=10 * HOUR, T_B=100.0, K=0.1 * HOUR)
KNOWN = {
    "N": Parameter(MODEL.N, lower=0.9 * MODEL.N, upper=1.1 * MODEL.N),
    "B": Parameter(MODEL.B, lower=0.8 * MODEL.B, upper=1.3 * MODEL.B),
    "T_B": Parameter(MODEL.T_B, lower=80.0, upper=130.0),
    "K": Parameter(MODEL.K, lower=0.5 * MODEL.K, upper=2.0 * MODEL.K),
}
TO_PAGE = choose_page_unit("gyro", "adev", "practical").per_si

Rows = dict[str, list[dict[str, Any]]]


def rows_of(
    sensor: str = "imu",
    recording: str = "day1",
    channel: str = "gyro_x",
    *,
    simulated: bool = False,
    parameters: dict[str, Parameter] = KNOWN,
    printed: bool = True,
    found: Sequence[float] = (),
    level: float = 1.0,
) -> Rows:
    key = {"sensor": sensor, "recording": recording, "channel": channel}
    method = key | {"method": "likelihood"}
    estimate = Estimate("likelihood", parameters)
    adev = level * np.sqrt(MODEL.allan_variance(TAU))
    frequency = np.geomspace(1e-4, RATE / 2, 60)
    fitted = estimate.model.sampled_spectrum(2 * np.pi * frequency / RATE, RATE) / RATE
    figure = {"quantity": "N", "statistic": "N", "printed": 0.005, "unit": "deg/s/sqrt(Hz)",
              "kind": "typ", "verdict": "as printed"}  # fmt: skip
    floor = figure | {"quantity": "bias_instability", "statistic": "adev_minimum", "printed": 8.0,
                      "unit": "deg/h", "kind": "max", "comparable": 8 * HOUR}  # fmt: skip
    return {
        "recordings": [
            {"sensor": sensor, "device": recording, "recording": recording, "kind": "static",
             "simulated": simulated, "status": "ok"},
        ],
        "allan": [
            key | {"tau": t, "cluster_size": round(t * RATE), "adev": a, "lower": a / 1.2,
                   "upper": a * 1.2, "edf": 9.0, "edf_upper": 9.0,
                     "edf_source": "fitted spectrum", "exponent": 0, "share": 1.0}
            for t, a in zip(TAU, adev, strict=True)
        ],
        "parameters": list(
            make_parameter_rows(Key(sensor, recording, channel), estimate, recommended=True)
        ),
        "reconstruction": [
            method | {"tau": t, "adev": a, "lower": a / 2, "upper": a * 2, "reconstructed": a}
            for t, a in zip(TAU, adev, strict=True)
        ],
        "datasheet": [
            method | figure | {"sidedness": "one-sided", "comparable": 10 * HOUR},
            method | figure | {"sidedness": "two-sided", "comparable": 14 * HOUR},
            method | floor,
        ] * printed,
        "spectrum": [
            key | {"frequency": f, "lower": f, "upper": f, "ordinates": 9.0, "density": d,
                   "fitted": d, "used": number % 5 > 0}
            for number, (f, d) in enumerate(zip(frequency, fitted, strict=True))
        ],
        "models": [
            key | {"model": estimate.model.name, "chosen": True, "free": 4, "log_likelihood": 0.0,
                   "bic": 0.0, "aic": 0.0, "weight": 1.0, "verdict": "explained", "bins": 60},
        ],
        "lines": [
            key | {"kind": "sinusoid", "frequency": f, "amplitude": HOUR, "ratio": 30.0}
            for f in found
        ],
    }  # fmt: skip


def views_of(*several: Rows) -> list[ChannelView]:
    return [view for one in gather_recordings(tables_of(*several)) for view in one.channels()]


def view_of(**values: Any) -> ChannelView:
    (view,) = views_of(rows_of(**values))
    return view


@cache
def usual() -> ChannelView:
    """A channel that is not to be changed."""
    return view_of()


def made(figure: Figure | None) -> Figure:
    assert figure is not None
    return figure


def texts(figure: Figure, folder: Path) -> list[str]:
    path = folder / "figure.svg"
    save(figure, path)
    tree = ET.fromstring(path.read_text(encoding="utf-8"))
    return ["".join(text.itertext()) for text in tree.iter("{http://www.w3.org/2000/svg}text")]


def written(figure: Figure) -> list[str]:
    # A formula is broken into its parts in a file.
    return [text.get_text().replace("$", "") for text in figure.findobj(Text)]


def line(axes: Axes, begin: str) -> Line2D:
    (found,) = [each for each in axes.lines if str(each.get_label()).startswith(begin)]
    return found


def value_at(drawn: Line2D, tau: float) -> float:
    x, y = np.asarray(drawn.get_xdata()), np.asarray(drawn.get_ydata())
    return float(np.exp(np.interp(np.log(tau), np.log(x), np.log(y))))


def legend_is_clear(figure: Figure) -> bool:
    (legend,) = figure.legends
    box = legend.get_window_extent()
    lowest = min(axes.get_tightbbox().y0 for axes in figure.axes)
    return bool(box.x0 >= 0 and box.x1 <= figure.bbox.x1 and box.y0 >= 0 and box.y1 <= lowest)


@pytest.mark.release
def test_the_curve_alone_has_its_units_and_says_what_it_is(tmp_path: Path) -> None:
    figure = draw_allan_figure(usual())
    found = texts(figure, tmp_path)
    assert {"averaging time τ (s)", "Allan deviation (°/h)", "measured", "95 % limits"} <= {*found}
    assert "imu / day1: gyroscope, x axis" in found
    drawn = line(figure.axes[0], "measured")
    np.testing.assert_allclose(drawn.get_ydata(), np.sqrt(MODEL.allan_variance(TAU)) * TO_PAGE)
    assert "Allan deviation (rad/s)" in written(draw_allan_figure(usual(), "si"))
    assert "Allan deviation (µg)" in written(draw_allan_figure(view_of(channel="accel_z")))


@pytest.mark.release
def test_terms_pass_through_the_points_where_they_are_read() -> None:
    figure = made(draw_terms_figure(usual()))
    (axes,) = figure.axes
    white, walk = line(axes, "angle random walk"), line(axes, "rate random walk")
    assert value_at(white, 1.0) == pytest.approx(20.0, rel=1e-4)
    assert value_at(walk, 3.0) == pytest.approx(0.1, rel=1e-4)
    process = line(axes, "bias instability")
    assert np.max(process.get_ydata()) == pytest.approx(FLOOR * 10.0, rel=1e-3)
    parts = [np.asarray(each.get_ydata()) for each in (white, walk, process)]
    np.testing.assert_allclose(line(axes, "sum").get_ydata(), np.sqrt(sum(p**2 for p in parts)))
    points = {
        (float(each.get_xdata()[0]), float(each.get_ydata()[0]))
        for each in axes.lines
        if len(each.get_xdata()) == 1
    }
    expected = {(1.0, 20.0), (PEAK_TAU * 100.0, FLOOR * 10.0), (3.0, 0.1)}
    np.testing.assert_allclose(sorted(points), sorted(expected))
    found = written(figure)
    assert "rate random walk, K = 6 °/h/√h" in found and "0.664 B" in found
    assert "sum: N+GM+K" in found


@pytest.mark.release
def test_undetermined_term_is_marked_not_determined() -> None:
    unsure = KNOWN | {
        "K": Parameter(
            None, "not_identified", "too short", MODEL.K / 9, MODEL.K * 9, fitted=MODEL.K
        )
    }
    view = view_of(parameters=unsure)
    assert "rate random walk, K = 6 °/h/√h (not determined)" in written(
        made(draw_terms_figure(view))
    )
    mark = make_mark(view, "K", 0.0)
    assert mark is not None and (mark.kind, mark.value, mark.lower) == (
        "not identified",
        MODEL.K,
        MODEL.K / 9,
    )
    figure = draw_forest_figure([view], ["imu"])
    (dot,) = [each for each in figure.axes[-1].lines if each.get_marker() == "o"]
    assert dot.get_markerfacecolor() == "white"
    assert "not determined: fitted value, 95 % limits" in written(figure)


@pytest.mark.release
def test_a_channel_without_k() -> None:
    view = view_of(parameters=KNOWN | {"K": Parameter(None, "absent", upper=0.3 * HOUR)})
    (axes,) = made(draw_terms_figure(view)).axes
    assert not [each for each in axes.lines if "random walk, $K$" in str(each.get_label())]
    mark = make_mark(view, "K", 0.0)
    assert mark is not None and (mark.kind, mark.value) == ("limit", 0.3 * HOUR)
    assert "upper 95 % limit" in written(draw_forest_figure([view], ["imu"]))
    nothing = view_of(parameters=dict.fromkeys(KNOWN, Parameter(None, "absent")))
    found = written(draw_forest_figure([nothing], ["imu"]))
    assert "not in the model" in found and "no recording has a value" in found


@pytest.mark.release
def test_models_of_the_methods_are_drawn_over_the_curve() -> None:
    figure = made(draw_methods_figure(usual()))
    above, ratio = figure.axes
    np.testing.assert_allclose(
        line(above, "likelihood").get_ydata(), np.sqrt(MODEL.allan_variance(TAU)) * TO_PAGE
    )
    np.testing.assert_allclose(ratio.lines[-1].get_ydata(), 1.0)
    names = {"likelihood (recommended)", "reconstruction", "95 % of reconstructions"}
    assert names <= {*written(figure)}
    without = view_of(parameters={"N": Parameter(None, "not_shown")})
    assert draw_methods_figure(without) is None and draw_terms_figure(without) is None


@pytest.mark.release
def test_lines_of_the_datasheet() -> None:
    figure = made(draw_datasheet_figure(usual()))
    (axes,) = figure.axes
    lines = [each for each in axes.lines if str(each.get_label()).startswith("datasheet $N$")]
    assert [value_at(each, 1.0) for each in lines] == pytest.approx([10.0, 14.0])
    assert [value_at(each, 100.0) for each in lines] == pytest.approx([1.0, 1.4])
    np.testing.assert_allclose(line(axes, "datasheet bias").get_ydata(), 8.0)
    assert "datasheet N: 0.005 °/s/√Hz (read as two-sided)" in written(figure)
    assert "datasheet bias instability: 8 °/h (max)" in written(figure)
    assert draw_datasheet_figure(view_of(printed=False)) is None


@pytest.mark.release
def test_the_terms_of_the_spectrum_make_the_fit(tmp_path: Path) -> None:
    figure = made(draw_spectrum_figure(view_of(found=[2.0, 2.1, 30.0])))
    (axes,) = figure.axes
    unit = choose_page_unit("gyro", "psd", "practical")
    terms = [line(axes, name) for name in ("angle random", "bias instability", "rate random")]
    total = np.sqrt(sum(np.asarray(term.get_ydata()) ** 2 for term in terms))
    fit = line(axes, "fit by likelihood: N+GM+K")
    grid = np.asarray(terms[0].get_xdata())
    found = np.exp(np.interp(np.log(fit.get_xdata()), np.log(grid), np.log(total)))
    np.testing.assert_allclose(found, fit.get_ydata(), rtol=1e-2)
    assert value_at(fit, 40.0) == pytest.approx(MODEL.N * unit.per_si, rel=1e-3)
    shown = texts(figure, tmp_path)
    assert {"frequency (Hz)", "root of the two-sided density (°/s/√Hz)", "lines (3)"} <= {*shown}
    assert "bins left out" in shown
    # Two lines stand too close for both of their names.
    assert [text for text in shown if text.endswith(" Hz")] == ["2 Hz", "30 Hz"]
    bare = view_of()
    bare.spectrum = {}
    assert draw_spectrum_figure(bare) is None


@pytest.mark.parametrize("step", few([4], [1]))
def test_a_simulated_log_is_called_so_in_every_figure(step: int) -> None:
    rows = rows_of(simulated=True)
    truth = {"sensor": "imu", "recording": "day1", "channel": "gyro_x", "parameter": "N"}
    rows["simulated_truth"] = [
        truth | {"component": 1, "value": MODEL.N, "unit": "x", "assumed": True, "source": "x"}
    ]
    views = views_of(rows)
    makers = [make for _, make in (*list_cross_figures(views), *list_channel_figures(views[0]))]
    assert len(makers) == 7
    figures = [make() for make in makers[::step]]  # the first kind of each
    every = []
    for figure in figures:
        found = written(made(figure))
        every += found
        assert any("simulated" in text for text in found)
        assert not any(text.startswith("measured") for text in found)
    assert step > 1 or "truth of the simulation" in every


@pytest.mark.release
@pytest.mark.parametrize("recordings", [6, 1, 30, 60])
def test_recordings_of_a_sensor_share_one_entry(recordings: int, tmp_path: Path) -> None:
    views = views_of(
        *(rows_of(recording=f"r{n}", level=1 + 0.01 * n) for n in range(recordings)),
        rows_of(sensor="other", level=3.0),
    )
    figure = draw_comparison_figure(views, ["imu", "other"])
    found = texts(figure, tmp_path)
    assert found.count("imu" if recordings == 1 else f"imu ({recordings} recordings)") == 1
    assert "other" in found and legend_is_clear(figure)
    forest = draw_forest_figure(views, ["imu", "other"])
    assert ("imu" if recordings == 1 else f"imu (n = {recordings})") in written(forest)
    assert legend_is_clear(forest) and forest.get_figheight() * 25.4 < 235.0
    (dots,) = [each for each in forest.axes[0].lines if len(each.get_ydata()) == recordings][:1]
    np.testing.assert_allclose(dots.get_xdata(), MODEL.N * choose_page_unit(
        "gyro", "N", "practical").per_si)  # fmt: skip


@pytest.mark.release
def test_comparison_figure_marks_the_median_recording() -> None:
    levels = (1.0, 9.0, 3.0, 2.0, 4.0)
    views = views_of(*(rows_of(recording=f"r{n}", level=one) for n, one in enumerate(levels)))
    (axes,) = draw_comparison_figure(views, ["imu"]).axes
    (marked,) = [each for each in axes.lines if each.get_marker() == "o"]
    np.testing.assert_allclose(marked.get_ydata(), views[2].adev * TO_PAGE)


@pytest.mark.release
@pytest.mark.parametrize("sensors", [9, 33])
def test_many_sensors_have_room_below_the_curves(sensors: int) -> None:
    names = [f"a_sensor_with_quite_a_long_name_{n}" for n in range(sensors)]
    views = views_of(*(rows_of(sensor=name, level=1 + n) for n, name in enumerate(names)))
    figure = draw_comparison_figure(views, names)
    assert legend_is_clear(figure)
    looks = {
        (each.get_color(), each.get_linestyle(), each.get_marker()) for each in figure.axes[0].lines
    }
    assert len(looks) == sensors
    forest = draw_forest_figure(views, names)
    assert len(forest.axes[0].get_yticklabels()) == sensors
    assert all(text.get_window_extent().x0 >= 0 for text in forest.axes[0].get_yticklabels())


@pytest.mark.release
def test_names_of_the_user_are_no_formulas_and_never_too_wide(tmp_path: Path) -> None:
    long = "x" * 150
    views = views_of(rows_of(sensor="a$b$"), rows_of(sensor=long, recording="_$"))
    found = texts(draw_comparison_figure(views, ["a$b$", long]), tmp_path)
    assert "a$b$" in found and any("xx…xx" in text for text in found)
    figure = draw_allan_figure(views[1])
    assert any(text.endswith(": gyroscope, x axis") for text in written(figure))
    assert figure.texts[0].get_window_extent().x1 <= figure.bbox.x1


@pytest.mark.release
def test_the_characteristic_curve_is_computed(tmp_path: Path) -> None:
    figure = draw_theory_figure()
    (axes,) = figure.axes
    total = line(axes, "Allan deviation")
    for tau in (0.01, 100.0, 1e5):
        expected = math.sqrt(float(CHARACTERISTIC.allan_variance(tau))) * TO_PAGE
        assert value_at(total, tau) == pytest.approx(expected)
    slope = np.diff(np.log(total.get_ydata())) / np.diff(np.log(total.get_xdata()))
    assert (slope[0], slope[-1]) == pytest.approx((-0.5, 0.5), abs=0.02)
    assert value_at(line(axes, "white noise"), 1.0) == pytest.approx(20.0)
    assert value_at(line(axes, "bias"), 1.0) == pytest.approx(FLOOR * 10.0)
    assert value_at(line(axes, "random walk"), 3.0) == pytest.approx(0.4, rel=1e-4)
    assert {"0.664 B", "N: at τ = 1 s", "K: at τ = 3 s"} <= {*written(figure)}
    assert {"slope −1/2", "slope 0", "slope +1/2"} <= {*texts(figure, tmp_path)}


@pytest.mark.release
def test_the_same_data_make_the_same_bytes(tmp_path: Path) -> None:
    kinds = ("svg", "pdf")
    before = {key: mpl.rcParams[key] for key in ("font.size", "svg.fonttype", "axes.grid")}
    for kind in kinds:
        save(draw_forest_figure([usual()], ["imu"]), tmp_path / f"first.{kind}")
        with mpl.rc_context({"font.size": 20.0, "axes.facecolor": "red"}):
            save(draw_forest_figure([usual()], ["imu"]), tmp_path / f"second.{kind}")
        first, second = ((tmp_path / f"{n}.{kind}").read_bytes() for n in ("first", "second"))
        assert first == second
    assert first.startswith(b"%PDF") and b"CreationDate" not in first
    assert before == {key: mpl.rcParams[key] for key in before}
    with pytest.raises(ValueError, match="xyz"):
        save(draw_theory_figure(), tmp_path / "bad.xyz")
    assert sorted(path.suffix[1:] for path in tmp_path.iterdir()) == sorted([*kinds, *kinds])


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("results")
    several = [
        rows_of("a", "r1"),
        rows_of("a", "r2", printed=False),
        rows_of("b", "r1"),
        {"recordings": [{"sensor": "c", "device": "bad", "recording": "bad", "kind": "static",
                         "simulated": False, "status": "rejected", "reason": "no stamps"}]},
    ]  # fmt: skip
    for name in TABLES:
        write(
            name,
            [row for rows in several for row in rows.get(name, [])],
            folder / "tables" / f"{name}.parquet",
        )
    yield folder


def command(*words: object) -> int:
    return main(["figures", *map(str, words)])


def test_the_command_writes_what_is_asked_for(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ("--sensor", "a", "--kind", "comparison,datasheet", "--format", "svg")
    assert command(results, *asked, "--output", tmp_path) == 0
    # r2 has no datasheet; the figure of one sensor does not take the place of that of all.
    expected = [tmp_path / "a/allan_gyro_x.svg", tmp_path / "a/r1/gyro_x_datasheet.svg"]
    said = capsys.readouterr()
    assert said.out.splitlines() == [str(path) for path in expected]
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file()) == expected
    assert "channel 2 of 2: a / r2 gyro_x" in said.err


@pytest.mark.release
def test_the_command_writes_beside_the_tables(results: Path) -> None:
    assert command(results, "--kind", "comparison", "--format", "pdf", "--units", "si") == 0
    assert (results / "figures/allan_gyro_x.pdf").read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("--sensor", "z"), "found no sensor 'z'; there are: a, b"),
        (("--sensor", "c"), "with a curve; status rejected (no stamps); there are: a, b"),
        (("--sensor", "a", "--recording", "q"), "found no recording 'q'; there are: r1, r2"),
        (("--channel", "gyro_q"), "found no channel 'gyro_q'; there are: gyro_x"),
        (
            ("--recording", "r2", "--kind", "datasheet"),
            "found nothing to draw: datasheet needs a printed figure",
        ),
    ],
)
def test_the_command_says_what_is_not_there(
    asked: tuple[str, ...], said: str, results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(results, *asked) == 2
    assert said in capsys.readouterr().err


def test_the_command_says_that_there_are_no_tables(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert command(tmp_path) == 2
    assert "no table recordings" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        command(tmp_path, "--kind", "allen")
    assert "found 'allen', expected all, or some of" in capsys.readouterr().err
