"""Verdicts on sensors with figures that are not known, by sums of squares by hand."""

import math
from collections.abc import Iterable
from typing import Any

import pytest

from imubench_pipeline.datasheets.class_limits import count_sensors_within, find_limit
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.navigation.error_budget.in_use import collect_figures_in_use, read_figures
from imubench_pipeline.navigation.expected_errors import list_error_rows, list_requirement_questions
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.files import build
from tests.ranking import ranking_rows
from tests.test_class_limits import sensor

CHANNELS = ("gyro_x", "accel_x")
N = 5e-5
GRADE = "industrial"
NOISE = N * math.sqrt(60.0 + 60.0**2 / 3600.0)
LEVERS = {
    # A change of 10 K comes evenly within the minute; the sensor turns by 360 deg.
    "temperature": 10.0 * 60.0 / 2.0,
    "scale_factor": 2.0 * math.pi,
    "nonlinearity": 2.0 * math.pi,
    "scale_factor_temperature": 10.0 * 2.0 * math.pi,
}
SMALL = {cause: 1e-3 / lever for cause, lever in LEVERS.items()}
"""Figures that add 1 mrad to the heading each."""


def combine(figures: dict[str, float], noise: float = NOISE) -> float:
    """Return the heading error, rad: the root of the sum of squares."""
    return math.hypot(noise, *(LEVERS[cause] * size for cause, size in figures.items()))


def limits(end: str, *unknown: str) -> dict[str, float]:
    """Return figures of the class for causes that are not known."""
    return {cause: getattr(find_limit(GRADE, "gyro", cause), end) for cause in unknown}


def requirement(at_most: float, error: str = "heading", **keys: Any) -> Requirement:
    """Return a requirement with a limit of 1 sigma, rad."""
    limit = {"error": error, "after": "60 s", "at_most": f"{at_most * 1.959963984540054} rad"}
    given = {"title": "t", "static_window": "1 h", "limits": [limit],
             "environment": {"turns": "360 deg", "temperature_change": "10 K"}}  # fmt: skip
    return Requirement.model_validate(given | keys)


def printed(figures: dict[str, float]) -> dict[str, Any]:
    """Return the gyro of a datasheet with figures, SI, of one standard deviation."""
    names = {"temperature": "temperature_coefficient", "scale_factor": "scale_factor_error"}
    units = {"temperature": "rad/s/K", "scale_factor_temperature": "1/K"}
    return {
        names.get(cause, cause): {"value": size, "unit": units.get(cause, "1"), "kind": "1sigma"}
        for cause, size in figures.items()
    }


