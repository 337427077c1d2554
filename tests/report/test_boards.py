import json
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.extensions.fusion.page import BOARDS, PublishedLine, make_published_line
from imubench_pipeline.extensions.fusion.tables import PublishedFigureRow
from imubench_pipeline.report.pages import list_pages
from imubench_pipeline.report.publish import publish
from imubench_pipeline.report.site import Site
from imubench_pipeline.tables.files import build
from tests.report.pages import Read, read_pages, sound_pages
from tests.report.tables import DEGREE, HOUR, Rows, joined, recording_rows, rejected_rows, site

pytestmark = pytest.mark.usefixtures("small_report")

FIGURE = "data:image/svg+xml;base64,PHN2Zy8+"
BOARD: dict[str, Any] = {
    "title": "three on one board",
    "note": "what was assumed",
    "sensors": {
        "cheap": {"gyro_x": "curve: 29 and 30", "gyro_y": None},
        "dear": {"gyro_x": None},
        "torn": {"gyro_x": None},
    },
    "temperature": True,
    "motion": [],
}
PRINTED: dict[str, Any] = {
    "place": "Table 5",
    "figure": "PSD",
    "printed": "0.0001 (°/s)/√Hz",
    "of": "log",
    "parameter": "N",
    "means": 0.006 * DEGREE,
    "unit": "rad/s/sqrt(Hz)",
    "truth": 0.0059 * DEGREE,
    "curve": 0.0063 * DEGREE,
    "value": 0.0057 * DEGREE,
    "lower": 0.0056 * DEGREE,
    "upper": 0.0058 * DEGREE,
    "datasheet": 0.0035 * DEGREE,
    "datasheet_upper": 0.005 * DEGREE,
    "reason": "it was read at 1 h",
}
FLOOR: dict[str, Any] = PRINTED | {
    "figure": "dynamic drift",
    "printed": "0.004 (°/s)/K",
    "parameter": "B",
    "means": 18 * HOUR,
    "unit": "rad/s",
    "truth": 20 * HOUR,
    "curve": None,
    "value": 21 * HOUR,
    "lower": None,
    "upper": 25 * HOUR,
    "datasheet": None,
    "datasheet_upper": None,
    "reason": None,
}
OFFSET: dict[str, Any] = FLOOR | {
    "figure": "fixed drift",
    "printed": "−2 °/s",
    "parameter": "bias",
    "means": -2 * DEGREE,
    "truth": -2 * DEGREE,
    "curve": -2.1 * DEGREE,
    "value": -2.05 * DEGREE,
    "lower": -2.06 * DEGREE,
    "upper": -2.04 * DEGREE,
    "datasheet": 1 * DEGREE,
}
COEFFICIENT: dict[str, Any] = OFFSET | {
    "place": "Table 1",
    "figure": "coefficient",
    "printed": "0.03 (°/s)/K",
    "of": "datasheet",
    "parameter": "sensitivity",
    "means": 0.03 * DEGREE,
    "unit": "rad/s/K",
    "datasheet": 0.015 * DEGREE,
}


def of_board(sensor: str, *figures: dict[str, Any], board: str = "pair", **given: Any) -> Rows:
    """The rows of a simulated recording of a board, of which this is published."""
    recording = f"sim_{board}"
    rows = deepcopy(recording_rows(sensor, recording, simulated=True, **given))
    names = {"sensor": sensor, "recording": recording, "channel": "gyro_x"}
    rows["published_figures"] = [names | one for one in figures]
    return rows


def made(*several: Rows, boards: dict[str, Any] | None = None, **given: Any) -> Site:
    return site(joined(*several), boards={"pair": BOARD} if boards is None else boards, **given)


def some() -> list[Rows]:
    figures = (PRINTED, FLOOR, OFFSET, COEFFICIENT)
    return [
        of_board("cheap", *figures, channels=("gyro_x", "gyro_y"), temperature="followed"),
        of_board("dear"),
        rejected_rows("torn", "sim_pair", simulated=True),
        recording_rows("cheap", "day1"),
    ]


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Read]:
    folder = tmp_path_factory.mktemp("report")
    publish(made(*some()), folder)
    return sound_pages(
        folder, {f"figures/allan_gyro_{a}.{kind}" for a in "xy" for kind in ("svg", "pdf")}
    )


def row(page: Read, figure: str) -> list[str]:
    """The cells of the line of a published figure."""
    (found,) = page.naming(figure, "tr")
    begin = next(i for i, one in enumerate(page.elements) if one is found)
    after = page.elements[begin + 1 :]
    end = next((i for i, one in enumerate(after) if one.tag == "tr"), len(after))
    return [one.text.strip() for one in after[:end] if one.tag in ("td", "th")]


# What the page says.


