"""From a kept log and its estimates to rows, findings, doubts and the ranking."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.model.estimates import BacktestRow, DeterministicRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.navigation.backtest.comparison import findings, list_backtest_rows
from imubench_pipeline.navigation.expected_errors import list_error_rows, list_requirement_questions
from imubench_pipeline.recordings.fitness import derive_doubts, judge_recordings
from imubench_pipeline.recordings.recording import ChannelLog, LogWriter, open_channel_logs
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.files import build
from tests.ranking import ranking_rows
from tests.rows import typed

RATE, SAMPLES, N = 5.0, 40_000, 1e-4
NAMES = {"sensor": "s", "recording": "r"}
ROBOT = Requirement.model_validate(
    {
        "title": "a robot",
        "static_window": "30 s",
        "limits": [
            {"error": "heading", "after": "600 s", "at_most": "5 deg"},
            {"error": "velocity", "after": "10 s", "at_most": "1 m/s"},
        ],
    }
)


def kept(folder: Path, **columns: np.ndarray) -> dict[str, ChannelLog]:
    folder.mkdir()
    with LogWriter(folder / "log.parquet", dict.fromkeys(columns, pa.float64())) as writer:
        writer.write(columns)
        samples = len(next(iter(columns.values())))
        holes = {name: bool(np.isnan(values).any()) for name, values in columns.items()}
        writer.finish({"rate": RATE, "grid": samples, "segments": [[0, samples]],
                       "holes": holes, "unusable": []})  # fmt: skip
    return open_channel_logs(folder)


def rows_of(
    logs: dict[str, ChannelLog],
    estimates: dict[str, Estimate],
    requirement: Requirement = ROBOT,
    **taken_out: str,
) -> list[BacktestRow]:
    kinds = [{"channel": channel, "kind": kind} for channel, kind in taken_out.items()]
    apart = typed(DeterministicRow, kinds)
    asked = {"robot": requirement}
    found = list_backtest_rows(NAMES, logs, estimates, asked, apart, draws=50, seed=1)
    return BacktestRow.rows_of(build("backtest", found))


@pytest.fixture(scope="module")
def white() -> tuple[np.ndarray, Estimate]:
    log = N * np.sqrt(RATE) * np.random.default_rng(6).standard_normal(SAMPLES)
    return log, fit(log, RATE).estimates[0]


def test_a_log_of_white_noise_drifts_as_its_budget_says(
    white: tuple[np.ndarray, Estimate], tmp_path: Path
) -> None:
    log, estimate = white
    estimates = {"gyro_x": estimate, "accel_x": estimate}
    logs = kept(tmp_path / "r", gyro_x=log + 0.01, accel_x=9.81 + log)
    rows = {(row["channel"], row["error"]): row for row in rows_of(logs, estimates)}
    # The heading has no part of an accelerometer.
    assert set(rows) == {("gyro_x", "heading"), ("gyro_x", "velocity"), ("accel_x", "velocity")}
    heading = rows["gyro_x", "heading"]
    assert heading["predicted"] == pytest.approx(N * np.sqrt(600 + 600**2 / 30), rel=0.02)
    assert heading["ratio"] == pytest.approx(heading["measured"] / heading["predicted"])
    for row in rows.values():
        assert row["ratio_lower"] < row["ratio"] < row["ratio_upper"]
        assert row["verdict"] == "as predicted" and not row["contradicted"]
        assert 1.0 < row["independent"] < row["windows"]
    # Most of it is the mean over 30 s, of which there are 247 in what is left of 8,000 s.
    assert 150 < heading["independent"] < 1.5 * 247
    assert not list(findings(rows.values()))
    assert list(rows.values()) == rows_of(logs, estimates)


def test_unmodelled_drift_adds_a_doubt_to_the_ranking(
    white: tuple[np.ndarray, Estimate], tmp_path: Path
) -> None:
    log, estimate = white
    day = 20.0 * N / np.sqrt(30.0) * np.sin(2 * np.pi * np.arange(SAMPLES) / SAMPLES)
    estimates = {"gyro_x": estimate, "accel_x": estimate}
    rows = rows_of(
        kept(tmp_path / "r", gyro_x=log + day, accel_x=log), estimates, gyro_x="periodic_drift"
    )
    heading = next(row for row in rows if row["error"] == "heading")
    assert heading["ratio"] > 1.5 * heading["ratio_upper"] and heading["contradicted"]
    assert heading["taken_out"] == ("periodic_drift",)
    (finding,) = findings(rows)
    assert finding["channel"] == "gyro_x" and finding["value"] == heading["ratio"]
    assert "periodic drift" in finding["detail"] and "600 s" in finding["detail"]
    (doubt,) = derive_doubts([finding], [], [])
    assert doubt.fitness != "unfit" and {"K", "B_curve"} <= set(doubt.parameters)
    about = RecordingRow(
        **NAMES,
        device="r",
        kind="static",
        status="ok",
        simulated=True,
        duration=SAMPLES / RATE,
    )
    (told,) = judge_recordings([about], [doubt], ())
    assert told.doubts == (DoubtMark("r", "backtest_contradicts", ("gyro_x",)),)
    questions = list_requirement_questions("robot", ROBOT)
    errors = list_error_rows(NAMES, estimates, questions, draws=20, seed=1)
    ranking = build(
        "ranking",
        ranking_rows(
            build("error_budget", errors).to_pylist(),
            {"robot": ROBOT},
            {"s": {"price_class": None}},
            [told],
            backtests=rows,
        ),
    ).to_pylist()
    by_error = {row["error"]: row for row in ranking}
    assert by_error["heading"]["backtest_ratio"] == heading["ratio"]
    assert by_error["heading"]["backtest_windows"] == heading["windows"]
    # Of a velocity error the gyro's tilt is the larger part here, and its log answers.
    largest = by_error["velocity"]["parts"][0]["quantity"]
    assert by_error["velocity"]["backtest_channel"] == f"{largest}_x"


def test_what_a_log_cannot_show_has_its_reason(
    white: tuple[np.ndarray, Estimate], tmp_path: Path
) -> None:
    log, estimate = white
    short = kept(tmp_path / "short", gyro_x=log[:3275])  # 655 s, of which 218 blocks of 3 s
    heading, velocity = rows_of(short, {"gyro_x": estimate})
    assert "need 1890 s" in heading["reason"] and "654 s" in heading["reason"]
    assert heading["duration_needed"] == 1890.0 and heading["ratio"] is None
    assert heading["predicted"] > 0.0 and heading["contradicted"] is None
    assert velocity["ratio"] is not None
    holed = log.copy()
    holed[::1000] = np.nan
    holed[1::1000] = np.nan
    holed[2::1000] = np.nan
    # Three samples every 200 s: no window of 630 s is without one of a block.
    gaps, between = rows_of(kept(tmp_path / "holed", gyro_x=holed), {"gyro_x": estimate})
    assert gaps["reason"].startswith("gaps leave 0 overlapping windows")
    assert between["verdict"] == "as predicted"
    other = Requirement.model_validate(
        {
            "title": "t",
            "turn_on": {"gyro": "0.2 deg/s", "accel": "20 mg"},
            "latitude": "45 deg",
            "limits": [
                {"error": "heading", "after": "60 s", "at_most": "5 deg"},
                {"error": "north", "after": "60 s", "at_most": "5 deg"},
            ],
        }
    )
    turned_on, north = rows_of(short, {"gyro_x": estimate}, other)
    assert "one turn-on bias" in turned_on["reason"] and "Earth" in north["reason"]
    unknown = Estimate("likelihood", {"N": Parameter(None, "not_shown", "too short")})
    assert "noise of this channel is not known" in rows_of(short, {"gyro_x": unknown})[0]["reason"]
