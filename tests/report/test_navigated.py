"""What the page of navigation says of tunings and sensors."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.report.navigated import NAVIGATION, TUNINGS, answers, ranking
from imubench_pipeline.report.publish import publish
from imubench_pipeline.settings.config import Method
from imubench_pipeline.tables import build
from tests.report.browser.test_numbers import number
from tests.report.pages import unfolded
from tests.report.tables import joined, recording_rows, site


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


def rows(*changes: dict[str, Any]) -> list[Any]:
    return build("navigation", [navigation_row(**one) for one in changes]).to_pylist()


def test_a_tuning_matters_where_it_surely_costs_a_tenth() -> None:
    (answer,) = answers(
        rows(
            {"tuning": "true", "recommended": False},
            {"smallest": True},
            {"tuning": "times_ten", "recommended": False, **ratio(1.8, 1.5, 2.1)},
            {"tuning": "curve", "recommended": False, **ratio(1.2, 0.9, 1.5)},
        )
    )
    assert answer["matters"] == (
        "It matters: ten times the estimate 1.8 times the error of the true model; "
        "no difference of a tenth: likelihood; these runs do not tell of curve."
    )
    assert answer["smallest"] == "likelihood, 15 states"
    assert answer["dishonest"] is None


def test_the_longest_outage_answers_and_a_filter_that_is_wrong_of_itself_is_named() -> None:
    (answer,) = answers(
        rows(
            ratio(3.0, 2.5, 3.5),
            {"outage": 60.0, "consistent": False, **ratio(1.0, 0.98, 1.05)},
        )
    )
    assert answer["outage"] == "60 s"
    assert answer["matters"] == "No difference of a tenth: likelihood."
    assert answer["dishonest"] == "likelihood"


def test_sensors_are_ranked_by_the_recommended_tuning_and_overlaps_are_said() -> None:
    far = {"position": 9.0, "position_lower": 8.0, "position_upper": 10.0}
    near = {"position": 2.1, "position_lower": 1.9, "position_upper": 2.3}
    better = {"position": 1.0, "position_lower": 0.9, "position_upper": 1.1}
    places = list(
        ranking(
            rows(
                {"sensor": "a", **far},
                {"sensor": "b"},
                {"sensor": "c", **near},
                {"sensor": "a", "tuning": "true", "recommended": False, **better},
                {"sensor": "a", "signals": "log", **better},
            )
        )
    )
    assert [(one["place"], one["sensor"], one["ties"]) for one in places] == [
        (1, "b", ["c"]),
        (2, "c", ["b"]),
        (3, "a", []),
    ]


def test_what_decides_nothing_has_no_place_and_says_why() -> None:
    sold, apart = (
        recording_rows(name, decides=not doubts, doubts=doubts)
        for name, doubts in (("sold", ""), ("fused", "not sold"))
    )
    run = {"navigation": [navigation_row("sold"), navigation_row("fused")]}
    context = NAVIGATION.page(site(joined(sold, apart, run))).context()
    assert [line["sensor"] for line in context["ranking"]] == ["sold"]
    assert context["apart"] == {"fused": "day1 does not decide: not sold"}


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
    assert [line["tuning"] for line in context["lines"]] == ["likelihood"]
    assert [line["reason"] for line in context["lacking"]] == ["no model lies above the curve"]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, list[dict[str, Any]]]:
    """The page of forty tunings of all sizes, unfolded, and the rows of the table."""
    rng = np.random.default_rng(3)

    def drawn(tuning: int) -> dict[str, Any]:
        sizes = {
            name: float(size)
            for name, size in navigation_row().items()
            if name.startswith(("position", "velocity", "heading"))
        }
        names = list(TUNINGS)
        return navigation_row(
            tuning=names[tuning % len(names)], outage=10.0 * (1 + tuning // len(names)),
            nees_inside=rng.uniform(0.5, 1.0), states=15 + tuning, outages=40 + tuning,
            **{name: size * 10.0 ** rng.uniform(-3.0, 4.0) for name, size in sizes.items()},
        )  # fmt: skip

    table = [drawn(k) for k in range(40)]
    folder = tmp_path_factory.mktemp("navigation")
    publish(site(joined(recording_rows("imu"), {"navigation": table})), folder)
    return unfolded((folder / "navigation.html").read_text()), table


def test_its_numbers_are_those_of_the_table(page: tuple[str, list[dict[str, Any]]]) -> None:
    text, table = page
    part = text[text.index('id="tunings"') :]
    heads = [re.sub("<[^>]*>", "", one) for one in re.findall(r"<th scope=\"col\".*?</th>", part)]
    lines = re.findall(r"<tr data-trajectory.*?</tr>", part, re.DOTALL)
    assert len(lines) == len(table)
    degrees = 180.0 / math.pi
    columns = {
        "Position, m": ("position", 1.0),
        "over that of the true model": ("position_ratio", 1.0),
        "Velocity, m/s": ("velocity", 1.0),
        "Heading, °": ("heading", degrees),
    }
    for line, row in zip(lines, table, strict=True):
        texts = re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", line)
        cells = dict(zip(heads, (re.sub("<[^>]*>", "", one) for one in texts), strict=True))
        for head, (name, factor) in columns.items():
            seen = [number(one) for one in re.split(r" \(| to |\)", cells[head]) if one]
            values = [factor * row[name + end] for end in ("", "_lower", "_upper")]
            assert seen == [float(f"{value:.2e}") for value in values], (head, cells[head])
        assert number(cells["Filter expects, m"]) == float(f"{row['position_predicted']:.2e}")
        assert number(cells["NEES inside"].split(" ")[0]) == float(
            f"{100 * row['nees_inside']:.2e}"
        )
        assert cells["Outage"] == f"{row['outage']:g} s"
        assert cells["States"] == str(row["states"])
        assert cells["Of"] == f"{row['outages']} outages"


def test_without_a_script_a_table_says_how_much_of_it_stands_there(
    page: tuple[str, list[dict[str, Any]]],
) -> None:
    (note,) = re.findall("<noscript>(.*?)</noscript>", page[0])
    assert "30 of 40 rows;" in note