def ranking(asked: Requirement, **sensors: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the deciding rows of sensors, whose noise is known exactly, by their datasheets."""
    rows: list[Any] = []
    for name, sheet in sensors.items():
        estimates = {
            channel: Estimate("likelihood", {"N": Parameter(noise, lower=noise, upper=noise)})
            for channel, noise in zip(CHANNELS, (N, 1e-3), strict=True)
        }
        declared = sensor(
            grade=GRADE, datasheet={"gyro": {}, "accel": {}, "source": "primary"} | sheet
        )
        figures = collect_figures_in_use(
            {quantity: read_figures(declared, quantity) for quantity in ("gyro", "accel")},
            CHANNELS,
            (),
        )
        names = {"sensor": name, "recording": "r"}
        questions = list(list_requirement_questions("robot", asked))
        rows += list_error_rows(names, estimates, questions, draws=100, seed=1, figures=figures)
    about = {name: {"price_class": None} for name in sensors}
    errors = build("error_budget", rows).to_pylist()
    found = build("ranking", ranking_rows(errors, {"robot": asked}, about)).to_pylist()
    return {row["sensor"]: row for row in found if row["decides"]}


def without(*causes: str) -> dict[str, float]:
    return {cause: size for cause, size in SMALL.items() if cause not in causes}


def middle(causes: Iterable[str]) -> float:
    """Return a limit between the errors with the best and the worst of the class."""
    known = without(*causes)
    ends = (combine(known | limits(end, *causes)) for end in ("best", "worst"))
    return math.sqrt(math.prod(ends))


def test_a_sensor_whose_figures_are_known_passes_without_a_condition() -> None:
    row = ranking(requirement(0.01), known={"gyro": printed(SMALL)})["known"]
    assert (row["verdict"], row["conditions"]) == ("meets", [])
    assert row["margin"] == row["likely_margin"] == pytest.approx(0.01 / combine(SMALL))
    assert row["noise_margin"] == pytest.approx(0.01 / NOISE)
    origins = {part["source"]: part["origin"] for part in row["parts"]}
    assert origins == dict.fromkeys(SMALL, "datasheet") | {"N": "measured"}


UNKNOWN = [("scale_factor",), ("scale_factor", "temperature")]


@pytest.mark.parametrize("unknown", UNKNOWN)
def test_an_unknown_figure_counts_as_the_worst_of_its_class(unknown: tuple[str, ...]) -> None:
    limit, known = middle(unknown), without(*unknown)
    worst = printed(known | limits("worst", *unknown))
    rows = ranking(requirement(limit), silent={"gyro": printed(known)}, worst={"gyro": worst})
    for row in rows.values():
        assert row["margin"] == pytest.approx(
            limit / combine(known | limits("worst", *unknown)), rel=1e-3
        )
    assert rows["silent"]["likely_margin"] == pytest.approx(
        limit / combine(known | limits("median", *unknown)), rel=1e-3
    )
    # Silence is no better than the worst figure; it has conditions.
    assert (rows["silent"]["verdict"], rows["worst"]["verdict"]) == ("meets_if", "fails")
    assert rows["silent"]["rank"] == rows["worst"]["rank"] == 1


@pytest.mark.parametrize("unknown", UNKNOWN)
def test_the_largest_figures_just_meet_the_limit(unknown: tuple[str, ...]) -> None:
    """They share the room that the others leave equally."""
    limit, known = middle(unknown), without(*unknown)
    asked = requirement(limit)
    conditions = ranking(asked, s={"gyro": printed(known)})["s"]["conditions"]
    largest = {each["figure"]: each["largest"] for each in conditions}
    room = math.sqrt((limit**2 - combine(known) ** 2) / len(unknown))
    assert largest == {cause: pytest.approx(room / LEVERS[cause]) for cause in unknown}
    for each in conditions:
        assert (each["subject"], each["property"]) == ("gyro", None)
        counts = count_sensors_within("gyro", each["figure"], each["largest"])
        assert (each["within"], each["printing"]) == counts
    for share, verdict in ((0.999, "meets"), (1.001, "fails")):
        sheet = printed(known | {cause: share * size for cause, size in largest.items()})
        row = ranking(asked, s={"gyro": sheet})["s"]
        assert (row["verdict"], row["conditions"]) == (verdict, [])


def test_what_fails_with_the_best_of_the_class_has_no_condition() -> None:
    known = without("scale_factor")
    best = combine(known | limits("best", "scale_factor"))
    for limit, verdict in ((0.99 * best, "fails"), (1.01 * best, "meets_if")):
        row = ranking(requirement(limit), s={"gyro": printed(known)})["s"]
        assert (row["verdict"], bool(row["conditions"])) == (verdict, verdict == "meets_if")


def test_a_levelled_tilt_has_the_turn_on_bias_of_the_accelerometer() -> None:
    asked = requirement(math.radians(2.0), "attitude", environment={})
    offset = {"offset": {"value": 50, "unit": "mg", "kind": "typ"}}
    found = ranking(asked, known={"accel": offset}, unknown={})
    # 50 mg are a tilt of 50 mrad; the noise of the window adds little.
    misaligned = find_limit(GRADE, "accel", "misalignment").worst  # which tilts as well
    noise = math.hypot(NOISE, 1e-3 / 60.0 / 9.80665, misaligned)
    assert found["known"]["margin"] == pytest.approx(math.radians(2.0) / math.hypot(0.05, noise))
    assert (found["known"]["verdict"], found["known"]["conditions"]) == ("fails", [])
    part, misaligned_part = found["known"]["parts"]
    assert misaligned_part["origin"] == "class limit"
    assert (part["source"], part["quantity"], part["through"], part["origin"]) == (
        *("turn_on_bias", "accel"),
        *("initial_tilt", "datasheet"),
    )
    assert found["unknown"]["verdict"] == "meets_if"
    (condition,) = found["unknown"]["conditions"]
    assert (condition["figure"], condition["subject"]) == ("turn_on_bias", "accel")
    room = math.sqrt(math.radians(2.0) ** 2 - noise**2)
    assert condition["largest"] == pytest.approx(9.80665 * room)


def test_no_figure_helps_where_another_limit_fails() -> None:
    unknown = ("scale_factor",)
    one = requirement(middle(unknown)).limits[0].model_dump(exclude_none=True)
    asked = requirement(1.0, limits=[one, one | {"after": "30 s", "at_most": "0.001 deg"}])
    row = ranking(asked, s={"gyro": printed(without(*unknown))})["s"]
    assert (row["verdict"], row["conditions"]) == ("fails", [])


@pytest.mark.parametrize("unknown", [(), *UNKNOWN])
def test_properties_that_are_not_known_are_conditions(unknown: tuple[str, ...]) -> None:
    limit = middle(unknown) if unknown else 0.01
    asked = requirement(limit, must={"mass": "30 g", "axes": ["gyro_x"]})
    row = ranking(asked, s={"gyro": printed(without(*unknown))})["s"]
    assert (row["verdict"], row["shortfalls"], row["rank"]) == ("meets_if", [], None)
    properties = [each for each in row["conditions"] if each["property"]]
    assert len(row["conditions"]) == len(unknown) + len(properties)
    assert [(each["property"], each["subject"]) for each in properties] == [
        ("axis", "gyro_x"),
        ("mass", ""),
    ]
    # A sensor that fails has none.
    (failing,) = ranking(requirement(1e-4, must={"mass": "30 g"}), s={}).values()
    assert (failing["verdict"], failing["conditions"]) == ("fails", [])
