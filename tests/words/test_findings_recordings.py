"""Sentences of findings about samples, copies, time stamps and files."""

import json
import re
from collections.abc import Iterable
from dataclasses import replace
from inspect import getmembers, isclass

import pytest

from imubench_pipeline.tables.findings import find
from imubench_pipeline.words.findings import files, samples, time_base
from imubench_pipeline.words.findings.base import FINDINGS, FindingData

RATE = 0.017453292519943295
"""1 °/s in rad/s."""

MILLI_G = 9.80665e-3

_TEMPERATURE = samples.Quantised(0.0625, None, 20.0, 25.5)
_GAPS = time_base.MissingSamples(350, 10000, 2, 250.0, 9000.0)
_LINE = files.IncompleteLastRecord("a.csv", "1,2")
_ZEROS = files.ZeroBytes("a.csv", 512, 1, "line 12", is_at_end=False)
_CHECKSUM = files.WrongChecksum("a.ubx", 3, "ESF-RAW", is_sentence=False, is_left_out=True)
_UNIT = files.UnitContradicts("a.csv", "rad/s", "the name 'gx'", "deg/s", 1.0, 57.29578)

EXAMPLES: list[tuple[str, FindingData]] = [
    ("temperature", _TEMPERATURE),
    ("gyro_x", samples.Quantised(0.05 * RATE, 0.31, is_rounded=True)),
    ("gyro_x", samples.Quantised(0.05 * RATE)),
    ("gyro_x", samples.Truncated(0.05 * RATE)),
    ("accel_z", samples.Coarse(3.0, 4 * MILLI_G, 2.1, is_rounded=True)),
    ("gyro_x", samples.Interpolated(312, 0.0102)),
    ("gyro_x", samples.RepeatedSamples(0.5, 0.021)),
    ("gyro_x", samples.HeldSamples(3, 0.012)),
    ("gyro_x", samples.NoSamples()),
    ("gyro_x", samples.TooShort(99, 100)),
    ("gyro_x", samples.TooShort(1_000_000, rate=200.0)),
    ("gyro_x", samples.Stuck(0.0, 5000)),
    ("accel_y", samples.Stuck(0.25, 1000)),
    ("gyro_x", samples.EmptyCells(10, 5, 0.05, 0.1)),
    ("gyro_x", samples.EmptyCells(1, 1, 0.01, 1234.56)),
    ("gyro_x", samples.NotFinite(2, 1e75, 1, 0.01, 0.1)),
    ("gyro_x", samples.StuckForAWhile(10.0, 1000)),
    ("gyro_x", samples.Saturated(123, -250 * RATE, "lowest")),
    ("gyro_x", samples.PiledUp(0.03, 0.0)),
    ("gyro_x", samples.Motion(500.0, 505.0)),
    ("gyro_x", samples.Step(0.01 * RATE, 1800.0, 40.0)),
    ("gyro_x", samples.WarmUp(-0.1 * RATE, 599.3, 12.0)),
    ("gyro_x", samples.WarmUp(-0.1 * RATE, 599.3, None)),
    ("gyro_x", samples.NotStationary(3.0, 10.0, 20.0)),
    ("gyro_x", samples.Joined(("level", "noise", "steps"), 500.0, 1.5)),
    ("gyro_x", samples.Interleaved(("level",), 5.2, 1.03)),
    ("gyro_y", samples.ChannelTwice("gyro_x", -9.80665)),
    ("gyro_y", samples.ChannelTwice("gyro_x", 1.0)),
    ("", samples.LogTwice(600.0, 1200.0, 0.0, 1, 0.5)),
    ("gyro_x", samples.LogTwice(600.0, 1200.0, 0.0, 3, 0.5)),
    ("gyro_x", samples.RepeatedStretch(1000.0, 1010.0, 400.1, 2)),
    ("", samples.RecordingTwice("run_2", "run_1", ("gyro_x", "gyro_y"))),
    ("gyro_x", samples.SharedNoise("gyro_y", -0.62)),
    ("", time_base.RateChanges(0.4, 10.0, 20.0, 50.0, 100.0)),
    ("gyro_x", time_base.RateChanges(0.4, 10.0, 20.0, 50.0, 100.0)),
    ("", time_base.CoarseStamps(100.0, 50.0)),
    ("", time_base.CoarseStamps(100.0, 125.0)),
    ("", _GAPS),
    ("", replace(_GAPS, missing=1, gaps=1, longest=0.01)),
    ("", replace(_GAPS, rate_of_bursts=33.33, noise_ratio=1.7)),
    ("", time_base.Segments(True, 1, 4500.0, 500.0)),
    ("", time_base.Segments(False, 2, -299.94, 350.0)),
    ("", time_base.RepeatedStamps(1)),
    ("", time_base.RepeatedStamps(12)),
    ("", time_base.MissingStamps(3)),
    ("", time_base.RateContradictsStamps(100.0, 50.0)),
    ("", time_base.RateDrifts(-1.2e-4)),
    ("", time_base.JitteredStamps(0.4, 3, 0.012, 50.0, 100.0)),
    ("", time_base.IrregularStamps(3, 100.0)),
    ("", time_base.OwnRate(("accel_x", "accel_z"), 500, 1000, 50.0)),
    ("", time_base.OwnRate(("accel_x",), 500, 1000, 50.0)),
    ("", files.Rejected("a.csv: the file is empty")),
    ("", files.Failed("MemoryError: no memory")),
    ("", files.WarmUpTrimmed(600.0)),
    ("", files.PartAtRest(30.0, 600.0)),
    ("", files.ShortRecording(900.0)),
    ("gyro_x", files.Knocks(1, 430.2, (599.92,), 14)),
    ("gyro_x", files.Knocks(7, 430.2, (1.0, 2.0, 3.0, 4.0, 5.5), 140)),
    ("", files.SimulatedByMark("a.csv")),
    ("", files.UnusedFiles(("a.csv", "b.csv"), 3, "run")),
    ("", files.UnequalLength(("a.csv", "b.csv"), (1000, 990))),
    ("", files.NotUsed("a.csv", 400)),
    ("gyro_x", _UNIT),
    ("gyro_x", replace(_UNIT, scale=0.01, factor=5729.578)),
    ("", _ZEROS),
    ("", replace(_ZEROS, places=4, damaged_lines=2, is_shifted=True)),
    ("", replace(_ZEROS, zeros=1, is_at_end=True)),
    ("", files.TruncatedFile("a.csv.gz", "compressed")),
    ("", files.TruncatedFile("a.bag", "bag")),
    ("", files.TruncatedFile("a.db3", "journal", "a.db3-wal")),
    ("", _LINE),
    ("", replace(_LINE, has_checksum=True)),
    ("", files.IncompleteLastRecord("a.csv", columns=3, expected=7)),
    ("", files.IncompleteLastRecord("a.ubx", messages=1, message="ESF-RAW")),
    ("", files.IncompleteFirstRecord("a.csv", 2, 1, "3,4")),
    ("", files.NotRecords("a.csv", 1, 2, "x,y")),
    ("", files.RestartedLog("a.csv", 2, 1)),
    ("", files.DamagedMessage("a.bag", 1, "/imu", is_left_out=False)),
    ("", files.DamagedMessage("a.bag", 3, "/imu", is_left_out=True)),
    ("", files.NotMeasured("a.bag", 6, "/imu", "linear_acceleration")),
    ("", _CHECKSUM),
    ("", replace(_CHECKSUM, is_shifted=True)),
    ("", files.WrongChecksum("a.txt", 1, "$VNIMU", is_sentence=True, is_left_out=False)),
    ("", files.UnreadableSentence("a.txt", 1, "$VNIMU", 12)),
    ("", files.OtherSentences("a.txt", 2, ("VNYPR", "VNQTN"))),
    ("", files.NotSentences("a.txt", 3)),
    ("", files.UncheckedLogs("a.asc", 1, "RAWIMUSA")),
    ("", files.LateRecords("a.bag", 3, 0.01)),
    ("", files.DamagedBytes("a.ulg", 100)),
]  # fmt: skip


