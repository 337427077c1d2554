from pathlib import Path
from typing import Any

from imubench_pipeline.extensions.fusion.page import (
    FUSION,
    PairLine,
    describe_common_errors,
    find_unprinted_grades,
    make_grade_lines,
    make_matrices,
    make_pair_lines,
)
from imubench_pipeline.extensions.fusion.tables import FusionRow, GradeRow
from imubench_pipeline.report.publish import publish
from imubench_pipeline.tables.files import build
from tests.report.tables import joined, recording_rows, site

ROW = {"quantity": "gyro", "tau": 10.0, "sensor": "a", "recording": "r", "channel": "gyro_x",
       "simulated": True, "adev": 3e-5, "floor": 1e-6, "common_share": 0.125, "other": "b",
       "other_recording": "q", "other_channel": "gyro_z", "other_simulated": False,
       "other_adev": 1e-5, "n": 10.2, "lower": 8.0, "upper": 12.9,
       "reachable": True}  # fmt: skip


def line(**changes: Any) -> PairLine:
    (found,) = make_pair_lines(FusionRow.rows_of(build("fusion", [ROW | changes])))
    return found


def test_numbers_are_rounded_up() -> None:
    found = line()
    assert (found.number, found.limits) == ("11", "8 to 13")
    assert (found.tau, found.common, found.quantity) == ("10 s", "12.5 %", "Gyroscope")
    assert (found.row.simulated, found.row.other_simulated) == (True, False)
    assert line(n=9.000000000001).number == "9"
    assert line(n=1.2, lower=0.4, upper=2.0).limits == "1 to 2"
    assert line(n=9.5, lower=9.1, upper=9.9).limits == "10"


def test_what_no_number_reaches_is_said() -> None:
    found = line(n=None, lower=None, upper=None, reachable=False, reasons=["a floor"])
    assert (found.number, found.limits, found.row.reasons) == ("not possible", "", ("a floor",))
    assert line(upper=None).limits == "8 or more"
    assert line(n=None).number == "–"


def test_only_the_worse_of_two_is_multiplied() -> None:
    rows = FusionRow.rows_of(build("fusion", [ROW | {"adev": 1e-5, "other_adev": 3e-5, "n": 0.1}]))
    assert list(make_pair_lines(rows)) == []


def test_what_is_not_known_of_a_pair_is_said_once() -> None:
    nothing = dict.fromkeys(("adev", "floor", "common_share", "n", "lower", "upper", "reachable"))
    one = ROW | nothing | {"reasons": ["too short"]}
    two = one | {"sensor": "b", "other": "a", "adev": 1e-5, "other_adev": None}
    (found,) = make_pair_lines(FusionRow.rows_of(build("fusion", [one, two])))
    assert (found.row.sensor, found.number, found.common) == ("a", "–", "–")


def test_the_page_says_what_it_assumes() -> None:
    assert "independent" in describe_common_errors({"N": 0.0, "B": 0.0, "K": 0.0, "R": 0.0})
    assert describe_common_errors({"N": 0.125, "B": 0.0, "K": 1.0, "R": 0.0}).startswith(
        "The units of one sensor are assumed to share 12.5 % of the variance of the white noise "
        "(N), 100 % of the variance of the random walk (K). The effect of a logged temperature"
    )


def test_fusion_line_shows_temperature_share_of_the_common_part() -> None:
    assert line(temperature_share=0.1).common == "12.5 % (temperature 10 %)"
    assert line(temperature_share=0.0).common == "12.5 %"


def test_equal_sensors_have_no_line_and_undetermined_ones_one_line(
    tmp_path: Path,
) -> None:
    made = site(joined(*(recording_rows(name) for name in ("one", "two"))), tmp_path)
    (found,) = FUSION.page(made).context()["lines"]
    assert (found.tau, found.number) == ("1000 s", "–")
    assert found.row.reasons[0].startswith("the logs of one tell tau up to 800 s alone")


def test_a_single_sensor_is_not_compared(tmp_path: Path) -> None:
    found = FUSION.page(site(joined(recording_rows("one")), tmp_path)).context()
    assert found["lines"] == []
    assert set(found["price_classes"]) == {"one"}


GRADE = {"quantity": "gyro", "sensor": "a", "recording": "r", "channel": "gyro_x",
         "simulated": True, "grade": "b", "grade_name": "V B", "option": "C", "statistic": "N",
         "value": 3e-5, "lower": 2.9e-5, "upper": 3.1e-5, "printed": 1e-5, "n": 9.0,
         "n_lower": 8.41, "n_upper": 9.61}  # fmt: skip


def test_grade_line_has_noise_and_lowest_point() -> None:
    floor = GRADE | {"statistic": "sigma_min", "value": None, "n": None, "n_lower": 0.0,
                     "n_upper": 4.2, "reason": "it still falls"}  # fmt: skip
    (found,) = make_grade_lines(GradeRow.rows_of(build("grades", [GRADE, floor])))
    assert (found.row.grade_name, found.row.option) == ("V B", "C")
    noise, lowest = found.cells
    assert noise[2:] == ("9", "9 to 10")
    assert lowest[2:] == ("–", "at most 5")
    assert lowest[1].reason == "it still falls"


def test_a_class_of_which_nothing_is_printed_has_no_line() -> None:
    nothing = GRADE | {"printed": None, "n": None, "n_lower": None, "n_upper": None}
    table = build(
        "grades", [GRADE, nothing | {"grade": "d", "grade_name": "V D", "reason": "it prints none"}]
    )
    rows = GradeRow.rows_of(table)
    (found,) = make_grade_lines(rows)
    assert found.row.grade_name == "V B"
    assert find_unprinted_grades(rows) == {"V D, gyroscope": "it prints none"}


def test_what_is_not_printed_of_a_class_is_said_on_the_page(tmp_path: Path) -> None:
    other = GRADE | {"sensor": "one", "printed": None, "n": None, "n_lower": None,
                     "n_upper": None, "grade": "d", "grade_name": "V D",
                     "reason": "it prints none"}  # fmt: skip
    rows = build("grades", [GRADE | {"sensor": "one"}, other])
    tables = joined(*(recording_rows(name) for name in ("one", "two"))) | {"grades": rows}
    publish(site(tables), tmp_path)
    page = (tmp_path / "fusion.html").read_text(encoding="utf-8")
    assert "is comparable: V D, gyroscope (it prints none)." in page


def test_a_matrix_has_the_quietest_first_and_a_number_where_one_is_not_enough() -> None:
    rows = [
        ROW,
        ROW | {"other": "c", "other_adev": 2e-5, "n": 2.3, "lower": 2.0, "upper": 2.6},
        ROW | {"sensor": "c", "adev": 2e-5, "n": 4.0, "lower": 3.1, "upper": 5.0},
    ]
    (matrix,) = make_matrices(list(make_pair_lines(FusionRow.rows_of(build("fusion", rows)))))
    assert (matrix.name, matrix.sensors) == ("Gyroscope, 10 s", ["b", "c", "a"])
    assert matrix.levels == [1e-5, 2e-5, 3e-5]
    numbers = [[cell and cell.number for cell in row] for row in matrix.cells]
    assert numbers == [[None, None, None], ["4", None, None], ["11", "3", None]]


def test_a_sensor_of_which_nothing_is_known_is_in_no_matrix() -> None:
    row = ROW | {"adev": None, "n": None, "lower": None, "upper": None, "reasons": ["too short"]}
    assert (
        list(make_matrices(list(make_pair_lines(FusionRow.rows_of(build("fusion", [row])))))) == []
    )
