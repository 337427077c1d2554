"""Limits of the grades: each has a source, and each grade is better than the one before."""

import csv
import math

import pytest

from imubench_pipeline.datasheets.class_limits import FILE, find_limit, read_grade_limits


@pytest.mark.parametrize("quantity", ["gyro", "accel"])
def test_each_grade_is_better_in_n_and_b(quantity: str) -> None:
    limits = read_grade_limits(quantity)
    assert list(limits) == ["industrial", "tactical", "navigation"]
    for figure in ("N", "B"):
        of = [limit[figure] for limit in limits.values()]
        assert of == sorted(of, reverse=True)


def test_limits_follow_from_their_sources() -> None:
    with FILE.with_name("grade_limits.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        assert row["source"]
        if row["source"].startswith("worst of the class"):
            worst = find_limit(row["grade"], row["quantity"], row["figure"]).worst
            assert float(row["limit"]) == worst
    navigation = read_grade_limits("gyro")["navigation"]
    assert navigation["N"] == pytest.approx(math.radians(0.002) / 60.0, rel=1e-3)
    assert navigation["B"] == pytest.approx(math.radians(0.01) / 3600.0, rel=1e-3)
    navigation = read_grade_limits("accel")["navigation"]
    assert navigation["N"] == pytest.approx(20e-6 * 9.80665, rel=1e-3)
    assert navigation["B"] == find_limit("tactical", "accel", "B").best
