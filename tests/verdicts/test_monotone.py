"""Silence never wins: a figure that is deleted or made worse never improves a sensor's verdict."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.datasheets.class_limits import FIGURES, find_limit, read_sigma
from imubench_pipeline.model.comparisons import ShortlistRow
from imubench_pipeline.navigation.shortlist import list_shortlist_rows, make_order
from imubench_pipeline.navigation.suitability import PASSING_VERDICTS
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import Sensor, read_sensors
from tests.conftest import PROJECT

SENSORS = {n: s for n, s in read_sensors(PROJECT / "config/sensors").items() if s.sold}
LARGER_IS_BETTER = ("full_scale", "bandwidth")
REQUIREMENTS = {
    name: Requirement.model_validate({"title": name, **stated})
    for name, stated in {
        "warehouse": {
            "static_window": "30 s",
            "limits": [{"error": "cross_track", "after": "30 s", "at_most": "0.3 m"}],
            "environment": {"speed": "1.5 m/s", "turns": "180 deg", "temperature_change": "5 K"},
        },
        "drone": {
            "static_window": "5 s",
            "limits": [
                {"error": "attitude", "after": "10 s", "at_most": "2 deg"},
                {"error": "position", "after": "10 s", "at_most": "30 m"},
            ],
            "environment": {"vibration": "2 g", "speed": "5 m/s", "turns": "90 deg"},
            "must": {"full_scale": {"gyro": "500 deg/s", "accel": "8 g"}, "bandwidth": "50 Hz"},
        },
        "tunnel": {
            "turn_on": {"on_time": "60 s"},
            "limits": [{"error": "velocity", "after": "60 s", "at_most": "10 m/s"}],
            "environment": {"temperature_change": "2 K", "speed_change": "20 m/s"},
            "must": {"temperature": ["-30 degC", "70 degC"], "mass": "100 g", "power": "2 W"},
        },
        "tripod": {
            "static_window": "60 s",
            "latitude": "50 deg",
            "positions": 4,
            "limits": [{"error": "north", "after": "600 s", "at_most": "2 deg"}],
            "environment": {"temperature_change": "1 K"},
        },
        "tripod without turning": {
            "turn_on": {"on_time": "60 s"},
            "latitude": "50 deg",
            "limits": [{"error": "north", "after": "600 s", "at_most": "2 deg"}],
        },
    }.items()
}


@cache
def judge_all() -> dict[str, list[ShortlistRow]]:
    rows: dict[str, list[ShortlistRow]] = {}
    for row in list_shortlist_rows(REQUIREMENTS, SENSORS):
        rows.setdefault(row.requirement, []).append(row)
    return rows


def list_cells(sensor: Sensor) -> Iterator[tuple[str, ...]]:
    """Yield the path of each printed figure, and of each statement of it that others repeat."""
    written = sensor.model_dump(mode="json")
    yield from ((key,) for key in ("mass", "power", "temperature_range") if written[key])
    for quantity in ("gyro", "accel"):
        for name, figures in (written["datasheet"][quantity] or {}).items():
            if figures:
                yield "datasheet", quantity, name
                chosen = [f["option"] in (None, *sensor.datasheet.options) for f in figures]
                # An option that nobody chose is another product.
                if len(figures) > 1 and all(chosen):
                    yield from (("datasheet", quantity, name, str(i)) for i in range(len(figures)))


CELLS = [(name, cell) for name, sensor in SENSORS.items() for cell in list_cells(sensor)]


def change(sensor: Sensor, cell: tuple[str, ...], factor: float | None) -> Sensor:
    """Return a sensor without a figure, or with one that is ``factor`` times as large."""
    written = sensor.model_dump(mode="json")
    *folder, last = cell
    place: Any = written
    for key in folder:
        place = place[int(key) if isinstance(place, list) else key]
    if factor is None:
        if isinstance(place, list):
            del place[int(last)]
        else:
            place[last] = [] if folder and last == "aliases" else None
    else:
        figures = [place[int(last)]] if isinstance(place, list) else place[last]
        for figure in figures:
            figure["value"] = scale(figure["value"], factor)
    return Sensor.model_validate(written)


def scale(value: Any, factor: float) -> Any:
    if isinstance(value, dict):
        return {key: scale(each, factor) for key, each in value.items()}
    if isinstance(value, list):
        return [scale(each, factor) for each in value]
    return None if value is None else value * factor


def compare(name: str, changed: Sensor) -> None:
    """Assert that a version of a sensor is judged no better than the sensor by any requirement."""
    for low in list_shortlist_rows(REQUIREMENTS, {name: changed}):
        everyone = judge_all()[low.requirement]
        (high,) = (row for row in everyone if row.sensor == name)
        where = name, low.requirement, low.verdict, high.verdict
        assert (low.margin or 0.0) <= (high.margin or 0.0) * (1.0 + 1e-9), where
        assert (low.verdict in PASSING_VERDICTS) <= (high.verdict in PASSING_VERDICTS), where
        others = [row for row in everyone if row.sensor != name]
        ranks = [sum(make_order(row) < make_order(own) for row in others) for own in (low, high)]
        assert ranks[0] >= ranks[1], where


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(CELLS))
def test_a_deleted_figure_never_helps(place: tuple[str, tuple[str, ...]]) -> None:
    name, cell = place
    compare(name, change(SENSORS[name], cell, None))


@pytest.mark.release
@pytest.mark.parametrize("name", SENSORS)
def test_no_deleted_figure_of_the_catalogue_helps(name: str) -> None:
    for cell in list_cells(SENSORS[name]):
        compare(name, change(SENSORS[name], cell, None))


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from([(name, cell) for name, cell in CELLS if cell[0] == "datasheet"]),
    st.floats(1.0, 100.0),
)
def test_a_worse_figure_never_helps(place: tuple[str, tuple[str, ...]], factor: float) -> None:
    name, cell = place
    if cell[2] == "noise_density":
        factor = min(factor, 3.0)  # a file with an accelerometer of 1 m/s^2/sqrt(Hz) is refused
    way = 1.0 / factor if cell[2] in LARGER_IS_BETTER else factor
    compare(name, change(SENSORS[name], cell, way))


@pytest.mark.parametrize("name", SENSORS)
def test_no_sensor_is_worse_than_the_limit_of_its_class(name: str) -> None:
    sensor = SENSORS[name]
    for quantity in ("gyro", "accel"):
        for figure in FIGURES:
            own = read_sigma(sensor, quantity, figure) if figure != "g_sensitivity" else None
            if own is not None:
                limit = find_limit(sensor.grade, quantity, figure)
                assert own <= limit.worst * (1.0 + 1e-3) and own >= limit.best * (1.0 - 1e-3)