def test_boards_page_shows_printed_and_estimated_figures_with_units(read: dict[str, Read]) -> None:
    cells = row(read["boards.html"], "Table 5: PSD")
    # 0.006 °/s/√Hz are 0.36 °/√h.
    assert cells == [
        "Table 5: PSD",
        "0.0001 (°/s)/√Hz",
        "N",
        "°/√h",
        "0.36",
        "0.354",
        "0.378",
        "0.3420.336 to 0.348",
        "0.21to 0.3",
        "0.95",
    ]
    reasons = [
        one.text
        for one in read["boards.html"].elements
        if "why" in (one.attributes.get("class") or "")
    ]
    assert "Reason for the difference: it was read at 1 h" in reasons


def test_each_parameter_has_the_unit_of_the_page(read: dict[str, Read]) -> None:
    page = read["boards.html"]
    floor = row(page, "dynamic drift")
    assert floor[2:8] == ["B", "°/h", "18", "20", "–", "21"]  # no interval of one limit
    assert floor[8:] == ["–", "1.17"]  # without a reason beside it
    offset = row(page, "fixed drift")
    assert offset[2:8] == ["bias", "°/s", "−2", "−2", "−2.1", "−2.05−2.06 to −2.04"]
    assert offset[8:10] == ["1", "1.02"]


def test_printed_datasheet_figure_is_compared_with_the_datasheet(
    read: dict[str, Read],
) -> None:
    cells = row(read["boards.html"], "coefficient")
    # Nothing that was found of the log stands in its line.
    assert cells[2:] == [
        "sensitivity of the datasheet",
        "°/h/K",
        "108",
        "–",
        "–",
        "–",
        "54",
        "0.5",
    ]


def test_a_sensor_on_two_boards_has_the_figures_of_each(tmp_path: Path) -> None:
    of_both = (of_board("cheap", board=board) for board in ("pair", "other"))
    publish(made(*of_both, boards={"pair": BOARD, "other": BOARD}), tmp_path)
    page = read_pages(tmp_path)["boards.html"]
    (data,) = (
        json.loads(one.text) for one in page.scripts if one.attributes.get("class") == "page"
    )
    names = ("sensor", "recording", "channel")
    drawn = [
        tuple(one.attributes[f"data-{name}"] for name in names)
        for one in page.elements
        if one.tag == "figure"
    ]
    assert drawn == [("cheap", "sim_other", "gyro_x"), ("cheap", "sim_pair", "gyro_x")]
    assert drawn == [tuple(one[name] for name in names) for one in data["channels"]]


def test_values_are_switched_with_the_units_of_the_page(read: dict[str, Read]) -> None:
    page = read["boards.html"]
    units = {one.attributes["value"]: one.attributes["data-unit"]
             for one in page.elements if one.tag == "data"}  # fmt: skip
    assert units[f"{PRINTED['value']:.7g}"] == "gyro.N"
    assert units[f"{FLOOR['value']:.7g}"] == "gyro.B"
    assert units[f"{OFFSET['value']:.7g}"] == "gyro.signal"
    assert units[f"{COEFFICIENT['datasheet']:.7g}"] == "gyro.sensitivity"


def test_the_page_says_that_all_of_it_is_simulated(read: dict[str, Read]) -> None:
    page = read["boards.html"]
    heads = [one.text for one in page.elements if one.tag == "h3"]
    assert len(heads) == 2
    assert all("simulated" in head for head in heads)
    (lead,) = (one.text for one in page.elements if one.attributes.get("class") == "lead")
    assert lead.startswith("Several simulated sensors")
    drawn = page.data["channels"]
    assert [(one["sensor"], one["channel"]) for one in drawn] == [
        ("cheap", "gyro_x"), ("cheap", "gyro_y"), ("dear", "gyro_x")
    ]  # fmt: skip
    assert all(one["simulated"] for one in drawn)
    assert set(page.data["looks"]["sensors"]) == {"cheap", "dear"}


def test_the_page_says_what_the_sensors_share_and_which_were_lost(read: dict[str, Read]) -> None:
    text = read["boards.html"].text
    assert "three on one board" in text and "what was assumed" in text
    assert "All sensors of the board share one temperature. Not analysed: torn." in text
    captions = [one.text for one in read["boards.html"].elements if one.tag == "figcaption"]
    assert len(captions) == 3
    assert captions[0].rstrip().endswith("Figures of the source: curve: 29 and 30.")
    assert "Figures of the source" not in "".join(captions[1:])


def test_the_page_says_what_temperature_does(read: dict[str, Read]) -> None:
    text = read["boards.html"].text
    assert text.count("The bias changes with temperature by 90 °/h/K.") == 2
    assert text.count("The sensor's own low-pass has its cut-off at 64 Hz (first order).") == 2


def test_a_channel_of_which_nothing_is_published_has_no_table(read: dict[str, Read]) -> None:
    captions = [one.text for one in read["boards.html"].elements if one.tag == "caption"]
    assert captions == ["Printed figures of V & Co cheap, Gyroscope x, and the results here"]


