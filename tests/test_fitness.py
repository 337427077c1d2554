"""Whether recordings decide: what findings, statuses and verdicts on models make of them."""

from collections.abc import Iterable, Sequence
from typing import Any

import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.extensions.fusion.tables import RECORDINGS_OF_A_PAIR, FusionRow
from imubench_pipeline.model.comparisons import ErrorBudgetRow, PooledRow
from imubench_pipeline.model.estimates import ModelRow, ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, FindingRow, RecordingRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.navigation.pooled import list_pooled_rows
from imubench_pipeline.recordings.fitness import (
    attach_doubts,
    attach_doubts_to_pools,
    derive_doubts,
    doubt_unsold_sensors,
    judge_fitness,
    judge_recordings,
    list_excluded,
    mask_excluded,
)
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.files import build
from imubench_pipeline.words.findings import FINDINGS
from tests.ranking import ranking_rows
from tests.rows import typed
from tests.test_selection import errors_of

ABOUT = {"sensor": "s", "recording": "a", "status": "ok"}
OTHER = ABOUT | {"sensor": "other"}
KEY = {"sensor": "s", "recording": "a", "channel": "gyro_x"}


def test_what_is_not_sold_decides_nothing() -> None:
    (doubt,) = doubt_unsold_sensors(typed(RecordingRow, [ABOUT, OTHER]), {"s"})
    row = verdict([doubt])
    assert (row.fitness, row.decides, row.doubts) == ("unfit", False, (DoubtMark("a", "not_sold"),))
    assert list_excluded([row]) == {("s", "a"): row.doubts}


def marked(*codes: str, recording: str = "a") -> tuple[DoubtMark, ...]:
    return tuple(DoubtMark(recording, code, ("gyro_x",)) for code in codes)


def verdict(found: Iterable[DoubtRow], include: Sequence[str] = (), **changes: Any) -> RecordingRow:
    (row,) = judge_recordings(typed(RecordingRow, [ABOUT | changes]), found, include)
    return row


def finding(name: str, severity: str = "warning", value: float = 1.0) -> FindingRow:
    detail = f"about {name}"
    return FindingRow(**KEY, finding=name, severity=severity, detail=detail, value=value)


def model(verdict: str, chosen: bool = True) -> ModelRow:
    (row,) = typed(ModelRow, [KEY | {"chosen": chosen, "verdict": verdict}])
    return row


def parameter(status: str) -> ParameterRow:
    about = {"parameter": "K", "status": status, "reason": "drift"}
    (row,) = typed(ParameterRow, [KEY | about])
    return row


def test_a_log_of_which_nothing_is_found_is_fit() -> None:
    found = list(
        derive_doubts(
            [finding("lines", "note")], [parameter("not_identified")], [model("explained")]
        )
    )
    assert found == []
    assert judge_fitness(found) == "fit"
    row = verdict(found)
    assert (row.fitness, row.decides, row.doubts) == ("fit", True, ())


@pytest.mark.parametrize("name", sorted(code for code, kind in FINDINGS.items() if kind.unfit))
def test_unfit_recording_is_excluded_unless_included(name: str) -> None:
    severity = "fatal" if name == "stuck" else "warning"
    found = list(derive_doubts([finding("truncated"), finding(name, severity)], [], []))
    row = verdict(found)
    assert (row.fitness, row.decides) == ("unfit", False)
    assert row.doubts == marked(name, "truncated")
    assert list_excluded([row]) == {("s", "a"): row.doubts}
    asked_for = verdict(found, ["s/a"])
    assert (asked_for.fitness, asked_for.decides) == ("unfit", True)
    assert list_excluded([asked_for]) == {}


def test_other_doubts_leave_the_figures_and_are_said() -> None:
    found = list(
        derive_doubts([finding("bias_step")], [], [model("not explained"), model("x", False)])
    )
    row = verdict(found)
    assert (row.fitness, row.decides) == ("fit with doubts", True)
    assert row.doubts == marked("bias_step", "not_explained")
    slow = ("B", "B_curve", "K", "R", "T_B", "bias", "sigma_min", "tau_min")
    assert found[0].parameters == slow
    assert found[1].parameters == ()


def test_a_doubtful_parameter_is_no_doubt_of_the_log() -> None:
    (one,) = derive_doubts([], [parameter("doubtful")], [])
    assert one.parameters == ("K",)
    assert one.reason == "drift"
    assert judge_fitness([one]) == "fit"


def test_a_unit_mixed_up_has_its_factor() -> None:
    (one,) = derive_doubts([finding("suspicious_unit", value=57.29577951)], [], [])
    assert one.factor == 57.29577951
    assert "T_B" not in one.parameters and "N" in one.parameters


