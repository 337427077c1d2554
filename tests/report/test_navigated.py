"""What the page of navigation says of tunings and sensors."""

import math
import re
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.extensions.aided.page import (
    NAVIGATION,
    TUNINGS,
    describe_tunings,
    rank_sensors,
)
from imubench_pipeline.extensions.aided.tables import NavigationRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.settings.config import Method
from imubench_pipeline.tables.files import build
from tests.report.browser.made import publish_some
from tests.report.pages import unfolded
from tests.report.tables import joined, recording_rows, site

SIZES = {
    "Position, m": ("position", 1.0),
    "Position / true model": ("position_ratio", 1.0),
    "Velocity, m/s": ("velocity", 1.0),
    "Heading, °": ("heading", 180 / math.pi),
}
"""Columns of the page that have limits, with what they are called and one of them in SI."""


def navigation_row(sensor: str = "imu", **changes: Any) -> dict[str, Any]:
    """A row of the table, of a tuning that is as good as the true model."""
    row: dict[str, Any] = {
        "sensor": sensor, "recording": "day1", "trajectory": "field", "outage": 30.0,
        "tuning": "likelihood", "recommended": True, "model": "gyro N; accel N", "states": 15,
        "signals": "truth", "runs": 100, "outages": 200, "nees_inside": 0.95, "nees_error": 0.004,
        "consistent": True, "smallest": False,
    }  # fmt: skip
    for name, size in {"position": 2.0, "velocity": 0.2, "heading": 0.01}.items():
        row |= {name: size, f"{name}_lower": 0.9 * size, f"{name}_upper": 1.1 * size}
        row |= {f"{name}_predicted": size}
        row |= {f"{name}_ratio": 1.0, f"{name}_ratio_lower": 0.98, f"{name}_ratio_upper": 1.02}
    return row | changes


def ratio(value: float, lower: float, upper: float) -> dict[str, float]:
    return {
        "position_ratio": value,
        "position_ratio_lower": lower,
        "position_ratio_upper": upper,
    }


def rows(*changes: dict[str, Any]) -> list[NavigationRow]:
    return NavigationRow.rows_of(build("navigation", [navigation_row(**one) for one in changes]))


def test_a_tuning_matters_where_it_surely_costs_a_tenth() -> None:
    (answer,) = describe_tunings(
        rows(
            {"tuning": "true", "recommended": False},
            {"smallest": True},
            {"tuning": "times_ten", "recommended": False, **ratio(1.8, 1.5, 2.1)},
            {"tuning": "curve", "recommended": False, **ratio(1.2, 0.9, 1.5)},
        )
    )
    assert answer.effect == (
        "The tuning matters: ten times the estimate 1.8 times the error of the true model; "
        "within 10 %: likelihood; inconclusive: read from the curve."
    )
    assert answer.smallest == "likelihood, 15 states"
    assert answer.inconsistent is None


def test_the_longest_outage_answers_and_a_filter_that_is_wrong_of_itself_is_named() -> None:
    (answer,) = describe_tunings(
        rows(
            ratio(3.0, 2.5, 3.5),
            {"outage": 60.0, "consistent": False, **ratio(1.0, 0.98, 1.05)},
        )
    )
    assert answer.outage == "60 s"
    assert answer.effect == "Within 10 %: likelihood."
    assert answer.inconsistent == "likelihood"


def test_navigation_ranking_uses_recommended_tuning_and_lists_ties() -> None:
    far = {"position": 9.0, "position_lower": 8.0, "position_upper": 10.0}
    near = {"position": 2.1, "position_lower": 1.9, "position_upper": 2.3}
    better = {"position": 1.0, "position_lower": 0.9, "position_upper": 1.1}
    places = list(
        rank_sensors(
            rows(
                {"sensor": "a", **far},
                {"sensor": "b"},
                {"sensor": "c", **near},
                {"sensor": "a", "tuning": "true", "recommended": False, **better},
                {"sensor": "a", "signals": "log", **better},
            )
        )
    )
    assert [(place, line.row.sensor, ties) for place, line, ties in places] == [
        (1, "b", ["c"]),
        (2, "c", ["b"]),
        (3, "a", []),
    ]


