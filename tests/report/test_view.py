from functools import cache
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.report.view import ChannelView, RecordingView, gather_recordings
from imubench_pipeline.tables.files import build, read, write_arrow
from imubench_pipeline.tables.schemas import ROWS, TABLES
from tests.conftest import few
from tests.report.tables import (
    MODEL,
    TAU,
    WITHOUT_K,
    Rows,
    Tables,
    joined,
    recording_rows,
    rejected_rows,
)

CHANNELS = ("gyro_x", "accel_z")


def of(sensor: str, recording: str, **given_: Any) -> Rows:
    finding = {"finding": "missing_samples", "detail": f"of {sensor} {recording}"}
    return recording_rows(sensor, recording, CHANNELS, findings=[finding], **given_)


RUN = joined(
    of("a", "r"),
    of("b", "r", parameters=WITHOUT_K),
    rejected_rows("b", "bad"),
    of("b", "q", simulated=True, printed=False),
)


def shuffled(tables: Tables, seed: int) -> Tables:
    """The same tables with their rows in another order; ``recordings`` as it was."""
    rng = np.random.default_rng(seed)
    return {
        name: table
        if name == "recordings"
        else table.take(pa.array(rng.permutation(table.num_rows), pa.int64()))
        for name, table in tables.items()
    }


def by_name(views: list[RecordingView]) -> dict[tuple[str, str], RecordingView]:
    return {(view.sensor, view.name): view for view in views}


@settings(max_examples=4)
@given(st.integers(0, 2**32))
def test_rows_go_to_their_recording_and_channel_whatever_their_order(seed: int) -> None:
    views = gather_recordings(shuffled(RUN, seed))
    names = [(view.sensor, view.name) for view in views]
    assert names == [("a", "r"), ("b", "r"), ("b", "bad"), ("b", "q")]
    for view in views:
        for table in ("allan", "parameters", "datasheet", "findings", "error_budget", "spectrum"):
            whole = [
                dict(row)
                for row in ROWS[table].rows_of(RUN[table])
                if (row["sensor"], row["recording"]) == (view.sensor, view.name)
            ]
            key = repr
            assert sorted(map(key, map(dict, view.rows(ROWS[table])))) == sorted(map(key, whole)), (
                table
            )
        for channel in view.channels():
            assert (channel.sensor, channel.recording) == (view.sensor, view.name)
            values = {
                row["parameter"]: row["value"] for row in channel.parameters[channel.recommended]
            }
            assert (values["K"] is None) == ((view.sensor, view.name) == ("b", "r"))
            assert set(channel.truth) == ({"N"} if view.simulated else set())
            assert len(channel.datasheet) == (0 if view.name == "q" else 2)
            order = np.argsort(channel.tau)
            np.testing.assert_array_equal(channel.tau[order], TAU)
            np.testing.assert_allclose(
                channel.adev, np.sqrt(channel.model("likelihood").allan_variance(channel.tau))
            )
            assert len(channel.spectrum["frequency"]) == 9
            assert set(channel.reconstruction) == set(channel.scores) == {"likelihood"}
            assert channel.fixed_bias is not None
        if not view.rejected:
            assert {channel.channel for channel in view.channels()} == set(CHANNELS)
            assert view.recommended() == dict.fromkeys(CHANNELS, "likelihood")


def test_a_channel_knows_what_it_is() -> None:
    gyro, accel = gather_recordings(RUN)[3].channels()
    assert (gyro.quantity, gyro.axis, gyro.title) == ("gyro", "x", "Gyroscope x")
    assert (accel.quantity, accel.axis, accel.title) == ("accel", "z", "Accelerometer z")
    assert gyro.label == "b / q (simulated)"
    assert [row["value"] for row in gyro.named("likelihood", "N")] == [MODEL.N]
    assert gyro.model("curve").terms[0].symbol == "N"


def test_findings_of_a_channel_are_its_own_and_those_of_the_whole_recording() -> None:
    findings = [
        {"finding": "missing_samples"},
        {"finding": "step", "channel": "gyro_x"},
        {"finding": "step", "channel": "gyro_x", "start": 2.0},
        {"finding": "lines", "channel": "gyro_x", "severity": "note"},
        {"finding": "motion", "channel": "accel_z"},
    ]
    (view,) = gather_recordings(joined(recording_rows(channels=CHANNELS, findings=findings)))
    channels = {channel.channel: channel for channel in view.channels()}
    assert channels["gyro_x"].warnings == ["missing_samples", "step"]
    assert [row["finding"] for row in channels["gyro_x"].findings] == [
        "missing_samples",
        "step",
        "step",
        "lines",
    ]
    assert channels["accel_z"].warnings == ["missing_samples", "motion"]
    assert len(view.warnings) == 4