def test_a_unit_of_time_mixed_up_has_a_factor_for_each_parameter() -> None:
    found = list(derive_doubts([finding("rate_implausible", value=1e-6)], [], []))
    assert {one.parameters: one.factor for one in found} == {
        ("N",): pytest.approx(1e-3),
        ("Q", "T_B", "tau_min"): pytest.approx(1e-6),
        ("K",): pytest.approx(1e3),
        ("R",): pytest.approx(1e6),
    }
    assert judge_fitness(found) == "unfit"
    assert verdict(found).doubts == marked("rate_implausible")


def test_a_recording_that_was_not_analysed_does_not_decide() -> None:
    for status in ("rejected", "failed"):
        row = verdict(derive_doubts([finding("rejected", "fatal")], [], []), status=status)
        assert (row.fitness, row.decides, row.doubts) == (None, False, ())
        assert list_excluded([row]) == {}  # it is reported as rejected


def test_pools_are_those_without_the_unfit_recording_and_count_it() -> None:
    def row(recording: str, value: float) -> dict[str, Any]:
        about = {"sensor": "s", "recording": recording, "channel": "gyro_x", "recommended": True}
        limits = {"value": value, "lower": 0.99 * value, "upper": 1.01 * value}
        return about | limits | {"parameter": "N", "status": "ok", "unit": "x"}

    rows = typed(ParameterRow, [row("a", 1.0), row("b", 1.01), row("c", 57.3)])
    apart = {("s", "c"): marked("motion", recording="c")}
    (pooled,) = list_pooled_rows(mask_excluded(rows, apart), [], {})
    (without,) = list_pooled_rows(rows[:2], [], {})
    assert pooled["value"] == without["value"]
    assert (pooled["recordings"], pooled["left_out"]) == (2, 1)
    assert "1 recording not used (the recording is in doubt)" in pooled["reasons"]


def test_rows_get_the_doubts_of_their_recordings() -> None:
    moved = {"device": "two", "decides": False, "doubts": marked("motion", recording="c")}
    about = typed(
        RecordingRow,
        [
            ABOUT | {"device": "one", "decides": True, "doubts": marked("lines")},
            ABOUT | {"recording": "b", "device": "two", "decides": True, "doubts": ()},
            ABOUT | {"recording": "c"} | moved,
        ],
    )
    rows = typed(ErrorBudgetRow, [{"sensor": "s", "recording": name} for name in "ab"])
    assert [row.doubts for row in attach_doubts(rows, about)] == [("lines",), ()]
    pair = {"sensor": "s", "recording": "b", "other": "s", "other_recording": "a"}
    pairs = typed(FusionRow, [pair])
    assert [row.doubts for row in attach_doubts(pairs, about, RECORDINGS_OF_A_PAIR)] == [("lines",)]
    pools = typed(PooledRow, [{"sensor": "s", "device": device} for device in (None, "one", "two")])
    said = [row.doubts for row in attach_doubts_to_pools(pools, about)]
    assert said == [marked("lines"), marked("lines"), ()]


def asked() -> Requirement:
    limits = [{"error": "heading", "after": "60 s", "at_most": "1 deg"}]
    return Requirement.model_validate({"title": "t", "static_window": "1 h", "limits": limits})


def test_a_ranking_stands_on_the_recordings_that_decide() -> None:
    def gyro(N: float) -> dict[str, Estimate]:
        return {"gyro_x": Estimate("likelihood", {"N": Parameter(N, "ok", None, N, N)})}

    requirement = {"robot": asked()}
    fine, moved = (list(errors_of({"s": gyro(N)}, requirement)) for N in (1e-4, 1e-2))
    both = fine + [row | {"recording": "moved"} for row in moved]
    moved_doubts = marked("motion", recording="moved")
    told = ABOUT | {"device": "d", "simulated": False, "duration": 7200.0}
    about = [
        told | {"recording": "r", "decides": True, "doubts": marked("lines", recording="r")},
        told | {"recording": "moved", "decides": False, "doubts": moved_doubts},
    ]
    prices = {"s": {"price_class": None}}
    (alone,) = build("ranking", ranking_rows(fine, requirement, prices, about[:1])).to_pylist()
    (found,) = build("ranking", ranking_rows(both, requirement, prices, about)).to_pylist()
    moved_mark = {"recording": "moved", "code": "motion", "channels": ["gyro_x"]}
    assert found["left_out"] == [moved_mark]
    assert found["doubts"] == [{"recording": "r", "code": "lines", "channels": ["gyro_x"]}]
    assert found | {"left_out": []} == alone
    only = both[len(fine) :]
    (none,) = build("ranking", ranking_rows(only, requirement, prices, about)).to_pylist()
    assert none["verdict"] == "not_enough_data"
    assert none["reasons"] == ["recording moved is not used: the sensor was moved"]
    assert none["rank"] is None
    assert none["logged_verdict"] == "fails" and none["corrected_verdict"] is None