def test_excluded_recordings_are_not_ranked_and_have_a_reason() -> None:
    sold, apart = (
        recording_rows(name, decides=not doubts, doubts=doubts)
        for name, doubts in (("sold", ()), ("fused", (DoubtMark("day1", "not_sold"),)))
    )
    run = {"navigation": [navigation_row("sold"), navigation_row("fused")]}
    context = NAVIGATION.page(site(joined(sold, apart, run))).context()
    assert [line.row.sensor for _, line, _ in context["ranking"]] == ["sold"]
    assert context["apart"] == {"fused": "day1 is not used: this sensor is not sold"}


def test_every_tuning_has_a_name() -> None:
    assert set(Method.__args__) <= set(TUNINGS)


def test_the_page_is_there_where_something_was_run(tmp_path: Path) -> None:
    without = site(joined(recording_rows("imu")))
    assert not NAVIGATION.exists(without)
    lacking = navigation_row(
        "imu", tuning="overbound", position=None, reason="no model lies above the curve"
    )
    made = site(joined(recording_rows("imu"), {"navigation": [navigation_row("imu"), lacking]}))
    context = NAVIGATION.page(made).context()
    assert [line.tuning for line in context["lines"]] == ["likelihood"]
    assert [line.row.reason for line in context["lacking"]] == ["no model lies above the curve"]


@pytest.fixture(scope="module")
def drives() -> list[dict[str, Any]]:
    """Rows of which no two figures are alike, more than stand in a page unpacked."""
    rng = np.random.default_rng(5)
    rows = [
        navigation_row(
            sensor, trajectory=trajectory, outage=outage, tuning=tuning, signals=signals,
            recommended=tuning == "likelihood", states=int(rng.integers(15, 40)),
            runs=int(rng.integers(20, 400)), outages=int(rng.integers(20, 400)),
            nees_inside=rng.uniform(0.5, 1.0), nees_error=10.0 ** rng.uniform(-4, -2),
            consistent=True, smallest=tuning == "datasheet",
        )
        for sensor in ("one", "two")
        for trajectory, signals in (("field", "truth"), ("rest", "log"))
        for outage in (None, 10.0, 60.0)
        for tuning in ("true", "datasheet", "times_ten", "likelihood")
    ]  # fmt: skip
    for row in rows:
        for name in ("position", "velocity", "heading", "position_ratio"):
            size = 10.0 ** rng.uniform(-2, 4)
            row |= {name: size, f"{name}_lower": size * rng.uniform(0.5, 0.9)}
            row |= {f"{name}_upper": size * rng.uniform(1.1, 2.0)}
        row["position_predicted"] = 10.0 ** rng.uniform(-2, 4)
    rows[3] |= {"nees_inside": None, "nees_error": None}
    for row in rows[12:24]:
        row |= dict.fromkeys(f"position_ratio{end}" for end in ("", "_lower", "_upper"))
    return rows


@pytest.fixture(scope="module")
def source(
    drives: list[dict[str, Any]], tmp_path_factory: pytest.TempPathFactory, small_report: None
) -> str:
    """The page of these rows, unfolded."""
    about = [recording_rows(sensor) for sensor in ("one", "two")]
    folder = tmp_path_factory.mktemp("report")
    publish_some(site(joined(*about, {"navigation": drives})), folder, [NAVIGATION.file])
    return unfolded((folder / NAVIGATION.file).read_text(encoding="utf-8"))


def lines_of(source: str, title: str) -> list[dict[str, tuple[str, str]]]:
    """The rows of a table of the page: of each column the text, and by what it is sorted."""
    table = source.partition(f'aria-label="{title}"')[2].partition("</table>")[0]
    lines = [
        [
            (
                unescape(re.sub("<[^>]*>", "", text)),
                "".join(re.findall('data-value="(.*?)"', about)),
            )
            for about, text in re.findall("<t[hd]([^>]*)>(.*?)</t[hd]>", line)
        ]
        for line in re.findall("<tr.*?</tr>", table)
    ]
    heads = [head for head, _ in lines[0]]
    return [dict(zip(heads, line, strict=True)) for line in lines[1:]]


def to_three_digits(*values: float) -> list[str]:
    return [f"{float(f'{value:.3g}'):.10f}".rstrip("0").rstrip(".") for value in values]


def hold_sizes(line: dict[str, tuple[str, str]], row: dict[str, Any]) -> set[str]:
    """Hold what has limits to its row of the table; return the columns."""
    shown = SIZES.keys() & line.keys()
    for head in shown:
        name, factor = SIZES[head]
        text, sorted_by = line[head]
        if row[name] is None:
            assert (text, sorted_by) == ("–", "")
            continue
        sizes = [factor * row[f"{name}{end}"] for end in ("", "_lower", "_upper")]
        assert re.findall(r"[\d.]+", text) == to_three_digits(*sizes), (head, row)
        assert re.sub(r"[\d.]+", "#", text) == "# (# to #)"
        if sorted_by:
            assert float(sorted_by) == row[name]
    return shown