def classes() -> Iterable[type[FindingData]]:
    for module in (samples, time_base, files):
        for _, one in getmembers(module, isclass):
            if one.__module__ == module.__name__ and issubclass(one, FindingData):
                yield one


def test_each_finding_has_an_example() -> None:
    assert {type(data) for _, data in EXAMPLES} == set(classes())
    assert all(FINDINGS[one.code] is one for one in classes())


@pytest.mark.parametrize(("channel", "data"), EXAMPLES)
def test_a_finding_is_told_in_plain_sentences(channel: str, data: FindingData) -> None:
    text = data.text(channel)
    # The key of a setting and a name in a log stand as they are written there.
    plain = re.sub(
        r"\S*\.\w+\.unit|quality\.\w+|linear_acceleration|run_\d|time_tag|wal_\w+", "", text
    )
    assert "_" not in plain and "nan" not in plain and "None" not in plain and "–" not in plain
    assert not text.endswith(".")
    for sentence in text.split(". "):
        assert len(sentence.split()) <= 25, sentence
    assert "{" not in text.replace("{start: ", "")


@pytest.mark.parametrize(("channel", "data"), EXAMPLES)
def test_the_data_of_a_finding_can_be_read_again(channel: str, data: FindingData) -> None:
    found = find(data, "warning", 1.0, channel or None)
    assert found.data is not None
    fields = json.loads(found.data)
    again = {name: tuple(of) if isinstance(of, list) else of for name, of in fields.items()}
    assert type(data)(**again) == data