def test_a_rejected_recording_has_its_reason_and_nothing_else() -> None:
    view = gather_recordings(RUN)[2]
    assert view.rejected
    assert view.row["reason"] == "line 3: found 'x'"
    assert view.channels() == []
    assert view.recommended() == {}
    # That it is rejected is said once, by its row.
    assert view.findings == view.warnings == view.budget == []


def test_errors_of_requirements_are_not_part_of_the_budget_of_a_recording() -> None:
    robot = {
        "title": "t",
        "static_window": "10 s",
        "limits": [{"error": "heading", "after": "100 s", "at_most": "1 deg"}],
    }
    (view,) = gather_recordings(joined(recording_rows(requirements={"robot": robot})))
    assert {row.requirement for row in view.rows(ErrorBudgetRow)} == {None, "robot"}
    assert {row["time"] for row in view.budget} == {60.0}


def test_nothing_has_no_recordings() -> None:
    assert gather_recordings({name: build(name, []) for name in TABLES}) == []


@cache
def keys_before() -> dict[tuple[str, str], str]:
    return keys(RUN)


def keys(tables: Tables) -> dict[tuple[str, str], str]:
    return {name: view.key for name, view in by_name(gather_recordings(tables)).items()}


CHANGES = {
    "allan": ("adev", 1e-3),
    "parameters": ("upper", 1e-3),
    "findings": ("detail", "other"),
    "scores": ("rms", None),
    "datasheet": ("verdict", "other"),
    "spectrum": ("used", False),
    "recordings": ("started", "2024-01-01"),
    "error_budget": ("sigma", 1.0),
    "models": ("note", "other"),
    "fixed_bias": ("value", 1.0),
}


TELLING = ("parameters", "findings", "scores", "spectrum")
"""A number, a text, a number that is no more, and a truth value."""


@pytest.mark.parametrize("table", few(TELLING, [name for name in CHANGES if name not in TELLING]))
def test_a_key_changes_with_its_own_recording_alone(table: str) -> None:
    before = keys_before()
    rows = RUN[table].to_pylist()
    place = next(i for i, row in enumerate(rows) if (row["sensor"], row["recording"]) == ("b", "r"))
    column, value = CHANGES[table]
    rows[place] |= {column: value}
    after = keys(RUN | {table: build(table, rows)})
    assert {name for name in before if before[name] != after[name]} == {("b", "r")}


def test_a_key_is_the_same_wherever_the_rows_stand_in_a_table() -> None:
    # Seven rows before it, and others after it, leave other bits in the same bytes.
    several = [of("b", "r", parameters=WITHOUT_K), of("a", "r"), of("c", "r", simulated=True)]
    odd = recording_rows("d", "r", ("gyro_y",), found=[0.5, 0.7])
    alone = keys(joined(several[0]))["b", "r"]
    for order in ([0, 1], [2, 1, 0]):
        tables = joined(odd, *(several[i] for i in order), odd | {"recordings": []})
        assert keys(tables)["b", "r"] == alone


def test_a_key_does_not_tell_how_the_table_was_kept(tmp_path: Any) -> None:
    before = keys_before()
    again = {}
    for name, table in RUN.items():
        write_arrow(table, tmp_path / f"{name}.parquet")
        again[name] = read(name, [tmp_path / f"{name}.parquet"])
    assert keys(again) == before
    halves = {
        name: pa.concat_tables(
            [table.slice(0, table.num_rows // 2), table.slice(table.num_rows // 2)]
        )
        for name, table in RUN.items()
    }
    assert keys(halves) == before


def test_a_key_is_the_same_where_rows_of_recordings_are_mixed() -> None:
    rows = {name: table.to_pylist() for name, table in RUN.items()}
    mixed = {}
    for name, own in rows.items():
        groups: dict[Any, list[Any]] = {}
        for row in own:
            groups.setdefault((row.get("sensor"), row.get("recording")), []).append(row)
        turns = max(map(len, groups.values()), default=0)
        mixed[name] = build(
            name, [g[i] for i in range(turns) for g in groups.values() if i < len(g)]
        )
    assert keys(mixed) == keys_before()


def test_key_distinguishes_null_zero_and_missing_values() -> None:
    def key(**score: Any) -> str:
        rows = recording_rows()
        rows["scores"][0] |= score
        return keys(joined(rows))["imu", "day1"]

    assert len({key(rms=None), key(rms=0.0), key(), key(reason=""), key(method="curve")}) == 5


def test_findings_of_a_channel_that_is_not_analysed_stop_nothing() -> None:
    dead = {"finding": "stuck", "severity": "fatal", "channel": "gyro_y"}
    (view,) = gather_recordings(joined(recording_rows(findings=[dead])))
    (channel,) = view.channels()
    assert isinstance(channel, ChannelView)
    assert channel.findings == []
    assert [row["finding"] for row in view.findings] == ["stuck"]