def test_every_number_of_a_tuning_is_that_of_its_table(
    source: str, drives: list[dict[str, Any]]
) -> None:
    shown = lines_of(source, "All tunings")
    assert len(shown) == len(drives) > 30
    for line, row in zip(shown, drives, strict=True):
        held = hold_sizes(line, row)
        assert held == SIZES.keys()
        assert line["Tuning"][0].split(",")[0] == TUNINGS[row["tuning"]]
        assert (line["Sensor"][0].split()[-1], line["Trajectory"][0]) == (
            row["sensor"], row["trajectory"],
        )  # fmt: skip
        outage = row["outage"]
        assert line["Outage"] == (f"{outage:.0f} s" if outage else "none", f"{outage or 0.0}")
        assert line["States"] == (str(row["states"]),) * 2
        assert [line["Predicted by the filter, m"][0]] == to_three_digits(row["position_predicted"])
        assert line["Outages"][0] == (f"{row['outages']} outages" if outage else "")
        text, sorted_by = line["NEES inside"]
        if row["nees_inside"] is None:
            assert (text, sorted_by) == ("", "")
        else:
            share, error = re.fullmatch(r"([\d.]+) ± ([\d.]+) %", text).groups()  # type: ignore[union-attr]  # else the test fails
            assert [share] == to_three_digits(100 * row["nees_inside"])
            assert float(error) == float(f"{100 * row['nees_error']:.2g}")
            assert float(sorted_by) == 100 * row["nees_inside"]
        held |= {"Outage", "States", "Predicted by the filter, m", "Outages", "NEES inside"}
        assert not {head for head, (text, _) in line.items() if re.search(r"\d", text)} - held


def test_every_number_of_a_rank_is_that_of_its_table(
    source: str, drives: list[dict[str, Any]]
) -> None:
    # Pieces of a log are no drive that all have.
    rows = [
        row for row in drives
        if (row["outage"], row["tuning"], row["signals"]) == (60.0, "likelihood", "truth")
    ]  # fmt: skip
    rows.sort(key=lambda row: row["position"])
    shown = lines_of(source, "Which sensor drifts least?")
    assert len(shown) == len(rows) == 2
    for place, (line, row) in enumerate(zip(shown, rows, strict=True), start=1):
        held = hold_sizes(line, row) | {"Place", "Outage"}
        assert len(held) == 5
        assert (line["Place"][0], line["Outage"][0]) == (str(place), "60 s")
        assert line["Sensor"][0].split()[-1] == row["sensor"]
        assert not {head for head, (text, _) in line.items() if re.search(r"\d", text)} - held


def test_every_number_of_an_answer_is_that_of_its_table(
    source: str, drives: list[dict[str, Any]]
) -> None:
    shown = lines_of(source, "Does the tuning matter?")
    assert len(shown) == 3  # of the fourth there is no ratio
    told = 0
    for line in shown:
        of = line["Sensor"][0].split()[-1], line["Trajectory"][0].split(",")[0]
        own = [row for row in drives if (row["sensor"], row["trajectory"]) == of]
        assert line["Trajectory"][0] == f"{of[1]}, 60 s, {own[0]['runs']} runs"
        smallest = next(row for row in own if row["smallest"])
        fewest = line["Consistent tuning with the fewest states"][0]
        assert fewest == f"datasheet, {smallest['states']} states"
        ratios = {
            TUNINGS[row["tuning"]]: row["position_ratio"] for row in own if row["outage"] == 60.0
        }
        for name, times in re.findall(r"(?:by|,) ([^,;]+?) ([\d.]+) times", line["Answer"][0]):
            assert [times] == to_three_digits(ratios[name])
            told += 1
        answer = re.sub("(within|at most) 10 %", "", line["Answer"][0], flags=re.IGNORECASE)
        assert len(re.findall(r"\d[\d.]*", answer)) == len(re.findall("[0-9] times", answer))
    assert told > 2


def test_table_without_script_shows_the_number_of_rows(
    source: str, drives: list[dict[str, Any]]
) -> None:
    (note,) = re.findall("<noscript>(.*?)</noscript>", source)
    assert f"30 of {len(drives)} rows." in note