def test_the_boards_are_reached_through_the_experiments(read: dict[str, Read]) -> None:
    assert "boards.html" in read["experiments.html"].links
    assert "recordings/cheap/sim_pair.html" in read["boards.html"].links
    assert "recordings/cheap/day1.html" not in read["boards.html"].links


# Which pages there are.


@pytest.mark.release
def test_without_boards_there_is_no_page_and_no_way_to_it(tmp_path: Path) -> None:
    few_rows = (of_board("cheap"), recording_rows("cheap", "day1"))
    none = made(*few_rows, boards={})
    assert "boards.html" not in {page.path for page in list_pages(none)}
    assert "boards.html" in {page.path for page in list_pages(made(*few_rows))}
    publish(none, tmp_path)
    for path, page in read_pages(tmp_path).items():
        assert not [link for link in page.links if "boards.html" in link], path


def test_a_report_of_before_there_were_boards_can_be_published_again(tmp_path: Path) -> None:
    # Its settings, kept beside it, know nothing of boards.
    old = made(recording_rows("imu", "day1"), boards={})
    settings = {name: value for name, value in old.settings.items() if name != "boards"}
    again = replace(old, settings=settings)
    assert "boards.html" not in {page.path for page in list_pages(again)}
    assert "boards.html" not in {entry.file for entry in again.existing}


def test_a_board_of_which_no_sensor_was_analysed_names_them_all(tmp_path: Path) -> None:
    lost = [rejected_rows(sensor, "sim_pair", simulated=True) for sensor in ("cheap", "torn")]
    (board,) = BOARDS.page(made(*lost)).context()["boards"]
    assert board["sensors"] == []
    assert board["lost"] == ["cheap", "dear", "torn"]


def test_recordings_of_other_sensors_and_measured_ones_are_not_of_the_board() -> None:
    others = [
        recording_rows("other", "sim_pair", simulated=True),
        recording_rows("dear", "sim_pair"),
        of_board("cheap", board="pair2"),
        of_board("cheap"),
    ]
    (board,) = BOARDS.page(made(*others)).context()["boards"]
    assert [one["view"].sensor for one in board["sensors"]] == ["cheap"]
    assert board["sensors"][0]["view"].name == "sim_pair"


@pytest.mark.parametrize(
    ("temperature", "motion", "said"),
    [
        (True, ["gyro_x"], "All sensors of the board share one temperature and one motion."),
        (False, ["gyro_x"], "All sensors of the board share one motion."),
        (False, [], "The sensors share only their place."),
    ],
)
def test_what_is_shared_is_said(temperature: bool, motion: list[str], said: str) -> None:
    board = BOARD | {"temperature": temperature, "motion": motion}
    (found,) = BOARDS.page(made(of_board("cheap"), boards={"pair": board})).context()["boards"]
    assert found["shared"] == said


def test_two_boards_have_each_their_own_recordings() -> None:
    boards = {"b": BOARD | {"title": "second"}, "a": BOARD | {"title": "first"}}
    found = made(of_board("cheap", board="a"), of_board("cheap", board="b"), boards=boards)
    shown = BOARDS.page(found).context()["boards"]
    assert [one["sensors"][0]["view"].name for one in shown] == [f"sim_{o['name']}" for o in shown]
    assert {one["title"] for one in shown} == {"first", "second"}


@pytest.mark.release
def test_the_page_is_written_again_only_if_its_recordings_or_words_change() -> None:
    key = BOARDS.page(made(*some())).key
    changed = some()
    changed[0]["published_figures"][0]["reason"] = "another"
    assert BOARDS.page(made(*changed)).key != key
    longer = some()
    longer[3]["recordings"][0]["duration"] = 9000.0  # a measured one
    assert BOARDS.page(made(*longer)).key == key
    renamed = {"pair": BOARD | {"title": "another"}}
    assert BOARDS.page(made(*some(), boards=renamed)).key != key


# A line of the table.


def line(**changes: Any) -> PublishedLine:
    names = {"sensor": "imu", "recording": "sim_pair", "channel": "gyro_x"}
    table = build("published_figures", [names | PRINTED | changes])
    return make_published_line(*PublishedFigureRow.rows_of(table))


def test_found_over_printed() -> None:
    assert line().ratio == "0.95"
    assert line(value=None).ratio == "–"
    assert line(of="datasheet").ratio == "0.583"
    assert line(of="datasheet", datasheet=None).ratio == "–"
    assert line(means=0.0).ratio == "–"
    assert line(means=-0.006 * DEGREE).ratio == "−0.95"


def test_limits_that_are_close_have_the_digits_to_differ() -> None:
    n = 0.006 * DEGREE
    assert line().digits == 3
    assert line(value=n, lower=n * (1 - 1e-5), upper=n * (1 + 1e-5)).digits > 4
    assert line(lower=None, upper=None).digits == 3


def test_an_accelerometer_has_its_own_units() -> None:
    assert line(channel="accel_z").unit == "accel.N"
    assert line(channel="accel_z", parameter="bias").unit == "accel.signal"