@pytest.mark.parametrize("one", list(classes()))
def test_a_doubt_is_short_and_plain(one: type[FindingData]) -> None:
    text = one.doubt.format(channels="gyro x", are="is")
    if one.affects:
        assert "_" not in text and "(" not in text and len(text.split()) <= 12


@pytest.mark.parametrize(
    ("channel", "data", "text"),
    [
        (
            "accel_z",
            samples.Saturated(123, 2000 * MILLI_G, "highest"),
            "accel z has 123 samples at its highest value, 2000 mg: it is saturated. Use a wider "
            "range",
        ),
        (
            "",
            time_base.Segments(True, 1, 4500.0, 500.0),
            "The clock jumps or stops once, by 4500 s forward, after 500 s of samples. The "
            "recording is analysed as 2 segments",
        ),
        (
            "",
            replace(_ZEROS, damaged_lines=1, is_shifted=True),
            "a.csv: 512 zero bytes in line 12; left out, with the text of 1 line that has them. "
            "State 'time': without it, all later samples are shifted in time",
        ),
    ],
)
def test_sentences(channel: str, data: FindingData, text: str) -> None:
    assert data.text(channel) == text


def test_a_wrong_rate_changes_n_by_its_root() -> None:
    """N² is σ²(τ) τ: half the rate makes N √2 times as large."""
    assert "N is 41 % higher" in time_base.CoarseStamps(100.0, 50.0).text("")
    assert "N is 11 % lower" in time_base.CoarseStamps(100.0, 125.0).text("")
    changes = time_base.RateChanges(0.4, 10.0, 20.0, 50.0, 100.0).text("")
    assert "N is 29 % too low" in changes


def test_findings_after_which_a_log_is_not_of_one_sensor_at_rest() -> None:
    assert {one.code for one in classes() if one.unfit} == {
        *("motion", "unit_contradicts", "stuck", "channel_twice", "log_twice", "recording_twice"),
        *("joined", "interleaved"),
    }
    assert FINDINGS["unit_contradicts"].scales == dict.fromkeys(
        ("N", "Q", "B", "B_curve", "sigma_min", "K", "R", "bias"), 1.0
    )
