from itertools import combinations

import pytest

from imubench_pipeline.report.palette import (
    METHOD_STYLES,
    Appearance,
    assign_sensor_styles,
    make_recording_styles,
)
from imubench_pipeline.report.view import METHOD_NAMES

MARKERS = {"circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x", "star"}
DASHES = {"solid", "dash", "dot", "dashdot", "longdash", "longdashdot"}
DASHES |= {"7px,3px,2px,3px,2px,3px", "11px,3px,5px,3px"}
BACKGROUNDS = {"light": "#ffffff", "dark": "#161a1e"}  # of report.css


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2."""
    parts = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def all_looks() -> list[Appearance]:
    sensors = assign_sensor_styles([str(i) for i in range(8)])
    return [*sensors.values(), *(METHOD_STYLES[name] for name in METHOD_NAMES)]


@pytest.mark.parametrize("scheme", BACKGROUNDS)
def test_every_line_has_a_contrast_of_three_to_one(scheme: str) -> None:
    for look in all_looks():
        assert contrast(getattr(look, scheme), BACKGROUNDS[scheme]) >= 3.0, look


def test_no_two_of_many_sensors_look_alike_even_in_grey() -> None:
    looks = assign_sensor_styles([f"s{i}" for i in range(280)])
    assert list(looks) == [f"s{i}" for i in range(280)]
    assert len(set(looks.values())) == 280
    for eight in (range(8 * turn, 8 * turn + 8) for turn in range(35)):
        assert len({looks[f"s{i}"].light for i in eight}) == 8


def test_sensors_of_one_colour_differ_in_marker_and_dash() -> None:
    looks = list(assign_sensor_styles([str(i) for i in range(40)]).values())
    for one, other in combinations(looks, 2):
        if one.light == other.light:
            assert one.dash != other.dash
            assert (one.marker, one.dash) != (other.marker, other.dash)


def test_no_two_recordings_of_a_sensor_look_alike_until_the_looks_repeat() -> None:
    for own in assign_sensor_styles([str(i) for i in range(12)]).values():
        looks = make_recording_styles(own)
        assert len(looks) == len(set(looks)) >= 50
        assert looks[0] == own
        # Its colour, only darker by day and lighter by night.
        for look in looks:
            assert contrast(look.light, "#ffffff") >= contrast(own.light, "#ffffff") - 0.01
            assert contrast(look.dark, "#161a1e") >= contrast(own.dark, "#161a1e") - 0.01


def test_methods_differ_in_more_than_their_colour() -> None:
    for one, other in combinations([METHOD_STYLES[name] for name in METHOD_NAMES], 2):
        assert one.light != other.light
        assert one.marker != other.marker
        assert one.dash != other.dash


def test_styles_use_markers_and_dashes_of_both_figure_libraries() -> None:
    for look in [*all_looks(), *make_recording_styles(all_looks()[0])]:
        assert look.marker in MARKERS
        assert look.dash in DASHES
        assert look.light != look.dark


def test_a_sensor_keeps_its_look_when_later_ones_are_added() -> None:
    few, more = assign_sensor_styles(["a", "b"]), assign_sensor_styles(["a", "b", "c"])
    assert few == {name: more[name] for name in ("a", "b")}
